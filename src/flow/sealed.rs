//! Fluid without an open boundary, between walls that move: it cannot keep its volume when they change it.
//!
//! Tested with 1 the continuity equation of such a body of fluid says `0 = Σ_i b_i`, b what its walls sweep. What is
//! left of that sum is spread over it as if it were a little compressible, gas ten thousand times as much as liquid:
//! `b_i ← b_i − w_i Σb`, `w_i ∝ ∫N_i (1 − φ_i + 1e-4)`. Else it would all go into the one node whose pressure is
//! pinned and whose equation is not asked for.

use super::material::Material;
use crate::cut::{Cell, CutMesh};
use crate::fem::constraints::FluidBody;
use crate::mesh::MeshPart;
use crate::mesh::connected::NONE;
use crate::mesh::tetrahedron::volume;

/// Compressibility of liquid over that of gas.
const LIQUID: f64 = 1e-4;

/// The sealed bodies of fluid.
#[derive(Clone, Debug, Default)]
pub(super) struct Sealed {
    /// Their names, ascending; the same on every rank.
    names: Vec<u64>,
    /// Owned node, the body it is in, ∫N_i [m³].
    nodes: Vec<(u32, u32, f64)>,
}

/// What walls did to them in a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Squeezed {
    /// How many there are.
    pub pockets: u32,
    /// By how much walls changed the volumes of all of them, sizes added up [m³].
    pub volume: f64,
}

impl Sealed {
    /// Of the bodies of fluid that have a pinned node. Collective.
    pub fn new(part: &MeshPart, cut: &CutMesh, fluid: &[FluidBody], pinned: &[u32]) -> Self {
        let mine: Vec<u64> = pinned.iter().map(|&i| fluid[i as usize].name).collect();
        let mut names: Vec<u64> = part.comm.all_gather(&mine).concat();
        names.sort_unstable();
        names.dedup();
        if names.is_empty() {
            return Self::default();
        }
        // Nodes inside structures go with the fluid beside them.
        let mut of: Vec<u64> = fluid.iter().map(|body| body.name).collect();
        let mut first = vec![0.0; part.n_owned()];
        for (e, tet) in part.mesh.tets.iter().enumerate() {
            let moments = match cut.cell(e) {
                Cell::Whole => [0.25 * volume(&part.mesh.corners(e)); 4],
                Cell::Cut(c) => c.pieces.fluid.first,
                Cell::Solid => continue,
            };
            let wet = tet.iter().map(|&n| fluid[n as usize].name).min().unwrap_or(NONE);
            for (&n, moment) in tet.iter().zip(moments) {
                let n = n as usize;
                if fluid[n].name == NONE {
                    of[n] = of[n].min(wet);
                }
                if n < part.n_owned() {
                    first[n] += moment;
                }
            }
        }
        let member = |(i, &moment): (usize, &f64)| {
            let body = names.binary_search(&of[i]).ok()?;
            Some((i as u32, body as u32, moment))
        };
        let nodes = first.iter().enumerate().filter_map(member).collect();
        Self { names, nodes }
    }

    /// Spreads what walls take from or give to each over it, in the continuity equations of a step: `rhs` are their
    /// right sides, `left` what is left of them. Collective.
    pub fn spread(
        &self,
        part: &MeshPart,
        material: &Material,
        rhs: &[[f64; 4]],
        left: &mut [[f64; 4]],
        dt: f64,
    ) -> Squeezed {
        if self.names.is_empty() {
            return Squeezed::default();
        }
        let weight = |i: u32, moment: f64| moment * (1.0 - material.phase(i as usize) + LIQUID);
        let mut sums = vec![[0.0; 2]; self.names.len()];
        for &(i, body, moment) in &self.nodes {
            let sum = &mut sums[body as usize];
            *sum = [sum[0] + rhs[i as usize][3], sum[1] + weight(i, moment)];
        }
        part.comm.sum_all(sums.as_flattened_mut());
        for &(i, body, moment) in &self.nodes {
            let [sum, all] = sums[body as usize];
            if all > 0.0 {
                left[i as usize][3] -= sum * weight(i, moment) / all;
            }
        }
        let volume = sums.iter().map(|[sum, _]| sum.abs() * dt).sum();
        Squeezed { pockets: self.names.len() as u32, volume }
    }
}
