//! Block upper Schur preconditioner of the coupled system `[A G; D C] (u, p)`:
//! `p = S⁻¹ r_p` by one multigrid cycle, then `u = A⁻¹ (r_u − G p)` by block Gauss-Seidel.
//!
//! `S = C − D A⁻¹ G ≈ L = ∫ ((Δt_eff + τ)/ρ) ∇q·∇p`, `1/Δt_eff = 1/Δt + 2θ|u|/h` (Elman, Silvester
//! & Wathen 2014, ch. 9, in the algebraic pressure-projection form). One application is one
//! projection step. Velocity gets one forward and one backward half sweep of 3×3 blocks within the
//! rank; ghosts are exchanged between them. With `A = D + L + U` within the rank and `H` across ranks that is
//! `(D+U)⁻¹ (D−H) (D+L)⁻¹`, positive unless H outweighs D: where a border of ranks cuts a ghost penalty it would,
//! and H is scaled down (compare Baker, Falgout, Kolev & Yang 2011). Where viscosity rules, one sweep is
//! not enough: see `viscous`.
//!
//! All in f32. The matrix is read where it is; it is stored as the half sweeps want it (`saddle`).

#![allow(non_snake_case)]

use super::block_csr::BlockCsr;
use super::distributed::Halo;
use super::multigrid::Multigrid;
use super::operator::Preconditioner;
use super::saddle::SaddleCsr;
use super::viscous::{ViscousCorrection, ViscousOperators};
use std::hint::black_box;

/// The preconditioner.
#[derive(Clone, Debug)]
pub struct SchurPreconditioner {
    halo: Halo,
    multigrid: Multigrid,
    /// Columns of A_ii⁻¹, each with a fourth entry 0.
    inverse: Vec<[[f32; 4]; 3]>,
    /// What each row's ghosts are multiplied by in the backward half sweep: 1 / max(1, Σ |tr A_ii⁻¹ A_ij| / 3).
    damping: Vec<f32>,
    viscous: Option<ViscousCorrection>,
    /// Changes of the backward half sweep, and what they leave of the right-hand side.
    change: Vec<[f32; 4]>,
    left_over: Vec<[f32; 4]>,
}

/// It, and the matrix it was set up with.
#[derive(Debug)]
pub struct Schur<'a> {
    parts: &'a mut SchurPreconditioner,
    matrix: &'a SaddleCsr,
}

impl SchurPreconditioner {
    /// For matrices of the pattern that `halo` was made for. `setup` comes before use.
    pub fn new(halo: &Halo) -> Self {
        Self {
            halo: halo.clone(),
            multigrid: Multigrid::new(halo),
            inverse: Vec::new(),
            damping: Vec::new(),
            viscous: None,
            change: Vec::new(),
            left_over: Vec::new(),
        }
    }

    /// Takes this step's system `a` and pressure operator `l`, of the same pattern. Diagonal blocks
    /// of A are regular; a node with constrained velocity or pressure has identity-like rows and
    /// columns, in `l` too. `viscous` if viscosity rules, on all ranks or on none. Nothing is kept
    /// from earlier calls but memory.
    pub fn setup(&mut self, a: &SaddleCsr, l: &BlockCsr<1>, viscous: Option<&ViscousOperators>) {
        self.multigrid.setup(l);
        self.viscous = viscous.map(|operators| {
            let mut correction = ViscousCorrection::new(&self.halo);
            correction.setup(operators);
            correction
        });
        self.inverse.clear();
        self.inverse.extend((0..a.n_rows()).map(|i| inverse(a.own(i))));
        self.damping.clear();
        let shares = self.inverse.iter().enumerate().map(|(i, inverse)| ghost_share(a, i, inverse));
        self.damping.extend(shares.map(|share| 1.0 / share.max(1.0)));
    }

    /// With the matrix of the last `setup`.
    pub fn with<'a>(&'a mut self, matrix: &'a SaddleCsr) -> Schur<'a> {
        Schur { parts: self, matrix }
    }

