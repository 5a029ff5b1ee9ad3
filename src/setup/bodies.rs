//! Case → bodies: shapes, grids of blocks, fragments, glue.

use super::solids::shape;
use super::{SetupError, walls};
use crate::bodies::cohesion_law::Law;
use crate::bodies::material::{Contact, Materials};
use crate::bodies::{
    Bodies, Cluster, Form, Joints, Motion, Ownership, Settings, State, Tracked, World, touching,
};
use crate::case::bodies::{self as case, BodyMotion, ContactLaw, Pieces};
use crate::case::{Case, CaseError, Solid};
use crate::cut::level_set;
use crate::mesh::MeshPart;
use crate::shape::{Pose, Shape, Surface, fragment};
use nalgebra::{UnitQuaternion, Vector3};
use partition::Communicator;
use std::sync::Arc;

/// The bodies of a case at t = 0, settled, and the points that are recorded. `solids`: its obstacles. Collective.
///
/// # Errors
/// A surface that is open or cannot be read, spheres that do not fit, a sub-step that is too long: with
/// file, line and key.
pub fn bodies(
    case: &Case,
    part: &MeshPart,
    solids: &[level_set::Solid],
) -> Result<Option<(Bodies, Vec<Tracked>)>, SetupError> {
    let Some(asked) = &case.bodies else { return Ok(None) };
    let comm = &part.comm;
    let law = |c: &ContactLaw| Contact {
        stiffness: c.stiffness,
        restitution: c.restitution,
        friction: c.friction,
    };
    let mut materials = Materials::uniform(asked.materials.len(), law(&asked.contact));
    materials.no_tension = asked.no_tension;
    for ([a, b], contact) in &asked.contacts {
        materials.set(*a, *b, law(contact));
    }
    let mut world = World {
        clusters: Vec::new(),
        walls: walls::walls(case, asked, part, solids)?,
        materials,
        gravity: case.gravity.into(),
        ignored: Vec::new(),
    };
    let mut state = State::default();
    let mut moving = Vec::new();
    let mut bonded = Vec::new();
    let mut tracked = Vec::new();
    for (group, entry) in (0..).zip(&asked.bodies) {
        let first = world.clusters.len();
        let key = format!("body[{}]", group + 1);
        for (form, pose) in pieces(case, asked, entry, &key, comm)? {
            let mut cluster = Cluster::new(form, entry.density, entry.material);
            cluster.group = group;
            cluster.applied = entry.applied.clone().map(Arc::new);
            cluster.motion = match &entry.motion {
                BodyMotion::Free { fixed, .. } if fixed.at(pose.position.into(), 0.0) > 0.0 => {
                    Motion::Fixed
                }
                BodyMotion::Free { locked, .. } => Motion::Free { locked: *locked },
                BodyMotion::Led { velocity, spin } => Motion::Prescribed {
                    velocity: Box::new(velocity.clone()),
                    spin: Box::new(spin.clone()),
                },
            };
            if cluster.is_free() {
                moving.push((state.len(), entry.velocity, entry.spin));
            }
            if entry.bonded {
                bonded.push(state.len() as u32);
            }
            world.clusters.push(cluster);
            state.push(pose);
        }
        world.ignored.extend(entry.ignores.iter().map(|&wall| (group, wall)));
        for (i, &point) in entry.track.iter().enumerate() {
            let x = Vector3::from(point);
            let from = |c: usize| {
                let form = &world.clusters[c].form;
                form.shape.distance(state.pose[c].to_local(x))
            };
            let nearest = (first..state.len()).min_by(|&a, &b| from(a).total_cmp(&from(b)));
            let Some(c) = nearest else { continue };
            let local = state.pose[c].to_local(x);
            let name = format!("{}_{}", entry.name, i + 1);
            tracked.push(Tracked { name, cluster: c as u32, local });
        }
    }
    let mut joints = Joints::default();
    if let Some(bond) = &asked.bond {
        joints.laws.push(Law {
            strength: bond.strength,
            opening: bond.opening,
            unloading: bond.unloading,
            compression: bond.compression,
            damping: bond.damping,
        });
        let pairs = touching::close_pairs(&state, &world, &bonded, bond.gap);
        let faces = touching::common_faces(&state, &world, &pairs, bond.points, bond.gap);
        for mut face in faces {
            face.points.iter_mut().for_each(|(_, area)| *area *= bond.area);
            joints.add(&state, &world, &face, 0);
        }
    }
    for (c, velocity, spin) in moving {
        state.set_motion(c, &world.clusters[c], velocity.into(), spin.into());
    }
    let settings =
        Settings { time_step: asked.time_step, fraction: asked.fraction, ..Settings::default() };
    let ranks = Ownership::new(comm, &world, &state, &joints, asked.ranks);
    let mut bodies = Bodies::new(world, state, joints, settings, ranks)
        .map_err(|unstable| case.source.error("bodies.time_step", unstable.to_string()))?;
    if asked.settle > 0.0 {
        bodies.settle(asked.settle);
    }
    Ok(Some((bodies, tracked)))
}

