//! Boundary conditions by name, turned into what they fix at each node.
//!
//! A node's constraint is the projector `P` on its free unknowns and a value `g` for the rest:
//! `u = P u + (I − P) g`, and a flag that its pressure is given. No-slip and given velocities have
//! `P = 0`; slip removes the normals of the walls that meet in the node, whatever their direction;
//! walls that differ by more than 30° there count as two.

use super::{dot, norm, triangle_normal};
use crate::case::{Boundary, Case, Formula};
use crate::mesh::MeshPart;
use crate::mesh::connected::NONE;

/// Walls whose normals differ by less than this are one smooth wall: cos 30°.
const SMOOTH: f64 = 0.866_025_403_784_438_6;

/// What a boundary does to one node.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Constraint {
    /// Projector on the free velocities.
    pub free: [[f64; 3]; 3],
    /// 1 if the pressure is given, else 0 (a number: it crosses rank borders).
    pub pressure_given: u8,
}

crate::mesh::part::item!(Constraint { free, pressure_given });

/// Everything free: an interior node.
pub const FREE: Constraint =
    Constraint { free: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], pressure_given: 0 };

impl Constraint {
    /// Whether anything is fixed.
    pub fn is_free(&self) -> bool {
        *self == FREE
    }
    /// P v
    #[inline]
    pub fn project(&self, v: [f64; 3]) -> [f64; 3] {
        self.free.map(|row| dot(row, v))
    }
    /// The free part of a velocity and pressure.
    #[inline]
    pub fn project_all(&self, v: [f64; 4]) -> [f64; 4] {
        let u = self.project([v[0], v[1], v[2]]);
        [u[0], u[1], u[2], if self.pressure_given == 1 { 0.0 } else { v[3] }]
    }
}

/// The constraint of each local node. Most nodes are free: they share one.
#[derive(Clone, Debug)]
pub struct Nodes {
    /// Index into `kinds`.
    kind: Vec<u32>,
    kinds: Vec<Constraint>,
}

impl Nodes {
    fn new(nodes: &[Constraint]) -> Self {
        let mut kinds = vec![FREE];
        let kind = |c: &Constraint| {
            if c.is_free() {
                return 0;
            }
            kinds.push(*c);
            kinds.len() as u32 - 1
        };
        Self { kind: nodes.iter().map(kind).collect(), kinds }
    }

    /// Gives or frees the pressure of a node.
    fn set_pressure_given(&mut self, i: usize, given: u8) {
        if self[i].pressure_given == given {
            return;
        }
        if self.kind[i] == 0 {
            self.kind[i] = self.kinds.len() as u32;
            self.kinds.push(FREE);
        }
        self.kinds[self.kind[i] as usize].pressure_given = given;
    }

    /// Of all nodes, in order.
    pub fn iter(&self) -> impl Iterator<Item = &Constraint> {
        self.kind.iter().map(|&kind| &self.kinds[kind as usize])
    }
}

impl std::ops::Index<usize> for Nodes {
    type Output = Constraint;
    #[inline]
    fn index(&self, i: usize) -> &Constraint {
        &self.kinds[self.kind[i] as usize]
    }
}

/// The constraints of all local nodes, and where their values come from.
#[derive(Clone, Debug)]
pub struct Constraints {
    /// Of each local node.
    pub nodes: Nodes,
    /// Owned and ghost nodes with a given velocity: node, index into `velocities`.
    moving: Vec<(u32, u32)>,
    velocities: Vec<[Formula; 3]>,
    /// Nodes with a given pressure: node, index into `pressures`.
    open: Vec<(u32, u32)>,
    pressures: Vec<Formula>,
    /// Owned nodes whose pressure is pinned to zero: a body of fluid without an open boundary has no other
    /// reference.
    pub pinned: Vec<u32>,
}