    /// The multigrid of the pressure operator.
    pub fn multigrid(&self) -> &Multigrid {
        &self.multigrid
    }

    /// u_i = A_ii⁻¹ (r − G p − Σ A_ij u_j over columns before i), from the first row to the last.
    fn forward(&self, a: &SaddleCsr, r: &[[f32; 4]], z: &mut [[f32; 4]]) {
        for (i, inverse) in self.inverse.iter().enumerate() {
            let (mut sum, mut known) = ([[0.0; 4]; 3], [0.0; 4]);
            let (at, columns) = a.right(i);
            for (at, &j) in (at..).zip(columns) {
                let (column, p) = (a.right_column(at), z[j as usize][3]);
                (0..4).for_each(|r| known[r] += column[r] * p);
            }
            // The row above, computed last, comes last: sums of several rows overlap.
            for (block, j) in a.left(i) {
                add_rows::<4>(&mut sum, block.as_flattened(), &z[j]);
            }
            let (own, p) = (a.own(i), z[i][3]);
            let sum = black_box(sum);
            let left = std::array::from_fn(|k| match k {
                3 => 0.0,
                _ => (r[i][k] - own[k][3] * p - known[k]) - total(&sum[k]),
            });
            z[i] = add_product([0.0, 0.0, 0.0, p], inverse, left);
        }
    }

    /// The same system from the last row to the first. Row i holds for the columns before it; the
    /// later ones, and the ghosts, have changed from zero.
    fn backward(&self, a: &SaddleCsr, z: &mut [[f32; 4]]) {
        for (i, inverse) in self.inverse.iter().enumerate().rev() {
            let mut sum = [[0.0; 4]; 3];
            let (at, columns) = a.right(i);
            let n_owned = columns.len() - ghosts(columns, self.inverse.len());
            let add = |sum: &mut [[f32; 4]; 3], k: usize| {
                let z = velocity(&z[columns[k] as usize]);
                add_rows::<3>(sum, a.right_block(at + k), &z);
            };
            (n_owned..columns.len()).rev().for_each(|k| add(&mut sum, k));
            if n_owned < columns.len() {
                sum.as_flattened_mut().iter_mut().for_each(|sum| *sum *= self.damping[i]);
            }
            (0..n_owned).rev().for_each(|k| add(&mut sum, k));
            z[i] = add_product(z[i], inverse, minus(sum));
        }
    }

    /// What is left of the momentum rows after the backward half sweep, when each row held with the
    /// columns before it and the ghosts as they were then (damped ones: nearly).
    /// Ghosts of `change` are valid.
    fn find_left_over(&mut self, a: &SaddleCsr) {
        let n = self.inverse.len();
        self.left_over.resize(n, [0.0; 4]);
        for (i, left_over) in self.left_over.iter_mut().enumerate() {
            let mut sum = [[0.0; 4]; 3];
            for (block, j) in a.left(i) {
                add_rows::<4>(&mut sum, block.as_flattened(), &velocity(&self.change[j]));
            }
            let (at, columns) = a.right(i);
            for (at, &j) in (at..).zip(columns).filter(|(_, j)| **j as usize >= n) {
                add_rows::<3>(&mut sum, a.right_block(at), &velocity(&self.change[j as usize]));
            }
            *left_over = minus(sum);
        }
    }

    fn correct_viscous(&mut self, a: &SaddleCsr, z: &mut [[f32; 4]]) {
        for (change, z) in self.change.iter_mut().zip(&*z) {
            *change = std::array::from_fn(|a| z[a] - change[a]);
        }
        self.halo.update_ghosts(&mut self.change);
        self.find_left_over(a);
        if let Some(viscous) = &mut self.viscous {
            viscous.add_velocity(&self.left_over, z);
        }
    }
}

