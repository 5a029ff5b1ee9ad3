//! Block upper Schur preconditioner of the coupled system `[A G; D C] (u, p)`:
//! `p = S⁻¹ r_p` by one multigrid cycle, then `u = A⁻¹ (r_u − G p)` by block Gauss-Seidel.
//!
//! `S = C − D A⁻¹ G ≈ L = ∫ ((Δt_eff + τ)/ρ) ∇q·∇p`, `1/Δt_eff = 1/Δt + 2θ|u|/h` (Elman, Silvester
//! & Wathen 2014, ch. 9, in the algebraic pressure-projection form). One application is one
//! projection step. Velocity gets one forward and one backward half sweep of 3×3 blocks within the
//! rank; ghosts are exchanged between them. Where viscosity rules, that is not enough: see `viscous`.
//!
//! Everything is stored in f32, split so that each half sweep streams what it needs: the forward one
//! `[A G]` left of the diagonal and `G` right of it, the backward one `A` right of the diagonal.

#![allow(non_snake_case)]

use super::block_csr::{BlockCsr, Value};
use super::distributed::Halo;
use super::multigrid::Multigrid;
use super::operator::Preconditioner;
use super::pattern::Pattern;
use super::viscous::{ViscousCorrection, ViscousOperators};
use std::sync::Arc;

/// The preconditioner; unknowns of a node are (u, v, w, p).
///
/// Blocks are columns of three values one after another. A column is read as a vector of four, whose
/// last lane means nothing; hence one value more at the end of each list.
#[derive(Clone, Debug)]
pub struct SchurPreconditioner {
    halo: Halo,
    multigrid: Multigrid,
    pattern: Arc<Pattern>,
    left: Triangle,
    right: Triangle,
    /// `[A_ij G_ij]` left of the diagonal.
    left_blocks: Vec<f32>,
    /// `G_ij` right of the diagonal.
    right_gradients: Vec<f32>,
    /// `A_ij` right of the diagonal.
    right_blocks: Vec<f32>,
    nodes: Vec<Own>,
    z: Vec<[f32; 4]>,
    viscous: Option<ViscousCorrection>,
    /// Changes of the backward half sweep, and what they leave of the right-hand side.
    change: Vec<[f32; 4]>,
    left_over: Vec<[f32; 4]>,
}

/// What a row has on its diagonal.
#[derive(Clone, Copy, Debug)]
struct Own {
    /// Columns of A_ii⁻¹, each with a fourth entry 0.
    inverse: [[f32; 4]; 3],
    /// G_ii
    gradient: [f32; 4],
}

/// Entries of all rows on one side of the diagonal.
#[derive(Clone, Debug, Default)]
struct Triangle {
    start: Vec<u32>,
    columns: Vec<u32>,
}

impl Triangle {
    #[inline]
    fn row(&self, i: usize) -> std::ops::Range<usize> {
        self.start[i] as usize..self.start[i + 1] as usize
    }
}

impl SchurPreconditioner {
    /// For matrices of the pattern that `halo` was made for. `setup` comes before use.
    pub fn new(halo: &Halo) -> Self {
        Self {
            halo: halo.clone(),
            multigrid: Multigrid::new(halo),
            pattern: Default::default(),
            left: Triangle::default(),
            right: Triangle::default(),
            left_blocks: Vec::new(),
            right_gradients: Vec::new(),
            right_blocks: Vec::new(),
            nodes: Vec::new(),
            z: vec![[0.0; 4]; halo.n_local()],
            viscous: None,
            change: Vec::new(),
            left_over: Vec::new(),
        }
    }

