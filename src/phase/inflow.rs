//! Where fluid may come in, and which: φ at the nodes of boundaries with a given velocity or pressure, and of
//! all boundaries where the case prescribes the velocity everywhere.

use super::Phase;
use crate::case::{Boundary, Case, Formula};
use crate::fem::{dot, norm, triangle_normal};
use crate::mesh::MeshPart;

/// Slower than this fraction of the node's speed, the flow is along the boundary.
const ALONG: f64 = 1e-9;

/// The boundaries that fluid may cross.
#[derive(Clone, Debug)]
pub struct Inflow {
    /// Local node, area-weighted normal out of the domain, index into `water`.
    nodes: Vec<(u32, [f64; 3], u32)>,
    /// Positive where what comes in is liquid; `None`: the gas.
    water: Vec<Option<Formula>>,
    /// Indices into `part.mesh.boundary` of the faces that fluid may cross.
    pub faces: Vec<u32>,
}

impl Inflow {
    /// From the case's boundary conditions. Collective.
    pub fn new(case: &Case, part: &MeshPart) -> Self {
        let mesh = &part.mesh;
        let mut water = Vec::new();
        let crossing: Vec<Option<u32>> = mesh
            .boundary_names
            .iter()
            .map(|name| match case.boundary(name) {
                Boundary::Velocity { water: w, .. } | Boundary::Pressure { water: w, .. } => {
                    water.push(w.clone());
                    Some(water.len() as u32 - 1)
                }
                Boundary::NoSlip | Boundary::Slip => case.prescribed_velocity.as_ref().map(|_| {
                    water.push(None);
                    water.len() as u32 - 1
                }),
            })
            .collect();
        // The lowest boundary wins where two meet: the same on every rank.
        let mut at = vec![([0.0; 3], u32::MAX); part.n_local()];
        let mut faces = Vec::new();
        for (f, face) in (0u32..).zip(&mesh.boundary) {
            let Some(which) = crossing[face.name as usize] else { continue };
            faces.push(f);
            let normal = triangle_normal(face.nodes.map(|n| mesh.nodes[n as usize]));
            for node in face.nodes.map(|n| n as usize).into_iter().filter(|&n| n < part.n_owned()) {
                let (sum, first) = &mut at[node];
                *sum = std::array::from_fn(|k| sum[k] + normal[k]);
                *first = which.min(*first);
            }
        }
        part.exchange.update_ghosts(&mut at);
        let nodes = (0u32..)
            .zip(at)
            .filter(|(_, (_, which))| *which != u32::MAX)
            .map(|(node, (normal, which))| (node, normal, which))
            .collect();
        Self { nodes, water, faces }
    }

    /// Local nodes where fluid comes in with this velocity [m/s] over a step from `t` of length `dt`, and its φ.
    ///
    /// Gas takes the place of what is there in the time that it needs to cross a cell: where hardly any comes
    /// in, the tail of the surface's profile stays.
    pub fn values(
        &self,
        part: &MeshPart,
        velocity: &[[f64; 3]],
        phase: &Phase,
        [t, dt]: [f64; 2],
        out: &mut Vec<(u32, f64)>,
    ) {
        out.clear();
        for &(node, normal, which) in &self.nodes {
            let u = velocity[node as usize];
            let inwards = -dot(u, normal) / norm(normal);
            if inwards > ALONG * norm(u) {
                let x = part.mesh.nodes[node as usize];
                let phi = match &self.water[which as usize] {
                    Some(distance) => super::profile::sigmoid(distance.at(x, t) / phase.delta()),
                    None => phase.phi[node as usize] * (-inwards * dt / phase.cell()).exp(),
                };
                out.push((node, phi));
            }
        }
    }
}
