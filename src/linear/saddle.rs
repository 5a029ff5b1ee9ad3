//! The matrix of a saddle-point system in (u, p), blocks `[A G; D C]`, in single precision.
//!
//! Stored once, and split so that each that goes over it streams what it needs: the product all, the forward half
//! sweep of `schur` `[A G]` left of the diagonal and `G` right of it, the backward one `A` right of the diagonal.

#![allow(non_snake_case)]

use super::block_csr::{BlockCsr, Rows, Value, fetch};
use super::pattern::Pattern;
use std::cmp::Ordering;
use std::hint::black_box;
use std::ops::Range;
use std::sync::Arc;

/// Row-compressed; unknowns of a node are (u, v, w, p).
///
/// Blocks are rows. Where rows have three values, they are read as vectors of four, whose last lane means nothing; hence
/// one value more at the end of these lists.
#[derive(Clone, Debug)]
pub struct SaddleCsr {
    /// Its entries: rows are owned nodes, columns are local nodes.
    pub pattern: Arc<Pattern>,
    /// Where each row's entries left of the diagonal begin among all such.
    left_start: Vec<u32>,
    /// `[A_ij G_ij]` left of the diagonal.
    left: Vec<[[f32; 4]; 3]>,
    /// `A_ij` right of the diagonal.
    right_velocity: Vec<f32>,
    /// `G_ij` right of the diagonal.
    right_gradient: Vec<f32>,
    /// `[A_ii G_ii]`
    own: Vec<[[f32; 4]; 3]>,
    /// `[D_ij C_ij]` of all entries.
    continuity: Vec<[f32; 4]>,
}

