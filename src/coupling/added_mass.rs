//! Bodies that are light for the water they carry along.
//!
//! The added mass of a body is estimated from its projected areas, `m_a = π/8 ρ A^{3/2}`: a sphere's is exact
//! within 5 %, a square plate's across within 15 %. Loose coupling gains the error `(m_a/m)` a step.

use crate::bodies::contact::Twist;
use crate::bodies::{Bodies, Placed};
use crate::case;
use crate::cut::CutMesh;
use crate::flow::Material;
use crate::mesh::MeshPart;
use nalgebra::{DVector, Vector3};

/// Added mass over mass from which flow and bodies are solved together.
const LIGHT: f64 = 0.5;

/// A body whose motion is found together with the water's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Its number among the bodies.
    pub body: usize,
    /// Half its largest extent [m]: what turns its spin into a velocity.
    pub arm: f64,
    /// Added mass over mass.
    pub ratio: f64,
    /// Whether glue holds it to what does not move freely, or it has touched something in this step.
    pub held: bool,
}

impl Light {
    /// How its wall moves while it moves so.
    pub fn wall<'a>(&self, placed: &'a Placed) -> &'a Twist {
        if self.held { &placed.twist } else { &placed.end }
    }
}

/// The free bodies in the liquid that are light for it or that glue holds, or all free ones in it if `choice` says so;
/// the same on every rank. Collective.
pub fn light(
    part: &MeshPart,
    cut: &CutMesh,
    material: &Material,
    bodies: &Bodies,
    first: usize,
    choice: case::Coupling,
) -> Vec<Light> {
    let clusters = &bodies.world.clusters;
    let mut wet = vec![0.0; clusters.len()];
    for c in cut.owned(part) {
        if let Some(body) = (c.body as usize).checked_sub(first) {
            let tet = &part.mesh.tets[c.element as usize];
            wet[body] += f64::from(tet.iter().any(|&n| material.phase(n as usize) > 0.5));
        }
    }
    part.comm.sum_all(&mut wet);
    let held = bodies.held();
    let density = material.liquid_density();
    let find = |(body, cluster): (usize, &crate::bodies::Cluster)| {
        let size = cluster.form.bounds.max - cluster.form.bounds.min;
        let area = |a: usize, b: usize| size[a] * size[b] * std::f64::consts::FRAC_PI_4;
        let largest = area(0, 1).max(area(1, 2)).max(area(2, 0));
        let ratio = std::f64::consts::PI / 8.0 * density * largest.powf(1.5) / cluster.mass;
        let chosen = choice == case::Coupling::Strong || ratio > LIGHT || held[body];
        (wet[body] > 0.0 && cluster.is_free() && chosen).then_some(Light {
            body,
            arm: 0.5 * size.max(),
            ratio,
            held: held[body],
        })
    };
    clusters.iter().enumerate().filter_map(find).collect()
}

/// Velocities and spins (times the arm) of the light bodies, six numbers each [m/s].
pub fn velocities<'a>(light: &[Light], twist: impl Fn(&Light) -> &'a Twist) -> DVector<f64> {
    let mut x = DVector::zeros(6 * light.len());
    for (i, l) in light.iter().enumerate() {
        let twist = twist(l);
        x.fixed_rows_mut::<3>(6 * i).copy_from(&twist.velocity);
        x.fixed_rows_mut::<3>(6 * i + 3).copy_from(&(twist.spin * l.arm));
    }
    x
}

/// The other way round, for the walls.
pub fn set_velocities(light: &[Light], x: &DVector<f64>, placed: &mut [Placed]) {
    for (i, l) in light.iter().enumerate() {
        let at = |k: usize| Vector3::new(x[6 * i + k], x[6 * i + k + 1], x[6 * i + k + 2]);
        placed[l.body].twist.velocity = at(0);
        placed[l.body].twist.spin = at(3) / l.arm;
    }
}