impl Constraints {
    /// From the case's boundary conditions; `fluid` names the connected body of
    /// fluid of each local node (empty: all one). Collective.
    pub fn new(case: &Case, part: &MeshPart, fluid: &[FluidBody]) -> Self {
        let mesh = &part.mesh;
        let conditions: Vec<&Boundary> =
            mesh.boundary_names.iter().map(|name| case.boundary(name)).collect();
        let n_owned = part.n_owned();

        // One small list of wall normals (area-weighted) per slip node; what else touches the node.
        let mut normals: Vec<Vec<[f64; 3]>> = vec![Vec::new(); n_owned];
        let mut no_slip = vec![false; n_owned];
        let mut moving_of = vec![u32::MAX; n_owned];
        let mut open_of = vec![u32::MAX; n_owned];
        let mut velocities = Vec::new();
        let mut pressures = Vec::new();
        let index: Vec<u32> = conditions
            .iter()
            .map(|c| match c {
                Boundary::Velocity { velocity, .. } => {
                    velocities.push(velocity.clone());
                    velocities.len() as u32 - 1
                }
                Boundary::Pressure { pressure, .. } => {
                    pressures.push(pressure.clone());
                    pressures.len() as u32 - 1
                }
                _ => 0,
            })
            .collect();
        for face in &mesh.boundary {
            let normal = triangle_normal(face.nodes.map(|n| mesh.nodes[n as usize]));
            for node in face.nodes.map(|n| n as usize).into_iter().filter(|&n| n < n_owned) {
                match conditions[face.name as usize] {
                    Boundary::NoSlip => no_slip[node] = true,
                    Boundary::Slip => add_wall(&mut normals[node], normal),
                    // The lowest index wins where two inlets meet: the same on every rank.
                    Boundary::Velocity { .. } => {
                        moving_of[node] = moving_of[node].min(index[face.name as usize])
                    }
                    Boundary::Pressure { .. } => {
                        open_of[node] = open_of[node].min(index[face.name as usize])
                    }
                }
            }
        }

        // Walls at rest win over given velocities, those over slip.
        let mut nodes = vec![FREE; part.n_local()];
        for i in 0..n_owned {
            if no_slip[i] || moving_of[i] != u32::MAX {
                nodes[i].free = [[0.0; 3]; 3];
            } else {
                nodes[i].free = projector(&normals[i]);
            }
            if no_slip[i] {
                moving_of[i] = u32::MAX;
            }
            nodes[i].pressure_given = u8::from(open_of[i] != u32::MAX);
        }
        part.exchange.update_ghosts(&mut nodes);
        moving_of.resize(part.n_local(), u32::MAX);
        open_of.resize(part.n_local(), u32::MAX);
        part.exchange.update_ghosts(&mut moving_of);
        part.exchange.update_ghosts(&mut open_of);
        let listed = |of: Vec<u32>| -> Vec<(u32, u32)> {
            (0u32..).zip(of).filter(|&(_, b)| b != u32::MAX).collect()
        };
        let mut constraints = Self {
            nodes: Nodes::new(&nodes),
            moving: listed(moving_of),
            velocities,
            open: listed(open_of),
            pressures,
            pinned: Vec::new(),
        };
        constraints.pin(case.gravity, part, fluid);
        constraints
    }

    /// Pins the pressure of each body of fluid that has no open boundary; whether that changed anything. Collective.
    pub fn pin(&mut self, gravity: [f64; 3], part: &MeshPart, fluid: &[FluidBody]) -> bool {
        let mut open = vec![false; part.n_local()];
        self.open.iter().for_each(|&(node, _)| open[node as usize] = true);
        let pinned = references(gravity, part, fluid, |i| open[i]);
        if !part.comm.any(pinned != self.pinned) {
            return false;
        }
        let before = std::mem::replace(&mut self.pinned, pinned);
        for (list, given) in [(&before, 0), (&self.pinned, 1)] {
            list.iter().for_each(|&node| self.nodes.set_pressure_given(node as usize, given));
        }
        let mut given: Vec<u8> = self.nodes.iter().map(|c| c.pressure_given).collect();
        part.exchange.update_ghosts(&mut given);
        for i in part.n_owned()..part.n_local() {
            self.nodes.set_pressure_given(i, given[i]);
        }
        true
    }

    /// Sets what is fixed at time `t`: velocities at walls and inlets, pressures `p` at time
    /// `t_pressure` at open boundaries.
    pub fn impose(
        &self,
        part: &MeshPart,
        t: f64,
        t_pressure: f64,
        u: &mut [[f64; 3]],
        p: &mut [f64],
    ) {
        for (c, v) in self.nodes.iter().zip(u.iter_mut()) {
            if !c.is_free() {
                *v = c.project(*v);
            }
        }
        for &(node, b) in &self.moving {
            let x = part.mesh.nodes[node as usize];
            let formula = &self.velocities[b as usize];
            u[node as usize] = std::array::from_fn(|k| formula[k].at(x, t));
        }
        for &node in &self.pinned {
            p[node as usize] = 0.0;
        }
        for &(node, b) in &self.open {
            let x = part.mesh.nodes[node as usize];
            p[node as usize] = self.pressures[b as usize].at(x, t_pressure);
        }
    }
}

