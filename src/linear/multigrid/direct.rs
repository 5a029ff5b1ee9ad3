//! The coarsest level: dense Cholesky, the same on every rank.

use crate::linear::block_csr::BlockCsr;
use faer::linalg::solvers::{Llt, SolveCore};
use faer::{Conj, Mat, Side};

/// Factors of a small symmetric matrix.
#[derive(Clone, Debug)]
pub struct Direct {
    factors: Llt<f64>,
    x: Mat<f64>,
}

impl Direct {
    /// Of a matrix that is at least positive semidefinite; `None` if it is not.
    pub fn new(a: &BlockCsr<1>) -> Option<Self> {
        faer::set_global_parallelism(faer::Par::Seq);
        let n = a.n_rows();
        let mut dense = Mat::<f64>::zeros(n, n);
        for i in 0..n {
            for (j, v) in a.entries(i) {
                dense[(i, j)] = v[0][0];
            }
            // Against rounding, where the pressure is held by a single node.
            dense[(i, i)] *= 1.0 + 1e-12;
        }
        let factors = dense.llt(Side::Lower).ok()?;
        Some(Self { factors, x: Mat::zeros(n, 1) })
    }

    /// A⁻¹ b.
    pub fn solve(&mut self, b: &[f64]) -> &[f64] {
        let x = self.x.col_as_slice_mut(0);
        x.copy_from_slice(b);
        self.factors.solve_in_place_with_conj(Conj::No, self.x.as_mut());
        self.x.col_as_slice(0)
    }
}
