//! φ at nodes inside a structure whose elements reach into the fluid.
//!
//! Such a node may have next to no fluid: then an equation of its own would ring. Its φ is given
//! instead, from its neighbours in the fluid, j: ψ moves as theirs do in the mean, and stays within their
//! distance, `|ψ_i − ψ_j| ≤ |x_i − x_j|`, as a distance must. At rest nothing moves. What its equation
//! would have changed of the liquid's volume is owed by these neighbours (`excess`), so ∫φ is kept to round-off.

use super::Phase;
use super::profile::{logit, sigmoid};
use crate::cut::CutMesh;
use crate::fem::norm;
use crate::mesh::MeshPart;

/// A node is of the margin if the fluid around it is more than this many times its lumped mass; 4 is a whole
/// support. Nodes with more fluid do well by their own equation; given φ with a step's lag, all of them
/// are unstable at rest (measured: 4 no, 6 yes), and with 10 or more a plunger's wetted nodes ring.
const SMALL: f64 = 6.0;

/// The nodes, and who stands for them.
#[derive(Clone, Debug, Default)]
pub(super) struct Margin {
    /// Local nodes, ascending.
    pub nodes: Vec<u32>,
    /// Node, neighbour in the fluid, weight (1 in sum for a node), distance [m]; sorted by node.
    pairs: Vec<(u32, u32, f64, f64)>,
    /// Whether a local node is one of them; empty if none is.
    member: Vec<bool>,
    /// Liquid that the neighbours of each node are still to be charged with [m³].
    pub parked: Vec<f64>,
}

impl Margin {
    /// `ratio`: fluid around each local node over its lumped mass. Collective.
    pub fn new(part: &MeshPart, cut: &CutMesh, ratio: &[f64]) -> Self {
        if cut.distance.is_empty() {
            return Self::default();
        }
        let mut pairs: Vec<(u32, u32)> = Vec::new();
        for c in &cut.elements {
            let tet = part.mesh.tets[c.element as usize];
            let inside = |n: &u32| !cut.is_in_fluid(*n as usize);
            let small = |n: &u32| inside(n) && ratio[*n as usize] > SMALL;
            for i in tet.into_iter().filter(small) {
                pairs.extend(tet.into_iter().filter(|n| !inside(n)).map(|j| (i, j)));
            }
        }
        pairs.sort_unstable();
        pairs.dedup();
        let place = |n: u32| part.mesh.nodes[n as usize];
        let distance = |i: u32, j: u32| norm(std::array::from_fn(|k| place(i)[k] - place(j)[k]));
        // A node's owner sees all its neighbours.
        let mut sum = vec![0.0; part.n_local()];
        for &(i, j) in &pairs {
            sum[i as usize] += distance(i, j).powi(-2);
        }
        part.exchange.update_ghosts(&mut sum);
        let mut member = vec![false; part.n_local()];
        pairs.iter().for_each(|&(i, _)| member[i as usize] = true);
        Self {
            nodes: (0u32..).zip(&member).filter(|(_, m)| **m).map(|(i, _)| i).collect(),
            pairs: pairs
                .into_iter()
                .map(|(i, j)| (i, j, distance(i, j).powi(-2) / sum[i as usize], distance(i, j)))
                .collect(),
            member,
            parked: vec![0.0; part.n_local()],
        }
    }

    #[inline]
    pub fn contains(&self, i: usize) -> bool {
        self.member.get(i).is_some_and(|m| *m)
    }
}

/// Gives these nodes their φ after a step from `phase.before`, and charges their neighbours with what is
/// parked. Collective.
pub(super) fn settle(phase: &mut Phase, part: &MeshPart) {
    let Phase { phi, before, excess, lumped, delta, margin, .. } = phase;
    if margin.member.is_empty() {
        return;
    }
    let n_owned = part.n_owned();
    for group in margin.pairs.chunk_by(|a, b| a.0 == b.0) {
        let i = group[0].0 as usize;
        if i >= n_owned {
            break;
        }
        let (mut change, mut least, mut most) = (0.0, f64::NEG_INFINITY, f64::INFINITY);
        for &(_, j, w, r) in group {
            let psi = logit(phi[j as usize]);
            change += w * (psi - logit(before[j as usize]));
            // A little more than the distance: at rest nothing is to happen.
            let reach = 1.001 * r / *delta;
            (least, most) = (least.max(psi - reach), most.min(psi + reach));
        }
        let old = logit(phi[i]);
        let new = old + change;
        let new = if least > most { 0.5 * (least + most) } else { new.clamp(least, most) };
        // A difference: beyond the profile's ends a logit does not give φ back.
        let moved = sigmoid(new) - sigmoid(old);
        phi[i] += moved;
        margin.parked[i] -= lumped[i] * moved;
    }
    part.exchange.update_ghosts(phi);
    part.exchange.update_ghosts(&mut margin.parked);
    for &(i, j, w, _) in &margin.pairs {
        if (j as usize) < n_owned {
            excess[j as usize] += w * margin.parked[i as usize];
        }
    }
    margin.parked.fill(0.0);
}
