//! One-level preconditioners for scalar equations: z = D⁻¹ r, and symmetric Gauss-Seidel
//! z = (D + U)⁻¹ D (D + L)⁻¹ r with the triangles of this rank's own rows and columns.

use super::block_csr::BlockCsr;
use super::operator::Preconditioner;
use super::pattern::Pattern;
use std::sync::Arc;

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
    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        for ((z, r), d) in z.iter_mut().zip(r).zip(&self.inverse) {
            *z = r * d;
        }
    }
}

/// Symmetric Gauss-Seidel on this rank's diagonal block; the matrix need not be symmetric.
#[derive(Clone, Debug, Default)]
pub struct SymmetricGaussSeidel {
    pattern: Arc<Pattern>,
    values: Vec<f32>,
    inverse: Vec<f64>,
}

impl SymmetricGaussSeidel {
    /// Copies this matrix, whose diagonal entries are not zero.
    pub fn setup(&mut self, a: &BlockCsr<1>) {
        self.pattern = a.pattern.clone();
        self.values.clear();
        self.values.extend(a.values.iter().map(|v| v[0][0] as f32));
        self.inverse.clear();
        self.inverse.extend((0..a.n_rows()).map(|i| 1.0 / a.diagonal(i)[0][0]));
    }
}

impl Preconditioner for SymmetricGaussSeidel {
    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        let (n, columns) = (self.pattern.n_rows(), &self.pattern.columns);
        for i in 0..n {
            let left = self.pattern.left(i);
            let mut sum = r[i];
            for (a, &j) in self.values[left.clone()].iter().zip(&columns[left]) {
                sum -= f64::from(*a) * z[j as usize];
            }
            z[i] = sum * self.inverse[i];
        }
        for i in (0..n).rev() {
            let right = self.pattern.right(i);
            let mut sum = 0.0;
            for (a, &j) in self.values[right.clone()].iter().zip(&columns[right]) {
                if (j as usize) < n {
                    sum += f64::from(*a) * z[j as usize];
                }
            }
            z[i] -= sum * self.inverse[i];
        }
    }
}
