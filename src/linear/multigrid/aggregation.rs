//! Groups of strongly coupled nodes, `−a_ij > θ √(a_ii a_jj)`, among one rank's own nodes.
//!
//! Greedy: a group grows around its first free node by the neighbour most strongly tied to all of
//! the group, until it has `SIZE` nodes; groups that stay small join a neighbour. Nodes tied to no
//! other (prescribed values) are in no group.

use crate::linear::block_csr::BlockCsr;
use crate::linear::distributed::NONE;

/// Nodes of a full aggregate.
const SIZE: usize = 9;

/// Aggregates smaller than this are dissolved into their neighbours.
const SMALL: usize = 4;

/// A node while groups grow.
#[derive(Clone, Copy)]
struct Node {
    /// 1/√a_ii
    scale: f32,
    /// Its group, or `NONE`.
    group: u32,
    /// Its place among the candidates, or `NONE`.
    place: u32,
}

/// Free nodes that are tied to the group that grows.
struct Candidates {
    nodes: Vec<u32>,
    /// Sums of their ties to it: positive.
    ties: Vec<f32>,
}

impl Candidates {
    /// Where the one most strongly tied is; the first of equals.
    fn best(&self) -> Option<usize> {
        // Positive numbers are in the order of their bits, and of integers the largest is found eight at a time.
        let largest = self.ties.iter().fold(0, |largest, tie| tie.to_bits().max(largest));
        self.ties.iter().position(|tie| tie.to_bits() == largest)
    }
}

/// The aggregate of each row, or `NONE`, and the number of aggregates.
pub fn aggregate(a: &BlockCsr<1>, theta: f64) -> (Vec<u32>, usize) {
    let n = a.n_rows();
    let free = |i| {
        let d = a.diagonal(i)[0][0];
        let scale = if d > 0.0 { (1.0 / d.sqrt()) as f32 } else { 0.0 };
        Node { scale, group: NONE, place: NONE }
    };
    let mut nodes: Vec<Node> = (0..n).map(free).collect();
    let mut size: Vec<u32> = Vec::new();
    let mut candidates =
        Candidates { nodes: Vec::with_capacity(256), ties: Vec::with_capacity(256) };
    for seed in 0..n {
        if nodes[seed].group != NONE {
            continue;
        }
        let mine = size.len() as u32;
        let mut members = 0;
        let mut next = Some(seed);
        candidates.nodes.drain(..).for_each(|j| nodes[j as usize].place = NONE);
        candidates.ties.clear();
        while let Some(i) = next {
            nodes[i].group = mine;
            members += 1;
            if members == SIZE {
                break;
            }
            let scale = nodes[i].scale;
            for (j, v) in a.entries(i) {
                if j >= n || nodes[j].group != NONE {
                    continue;
                }
                let node = &mut nodes[j];
                let tie = -v[0][0] as f32 * scale * node.scale;
                if tie > theta as f32 {
                    if node.place == NONE {
                        node.place = candidates.nodes.len() as u32;
                        candidates.nodes.push(j as u32);
                        candidates.ties.push(tie);
                    } else {
                        candidates.ties[node.place as usize] += tie;
                    }
                }
            }
            next = candidates.best().map(|at| {
                let chosen = candidates.nodes.swap_remove(at) as usize;
                candidates.ties.swap_remove(at);
                if let Some(&moved) = candidates.nodes.get(at) {
                    nodes[moved as usize].place = at as u32;
                }
                chosen
            });
        }
        size.push(members as u32);
    }
    let mut group: Vec<u32> = nodes.iter().map(|node| node.group).collect();
    join_small(a, &mut group, &mut size);
    number(a, &mut group, &size)
}

/// Members of small groups go, one by one, to the group they are most strongly tied to.
fn join_small(a: &BlockCsr<1>, group: &mut [u32], size: &mut [u32]) {
    let n = group.len();
    for i in 0..n {
        if size[group[i] as usize] >= SMALL as u32 {
            continue;
        }
        let mut best = (0.0, NONE);
        for (j, v) in a.entries(i) {
            if j < n && group[j] != group[i] && size[group[j] as usize] >= SMALL as u32 {
                let tie = v[0][0].abs();
                if tie > best.0 {
                    best = (tie, group[j]);
                }
            }
        }
        if best.1 != NONE {
            group[i] = best.1;
        }
    }
}

/// Numbers the groups that are left in the order of their first nodes, and leaves out lone nodes
/// without any tie.
fn number(a: &BlockCsr<1>, group: &mut [u32], size: &[u32]) -> (Vec<u32>, usize) {
    let mut name = vec![NONE; size.len()];
    let mut count = 0;
    let numbered = (0..group.len())
        .map(|i| {
            let g = group[i] as usize;
            let tied = size[g] > 1 || a.entries(i).any(|(j, v)| j != i && v[0][0] != 0.0);
            if !tied {
                return NONE;
            }
            if name[g] == NONE {
                name[g] = count;
                count += 1;
            }
            name[g]
        })
        .collect();
    (numbered, count as usize)
}
