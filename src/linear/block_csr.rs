//! Compressed rows of small dense blocks.

use super::distributed::Item;
use super::pattern::Pattern;
use std::ops::Range;
use std::sync::Arc;

/// What values are stored as; sums are of doubles.
pub trait Value: Copy + Default + Into<f64> + Item {}
impl Value for f64 {}
impl Value for f32 {}

/// A matrix whose rows are of B unknowns each.
pub trait Rows<const B: usize> {
    /// `Σ_j A_ij x_j`; `x` over local nodes.
    fn multiply_row<X: Value>(&self, i: usize, x: &[[X; B]]) -> [f64; B];

    /// `y[i] = Σ_j A_ij x_j` for the given rows; `y` at least over rows.
    #[inline]
    fn multiply_rows<X: Value>(&self, rows: Range<usize>, x: &[[X; B]], y: &mut [[f64; B]]) {
        for i in rows {
            y[i] = self.multiply_row(i, x);
        }
    }
}

/// Row-compressed matrix of B×B blocks (row-major inside a block).
#[derive(Clone, Debug)]
pub struct BlockCsr<const B: usize, T = f64> {
    /// Its entries: rows are owned nodes, columns are local nodes.
    pub pattern: Arc<Pattern>,
    /// The blocks: `values[entry][r][c]`.
    pub values: Vec<[[T; B]; B]>,
}

impl<const B: usize, T: Value> BlockCsr<B, T> {
    /// Zero matrix.
    pub fn zero(pattern: &Arc<Pattern>) -> Self {
        Self {
            pattern: pattern.clone(),
            values: vec![[[T::default(); B]; B]; pattern.columns.len()],
        }
    }

    /// Rows.
    pub fn n_rows(&self) -> usize {
        self.pattern.n_rows()
    }

    /// Entries of row i.
    #[inline]
    pub fn row(&self, i: usize) -> Range<usize> {
        self.pattern.row(i)
    }

    /// Columns and blocks of row i.
    #[inline]
    pub fn entries(&self, i: usize) -> impl Iterator<Item = (usize, &[[T; B]; B])> {
        let columns = self.pattern.columns_of(i).iter().map(|&j| j as usize);
        columns.zip(&self.values[self.row(i)])
    }

    /// Begins to read row i: who jumps about among rows would wait for each.
    #[inline]
    pub fn fetch_row(&self, i: usize) {
        let row = self.row(i);
        self.pattern.columns[row.clone()].iter().step_by(16).for_each(fetch);
        self.values[row].iter().step_by(8).for_each(fetch);
    }

    /// The diagonal block of row i.
    #[inline]
    pub fn diagonal(&self, i: usize) -> &[[T; B]; B] {
        &self.values[self.pattern.diagonals()[i] as usize]
    }

    /// All values zero.
    pub fn clear(&mut self) {
        self.values.fill([[T::default(); B]; B]);
    }
}

impl<const B: usize, T: Value> Rows<B> for BlockCsr<B, T> {
    /// Products are summed column by column of the block, so that they fill SIMD lanes.
    #[inline]
    fn multiply_row<X: Value>(&self, i: usize, x: &[[X; B]]) -> [f64; B] {
        let mut sum = [[0.0; B]; B];
        for (j, block) in self.entries(i) {
            let xj: [f64; B] = x[j].map(Into::into);
            for r in 0..B {
                for c in 0..B {
                    sum[r][c] += block[r][c].into() * xj[c];
                }
            }
        }
        sum.map(|lanes| lanes.iter().sum())
    }
}

/// Begins to read what will be wanted soon.
#[inline]
pub(super) fn fetch<T>(at: &T) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: a hint, of an address that can be read.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(std::ptr::from_ref(at).cast()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = at;
}