impl Preconditioner for Schur<'_> {
    fn apply(&mut self, r: &[f32], z: &mut [f32]) {
        let (a, parts) = (self.matrix, &mut *self.parts);
        let ((r, _), (z, _)) = (r.as_chunks::<4>(), z.as_chunks_mut::<4>());
        for (b, r) in parts.multigrid.right_hand_side().iter_mut().zip(r) {
            *b = r[3];
        }
        for (z, p) in z.iter_mut().zip(parts.multigrid.cycle()) {
            *z = [0.0, 0.0, 0.0, *p];
        }
        if let Some(viscous) = &parts.viscous {
            viscous.add_pressure(r, z);
        }
        parts.halo.update_ghosts(z);
        parts.forward(a, r, z);
        parts.halo.update_ghosts(z);
        if parts.viscous.is_some() {
            parts.change.clear();
            parts.change.extend_from_slice(z);
        }
        parts.backward(a, z);
        if parts.viscous.is_some() {
            parts.correct_viscous(a, z);
        }
    }
}

/// How many of the ascending `columns` are ghosts.
#[inline]
fn ghosts(columns: &[u32], n_owned: usize) -> usize {
    columns.iter().rev().take_while(|&&j| j as usize >= n_owned).count()
}

/// Σ |tr A_ii⁻¹ A_ij| / 3 over the ghosts j in row i.
fn ghost_share(a: &SaddleCsr, i: usize, inverse: &[[f32; 4]; 3]) -> f32 {
    let (at, columns) = a.right(i);
    let trace = |at: usize| {
        let block = a.right_block(at);
        let rows = (0..9).map(|k| inverse[k % 3][k / 3] * block[3 * (k % 3) + k / 3]);
        rows.sum::<f32>().abs() / 3.0
    };
    let first = at + columns.len() - ghosts(columns, a.n_rows());
    (first..at + columns.len()).map(trace).sum()
}

/// sum_r += row r of the block · x, lane by lane; rows are `STRIDE` values apart.
#[inline]
fn add_rows<const STRIDE: usize>(sum: &mut [[f32; 4]; 3], block: &[f32], x: &[f32; 4]) {
    for (r, sum) in sum.iter_mut().enumerate() {
        for c in 0..4 {
            sum[c] += block[STRIDE * r + c] * x[c];
        }
    }
}

/// Without the pressure: what stands behind a row of three counts for nothing.
#[inline]
fn velocity(z: &[f32; 4]) -> [f32; 4] {
    [z[0], z[1], z[2], 0.0]
}

#[inline]
fn total(lanes: &[f32; 4]) -> f32 {
    (lanes[0] + lanes[1]) + (lanes[2] + lanes[3])
}

#[inline]
fn minus(sum: [[f32; 4]; 3]) -> [f32; 4] {
    // Seen through, sums across lanes make the compiler turn every block that it reads.
    let sum = black_box(sum);
    [-total(&sum[0]), -total(&sum[1]), -total(&sum[2]), 0.0]
}

/// z + A_ii⁻¹ x, all four lanes at once: z is read next as one vector.
#[inline]
fn add_product(z: [f32; 4], m: &[[f32; 4]; 3], x: [f32; 4]) -> [f32; 4] {
    std::array::from_fn(|r| (z[r] + m[0][r] * x[0]) + (m[1][r] * x[1] + m[2][r] * x[2]))
}

/// Columns of the inverse of the velocity part of a node's block.
fn inverse(block: &[[f32; 4]; 3]) -> [[f32; 4]; 3] {
    let m = |r: usize, c: usize| f64::from(block[r % 3][c % 3]);
    let cofactor =
        |r: usize, c: usize| m(r + 1, c + 1) * m(r + 2, c + 2) - m(r + 1, c + 2) * m(r + 2, c + 1);
    let det = m(0, 0) * cofactor(0, 0) + m(0, 1) * cofactor(0, 1) + m(0, 2) * cofactor(0, 2);
    std::array::from_fn(|c| {
        let entry = |r: usize| (cofactor(c, r) / det) as f32;
        [entry(0), entry(1), entry(2), 0.0]
    })
}
