//! One-level preconditioners for scalar equations: z = D⁻¹ r, and symmetric Gauss-Seidel
//! z = (D + U)⁻¹ D (D + L)⁻¹ r with the triangles of this rank's own rows and columns.

use super::block_csr::BlockCsr;
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
        self.inverse.extend((0..a.n_rows()).map(|i| 1.0 / a.values[a.diagonal(i)][0][0]));
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
    row_start: Vec<u32>,
    diagonal: Vec<u32>,
    columns: Vec<u32>,
    values: Vec<f32>,
    inverse: Vec<f64>,
}

impl SymmetricGaussSeidel {
    /// Copies this matrix, whose diagonal entries are not zero.
    pub fn setup(&mut self, a: &BlockCsr<1>) {
        if self.row_start != a.row_start || self.columns != a.columns {
            self.row_start.clone_from(&a.row_start);
            self.columns.clone_from(&a.columns);
            self.diagonal = (0..a.n_rows()).map(|i| a.diagonal(i) as u32).collect();
        }
        self.values.clear();
        self.values.extend(a.values.iter().map(|v| v[0][0] as f32));
        self.inverse.clear();
        self.inverse.extend(self.diagonal.iter().map(|&d| 1.0 / a.values[d as usize][0][0]));
    }
}

impl Preconditioner for SymmetricGaussSeidel {
    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        let n = self.diagonal.len();
        for i in 0..n {
            let lower = self.row_start[i] as usize..self.diagonal[i] as usize;
            let mut sum = r[i];
            for (a, &j) in self.values[lower.clone()].iter().zip(&self.columns[lower]) {
                sum -= f64::from(*a) * z[j as usize];
            }
            z[i] = sum * self.inverse[i];
        }
        for i in (0..n).rev() {
            let upper = self.diagonal[i] as usize + 1..self.row_start[i + 1] as usize;
            let mut sum = 0.0;
            for (a, &j) in self.values[upper.clone()].iter().zip(&self.columns[upper]) {
                if (j as usize) < n {
                    sum += f64::from(*a) * z[j as usize];
                }
            }
            z[i] -= sum * self.inverse[i];
        }
    }
}
