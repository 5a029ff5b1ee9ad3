//! Clusters against exact solutions.

mod cost;
mod fracture;
mod impact;
mod rigid_motion;

use super::cohesion_law::Law;
use super::material::{Contact, Materials};
use super::walls::{Wall, WallSurface};
use super::*;
use crate::shape::{Pose, Shape};
use nalgebra::{UnitQuaternion, Vector3};
use std::sync::Arc;

type V3 = Vector3<f64>;

/// A case in the making.
struct Scene {
    world: World,
    state: State,
    joints: Joints,
    settings: Settings,
    moving: Vec<(usize, V3, V3)>,
}

impl Scene {
    fn new(contact: Contact, gravity: [f64; 3]) -> Self {
        let world = World {
            clusters: Vec::new(),
            walls: Vec::new(),
            materials: Materials::uniform(1, contact),
            gravity: gravity.into(),
            ignored: Vec::new(),
        };
        let (state, joints, settings) = Default::default();
        Self { world, state, joints, settings, moving: Vec::new() }
    }

    fn floor(mut self) -> Self {
        let surface = WallSurface::Plane { normal: Vector3::z(), offset: 0.0 };
        self.world.walls.push(Wall { name: "floor".into(), material: 0, surface });
        self
    }

    fn form(shape: &Shape, sphere: f64) -> Arc<Form> {
        Arc::new(Form::new(shape, sphere, 2.0 * sphere).unwrap().0)
    }

    fn add(&mut self, form: &Arc<Form>, density: f64, x: [f64; 3]) -> usize {
        self.turned(form, density, x, UnitQuaternion::identity())
    }

    fn turned(
        &mut self,
        form: &Arc<Form>,
        density: f64,
        x: [f64; 3],
        rotation: UnitQuaternion<f64>,
    ) -> usize {
        self.world.clusters.push(Cluster::new(form.clone(), density, 0));
        self.state.push(Pose { position: x.into(), rotation });
        self.state.len() - 1
    }

    fn moving(&mut self, c: usize, velocity: [f64; 3], spin: [f64; 3]) {
        self.moving.push((c, velocity.into(), spin.into()));
    }

    /// Glues all faces in common.
    fn glue(&mut self, law: Law, across: u32) {
        self.joints.laws.push(law);
        let n = self.state.len() as u32;
        let pairs: Vec<[u32; 2]> = (0..n).flat_map(|a| (a + 1..n).map(move |b| [a, b])).collect();
        for face in touching::common_faces(&self.state, &self.world, &pairs, across, 1e-9) {
            self.joints.add(&self.state, &self.world, &face, 0);
        }
    }

    fn start(mut self) -> Bodies {
        for (c, v, w) in self.moving {
            self.state.set_motion(c, &self.world.clusters[c], v, w);
        }
        let ranks = Ownership::single(&self.world, &self.state, &self.joints);
        Bodies::new(self.world, self.state, self.joints, self.settings, ranks).unwrap()
    }
}

fn contact(stiffness: f64, restitution: f64, angle: f64) -> Contact {
    Contact { stiffness, restitution, friction: angle.to_radians().tan() }
}

fn advance(bodies: &mut Bodies, dt: f64) {
    let loads = vec![Load::default(); bodies.state.len()];
    bodies.advance(dt, &loads);
}
