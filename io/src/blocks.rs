//! Rows in the order of their global ids, whatever rank owns them: with n rows on s ranks, rank r
//! handles rows ⌊r n / s⌋ to ⌊(r + 1) n / s⌋.
//!
//! Written this way, a file does not depend on the number of ranks, and every rank writes one
//! contiguous piece of nearly the same size. No rank ever holds more than its piece.

use partition::{Communicator, Item};
use std::ops::Range;

/// The equal pieces of `total` rows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Blocks {
    pub total: u64,
    ranks: u64,
}

impl Blocks {
    /// `total` rows on the ranks.
    pub fn new(comm: &Communicator, total: u64) -> Self {
        Self { total, ranks: comm.size() as u64 }
    }

    /// The rows of a rank.
    pub fn rows(&self, rank: usize) -> Range<u64> {
        self.first(rank as u64)..self.first(rank as u64 + 1)
    }

    /// The rank whose rows hold `id`.
    pub fn rank_of(&self, id: u64) -> usize {
        let mut rank = (u128::from(id) * u128::from(self.ranks) / u128::from(self.total)) as u64;
        while self.first(rank + 1) <= id {
            rank += 1;
        }
        rank as usize
    }

    fn first(&self, rank: u64) -> u64 {
        (u128::from(rank) * u128::from(self.total) / u128::from(self.ranks)) as u64
    }
}

/// The way of owned items to the ranks that handle their rows.
#[derive(Debug)]
pub(crate) struct ToBlocks {
    comm: Communicator,
    blocks: Blocks,
    /// For each rank, which of my items go there.
    leaving: Vec<Vec<u32>>,
    /// For each rank, the rows (from the first of mine on) of the items that come from there.
    arriving: Vec<Vec<u32>>,
}

impl ToBlocks {
    /// From the ids of the items each rank owns: together every id from 0 to n - 1, once. Collective.
    pub fn new(comm: &Communicator, ids: &[u64]) -> Self {
        let blocks = Blocks::new(comm, comm.sum_u64(ids.len() as u64));
        let mut leaving = vec![Vec::new(); comm.size()];
        let mut rows = vec![Vec::new(); comm.size()];
        for (i, &id) in ids.iter().enumerate() {
            assert!(id < blocks.total, "global ids are 0 to {}, found {id}", blocks.total - 1);
            let rank = blocks.rank_of(id);
            leaving[rank].push(i as u32);
            rows[rank].push((id - blocks.first(rank as u64)) as u32);
        }
        let arriving = comm.exchange_lists(rows);
        let mine = blocks.rows(comm.rank());
        let mut seen = vec![false; (mine.end - mine.start) as usize];
        for &row in arriving.iter().flatten() {
            let twice = std::mem::replace(&mut seen[row as usize], true);
            assert!(!twice, "the global id {} is owned once", mine.start + u64::from(row));
        }
        // As many ids as rows, none twice: all are there.
        Self { comm: comm.clone(), blocks, leaving, arriving }
    }

    /// Number of rows on all ranks.
    pub fn total(&self) -> u64 {
        self.blocks.total
    }

    /// The rows that this rank handles.
    pub fn mine(&self) -> Range<u64> {
        self.blocks.rows(self.comm.rank())
    }

    /// My rows of a field of which every rank gives its owned items (and perhaps more after them),
    /// `components` values each. Collective.
    pub fn rows<T: Item + Default>(&self, components: usize, value: impl Fn(usize) -> T) -> Vec<T> {
        let values_of = |items: &Vec<u32>| {
            let places = items.iter().flat_map(|&i| (0..components).map(move |c| (i, c)));
            places.map(|(i, c)| value(i as usize * components + c)).collect()
        };
        let arrived = self.comm.exchange_lists(self.leaving.iter().map(values_of).collect());
        let mine = self.mine();
        let mut rows = vec![T::default(); (mine.end - mine.start) as usize * components];
        for (places, values) in self.arriving.iter().zip(&arrived) {
            for (&row, value) in places.iter().zip(values.chunks_exact(components)) {
                let at = row as usize * components;
                rows[at..at + components].copy_from_slice(value);
            }
        }
        rows
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_has_one_rank() {
        for (total, ranks) in [(0, 3), (1, 3), (7, 3), (10, 1), (1 << 40, 7), (5, 16)] {
            let blocks = Blocks { total, ranks };
            let ends: Vec<_> = (0..ranks as usize).map(|r| blocks.rows(r)).collect();
            assert_eq!((ends[0].start, ends[ranks as usize - 1].end), (0, total));
            assert!(ends.windows(2).all(|pair| pair[0].end == pair[1].start));
            for (rank, rows) in ends.iter().enumerate().filter(|(_, rows)| !rows.is_empty()) {
                assert_eq!(blocks.rank_of(rows.start), rank);
                assert_eq!(blocks.rank_of(rows.end - 1), rank);
            }
        }
    }
}