    /// Takes this step's system `a` and pressure operator `l`, of the same pattern. Diagonal blocks
    /// of A are regular; a node with constrained velocity or pressure has identity-like rows and
    /// columns, in `l` too. `viscous` if viscosity rules, on all ranks or on none. Nothing is kept
    /// from earlier calls but memory.
    pub fn setup(
        &mut self,
        a: &BlockCsr<4, impl Value>,
        l: &BlockCsr<1>,
        viscous: Option<&ViscousOperators>,
    ) {
        self.multigrid.setup(l);
        self.viscous = viscous.map(|operators| {
            let mut correction = ViscousCorrection::new(&self.halo);
            correction.setup(operators);
            correction
        });
        if !Arc::ptr_eq(&self.pattern, &a.pattern) {
            self.pattern = a.pattern.clone();
            let side = |is_in: fn(usize, usize) -> bool| {
                let mut side = Triangle { start: vec![0], columns: Vec::new() };
                for i in 0..a.n_rows() {
                    let row = a.pattern.columns_of(i).iter().filter(|&&j| is_in(j as usize, i));
                    side.columns.extend(row);
                    side.start.push(side.columns.len() as u32);
                }
                side
            };
            (self.left, self.right) = (side(|j, i| j < i), side(|j, i| j > i));
        }
        for list in [&mut self.left_blocks, &mut self.right_gradients, &mut self.right_blocks] {
            list.clear();
        }
        self.nodes.clear();
        for i in 0..a.n_rows() {
            let row = &a.values[a.row(i)];
            let n_left = self.left.row(i).len();
            for v in &row[..n_left] {
                let block: [f32; 12] = std::array::from_fn(|k| v[k % 3][k / 3].into() as f32);
                self.left_blocks.extend_from_slice(&block);
            }
            let own = row[n_left].map(|row| row.map(Into::into));
            let gradient = [own[0][3], own[1][3], own[2][3], 0.0].map(|g| g as f32);
            self.nodes.push(Own { inverse: inverse(&own), gradient });
            for v in &row[n_left + 1..] {
                let block: [f32; 9] = std::array::from_fn(|k| v[k % 3][k / 3].into() as f32);
                self.right_blocks.extend_from_slice(&block);
                self.right_gradients.extend_from_slice(&[0, 1, 2].map(|r| v[r][3].into() as f32));
            }
        }
        for list in [&mut self.left_blocks, &mut self.right_gradients, &mut self.right_blocks] {
            list.push(0.0);
        }
    }

    /// The multigrid of the pressure operator.
    pub fn multigrid(&self) -> &Multigrid {
        &self.multigrid
    }

    /// u_i = A_ii⁻¹ (r − G p − Σ A_ij u_j over columns before i), from the first row to the last.
    fn forward(&mut self, r: &[[f64; 4]]) {
        for (i, own) in self.nodes.iter().enumerate() {
            let mut sum = [[0.0; 4]; 4];
            for e in self.right.row(i) {
                let x = &self.z[self.right.columns[e] as usize];
                add_columns(&mut sum[3..], &self.right_gradients[3 * e..], &x[3..]);
            }
            // The row above, computed last, comes last: sums of several rows overlap.
            for e in self.left.row(i) {
                let x = &self.z[self.left.columns[e] as usize];
                add_columns(&mut sum, &self.left_blocks[12 * e..], x);
            }
            let p = self.z[i][3];
            let left: [f32; 4] = std::array::from_fn(|a| {
                let sum = (sum[0][a] + sum[1][a]) + (sum[2][a] + sum[3][a]);
                (r[i][a] as f32 - own.gradient[a] * p) - sum
            });
            self.z[i] = add_product([0.0, 0.0, 0.0, p], own, left);
        }
    }

    /// The same system from the last row to the first. Row i holds for the columns before it; the
    /// later ones, and the ghosts, have changed from zero.
    fn backward(&mut self) {
        for (i, own) in self.nodes.iter().enumerate().rev() {
            let mut sum = [[0.0; 4]; 3];
            for e in self.right.row(i).rev() {
                let x = &self.z[self.right.columns[e] as usize];
                add_columns(&mut sum, &self.right_blocks[9 * e..], &x[..3]);
            }
            let change = std::array::from_fn(|a| -((sum[0][a] + sum[1][a]) + sum[2][a]));
            self.z[i] = add_product(self.z[i], own, change);
        }
    }
}

