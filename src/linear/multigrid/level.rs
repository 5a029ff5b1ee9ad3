//! One level: its matrix in f32, Gauss-Seidel sweeps within the rank, transfer to the next level.

use crate::linear::block_csr::BlockCsr;
use crate::linear::distributed::{Halo, NONE};
use crate::linear::pattern::Pattern;
use std::sync::Arc;

/// A level that is smoothed.
#[derive(Clone, Debug)]
pub struct Level {
    /// Its halo; of one rank if the level was gathered.
    pub halo: Halo,
    pattern: Arc<Pattern>,
    values: Vec<f32>,
    inverse: Vec<f32>,
    /// Index in the next level's vectors of each local node, or `NONE`.
    pub coarse_of: Vec<u32>,
    /// The next level is held whole by every rank.
    pub gathered: bool,
    /// Restricted residual, as long as the next level's vectors.
    pub restricted: Vec<f64>,
    /// Right-hand side.
    pub b: Vec<f32>,
    /// Result of a cycle.
    pub x: Vec<f32>,
    /// First direction of the K-cycle, then its result.
    pub e: Vec<f32>,
    /// A times the directions.
    pub v: [Vec<f32>; 2],
    /// Cycles begun since the matrix was set.
    pub visits: u64,
}

impl Level {
    /// A level without matrix.
    pub fn new(halo: Halo) -> Self {
        Self {
            pattern: Arc::default(),
            values: Vec::new(),
            inverse: Vec::new(),
            coarse_of: Vec::new(),
            gathered: false,
            restricted: Vec::new(),
            b: vec![0.0; halo.n_local()],
            x: vec![0.0; halo.n_local()],
            e: Vec::new(),
            v: Default::default(),
            visits: 0,
            halo,
        }
    }

    /// Copies the matrix.
    pub fn set_matrix(&mut self, a: &BlockCsr<1>) {
        self.visits = 0;
        self.pattern = a.pattern.clone();
        self.values.clear();
        self.values.extend(a.values.iter().map(|v| v[0][0] as f32));
        self.inverse.clear();
        self.inverse.extend((0..a.n_rows()).map(|i| {
            let d = a.diagonal(i)[0][0];
            if d > 0.0 { (1.0 / d) as f32 } else { 0.0 }
        }));
    }

    /// Vectors of the K-cycle.
    pub fn make_directions(&mut self) {
        let n = self.halo.n_local();
        self.e.resize(n, 0.0);
        for v in &mut self.v {
            v.resize(n, 0.0);
        }
    }

    #[inline]
    fn sum(&self, entries: std::ops::Range<usize>, x: &[f32]) -> f32 {
        let mut sum = 0.0;
        for (a, &j) in self.values[entries.clone()].iter().zip(&self.pattern.columns[entries]) {
            sum += a * x[j as usize];
        }
        sum
    }

    /// x = (D + L)⁻¹ b: one forward sweep from zero, ghosts taken as zero.
    pub fn forward_from_zero(&mut self) {
        self.visits += 1;
        let mut x = std::mem::take(&mut self.x);
        for i in 0..self.pattern.n_rows() {
            x[i] = (self.b[i] - self.sum(self.pattern.left(i), &x)) * self.inverse[i];
        }
        self.x = x;
    }

    /// The residual after `forward_from_zero`, summed over aggregates: what is left of row i is
    /// −Σ a_ij x_j over later and ghost columns. Ghosts of x are valid.
    pub fn restrict(&mut self) {
        self.restricted.fill(0.0);
        for i in 0..self.pattern.n_rows() {
            let coarse = self.coarse_of[i];
            if coarse != NONE {
                let left_over = self.sum(self.pattern.right(i), &self.x);
                self.restricted[coarse as usize] -= f64::from(left_over);
            }
        }
        if self.gathered {
            self.halo.sum_all(&mut self.restricted);
        }
    }

    /// x += the coarse correction, ghosts too.
    pub fn prolong<T: Copy + Into<f64>>(&mut self, correction: &[T]) {
        for (x, &coarse) in self.x.iter_mut().zip(&self.coarse_of) {
            if coarse != NONE {
                *x += correction[coarse as usize].into() as f32;
            }
        }
    }

    /// One backward sweep.
    pub fn backward(&mut self) {
        let mut x = std::mem::take(&mut self.x);
        for i in (0..self.pattern.n_rows()).rev() {
            x[i] += (self.b[i] - self.sum(self.pattern.row(i), &x)) * self.inverse[i];
        }
        self.x = x;
    }

    /// `v[k] = A x`, updating ghosts of x.
    pub fn multiply(&mut self, k: usize) {
        self.halo.update_ghosts(&mut self.x);
        let mut v = std::mem::take(&mut self.v[k]);
        for i in 0..self.pattern.n_rows() {
            v[i] = self.sum(self.pattern.row(i), &self.x);
        }
        self.v[k] = v;
    }
}
