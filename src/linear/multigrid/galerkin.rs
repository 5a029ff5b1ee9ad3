//! The coarse matrix of unsmoothed aggregation: a_IJ = Σ a_ij over i in I, j in J.

use crate::linear::block_csr::BlockCsr;
use crate::linear::distributed::NONE;
use crate::linear::pattern::Pattern;
use std::sync::Arc;

/// Rows are read from memory so many rows before they are summed.
const AHEAD: usize = 6;

/// Rows of this rank's `n_rows` aggregates. Row I is column `first + I`; columns are the values of
/// `coarse_of`, below `n_columns`.
pub fn coarse_matrix(
    a: &BlockCsr<1>,
    coarse_of: &[u32],
    n_rows: usize,
    first: u32,
    n_columns: usize,
) -> BlockCsr<1> {
    // Members of each aggregate, ascending.
    let own = |i: usize| (coarse_of[i] != NONE).then(|| (coarse_of[i] - first) as usize);
    let mut start = vec![0u32; n_rows + 1];
    for i in 0..a.n_rows() {
        if let Some(I) = own(i) {
            start[I + 1] += 1;
        }
    }
    for I in 0..n_rows {
        start[I + 1] += start[I];
    }
    let mut next = start.clone();
    let mut members = vec![0u32; start[n_rows] as usize];
    for i in 0..a.n_rows() {
        if let Some(I) = own(i) {
            members[next[I] as usize] = i as u32;
            next[I] += 1;
        }
    }

    let mut row_start = Vec::with_capacity(n_rows + 1);
    let mut columns = Vec::with_capacity(n_rows * 16);
    let mut values = Vec::with_capacity(n_rows * 16);
    row_start.push(0);
    // Entries of a row in the order in which they are met: sums; columns, and where their sums are, to be sorted.
    let mut sums: Vec<f64> = Vec::with_capacity(256);
    let mut met: Vec<u64> = Vec::with_capacity(256);
    let mut place = vec![NONE; n_columns];
    for I in 0..n_rows {
        for m in start[I] as usize..start[I + 1] as usize {
            if let Some(&soon) = members.get(m + AHEAD) {
                a.fetch_row(soon as usize);
            }
            for (j, v) in a.entries(members[m] as usize) {
                let J = coarse_of[j];
                if J == NONE {
                    continue;
                }
                let at = &mut place[J as usize];
                if *at == NONE {
                    *at = sums.len() as u32;
                    met.push(u64::from(J) << 32 | u64::from(*at));
                    sums.push(v[0][0]);
                } else {
                    sums[*at as usize] += v[0][0];
                }
            }
        }
        met.sort_unstable();
        for entry in met.drain(..) {
            let (J, at) = ((entry >> 32) as u32, entry as u32);
            place[J as usize] = NONE;
            columns.push(J);
            values.push([[sums[at as usize]]]);
        }
        sums.clear();
        row_start.push(columns.len() as u32);
    }
    BlockCsr { pattern: Arc::new(Pattern::new(row_start, columns)), values }
}
