//! Contact of clusters [18-20, 23, 24]: at each pair of spheres that touch, the law of `contact_law`.
//!
//! Its `m` is the mass that one contact has to stop: with N = Σn, S = I⁻¹ Σ r×n over all contacts the two
//! clusters have with each other, `1/m_i = Σ_bodies (n_i·N/m + (r_i×n_i)·S)`. For one contact that is the
//! mass felt at the point; a block that lands flat on k spheres has m/k for each: both rebound with e.
//! (The whole mass of the block at each of 2, 4, 9 spheres gives 0.60, 0.48, 0.32 instead of 0.7.)

use super::account::Account;
use super::cluster::{Cluster, Inertia, State};
use super::contact_law::{Point, push};
use super::material::Materials;
use super::neighbours::{Neighbours, Partner};
use super::walls::Wall;
use nalgebra::Vector3;

/// Predicted velocity of a cluster at the time of the forces.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Twist {
    /// Of the centroid [m/s].
    pub velocity: Vector3<f64>,
    /// [rad/s]
    pub spin: Vector3<f64>,
}

/// One touching pair of spheres.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    candidate: u32,
    /// From the partner to the cluster.
    normal: Vector3<f64>,
    overlap: f64,
    /// Contact point from the centroids of the cluster and its partner.
    arm: [Vector3<f64>; 2],
}

/// One side of a pair.
struct Side {
    twist: Twist,
    inverse_mass: f64,
    inverse_moments: Vector3<f64>,
    /// Σ r×n, then I⁻¹ of it.
    turn: Vector3<f64>,
}

/// Adds the contact forces of all pairs to `state.force` and `state.torque`, moves tangential springs on by
/// `dt`, and books what dashpots and sliders take. `counted`: whether a cluster's pairs are booked here.
pub fn add_forces(
    state: &mut State,
    near: &mut Neighbours,
    inertia: &[Inertia],
    twists: &[Twist],
    world: &World,
    dt: f64,
    counted: &[bool],
    account: &mut Account,
) {
    let Neighbours {
        pairs, spheres, candidates, spring, rest, touching, hits, deepest, balls, ..
    } = near;
    balls.add_forces(state, twists, world, dt, counted, account, deepest);
    let no_tension = world.materials.no_tension;
    for pair in pairs.iter() {
        hits.clear();
        let a = pair.cluster as usize;
        let first = pair.first as usize;
        match pair.partner {
            Partner::Cluster(b) => {
                for k in first..pair.end as usize {
                    let [i, j] = candidates[k];
                    let (s, t) = (&spheres[i as usize], &spheres[j as usize]);
                    let away = s.place - t.place;
                    let reach = s.radius + t.radius;
                    let square = away.norm_squared();
                    if square >= reach * reach {
                        if touching[k] || rest[k] > 0.0 {
                            (touching[k], rest[k]) = (false, 0.0);
                        }
                        continue;
                    }
                    let distance = square.sqrt();
                    let normal = if distance > 0.0 { away / distance } else { Vector3::z() };
                    let whole = reach - distance;
                    *deepest = deepest.max(whole / s.radius.min(t.radius));
                    rest[k] = rest[k].min(whole);
                    let overlap = whole - rest[k];
                    if overlap == 0.0 {
                        touching[k] = false;
                        continue;
                    }
                    let point = s.place - normal * (s.radius - 0.5 * whole);
                    let arm = [a, b as usize].map(|c| point - state.pose[c].position);
                    hits.push(Hit { candidate: k as u32, normal, overlap, arm });
                }
            }
            Partner::Wall(w) => {
                let surface = &world.walls[w as usize].surface;
                for k in first..pair.end as usize {
                    let s = &spheres[candidates[k][0] as usize];
                    let (distance, normal) = surface.distance(s.place);
                    if distance >= s.radius {
                        touching[k] = false;
                        continue;
                    }
                    let overlap = s.radius - distance;
                    *deepest = deepest.max(overlap / s.radius);
                    let point = s.place - normal * (s.radius - 0.5 * overlap);
                    let arm = [point - state.pose[a].position, Vector3::zeros()];
                    hits.push(Hit { candidate: k as u32, normal, overlap, arm });
                }
            }
        }
        if hits.is_empty() {
            continue;
        }
        let mut sides = [Side::of(&inertia[a], twists[a]), Side::wall()];
        let (other, material) = match pair.partner {
            Partner::Cluster(b) => {
                let partner = &inertia[b as usize];
                sides[1] = Side::of(partner, twists[b as usize]);
                (Some(b as usize), partner.material)
            }
            Partner::Wall(w) => (None, world.walls[w as usize].material),
        };
        let mut normals = Vector3::zeros();
        for hit in hits.iter() {
            normals += hit.normal;
            for (side, arm) in sides.iter_mut().zip(&hit.arm) {
                side.turn += arm.cross(&hit.normal);
            }
        }
        for (side, body) in sides.iter_mut().zip([Some(a), other]) {
            if let Some(body) = body {
                side.turn = State::spin(&state.pose[body], &side.inverse_moments, &side.turn);
            }
        }
        let inverse_masses = sides[0].inverse_mass + sides[1].inverse_mass;
        let law = world.materials.pair(inertia[a].material, material);
        let damping = world.materials.damping(inertia[a].material, material);
        let booked = counted[a];
        let mut sums = [Vector3::zeros(); 3];
        for hit in hits.iter() {
            let k = hit.candidate as usize;
            let n = hit.normal;
            let turns: f64 =
                sides.iter().zip(&hit.arm).map(|(side, arm)| arm.cross(&n).dot(&side.turn)).sum();
            // Never more than the two whole masses.
            let inverse = (n.dot(&normals) * inverse_masses + turns).max(inverse_masses);
            let dashpot = if inverse > 0.0 { damping / inverse.sqrt() } else { 0.0 };
            let [v_a, v_b] =
                [0, 1].map(|i| sides[i].twist.velocity + sides[i].twist.spin.cross(&hit.arm[i]));
            let spin = 0.5 * (sides[0].twist.spin + sides[1].twist.spin).dot(&n);
            let (overlap, velocity) = (hit.overlap, v_a - v_b);
            let point = Point { normal: n, overlap, velocity, spin, dashpot };
            let push = push(law, no_tension, &point, &mut spring[k], touching[k], dt);
            touching[k] = true;
            if booked {
                account.friction += push.friction;
                account.dashpots += push.dashpots;
            }
            let force = push.force;
            sums[0] += force;
            sums[1] += hit.arm[0].cross(&force);
            sums[2] += hit.arm[1].cross(&force);
        }
        state.force[a] += sums[0];
        state.torque[a] += sums[1];
        if let Some(b) = other {
            state.force[b] -= sums[0];
            state.torque[b] -= sums[2];
        }
    }
}