impl SchurPreconditioner {
    /// What is left of the momentum rows after the backward half sweep, when each row held with the
    /// columns before it and the ghosts as they were then. Ghosts of `change` are valid.
    fn find_left_over(&mut self) {
        let n = self.nodes.len();
        self.left_over.resize(n, [0.0; 4]);
        for (i, left_over) in self.left_over.iter_mut().enumerate() {
            let mut sum = [[0.0; 4]; 4];
            for e in self.left.row(i) {
                let x = &self.change[self.left.columns[e] as usize];
                add_columns(&mut sum, &self.left_blocks[12 * e..], x);
            }
            for e in self.right.row(i).filter(|&e| self.right.columns[e] as usize >= n) {
                let x = &self.change[self.right.columns[e] as usize];
                add_columns(&mut sum[..3], &self.right_blocks[9 * e..], &x[..3]);
            }
            *left_over = std::array::from_fn(|a| -((sum[0][a] + sum[1][a]) + sum[2][a]));
        }
    }

    fn correct_viscous(&mut self) {
        for (change, z) in self.change.iter_mut().zip(&self.z) {
            *change = std::array::from_fn(|a| z[a] - change[a]);
        }
        self.halo.update_ghosts(&mut self.change);
        self.find_left_over();
        if let Some(viscous) = &mut self.viscous {
            viscous.add_velocity(&self.left_over, &mut self.z);
        }
    }
}

impl Preconditioner for SchurPreconditioner {
    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        let (r, _) = r.as_chunks::<4>();
        for (b, r) in self.multigrid.right_hand_side().iter_mut().zip(r) {
            *b = r[3] as f32;
        }
        for (z, p) in self.z.iter_mut().zip(self.multigrid.cycle()) {
            *z = [0.0, 0.0, 0.0, *p];
        }
        if let Some(viscous) = &self.viscous {
            viscous.add_pressure(r, &mut self.z);
        }
        self.halo.update_ghosts(&mut self.z);
        self.forward(r);
        self.halo.update_ghosts(&mut self.z);
        if self.viscous.is_some() {
            self.change.clone_from(&self.z);
        }
        self.backward();
        if self.viscous.is_some() {
            self.correct_viscous();
        }
        for (z, x) in z.iter_mut().zip(self.z.as_flattened()) {
            *z = f64::from(*x);
        }
    }
}

/// sum_c += column c of the block · x_c, with a value more after the block.
#[inline]
fn add_columns(sum: &mut [[f32; 4]], block: &[f32], x: &[f32]) {
    for (c, (sum, x)) in sum.iter_mut().zip(x).enumerate() {
        for r in 0..4 {
            sum[r] += block[3 * c + r] * x;
        }
    }
}

/// z + A_ii⁻¹ x, all four lanes at once: z is read next as one vector.
#[inline]
fn add_product(z: [f32; 4], own: &Own, x: [f32; 4]) -> [f32; 4] {
    let m = &own.inverse;
    std::array::from_fn(|r| (z[r] + m[0][r] * x[0]) + (m[1][r] * x[1] + m[2][r] * x[2]))
}

/// Columns of the inverse of the velocity part of a node's block.
fn inverse(block: &[[f64; 4]; 4]) -> [[f32; 4]; 3] {
    let m = |r: usize, c: usize| block[r % 3][c % 3];
    let cofactor =
        |r: usize, c: usize| m(r + 1, c + 1) * m(r + 2, c + 2) - m(r + 1, c + 2) * m(r + 2, c + 1);
    let det = m(0, 0) * cofactor(0, 0) + m(0, 1) * cofactor(0, 1) + m(0, 2) * cofactor(0, 2);
    std::array::from_fn(|c| {
        let entry = |r: usize| (cofactor(c, r) / det) as f32;
        [entry(0), entry(1), entry(2), 0.0]
    })
}

/// Weights of the inner product in which residuals are measured, for each owned unknown: 1/a_ii of
/// the momentum rows and 1/l_ii of the continuity row. Residuals squared are then energies, whatever
/// the densities; a mass defect and a momentum defect count alike.
pub fn residual_weights(a: &BlockCsr<4, impl Value>, l: &BlockCsr<1>, weights: &mut Vec<f64>) {
    weights.clear();
    for i in 0..a.n_rows() {
        let (block, l) = (a.diagonal(i), l.diagonal(i)[0][0]);
        weights.extend(
            [block[0][0].into(), block[1][1].into(), block[2][2].into(), l].map(|d| 1.0 / d),
        );
    }
}
