//! Which entries matrices have, shared by all that live on one node graph; and where elements put theirs.

use std::ops::Range;
use std::sync::OnceLock;

/// Compressed rows: rows are owned nodes, columns are local nodes.
#[derive(Clone, Debug, Default)]
pub struct Pattern {
    /// `row_start[i]..row_start[i+1]` are row i's entries; length rows + 1.
    pub row_start: Vec<u32>,
    /// Column (local node) of each entry, ascending within a row.
    pub columns: Vec<u32>,
    diagonals: OnceLock<Vec<u32>>,
}

/// Where each element's 16 node pairs go: `[e][4 i + j]`, counted from the beginning of row i; `FAR` has to be looked
/// up.
pub type ElementPlaces = Vec<[u8; 16]>;

/// A place that a byte does not reach, in a row of more entries than any good mesh has.
pub const FAR: u8 = u8::MAX;

impl Pattern {
    /// Of these rows.
    pub fn new(row_start: Vec<u32>, columns: Vec<u32>) -> Self {
        Self { row_start, columns, diagonals: OnceLock::new() }
    }

    /// The node graph of these elements: rows for the first `n_rows` nodes; and the places that assembly uses.
    pub fn of_elements(tets: &[[u32; 4]], n_rows: usize) -> (Self, ElementPlaces) {
        let mut count = vec![0u32; n_rows + 1];
        for tet in tets {
            for &i in tet {
                if (i as usize) < n_rows {
                    count[i as usize + 1] += 4;
                }
            }
        }
        for i in 0..n_rows {
            count[i + 1] += count[i];
        }
        let mut raw = vec![0u32; count[n_rows] as usize];
        let mut next = count.clone();
        for tet in tets {
            for &i in tet {
                if (i as usize) < n_rows {
                    let at = next[i as usize] as usize;
                    raw[at..at + 4].copy_from_slice(tet);
                    next[i as usize] += 4;
                }
            }
        }
        let mut row_start = vec![0u32; n_rows + 1];
        let mut columns = Vec::new();
        for i in 0..n_rows {
            let row = &mut raw[count[i] as usize..count[i + 1] as usize];
            row.sort_unstable();
            let mut last = u32::MAX;
            for &j in row.iter() {
                if j != last {
                    columns.push(j);
                    last = j;
                }
            }
            row_start[i + 1] = columns.len() as u32;
        }
        columns.shrink_to_fit();
        let pattern = Self::new(row_start, columns);
        let place = |i: u32, j: u32| {
            if (i as usize) < n_rows {
                (pattern.entry(i, j) - pattern.row_start[i as usize]).min(u32::from(FAR)) as u8
            } else {
                0
            }
        };
        let places =
            tets.iter().map(|tet| std::array::from_fn(|p| place(tet[p / 4], tet[p % 4]))).collect();
        (pattern, places)
    }

    /// Rows.
    pub fn n_rows(&self) -> usize {
        self.row_start.len().saturating_sub(1)
    }

    /// Entries of row i.
    #[inline]
    pub fn row(&self, i: usize) -> Range<usize> {
        self.row_start[i] as usize..self.row_start[i + 1] as usize
    }

    /// Entries of row i left of the diagonal.
    #[inline]
    pub fn left(&self, i: usize) -> Range<usize> {
        self.row_start[i] as usize..self.diagonals()[i] as usize
    }

    /// Entries of row i right of the diagonal.
    #[inline]
    pub fn right(&self, i: usize) -> Range<usize> {
        self.diagonals()[i] as usize + 1..self.row_start[i + 1] as usize
    }

    /// Columns of row i.
    #[inline]
    pub fn columns_of(&self, i: usize) -> &[u32] {
        &self.columns[self.row(i)]
    }

    /// Position of entry (i, j), which must exist.
    pub fn entry(&self, i: u32, j: u32) -> u32 {
        let at = self.columns_of(i as usize).binary_search(&j).expect("entry of the node graph");
        self.row_start[i as usize] + at as u32
    }

    /// Positions of the diagonal entries, which must exist in every row.
    pub fn diagonals(&self) -> &[u32] {
        self.diagonals.get_or_init(|| (0..self.n_rows() as u32).map(|i| self.entry(i, i)).collect())
    }
}
