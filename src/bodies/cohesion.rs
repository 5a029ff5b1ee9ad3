//! Joints: flat faces where two clusters are glued, with integration points [28].
//!
//! At each point the opening δ⃗ = (max(δ_n, 0), δ_t) makes the traction σ(|δ⃗|) δ⃗/|δ⃗|, at the middle between
//! the two clusters' points. A point that opened by δ_f is broken for good. All is computed in the frame
//! of the cluster with the lower number.

use super::account::Account;
use super::cluster::State;
use super::cohesion_law::{BROKEN, Law};
use super::contact::{Twist, World};
use super::touching::Common;
use crate::case::{Compression, Unloading};
use nalgebra::Vector3;

/// A glued face.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    /// The lower number.
    pub a: u32,
    /// The higher number.
    pub b: u32,
    /// From a to b, in the frame of a.
    pub normal: Vector3<f64>,
    /// Index into `Joints::laws`.
    pub law: u32,
    /// First point.
    pub first: u32,
    /// Past the last one.
    pub end: u32,
    /// Damping force over elastic force times time, β [s].
    beta: f64,
}

/// A glued face came off: its last point broke.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Break {
    /// When [s].
    pub t: f64,
    /// Which joint.
    pub joint: u32,
    /// Middle of the face then [m].
    pub place: Vector3<f64>,
}

/// All joints; points of joint j are `first..end` of the lists.
#[derive(Clone, Debug, Default)]
pub struct Joints {
    /// What glues.
    pub laws: Vec<Law>,
    /// Sorted by clusters.
    pub joints: Vec<Joint>,
    /// Of each point, in the frames of a and b [m].
    pub places: Vec<[Vector3<f64>; 2]>,
    /// Tributary area of each point [m²]; of a joint they add up to its face.
    pub area: Vec<f64>,
    /// Largest opening of each point so far [m]; `BROKEN`.
    pub largest: Vec<f64>,
    /// Unbroken points of each joint.
    pub alive: Vec<u32>,
    /// Of each joint the prism over its outline, as deep as the clusters: outward normals and offsets [m] of
    /// its sides, in the frame of a.
    pub prisms: Vec<Vec<(Vector3<f64>, f64)>>,
}

impl Joints {
    /// Adds a face that clusters have in common, glued by a law.
    pub fn add(&mut self, state: &State, world: &World, face: &Common, law: u32) {
        let ([a, b], normal, points) = (face.clusters, face.normal, &face.points);
        assert!(a < b, "the lower number first");
        self.prisms.push(prism(state, world, face));
        let pose = |c: u32| &state.pose[c as usize];
        let first = self.places.len() as u32;
        for &(x, area) in points {
            self.places.push([pose(a).to_local(x), pose(b).to_local(x)]);
            self.area.push(area);
            self.largest.push(0.0);
        }
        let end = self.places.len() as u32;
        let area: f64 = points.iter().map(|p| p.1).sum();
        let glue = &self.laws[law as usize];
        let inverse: f64 = [a, b].iter().map(|&c| world.clusters[c as usize].inverse_mass()).sum();
        let omega = (glue.stiffness() * area * inverse).sqrt();
        let beta = if omega > 0.0 { 2.0 * glue.damping / omega } else { 0.0 };
        let normal = pose(a).rotation.inverse_transform_vector(&normal);
        self.joints.push(Joint { a, b, normal, law, first, end, beta });
        self.alive.push(points.len() as u32);
    }

    /// β of a joint [s].
    pub fn damping_time(&self, joint: u32) -> f64 {
        self.joints[joint as usize].beta
    }

    /// Sorts the joints by clusters; the points stay where they are.
    pub fn sort(&mut self) {
        let mut order: Vec<usize> = (0..self.joints.len()).collect();
        order.sort_by_key(|&j| (self.joints[j].a, self.joints[j].b, j));
        self.joints = order.iter().map(|&j| self.joints[j]).collect();
        self.alive = order.iter().map(|&j| self.alive[j]).collect();
        self.prisms = order.iter().map(|&j| std::mem::take(&mut self.prisms[j])).collect();
    }

