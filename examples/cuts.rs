//! What the cuts of a mesh into many parts would cost, found on one rank: one line of JSON for each number of parts.
//!
//!     cuts CASE [--direct] PARTS ...
//!
//! The mesh is split as the program does: METIS on the reader's mesh, which is then refined; with `--direct` METIS on
//! the refined mesh. For each part: elements of METIS, elements that touch a node of the part (assembled), elements
//! held, nodes owned, ghosts and neighbours, and the same of the coarser grids of the multigrid, whose aggregates do not
//! cross parts, down to the level that every rank holds. `far`: ghosts that the ranks of one node of a cluster have on
//! other nodes, `RANKS` in a row on a node.

use fcm_fsi::case::{Case, MeshSource, Sources};
use fcm_fsi::linear::multigrid::{
    MultigridSettings, aggregation::aggregate, galerkin::coarse_matrix,
};
use fcm_fsi::linear::{BlockCsr, Pattern};
use fcm_fsi::mesh::tetrahedron::Tetrahedron;
use fcm_fsi::mesh::{FACES, Mesh, MeshPart, boxes};
use fcm_fsi::report::summary::memory_peak_mb;
use partition::{Communicator, metis};
use serde_json::{Value, json};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

const NONE: u32 = u32::MAX;

/// Ranks of a node of a cluster.
const RANKS: u32 = 64;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().expect("cuts CASE [--direct] PARTS ...");
    let (flags, parts): (Vec<String>, Vec<String>) = arguments.partition(|a| a.starts_with('-'));
    let case = Case::new(&Sources::read(Path::new(&path)).expect("a case")).expect("a good case");
    let MeshSource::Box(block) = &case.mesh else { panic!("the mesh is a box") };

    let start = Instant::now();
    let coarse = boxes::box_mesh(block).expect("a good mesh");
    let generated = start.elapsed().as_secs_f64();
    let tets = coarse.tets.clone();
    let part =
        MeshPart::distribute(&Communicator::single(), Some(coarse), case.refine).expect("a mesh");
    let topology = Topology::new(part.mesh);
    let parent: Vec<u32> =
        part.element_global.iter().map(|e| (e >> (3 * case.refine)) as u32).collect();
    drop(part.element_global);
    for n in parts.iter().map(|n| n.parse::<usize>().expect("a number of parts")) {
        let start = Instant::now();
        let (split, owned) = if flags.is_empty() {
            let split = metis::split(&tets, n, &[]).expect("METIS");
            (parent.iter().map(|&e| split[e as usize]).collect(), "reader's mesh")
        } else {
            (metis::split(&topology.mesh.tets, n, &[]).expect("METIS"), "refined mesh")
        };
        let seconds = start.elapsed().as_secs_f64();
        let mut line = topology.cut(n, split);
        line["split"] = json!({ "of": owned, "tets": tets.len(), "seconds": seconds, "mesh_seconds": generated });
        line["memory_mb"] = json!(memory_peak_mb());
        println!("{line}");
    }
}

/// A mesh, its elements around nodes and across faces, and a Laplacian on it.
struct Topology {
    mesh: Mesh,
    start: Vec<u32>,
    around: Vec<u32>,
    across: Vec<[u32; 4]>,
    laplacian: BlockCsr<1>,
}

impl Topology {
    fn new(mesh: Mesh) -> Self {
        let n = mesh.nodes.len();
        let mut start = vec![0u32; n + 1];
        mesh.tets.as_flattened().iter().for_each(|&node| start[node as usize + 1] += 1);
        (0..n).for_each(|i| start[i + 1] += start[i]);
        let mut next = start.clone();
        let mut around = vec![0u32; 4 * mesh.tets.len()];
        for (e, tet) in (0..).zip(&mesh.tets) {
            for &node in tet {
                around[next[node as usize] as usize] = e;
                next[node as usize] += 1;
            }
        }
        let across = (0..).zip(&mesh.tets).map(|(e, tet): (u32, _)| {
            FACES.map(|corners| {
                let [a, b, c] = corners.map(|corner| tet[corner]);
                let list = &around[start[a as usize] as usize..start[a as usize + 1] as usize];
                let other = list.iter().find(|&&f| {
                    let nodes = &mesh.tets[f as usize];
                    f != e && nodes.contains(&b) && nodes.contains(&c)
                });
                other.copied().unwrap_or(NONE)
            })
        });
        let across = across.collect();
        let (pattern, places) = Pattern::of_elements(&mesh.tets, n);
        let mut laplacian = BlockCsr::<1>::zero(&Arc::new(pattern));
        for (e, tet) in mesh.tets.iter().enumerate() {
            let t = Tetrahedron::of(&mesh, e);
            for i in 0..4 {
                for j in 0..4 {
                    let dot: f64 = (0..3).map(|k| t.grad[i][k] * t.grad[j][k]).sum();
                    let row = laplacian.pattern.row_start[tet[i] as usize] as usize;
                    laplacian.values[row + usize::from(places[e][4 * i + j])][0][0] +=
                        t.volume * dot;
                }
            }
        }
        Self { mesh, start, around, across, laplacian }
    }

    fn around(&self, node: usize) -> &[u32] {
        &self.around[self.start[node] as usize..self.start[node + 1] as usize]
    }