/// Adds a face's area vector to the smooth wall it continues, or starts a new one.
fn add_wall(walls: &mut Vec<[f64; 3]>, normal: [f64; 3]) {
    for wall in walls.iter_mut() {
        if dot(*wall, normal) > SMOOTH * norm(*wall) * norm(normal) {
            *wall = std::array::from_fn(|k| wall[k] + normal[k]);
            return;
        }
    }
    walls.push(normal);
}

/// I − Σ n nᵀ over an orthonormal basis of the walls' normals.
fn projector(walls: &[[f64; 3]]) -> [[f64; 3]; 3] {
    let mut free = FREE.free;
    for wall in walls {
        // What of this normal is still free; a nearly dependent one adds nothing.
        let rest = free.map(|row| dot(row, *wall));
        let length = norm(rest);
        if length > 0.1 * norm(*wall) {
            for a in 0..3 {
                for b in 0..3 {
                    free[a][b] -= rest[a] * rest[b] / (length * length);
                }
            }
        }
    }
    free
}

/// The body of fluid that a node is in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FluidBody {
    /// `mesh::connected::NONE` without fluid.
    pub name: u64,
    /// Whether the pressure should rather be pinned in another node.
    pub near_wall: bool,
}

/// A candidate for the reference of its body of fluid, best first.
type Candidate = (u64, (u8, u64, u64));

/// In each body of fluid without an open node, the node highest against gravity, ties by lowest global id; of
/// those, the ones owned here. Collective.
fn references(
    gravity: [f64; 3],
    part: &MeshPart,
    fluid: &[FluidBody],
    open: impl Fn(usize) -> bool,
) -> Vec<u32> {
    let mut best = std::collections::BTreeMap::<u64, (u8, u64, u64)>::new();
    let candidate = |i: usize| -> Option<Candidate> {
        let body = fluid.get(i).copied().unwrap_or(FluidBody { name: 0, near_wall: false });
        // Depths in an order that integers keep.
        let bits = (dot(gravity, part.mesh.nodes[i]) + 0.0).to_bits();
        let depth = if bits >> 63 == 1 { !bits } else { bits | 1 << 63 };
        let class = if open(i) { 0 } else { 1 + u8::from(body.near_wall) };
        (body.name != NONE).then_some((body.name, (class, depth, part.nodes.global[i])))
    };
    for (name, key) in (0..part.n_owned()).filter_map(candidate) {
        best.entry(name).and_modify(|b| *b = key.min(*b)).or_insert(key);
    }
    let mine: Vec<_> = best.iter().map(|(n, k)| [*n, u64::from(k.0), k.1, k.2]).collect();
    best.clear();
    for [name, class, depth, id] in part.comm.all_gather(&mine).into_iter().flatten() {
        let key = (class as u8, depth, id);
        best.entry(name).and_modify(|b| *b = key.min(*b)).or_insert(key);
    }
    let wanted = |i: &usize| {
        candidate(*i).is_some_and(|(name, key)| key.0 > 0 && best.get(&name) == Some(&key))
    };
    (0..part.n_owned()).filter(wanted).map(|i| i as u32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn projector_of_a_corner_edge_and_face() {
        let corner = projector(&[[1., 0., 0.], [0., -2., 0.], [0., 0., 3.]]);
        assert!(corner.iter().flatten().all(|v| v.abs() < 1e-15));
        let s = 0.5f64.sqrt();
        let face = projector(&[[s, s, 0.0]]);
        let c = Constraint { free: face, pressure_given: 0 };
        let v = c.project([1.0, 0.0, 5.0]);
        for (a, b) in v.iter().zip([0.5, -0.5, 5.0]) {
            assert!((a - b).abs() < 1e-15);
        }
        // Two walls not at right angles still leave exactly their common edge free.
        let edge = projector(&[[0., 0., 1.], [0., s, s]]);
        let c = Constraint { free: edge, pressure_given: 0 };
        let v = c.project([2.0, 3.0, 4.0]);
        for (a, b) in v.iter().zip([2.0, 0.0, 0.0]) {
            assert!((a - b).abs() < 1e-14);
        }
    }

    #[test]
    fn a_bent_wall_is_one_wall_and_a_corner_is_two() {
        let mut walls = Vec::new();
        add_wall(&mut walls, [0.0, 0.0, 1.0]);
        add_wall(&mut walls, [0.2, 0.0, 1.0]);
        add_wall(&mut walls, [1.0, 0.0, 0.0]);
        assert_eq!(walls.len(), 2);
    }
}