/// Forms and poses of an entry's clusters, copies of one form sharing it.
fn pieces(
    case: &Case,
    asked: &case::Bodies,
    entry: &case::Body,
    key: &str,
    comm: &Communicator,
) -> Result<Vec<(Arc<Form>, Pose)>, SetupError> {
    let fail = |name: &str, message: String| -> CaseError {
        case.source.error(&format!("{key}.{name}"), message)
    };
    let whole = shape(case, key, &entry.shape, comm)?;
    let [x, y, z] = entry.turned;
    let stand =
        Pose { position: entry.at.into(), rotation: UnitQuaternion::from_euler_angles(x, y, z) };
    // Shapes, each with its places in the entry's own frame.
    let shapes: Vec<(Shape, Vec<Pose>)> = match &entry.pieces {
        Pieces::One => vec![(whole, vec![Pose::identity()])],
        Pieces::Grid { count, hollow, openings } => {
            let Solid::Cuboid(edges) = entry.shape else { unreachable!("checked") };
            vec![grid(edges, *count, *hollow, |local| {
                let x = stand.to_space(local).into();
                openings.iter().any(|opening| opening.at(x, 0.0) > 0.0)
            })]
        }
        Pieces::Fragments { size, seed } => fragment::fragments(&whole, *size, *seed)
            .and_then(|cells| {
                let shape = |c: Surface| Shape::mesh(c).map_err(|e| e.to_string());
                cells.into_iter().map(|c| Ok((shape(c)?, vec![Pose::identity()]))).collect()
            })
            .map_err(|message| fail("fragments", message))?,
    };
    let spacing = asked.sphere_spacing / asked.sphere_radius * entry.sphere_radius;
    let mut pieces = Vec::new();
    let (count, step) = entry.copies;
    let mut forms = Vec::new();
    for (shape, places) in &shapes {
        let (form, back) = Form::new(shape, entry.sphere_radius, spacing)
            .map_err(|thin| fail("sphere_radius", thin.to_string()))?;
        forms.push((Arc::new(form), back, places));
    }
    for i in 0..count[0] {
        for j in 0..count[1] {
            for k in 0..count[2] {
                let shift = Vector3::new(i.into(), j.into(), k.into());
                let shift = shift.component_mul(&Vector3::from(step));
                for (form, back, places) in &forms {
                    for place in *places {
                        let mut pose = stand.after(place).after(back);
                        pose.position += shift;
                        pieces.push((form.clone(), pose));
                    }
                }
            }
        }
    }
    Ok(pieces)
}

/// The block of a grid and where it is put; `hollow`: only along the upright sides.
fn grid(
    edges: [f64; 3],
    count: [u32; 3],
    hollow: bool,
    open: impl Fn(Vector3<f64>) -> bool,
) -> (Shape, Vec<Pose>) {
    let block: [f64; 3] = std::array::from_fn(|k| edges[k] / f64::from(count[k]));
    let mut places = Vec::new();
    let place =
        |i: [u32; 3]| Vector3::from_fn(|k, _| block[k] * (f64::from(i[k]) + 0.5) - 0.5 * edges[k]);
    for k in 0..count[2] {
        for j in 0..count[1] {
            for i in 0..count[0] {
                let side = i == 0 || i + 1 == count[0] || j == 0 || j + 1 == count[1];
                let position = place([i, j, k]);
                if (side || !hollow) && !open(position) {
                    places.push(Pose { position, ..Pose::identity() });
                }
            }
        }
    }
    (Shape::cuboid(block), places)
}