    /// The rank with most elements around each node; among equals the one that the node's number picks.
    fn owners(&self, split: &[u32]) -> Vec<u32> {
        let mut ranks = Vec::new();
        (0..self.mesh.nodes.len())
            .map(|node| {
                ranks.clear();
                ranks.extend(self.around(node).iter().map(|&e| split[e as usize]));
                ranks.sort_unstable();
                let most = ranks.chunk_by(|a, b| a == b).map(<[u32]>::len).max().unwrap_or(0);
                let mut equal = ranks.chunk_by(|a, b| a == b).filter(|run| run.len() == most);
                let count = equal.clone().count();
                equal.nth(node.wrapping_mul(0x9e37_79b9) / 64 % count).expect("a node has elements")
                    [0]
            })
            .collect()
    }

    fn cut(&self, n: usize, split: Vec<u32>) -> Value {
        let owner = self.owners(&split);
        // Ranks that need an element for its rows.
        let readers = |e: u32, list: &mut Vec<u32>| {
            list.push(split[e as usize]);
            list.extend(self.mesh.tets[e as usize].map(|node| owner[node as usize]));
        };
        let (mut owned, mut assembled, mut held) = (vec![0u64; n], vec![0u64; n], vec![0u64; n]);
        let mut list = Vec::new();
        let distinct = |list: &mut Vec<u32>| {
            list.sort_unstable();
            list.dedup();
        };
        // Whether all that an element touches is of its own rank.
        let mut inner = vec![false; split.len()];
        for (e, tet) in (0u32..).zip(&self.mesh.tets) {
            let own = split[e as usize];
            owned[own as usize] += 1;
            list.clear();
            list.extend(tet.map(|node| owner[node as usize]));
            distinct(&mut list);
            list.iter().for_each(|&rank| assembled[rank as usize] += 1);
            readers(e, &mut list);
            let near = self.across[e as usize].iter().filter(|&&f| f != NONE);
            near.for_each(|&f| readers(f, &mut list));
            distinct(&mut list);
            list.iter().for_each(|&rank| held[rank as usize] += 1);
            inner[e as usize] = *list == [own];
        }
        // Who sees which node of another: (rank, node).
        let mut seen: Vec<(u32, u32)> = Vec::new();
        for (node, &own) in (0u32..).zip(&owner) {
            list.clear();
            for &e in self.around(node as usize) {
                if inner[e as usize] {
                    list.push(split[e as usize]);
                    continue;
                }
                readers(e, &mut list);
                let near = self.across[e as usize].iter().filter(|&&f| f != NONE);
                near.for_each(|&f| readers(f, &mut list));
            }
            distinct(&mut list);
            seen.extend(list.iter().filter(|&&rank| rank != own).map(|&rank| (rank, node)));
        }
        json!({
            "parts": n,
            "nodes": owner.len(),
            "tets": split.len(),
            "elements": spread(&owned),
            "assembled": spread(&assembled),
            "held": spread(&held),
            "levels": self.levels(n, owner, seen),
        })
    }

    fn levels(&self, n: usize, mut owner: Vec<u32>, mut seen: Vec<(u32, u32)>) -> Vec<Value> {
        let settings = MultigridSettings::default();
        let mut matrix = self.laplacian.clone();
        let mut theta = settings.strength;
        let mut levels = Vec::new();
        loop {
            levels.push(level(n, &owner, &seen, matrix.pattern.columns.len()));
            if owner.len() as u64 <= settings.gathered {
                return levels;
            }
            // Aggregates do not cross parts.
            let mut inside = matrix.clone();
            for i in 0..inside.n_rows() {
                for at in inside.row(i) {
                    if owner[inside.pattern.columns[at] as usize] != owner[i] {
                        inside.values[at] = [[0.0]];
                    }
                }
            }
            let (aggregates, count) = aggregate(&inside, theta);
            drop(inside);
            matrix = coarse_matrix(&matrix, &aggregates, count, 0, count);
            let mut coarse = vec![0; count];
            for (&aggregate, &owner) in aggregates.iter().zip(&owner) {
                if aggregate != NONE {
                    coarse[aggregate as usize] = owner;
                }
            }
            owner = coarse;
            seen = seen.iter().map(|&(rank, node)| (rank, aggregates[node as usize])).collect();
            seen.retain(|pair| pair.1 != NONE);
            seen.sort_unstable();
            seen.dedup();
            theta *= 0.5;
        }
    }
}

/// Rows, ghosts and neighbours of each rank on one level.
fn level(n: usize, owner: &[u32], seen: &[(u32, u32)], entries: usize) -> Value {
    let (mut owned, mut ghosts, mut neighbours) = (vec![0u64; n], vec![0u64; n], vec![0u64; n]);
    owner.iter().for_each(|&rank| owned[rank as usize] += 1);
    let mut far = vec![0u64; n.div_ceil(RANKS as usize)];
    let mut pairs: Vec<(u32, u32)> = Vec::with_capacity(seen.len());
    for &(rank, node) in seen {
        ghosts[rank as usize] += 1;
        let other = owner[node as usize];
        far[(rank / RANKS) as usize] += u64::from(other / RANKS != rank / RANKS);
        pairs.push((rank, other));
    }
    pairs.sort_unstable();
    pairs.dedup();
    pairs.iter().for_each(|&(rank, _)| neighbours[rank as usize] += 1);
    json!({
        "nodes": owner.len(),
        "entries": entries,
        "owned": spread(&owned),
        "ghosts": spread(&ghosts),
        "neighbours": spread(&neighbours),
        "far": spread(&far),
    })
}

fn spread(values: &[u64]) -> Value {
    let mean = values.iter().sum::<u64>() as f64 / values.len() as f64;
    json!({ "mean": mean, "max": values.iter().max(), "min": values.iter().min() })
}
