//! Block upper Schur preconditioner of the coupled system `[A G; D C] (u, p)`:
//! `p = S⁻¹ r_p` by one multigrid cycle, then `u = A⁻¹ (r_u − G p)` by block Gauss-Seidel.
//!
//! `S = C − D A⁻¹ G ≈ L = ∫ ((Δt_eff + τ)/ρ) ∇q·∇p`, `1/Δt_eff = 1/Δt + 2θ|u|/h` (Elman, Silvester
//! & Wathen 2014, ch. 9, in the algebraic pressure-projection form). One application is one
//! projection step. Velocity gets one forward and one backward half sweep of 3×3 blocks within the
//! rank; ghosts are exchanged between them. Everything is stored in f32.

#![allow(non_snake_case)]

use super::block_csr::BlockCsr;
use super::distributed::Halo;
use super::multigrid::Multigrid;
use super::operator::Preconditioner;

/// The preconditioner; unknowns of a node are (u, v, w, p).
#[derive(Clone, Debug)]
pub struct SchurPreconditioner {
    halo: Halo,
    multigrid: Multigrid,
    row_start: Vec<u32>,
    columns: Vec<u32>,
    diagonal: Vec<u32>,
    /// `[A_ij G_ij]` of each entry.
    momentum: Vec<[[f32; 4]; 3]>,
    /// `A_ii⁻¹`
    inverse: Vec<[[f32; 3]; 3]>,
    z: Vec<[f32; 4]>,
}

impl SchurPreconditioner {
    /// For matrices of the pattern that `halo` was made for. `setup` comes before use.
    pub fn new(halo: &Halo) -> Self {
        Self {
            halo: halo.clone(),
            multigrid: Multigrid::new(halo),
            row_start: Vec::new(),
            columns: Vec::new(),
            diagonal: Vec::new(),
            momentum: Vec::new(),
            inverse: Vec::new(),
            z: vec![[0.0; 4]; halo.n_local()],
        }
    }

    /// Takes this step's system `a` and pressure operator `l`, of the same pattern. Diagonal blocks
    /// of A are regular; a node with constrained velocity or pressure has identity-like rows and
    /// columns, in `l` too. Nothing is kept from earlier calls but memory.
    pub fn setup(&mut self, a: &BlockCsr<4>, l: &BlockCsr<1>) {
        self.multigrid.setup(l);
        if self.row_start != a.row_start || self.columns != a.columns {
            self.row_start.clone_from(&a.row_start);
            self.columns.clone_from(&a.columns);
            self.diagonal = (0..a.n_rows()).map(|i| a.diagonal(i) as u32).collect();
        }
        self.momentum.clear();
        self.momentum
            .extend(a.values.iter().map(|v| [v[0], v[1], v[2]].map(|row| row.map(|x| x as f32))));
        self.inverse.clear();
        self.inverse.extend(self.diagonal.iter().map(|&d| inverse(&a.values[d as usize])));
    }

    #[inline]
    fn row(&self, i: usize) -> [usize; 3] {
        [self.row_start[i], self.diagonal[i], self.row_start[i + 1]].map(|at| at as usize)
    }

    #[inline]
    fn entries(
        &self,
        range: std::ops::Range<usize>,
    ) -> impl DoubleEndedIterator<Item = (&[[f32; 4]; 3], &u32)> {
        self.momentum[range.clone()].iter().zip(&self.columns[range])
    }

    /// The multigrid of the pressure operator.
    pub fn multigrid(&self) -> &Multigrid {
        &self.multigrid
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
        self.halo.update_ghosts(&mut self.z);
        // Velocities not yet reached are zero: their columns give G p alone. The column next to the
        // row comes last in each sum, as it was computed last: sums of several rows overlap.
        let n = self.diagonal.len();
        for i in 0..n {
            let [start, diagonal, end] = self.row(i);
            let mut sum = [[0.0; 4]; 3];
            add(&mut sum, self.entries(diagonal..end), &self.z);
            add(&mut sum, self.entries(start..diagonal), &self.z);
            let left = std::array::from_fn(|a| r[i][a] as f32 - total(sum[a]));
            self.z[i][..3].copy_from_slice(&times(&self.inverse[i], left));
        }
        self.halo.update_ghosts(&mut self.z);
        // Row i holds for the columns before i; the later ones and the ghosts have changed.
        for i in (0..n).rev() {
            let [_, diagonal, end] = self.row(i);
            let mut sum = [[0.0; 4]; 3];
            add(&mut sum, self.entries(diagonal + 1..end).rev(), &self.z);
            let change = times(&self.inverse[i], sum.map(|[x, y, z, _]| (x + z) + y));
            for a in 0..3 {
                self.z[i][a] -= change[a];
            }
        }
        for (z, x) in z.iter_mut().zip(self.z.as_flattened()) {
            *z = f64::from(*x);
        }
    }
}

/// sum += Σ_j [A G]_ij (u, p)_j, still apart by the four columns, which are SIMD lanes.
#[inline]
fn add<'a>(
    sum: &mut [[f32; 4]; 3],
    entries: impl Iterator<Item = (&'a [[f32; 4]; 3], &'a u32)>,
    x: &[[f32; 4]],
) {
    for (block, &j) in entries {
        let x = &x[j as usize];
        for r in 0..3 {
            for c in 0..4 {
                sum[r][c] += block[r][c] * x[c];
            }
        }
    }
}

#[inline]
fn total(lanes: [f32; 4]) -> f32 {
    (lanes[0] + lanes[2]) + (lanes[1] + lanes[3])
}

#[inline]
fn times(m: &[[f32; 3]; 3], x: [f32; 3]) -> [f32; 3] {
    m.map(|row| row[0] * x[0] + row[1] * x[1] + row[2] * x[2])
}

/// Inverse of the velocity part of a node's block.
fn inverse(block: &[[f64; 4]; 4]) -> [[f32; 3]; 3] {
    let m = |r: usize, c: usize| block[r % 3][c % 3];
    let cofactor =
        |r: usize, c: usize| m(r + 1, c + 1) * m(r + 2, c + 2) - m(r + 1, c + 2) * m(r + 2, c + 1);
    let det = m(0, 0) * cofactor(0, 0) + m(0, 1) * cofactor(0, 1) + m(0, 2) * cofactor(0, 2);
    std::array::from_fn(|r| std::array::from_fn(|c| (cofactor(c, r) / det) as f32))
}

/// Weights of the inner product in which residuals are measured, for each owned unknown: 1/a_ii of
/// the momentum rows and 1/l_ii of the continuity row. Residuals squared are then energies, whatever
/// the densities; a mass defect and a momentum defect count alike.
pub fn residual_weights(a: &BlockCsr<4>, l: &BlockCsr<1>, weights: &mut Vec<f64>) {
    weights.clear();
    for i in 0..a.n_rows() {
        let block = &a.values[a.diagonal(i)];
        let l = l.values[l.diagonal(i)][0][0];
        weights.extend([block[0][0], block[1][1], block[2][2], l].map(|d| 1.0 / d));
    }
}