    /// Whether two clusters feel each other through their bond alone: no point of it is broken.
    pub fn bond_alone(&self, a: u32, b: u32) -> bool {
        let from = self.joints.partition_point(|j| (j.a, j.b) < (a, b));
        let mine = self.joints[from..].iter().zip(&self.alive[from..]);
        let mut mine = mine.take_while(|(j, _)| (j.a, j.b) == (a, b)).peekable();
        mine.peek().is_some()
            && mine.all(|(j, &alive)| {
                alive == j.end - j.first
                    && self.laws[j.law as usize].compression == Compression::Bond
            })
    }

    /// Counts the unbroken points of a joint.
    pub fn recount(&mut self, joint: u32) {
        let j = &self.joints[joint as usize];
        let points = &self.largest[j.first as usize..j.end as usize];
        self.alive[joint as usize] = points.iter().filter(|&&d| d != BROKEN).count() as u32;
    }

    /// Area of a joint and how much of it is broken [m²].
    pub fn areas(&self, joint: usize) -> (f64, f64) {
        let j = &self.joints[joint];
        let points = j.first as usize..j.end as usize;
        points.fold((0.0, 0.0), |(all, broken), p| {
            let gone = if self.largest[p] == BROKEN { self.area[p] } else { 0.0 };
            (all + self.area[p], broken + gone)
        })
    }

    /// Widest opening of any bond [m].
    pub fn widest_opening(&self) -> f64 {
        self.laws.iter().map(|law| law.opening).fold(0.0, f64::max)
    }

    /// Middle of a joint's face now [m].
    pub fn middle(&self, state: &State, joint: u32) -> Vector3<f64> {
        let j = &self.joints[joint as usize];
        let points = j.first as usize..j.end as usize;
        let sum =
            points.clone().fold(Vector3::zeros(), |sum, p| sum + self.area[p] * self.places[p][0]);
        let area: f64 = self.area[points].iter().sum();
        state.pose[j.a as usize].to_space(sum / area)
    }

    /// Opening of a point in the frame of a: (normal part, all of it) [m].
    fn opening(&self, state: &State, joint: &Joint, point: usize) -> (f64, Vector3<f64>) {
        let [a, b] = [joint.a, joint.b].map(|c| &state.pose[c as usize]);
        let [on_a, on_b] = self.places[point];
        let delta = a.to_local(b.to_space(on_b)) - on_a;
        (delta.dot(&joint.normal), delta)
    }

    /// Energy stored and spent in all joints whose first cluster is counted [J].
    pub fn energy(&self, state: &State, counted: &[bool]) -> (f64, f64) {
        let (mut stored, mut spent) = (0.0, 0.0);
        for joint in &self.joints {
            if !counted[joint.a as usize] {
                continue;
            }
            let law = &self.laws[joint.law as usize];
            for p in joint.first as usize..joint.end as usize {
                let (normal, delta) = self.opening(state, joint, p);
                let tangential = delta - normal * joint.normal;
                let open = tangential.norm().hypot(normal.max(0.0));
                let (kept, gone) = law.energy(open, self.largest[p]);
                stored += kept * self.area[p];
                spent += gone * self.area[p];
                if self.largest[p] != BROKEN && law.compression == Compression::Bond && normal < 0.0
                {
                    stored += 0.5 * law.stiffness() * normal * normal * self.area[p];
                }
            }
        }
        (stored, spent)
    }

