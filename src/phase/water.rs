//! Connected bodies of water: nodes with φ > ½ joined by element edges (that do not run inside a structure), and the band around each.
//!
//! A body's name is its smallest global node number, so it does not depend on the ranks (`mesh::connected`).
//! Nodes of air, and of spray that is nowhere wetter than ½, have none. The band (φ(1−φ) above its outer limit) is added
//! node layer by node layer, each node joining its wettest named neighbour.

use super::profile::OUTER;
use crate::cut::CutMesh;
use crate::linear::Pattern;
use crate::mesh::MeshPart;
pub use crate::mesh::connected::NONE;
use crate::mesh::connected::connected;
use std::collections::BTreeSet;

/// The body of each local node. Collective.
pub fn bodies_of_water(part: &MeshPart, cut: &CutMesh, graph: &Pattern, phi: &[f64]) -> Vec<u64> {
    let mut names = connected(part, |i| phi[i] > 0.5 && cut.is_in_fluid(i));
    add_band(part, cut, graph, phi, &mut names);
    names
}

fn add_band(part: &MeshPart, cut: &CutMesh, graph: &Pattern, phi: &[f64], names: &mut [u64]) {
    // Nodes inside a structure are like the band: they go with the fluid next to them.
    let mut dry: Vec<u32> = (0..part.n_owned() as u32)
        .filter(|&i| {
            names[i as usize] == NONE && {
                let phi = phi[i as usize];
                phi * (1.0 - phi) > OUTER || phi > 0.5
            }
        })
        .collect();
    let mut joined = Vec::new();
    loop {
        joined.clear();
        dry.retain(|&i| {
            let mut best: Option<(f64, u64)> = None;
            for &j in graph.columns_of(i as usize) {
                let name = names[j as usize];
                let candidate = (phi[j as usize], name);
                let better = best
                    .is_none_or(|b| candidate.0 > b.0 || (candidate.0 == b.0 && candidate.1 < b.1));
                if name != NONE
                    && better
                    && (cut.is_in_fluid(i as usize) || cut.is_in_fluid(j as usize))
                {
                    best = Some(candidate);
                }
            }
            if let Some((_, name)) = best {
                joined.push((i, name));
            }
            best.is_none()
        });
        if !part.comm.any(!joined.is_empty()) {
            return;
        }
        for &(i, name) in &joined {
            names[i as usize] = name;
        }
        part.exchange.update_ghosts(names);
    }
}

/// Pairs of bodies (smaller name first, ascending) whose bands touch; the same on every rank.
/// Collective.
pub fn contacts(part: &MeshPart, cut: &CutMesh, graph: &Pattern, names: &[u64]) -> Vec<(u64, u64)> {
    let mut pairs = BTreeSet::new();
    for i in 0..part.n_owned() {
        let a = names[i];
        if a == NONE {
            continue;
        }
        let mut last = a;
        for &j in graph.columns_of(i) {
            let b = names[j as usize];
            if b != last
                && b != a
                && b != NONE
                && (cut.is_in_fluid(i) || cut.is_in_fluid(j as usize))
            {
                pairs.insert((a.min(b), a.max(b)));
                last = b;
            }
        }
    }
    let mine: Vec<_> = pairs.into_iter().collect();
    let all: BTreeSet<_> = part.comm.all_gather(&mine).into_iter().flatten().collect();
    all.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::boxes::tensor_box;

    #[test]
    fn two_drops_and_spray_are_told_apart_and_the_band_goes_to_the_nearer() {
        let x: Vec<f64> = (0..=40).map(|i| i as f64).collect();
        let part = MeshPart::single(tensor_box([&x, &[0.0, 1.0, 2.0], &[0.0, 1.0]]));
        let (graph, _) = Pattern::of_elements(&part.mesh.tets, part.n_owned());
        let phi: Vec<f64> = part
            .mesh
            .nodes
            .iter()
            .map(|p| match p[0] {
                x if (4.0..=8.0).contains(&x) => 0.9,
                x if (14.0..=20.0).contains(&x) => 0.8,
                x if (9.0..=12.0).contains(&x) => 0.2,
                13.0 => 0.3,
                x if (30.0..=32.0).contains(&x) => 0.4,
                _ => 0.0,
            })
            .collect();
        let names = bodies_of_water(&part, &CutMesh::whole(), &graph, &phi);
        for (p, &name) in part.mesh.nodes.iter().zip(&names) {
            // x = 11 is three layers from both and as wet on both sides: the smaller name.
            let expected = match p[0] as u64 {
                4..=11 => 4,
                12..=20 => 14,
                _ => NONE,
            };
            assert_eq!(name, expected, "x = {}", p[0]);
        }
        assert_eq!(contacts(&part, &CutMesh::whole(), &graph, &names), [(4, 14)]);
    }
}
