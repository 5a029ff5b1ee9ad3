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

/// The aggregate of each row, or `NONE`, and the number of aggregates.
pub fn aggregate(a: &BlockCsr<1>, theta: f64) -> (Vec<u32>, usize) {
    let n = a.n_rows();
    // 1/√a_ii
    let scale: Vec<f64> = (0..n)
        .map(|i| {
            let d = a.diagonal(i)[0][0];
            if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 }
        })
        .collect();
    let mut group = vec![NONE; n];
    let mut size: Vec<u32> = Vec::new();
    let mut candidates: Vec<(u32, f64)> = Vec::with_capacity(256);
    // Where each node is among them.
    let mut place = vec![NONE; n];
    for seed in 0..n {
        if group[seed] != NONE {
            continue;
        }
        let mine = size.len() as u32;
        let mut members = 0;
        let mut next = Some(seed);
        candidates.drain(..).for_each(|(j, _)| place[j as usize] = NONE);
        while let Some(i) = next {
            group[i] = mine;
            members += 1;
            if members == SIZE {
                break;
            }
            for (j, v) in a.entries(i) {
                if j >= n || group[j] != NONE {
                    continue;
                }
                let tie = -v[0][0] * scale[i] * scale[j];
                if tie > theta {
                    if place[j] == NONE {
                        place[j] = candidates.len() as u32;
                        candidates.push((j as u32, tie));
                    } else {
                        candidates[place[j] as usize].1 += tie;
                    }
                }
            }
            let mut best = None;
            for (at, c) in candidates.iter().enumerate() {
                if best.is_none_or(|b: usize| c.1 > candidates[b].1) {
                    best = Some(at);
                }
            }
            next = best.map(|at| {
                let (chosen, _) = candidates.swap_remove(at);
                if let Some((moved, _)) = candidates.get(at) {
                    place[*moved as usize] = at as u32;
                }
                chosen as usize
            });
        }
        size.push(members as u32);
    }
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
