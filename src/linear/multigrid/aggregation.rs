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
    let mut front = Front::new(n);
    for seed in 0..n {
        if group[seed] != NONE {
            continue;
        }
        let mine = size.len() as u32;
        let mut members = 0;
        let mut next = Some(seed);
        front.clear();
        while let Some(i) = next {
            group[i] = mine;
            members += 1;
            if members == SIZE {
                break;
            }
            let known = front.count;
            front.extend(a.row(i).len());
            for (j, v) in a.entries(i) {
                let Some(&of) = group.get(j) else { continue };
                let tie = -v[0][0] * scale[i] * scale[j];
                front.tie(j, tie, (of == NONE) & (tie > theta));
            }
            front.nodes[known..front.count].iter().for_each(|&(j, _)| a.fetch_row(j as usize));
            next = front.take_strongest();
        }
        size.push(members as u32);
    }
    join_small(a, &mut group, &mut size);
    number(a, &mut group, &size)
}

/// Free nodes tied to a growing group, and how strongly.
struct Front {
    /// Of these the first `count`.
    nodes: Vec<(u32, f64)>,
    count: usize,
    /// Where each node is among them, or `NONE`.
    place: Vec<u32>,
}

impl Front {
    fn new(n: usize) -> Self {
        Self { nodes: Vec::with_capacity(256), count: 0, place: vec![NONE; n] }
    }

    fn clear(&mut self) {
        for &(j, _) in &self.nodes[..self.count] {
            self.place[j as usize] = NONE;
        }
        self.count = 0;
    }

    /// Makes room for so many more.
    fn extend(&mut self, more: usize) {
        if self.nodes.len() < self.count + more {
            self.nodes.resize(self.count + more, (0, 0.0));
        }
    }

    /// Adds a tie to node j where it `counts`. Whether it does, and whether j is known, is as good as chance: without
    /// branches this is a tenth faster.
    #[inline]
    fn tie(&mut self, j: usize, tie: f64, counts: bool) {
        let place = self.place[j];
        let new = place == NONE;
        // What does not count goes behind the last one.
        let at = if new | !counts { self.count } else { place as usize };
        let entry = &mut self.nodes[at];
        *entry = (j as u32, if new { tie } else { entry.1 + tie });
        self.place[j] = if counts { at as u32 } else { place };
        self.count += usize::from(new & counts);
    }

    /// The first of the most strongly tied ones leaves.
    fn take_strongest(&mut self) -> Option<usize> {
        let (mut best, mut strongest) = (0, f64::NEG_INFINITY);
        for (at, &(_, tie)) in self.nodes[..self.count].iter().enumerate() {
            if tie > strongest {
                (best, strongest) = (at, tie);
            }
        }
        let last = self.count.checked_sub(1)?;
        let (chosen, _) = self.nodes[best];
        self.nodes[best] = self.nodes[last];
        self.place[self.nodes[best].0 as usize] = best as u32;
        self.count = last;
        Some(chosen as usize)
    }
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
