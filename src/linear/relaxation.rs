//! One-level preconditioners for scalar equations: z = D⁻¹ r, and symmetric Gauss-Seidel
//! z = (D + U)⁻¹ D (D + L)⁻¹ r with the triangles of this rank's own rows and columns.

use super::block_csr::{BlockCsr, Value};
use super::operator::Preconditioner;

/// z = D⁻¹ r.
#[derive(Clone, Debug, Default)]
pub struct Jacobi {
    inverse: Vec<f64>,
}

impl Jacobi {
    /// Of this matrix, whose diagonal entries are not zero.
    pub fn setup(&mut self, a: &BlockCsr<1>) {
        self.inverse.clear();
        self.inverse.extend((0..a.n_rows()).map(|i| 1.0 / a.diagonal(i)[0][0]));
    }
}

impl Preconditioner for Jacobi {
    fn apply(&mut self, r: &[f32], z: &mut [f32]) {
        for ((z, r), d) in z.iter_mut().zip(r).zip(&self.inverse) {
            *z = (f64::from(*r) * d) as f32;
        }
    }
}

/// Symmetric Gauss-Seidel on this rank's diagonal block; the matrix need not be symmetric.
#[derive(Clone, Debug, Default)]
pub struct SymmetricGaussSeidel {
    inverse: Vec<f32>,
}

impl SymmetricGaussSeidel {
    /// Of this matrix, whose diagonal entries are not zero.
    pub fn setup(&mut self, a: &BlockCsr<1, impl Value>) {
        self.inverse.clear();
        let inverse = |i| (1.0 / a.diagonal(i)[0][0].into()) as f32;
        self.inverse.extend((0..a.n_rows()).map(inverse));
    }

    /// With the matrix of the last `setup`.
    pub fn with<'a, T>(&'a self, matrix: &'a BlockCsr<1, T>) -> Sweeps<'a, T> {
        Sweeps { matrix, inverse: &self.inverse }
    }
}

/// Its sweeps over a matrix.
#[derive(Clone, Copy, Debug)]
pub struct Sweeps<'a, T> {
    matrix: &'a BlockCsr<1, T>,
    inverse: &'a [f32],
}

/// What is smaller counts as zero: a sweep spreads ever smaller numbers, and arithmetic with those that are too small
/// for an exponent is slow.
const LEAST: f64 = 1e-30;

#[inline]
fn rounded(z: f64) -> f32 {
    if z.abs() < LEAST { 0.0 } else { z as f32 }
}

impl<T: Value> Preconditioner for Sweeps<'_, T> {
    fn apply(&mut self, r: &[f32], z: &mut [f32]) {
        let (n, pattern) = (self.matrix.n_rows(), &self.matrix.pattern);
        let row = |entries: std::ops::Range<usize>| {
            pattern.columns[entries.clone()].iter().zip(&self.matrix.values[entries])
        };
        for i in 0..n {
            let mut sum = f64::from(r[i]);
            for (&j, a) in row(pattern.left(i)) {
                sum -= a[0][0].into() * f64::from(z[j as usize]);
            }
            z[i] = rounded(sum * f64::from(self.inverse[i]));
        }
        for i in (0..n).rev() {
            let mut sum = 0.0;
            for (&j, a) in row(pattern.right(i)) {
                if (j as usize) < n {
                    sum += a[0][0].into() * f64::from(z[j as usize]);
                }
            }
            z[i] = rounded(f64::from(z[i]) - sum * f64::from(self.inverse[i]));
        }
    }
}