/// What the pairs are made of.
#[derive(Clone, Debug)]
pub struct World {
    /// All clusters.
    pub clusters: Vec<Cluster>,
    /// All walls.
    pub walls: Vec<Wall>,
    /// Contact properties.
    pub materials: Materials,
    /// [m/s²]
    pub gravity: Vector3<f64>,
    /// Pairs (cluster group, wall) that do not feel each other.
    pub ignored: Vec<(u32, u32)>,
}

impl Side {
    fn of(inertia: &Inertia, twist: Twist) -> Self {
        let Inertia { inverse_mass, inverse_moments, .. } = *inertia;
        Self { twist, inverse_mass, inverse_moments, turn: Vector3::zeros() }
    }

    fn wall() -> Self {
        Self {
            twist: Twist::default(),
            inverse_mass: 0.0,
            inverse_moments: Vector3::zeros(),
            turn: Vector3::zeros(),
        }
    }
}

/// Energy in the springs of all contacts [J].
pub fn elastic_energy(state: &State, near: &Neighbours, world: &World, counted: &[bool]) -> f64 {
    let mut sum = near.balls.elastic_energy(state, world, counted);
    for pair in &near.pairs {
        if !counted[pair.cluster as usize] {
            continue;
        }
        let material = match pair.partner {
            Partner::Cluster(b) => world.clusters[b as usize].material,
            Partner::Wall(w) => world.walls[w as usize].material,
        };
        let k = world.materials.pair(world.clusters[pair.cluster as usize].material, material);
        for c in pair.first as usize..pair.end as usize {
            if near.touching[c] {
                let overlap = near.overlap(state, world, pair, c) - near.rest[c];
                sum += 0.5 * k.stiffness * (overlap * overlap + near.spring[c].norm_squared());
            }
        }
    }
    sum
}
