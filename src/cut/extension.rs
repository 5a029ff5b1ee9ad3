//! Nodes that become wet as a structure moves take their history from the fluid next to them.
//!
//! A node that had no fluid takes the mean of its neighbours that had, those at its own height first (the free
//! surface meets the wall as it stands beside it); where none had, of those that have just been given theirs.

use super::CutMesh;
use crate::fem::{dot, norm};
use crate::mesh::MeshPart;

/// Which nodes take what from which.
#[derive(Clone, Debug, Default)]
pub struct Extension {
    /// Owned nodes and their range in `donors`, layer by layer.
    layers: Vec<Vec<(u32, std::ops::Range<usize>)>>,
    /// Local nodes and weights that sum to 1.
    donors: Vec<(u32, f64)>,
}

impl Extension {
    /// From the fluid of `before` to that of `after`; `gravity` says which way is down. Collective.
    pub fn new(part: &MeshPart, before: &CutMesh, after: &CutMesh, gravity: [f64; 3]) -> Self {
        let mut extension = Self::default();
        // 0: has values; 1: needs them; 2: has none and needs none.
        let mut state = vec![0u8; part.n_local()];
        before.dry_nodes.iter().for_each(|&n| state[n as usize] = 1);
        after.dry_nodes.iter().for_each(|&n| state[n as usize] *= 2);
        loop {
            let mut pairs: Vec<(u32, u32)> = Vec::new();
            for tet in &part.mesh.tets {
                for &i in tet.iter().filter(|&&i| state[i as usize] == 1) {
                    let donors = tet.iter().filter(|&&j| state[j as usize] == 0);
                    pairs.extend(donors.map(|&j| (i, j)));
                }
            }
            pairs.retain(|(i, _)| (*i as usize) < part.n_owned());
            pairs.sort_unstable();
            pairs.dedup();
            if !part.comm.any(!pairs.is_empty()) {
                return extension;
            }
            let layer = pairs.chunk_by(|a, b| a.0 == b.0).map(|group| {
                let start = extension.donors.len();
                extension.donors.extend(group.iter().map(|&(i, j)| {
                    (j, weight(part.mesh.nodes[i as usize], part.mesh.nodes[j as usize], gravity))
                }));
                let donors = &mut extension.donors[start..];
                let sum: f64 = donors.iter().map(|d| d.1).sum();
                donors.iter_mut().for_each(|d| d.1 /= sum);
                (group[0].0, start..extension.donors.len())
            });
            let layer: Vec<_> = layer.collect();
            layer.iter().for_each(|(i, _)| state[*i as usize] = 0);
            part.exchange.update_ghosts(&mut state);
            extension.layers.push(layer);
        }
    }

    /// Gives nodal values to the nodes that need them; ghosts valid before and after. Collective.
    pub fn apply<const C: usize>(&self, part: &MeshPart, values: &mut [[f64; C]]) {
        for layer in &self.layers {
            for (node, donors) in layer {
                let mut mean = [0.0; C];
                for &(j, w) in &self.donors[donors.clone()] {
                    for k in 0..C {
                        mean[k] += w * values[j as usize][k];
                    }
                }
                values[*node as usize] = mean;
            }
            part.exchange.update_ghosts(values);
        }
    }
}

impl Extension {
    /// The reverse: what nodes have goes to those they would take from, with the same weights. Of owned nodes;
    /// ghosts are stale after. Collective.
    pub fn hand_over(&self, part: &MeshPart, values: &mut [f64]) {
        for layer in self.layers.iter().rev() {
            values[part.n_owned()..].fill(0.0);
            for (node, donors) in layer {
                let value = std::mem::take(&mut values[*node as usize]);
                for &(j, w) in &self.donors[donors.clone()] {
                    values[j as usize] += w * value;
                }
            }
            part.exchange.sum_to_owners(values);
        }
    }
}

/// Of a neighbour: near, and at the same height.
fn weight(x: [f64; 3], y: [f64; 3], gravity: [f64; 3]) -> f64 {
    let r: [f64; 3] = std::array::from_fn(|k| y[k] - x[k]);
    let g = norm(gravity);
    let rise = if g > 0.0 { dot(r, gravity) / g } else { 0.0 };
    let square = dot(r, r);
    1.0 / (square + 100.0 * rise * rise)
}