    /// Adds the forces of the joints `active` to `state.force` and `state.torque`. `cracked` receives those
    /// of which points break now.
    pub fn add_forces(
        &mut self,
        state: &mut State,
        twists: &[Twist],
        active: &[u32],
        dt: f64,
        counted: &[bool],
        account: &mut Account,
        cracked: &mut Vec<u32>,
    ) {
        for &j in active {
            let joint = &self.joints[j as usize];
            if self.alive[j as usize] == 0 {
                continue;
            }
            let law = self.laws[joint.law as usize];
            let bonded = law.compression == Compression::Bond;
            let stiffness = law.stiffness();
            let [a, b] = [joint.a as usize, joint.b as usize];
            let back = state.pose[a].rotation.inverse();
            let to_a = (back * state.pose[b].rotation).to_rotation_matrix();
            let apart = back * (state.pose[b].position - state.pose[a].position);
            let velocity = back * (twists[b].velocity - twists[a].velocity);
            let [spin_a, spin_b] = [a, b].map(|c| back * twists[c].spin);
            let n = joint.normal;
            let mut sums = [Vector3::zeros(); 3];
            let mut damped = 0.0;
            let before = self.alive[j as usize];
            for p in joint.first as usize..joint.end as usize {
                let [on_a, on_b] = self.places[p];
                let there = apart + to_a * on_b;
                let delta = there - on_a;
                let arm_a = 0.5 * (on_a + there);
                let arm_b = arm_a - apart;
                let v = velocity + spin_b.cross(&arm_b) - spin_a.cross(&arm_a);
                let (delta_n, v_n) = (delta.dot(&n), v.dot(&n));
                if self.largest[p] == BROKEN {
                    continue;
                }
                let (mut open, mut rate) = (delta, v);
                if delta_n < 0.0 {
                    open -= delta_n * n;
                    rate -= v_n * n;
                }
                let size = open.norm();
                if size >= law.opening {
                    if bonded && delta_n < 0.0 && counted[a] {
                        account.fracture += 0.5 * stiffness * delta_n * delta_n * self.area[p];
                    }
                    self.largest[p] = BROKEN;
                    self.alive[j as usize] -= 1;
                    continue;
                }
                self.largest[p] = self.largest[p].max(size);
                let reached = match law.unloading {
                    Unloading::Curve => size,
                    Unloading::Damage => self.largest[p],
                };
                let secant = law.secant(reached);
                let mut traction = secant * (open + joint.beta * rate);
                damped += secant * joint.beta * rate.norm_squared() * self.area[p];
                if bonded && delta_n < 0.0 {
                    let pressure = (stiffness * (delta_n + joint.beta * v_n)).min(0.0);
                    traction += pressure * n;
                    damped += (pressure - stiffness * delta_n) * v_n * self.area[p];
                }
                let force = traction * self.area[p];
                sums[0] += force;
                sums[1] += arm_a.cross(&force);
                sums[2] += arm_b.cross(&force);
            }
            if self.alive[j as usize] < before {
                cracked.push(j);
            }
            let forth = state.pose[a].rotation;
            let [force, torque_a, torque_b] = sums.map(|s| forth * s);
            state.force[a] += force;
            state.torque[a] += torque_a;
            state.force[b] -= force;
            state.torque[b] -= torque_b;
            if counted[a] {
                account.dashpots += damped * dt;
            }
        }
    }
}

/// The prism over a common face, through both clusters, in the frame of the first.
fn prism(state: &State, world: &World, face: &Common) -> Vec<(Vector3<f64>, f64)> {
    let pose = &state.pose[face.clusters[0] as usize];
    let (n, corners) = (face.normal, &face.outline);
    let depth = |c: u32, along: Vector3<f64>| {
        let form = &world.clusters[c as usize].form;
        let surface = form.shape.surface(form.radius);
        let to = surface.vertices.iter().map(|&x| state.pose[c as usize].to_space(x).dot(&along));
        to.fold(f64::NEG_INFINITY, f64::max)
    };
    let [a, b] = face.clusters;
    let edges = corners.iter().zip(corners.iter().cycle().skip(1));
    let sides = edges.map(|(x, y)| {
        let out = (y - x).cross(&n).normalize();
        (out, out.dot(x))
    });
    let in_space = sides.chain([(n, depth(b, n)), (-n, depth(a, -n))]);
    let turned = |n: Vector3<f64>| pose.rotation.inverse_transform_vector(&n);
    in_space.map(|(n, offset)| (turned(n), offset - n.dot(&pose.position))).collect()
}