impl SaddleCsr {
    /// Zero matrix. Every row has a diagonal entry.
    pub fn zero(pattern: &Arc<Pattern>) -> Self {
        let n = pattern.n_rows();
        let mut count = 0;
        let left_start = (0..n)
            .map(|i| {
                let start = count;
                count += pattern.left(i).len();
                start as u32
            })
            .collect();
        let (n_left, n_right) = (count, pattern.columns.len() - n - count);
        Self {
            pattern: pattern.clone(),
            left_start,
            left: vec![[[0.0; 4]; 3]; n_left],
            right_velocity: vec![0.0; 9 * n_right + 1],
            right_gradient: vec![0.0; 3 * n_right + 1],
            own: vec![[[0.0; 4]; 3]; n],
            continuity: vec![[0.0; 4]; pattern.columns.len()],
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

    /// All values zero.
    pub fn clear(&mut self) {
        self.left.fill([[0.0; 4]; 3]);
        self.right_velocity.fill(0.0);
        self.right_gradient.fill(0.0);
        self.own.fill([[0.0; 4]; 3]);
        self.continuity.fill([0.0; 4]);
    }

    /// Blocks `[A G]` and columns of the entries of row `i` left of the diagonal.
    #[inline(always)]
    pub(super) fn left(&self, i: usize) -> impl ExactSizeIterator<Item = (&[[f32; 4]; 3], usize)> {
        let columns = &self.pattern.columns[self.pattern.left(i)];
        let at = self.left_start[i] as usize;
        self.left[at..at + columns.len()].iter().zip(columns.iter().map(|&j| j as usize))
    }

    /// Where the entries right of the diagonal begin among all such, and their columns.
    #[inline]
    pub(super) fn right(&self, i: usize) -> (usize, &[u32]) {
        (self.right_start(i), &self.pattern.columns[self.pattern.right(i)])
    }

    #[inline]
    fn right_start(&self, i: usize) -> usize {
        self.pattern.row_start[i] as usize - i - self.left_start[i] as usize
    }

    /// `A`, and what follows it, of an entry right of the diagonal.
    #[inline]
    pub(super) fn right_block(&self, at: usize) -> &[f32; 10] {
        self.right_velocity[9 * at..].first_chunk().expect("a value follows the last block")
    }

    /// `G`, and what follows it, of an entry right of the diagonal.
    #[inline]
    pub(super) fn right_column(&self, at: usize) -> &[f32; 4] {
        self.right_gradient[3 * at..].first_chunk().expect("a value follows the last column")
    }

    /// `[A G]` of the diagonal entry of row i.
    #[inline]
    pub(super) fn own(&self, i: usize) -> &[[f32; 4]; 3] {
        &self.own[i]
    }

    /// Where entries of row `i` are.
    #[inline]
    fn places(&self, i: usize) -> impl Fn(usize) -> Place + use<> {
        let own = self.pattern.diagonals()[i] as usize;
        let start = self.pattern.row_start[i] as usize;
        let (left, right) = (self.left_start[i] as usize, self.right_start(i));
        move |e| match e.cmp(&own) {
            Ordering::Less => Place::Left(left + e - start),
            Ordering::Equal => Place::Own,
            Ordering::Greater => Place::Right(right + e - own - 1),
        }
    }

    /// Asks for the memory of these entries of row `i`, which `add` will want.
    #[inline]
    pub fn fetch(&self, i: usize, entries: [usize; 4]) {
        let place = self.places(i);
        for e in entries {
            match place(e) {
                Place::Left(at) => fetch(&self.left[at]),
                Place::Own => fetch(&self.own[i]),
                Place::Right(at) => {
                    fetch(&self.right_velocity[9 * at]);
                    fetch(&self.right_gradient[3 * at]);
                }
            }
            fetch(&self.continuity[e]);
        }
    }

    /// Adds to the blocks of `entries` of row `i`.
    #[inline]
    pub fn add<const N: usize>(
        &mut self,
        i: usize,
        entries: [usize; N],
        blocks: &[[[f32; 4]; 4]; N],
    ) {
        let add = |row: &mut [f32; 4], add: &[f32; 4]| {
            for c in 0..4 {
                row[c] += add[c];
            }
        };
        let place = self.places(i);
        for (e, block) in entries.into_iter().zip(blocks) {
            match place(e) {
                Place::Left(at) => {
                    self.left[at].iter_mut().zip(block).for_each(|(r, b)| add(r, b));
                }
                Place::Own => self.own[i].iter_mut().zip(block).for_each(|(r, b)| add(r, b)),
                Place::Right(at) => {
                    let A = self.right_velocity[9 * at..].first_chunk_mut::<10>();
                    let A = A.expect("a value follows the last block");
                    // Rows of four overlap: all are read before the first is written.
                    let rows: [[f32; 4]; 3] = std::array::from_fn(|r| {
                        let add = [block[r][0], block[r][1], block[r][2], 0.0];
                        std::array::from_fn(|c| A[3 * r + c] + add[c])
                    });
                    for (r, row) in rows.iter().enumerate() {
                        A[3 * r..3 * r + 4].copy_from_slice(row);
                    }
                    let G = self.right_gradient[3 * at..].first_chunk_mut::<4>();
                    let G = G.expect("a value follows the last column");
                    (0..3).for_each(|r| G[r] += block[r][3]);
                }
            }
            add(&mut self.continuity[e], &block[3]);
        }
    }

    /// The same for each velocity component by itself.
    pub fn add_velocity(&mut self, i: usize, e: usize, value: f64) {
        let mut block = [[0.0; 4]; 4];
        (0..3).for_each(|k| block[k][k] = value as f32);
        self.add(i, [e], &[block]);
    }

    /// The block of entry `e`, in row `i`.
    pub fn block(&self, i: usize, e: usize) -> [[f64; 4]; 4] {
        let [x, y, z] = match self.places(i)(e) {
            Place::Left(at) => self.left[at],
            Place::Own => self.own[i],
            Place::Right(at) => {
                let (A, G) = (self.right_block(at), self.right_column(at));
                std::array::from_fn(|r| [A[3 * r], A[3 * r + 1], A[3 * r + 2], G[r]])
            }
        };
        [x, y, z, self.continuity[e]].map(|row| row.map(f64::from))
    }

    /// Sets the block of entry `e`, in row `i`.
    pub fn set(&mut self, i: usize, e: usize, block: &[[f64; 4]; 4]) {
        match self.places(i)(e) {
            Place::Left(at) => self.left[at] = Default::default(),
            Place::Own => self.own[i] = Default::default(),
            Place::Right(at) => {
                self.right_velocity[9 * at..9 * at + 9].fill(0.0);
                self.right_gradient[3 * at..3 * at + 3].fill(0.0);
            }
        }
        self.continuity[e] = [0.0; 4];
        self.add(i, [e], &[block.map(|row| row.map(|value| value as f32))]);
    }

    /// The diagonal of row i.
    pub fn diagonal(&self, i: usize) -> [f64; 4] {
        let [x, y, z] = &self.own[i];
        let last = self.continuity[self.pattern.diagonals()[i] as usize][3];
        [x[0], y[1], z[2], last].map(f64::from)
    }
}

/// Where a block is.
enum Place {
    Left(usize),
    Own,
    Right(usize),
}

/// sum += row · x, lane by lane.
#[inline]
fn add(sum: &mut [f64; 4], row: &[f32; 4], x: &[f64; 4]) {
    for c in 0..4 {
        sum[c] += f64::from(row[c]) * x[c];
    }
}

impl Rows<4> for SaddleCsr {
    #[inline]
    fn multiply_row<X: Value>(&self, i: usize, x: &[[X; 4]]) -> [f64; 4] {
        let x = |j: usize| x[j].map(Into::into);
        let (mut sum, mut gradient) = ([[0.0; 4]; 4], [0.0; 4]);
        let (continuity, left) = (&self.continuity[self.row(i)], self.left(i));
        let (before, rest) = continuity.split_at(left.len());
        for ((block, j), last) in left.zip(before) {
            let x = x(j);
            (0..3).for_each(|r| add(&mut sum[r], &block[r], &x));
            add(&mut sum[3], last, &x);
        }
        let xi = x(i);
        (0..3).for_each(|r| add(&mut sum[r], &self.own[i][r], &xi));
        add(&mut sum[3], &rest[0], &xi);
        let (at, columns) = self.right(i);
        for ((at, &j), last) in (at..).zip(columns).zip(&rest[1..]) {
            let (x, A, G) = (x(j as usize), self.right_block(at), self.right_column(at));
            let velocity = [x[0], x[1], x[2], 0.0];
            for r in 0..3 {
                add(&mut sum[r], A[3 * r..].first_chunk().expect("one value follows"), &velocity);
            }
            add(&mut gradient, G, &[x[3]; 4]);
            add(&mut sum[3], last, &x);
        }
        // Seen through, sums across lanes make the compiler turn every block that it reads.
        let (mut sum, gradient) = black_box((sum, gradient));
        (0..3).for_each(|r| sum[r][3] += gradient[r]);
        sum.map(|[a, b, c, d]| (a + b) + (c + d))
    }
}

impl<T: Value> From<&BlockCsr<4, T>> for SaddleCsr {
    fn from(a: &BlockCsr<4, T>) -> Self {
        let mut matrix = Self::zero(&a.pattern);
        for i in 0..a.n_rows() {
            for e in a.row(i) {
                matrix.set(i, e, &a.values[e].map(|row| row.map(Into::into)));
            }
        }
        matrix
    }
}

/// Weights of the inner product in which residuals are measured, for each owned unknown: 1/a_ii of
/// the momentum rows and 1/l_ii of the continuity row. Residuals squared are then energies, whatever
/// the densities; a mass defect and a momentum defect count alike.
pub fn residual_weights(a: &SaddleCsr, l: &BlockCsr<1>, weights: &mut Vec<f64>) {
    weights.clear();
    for i in 0..a.n_rows() {
        let [x, y, z, _] = a.diagonal(i);
        weights.extend([x, y, z, l.diagonal(i)[0][0]].map(|d| 1.0 / d));
    }
}
