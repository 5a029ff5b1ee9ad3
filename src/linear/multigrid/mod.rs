//! z ≈ L⁻¹ r for scalar, symmetric, diffusion-like L: unsmoothed aggregation with a K-cycle
//! (Notay 2010, Notay & Vassilevski 2008).
//!
//! Aggregates of about nine strongly coupled nodes within each rank; the coarse matrix is a sum of
//! entries; one forward Gauss-Seidel sweep before and one backward after. On each coarse level two
//! steps of flexible CG, preconditioned by the next cycle, make counts independent of the mesh (a
//! V-cycle's grow); the second step is skipped if the first gains a factor four. A level of few
//! nodes is gathered on every rank, and from there on results do not depend on ranks. Everything is
//! built anew in each set-up: nothing is lagged.

#![allow(non_snake_case)]

pub mod aggregation;
mod direct;
pub mod galerkin;
mod level;

use super::block_csr::BlockCsr;
use super::distributed::Halo;
use super::operator::Preconditioner;
use direct::Direct;
use level::Level;

/// The second step of the K-cycle is taken if the first leaves more than this of the residual.
const SECOND_STEP: f64 = 0.25;

/// How levels are made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MultigridSettings {
    /// Strength θ on the finest level; halved on each coarser one.
    pub strength: f64,
    /// Levels of at most so many nodes, over all ranks, are held by every rank.
    pub gathered: u64,
    /// Gathered levels of at most so many nodes are solved directly.
    pub direct: usize,
}

impl Default for MultigridSettings {
    fn default() -> Self {
        Self { strength: 0.05, gathered: 20_000, direct: 300 }
    }
}

/// The hierarchy of levels.
#[derive(Clone, Debug)]
pub struct Multigrid {
    settings: MultigridSettings,
    levels: Vec<Level>,
    bottom: Option<Direct>,
    sizes: Vec<u64>,
}

impl Multigrid {
    /// For matrices of the pattern that `halo` was made for. `setup` comes before use.
    pub fn new(halo: &Halo) -> Self {
        Self::with_settings(halo, MultigridSettings::default())
    }

    /// As `new`, with other levels.
    pub fn with_settings(halo: &Halo, settings: MultigridSettings) -> Self {
        Self { settings, levels: vec![Level::new(halo.clone())], bottom: None, sizes: Vec::new() }
    }

    /// Builds all levels of L. Diagonal entries are positive; rows of prescribed values are
    /// diagonal, and so are their columns.
    pub fn setup(&mut self, L: &BlockCsr<1>) {
        self.levels.truncate(1);
        self.bottom = None;
        self.levels[0].set_matrix(L);
        let mut n = self.levels[0].halo.sum_u64(L.n_rows() as u64);
        self.sizes = vec![n];
        let mut theta = self.settings.strength;
        let mut coarse: Option<BlockCsr<1>> = None;
        loop {
            let fine = self.levels.last_mut().expect("at least the finest level");
            let matrix = coarse.as_ref().unwrap_or(L);
            let (aggregates, count) = aggregation::aggregate(matrix, theta);
            let n_coarse = fine.halo.sum_u64(count as u64);
            if n_coarse == 0 || 10 * n_coarse > 9 * n {
                fine.coarse_of.clear();
                return;
            }
            fine.gathered = n_coarse <= self.settings.gathered;
            let (next, halo) = if fine.gathered {
                let (first, coarse_of) = fine.halo.name_aggregates(&aggregates, count);
                let rows =
                    galerkin::coarse_matrix(matrix, &coarse_of, count, first, n_coarse as usize);
                fine.coarse_of = coarse_of;
                (fine.halo.gather(rows), Halo::single(n_coarse as usize))
            } else {
                let (nodes, coarse_of) = fine.halo.coarse_nodes(&aggregates, count);
                let rows = galerkin::coarse_matrix(matrix, &coarse_of, count, 0, nodes.len());
                fine.coarse_of = coarse_of;
                let halo = fine.halo.coarse(&nodes, &rows.pattern);
                (rows, halo)
            };
            fine.restricted.resize(halo.n_local(), 0.0);
            (n, theta) = (n_coarse, 0.5 * theta);
            self.sizes.push(n);
            if fine.gathered && next.n_rows() <= self.settings.direct {
                self.bottom = Direct::new(&next);
                if self.bottom.is_some() {
                    return;
                }
            }
            let mut level = Level::new(halo);
            level.set_matrix(&next);
            level.make_directions();
            self.levels.push(level);
            coarse = Some(next);
        }
    }

    /// Nodes of each level over all ranks, finest first.
    pub fn sizes(&self) -> &[u64] {
        &self.sizes
    }

    /// Of each smoothed level: nodes over all ranks, cycles since `setup`, and what has left this rank through its
    /// halo since that was made (exchanges, messages, bytes).
    pub fn visits(&self) -> impl Iterator<Item = (u64, u64, [u64; 3])> {
        let levels = self.levels.iter().zip(&self.sizes);
        levels.map(|(level, &nodes)| (nodes, level.visits, level.halo.traffic()))
    }

    /// Where the right-hand side of `cycle` is put: owned entries are read.
    pub fn right_hand_side(&mut self) -> &mut [f32] {
        &mut self.levels[0].b
    }

    /// One cycle from zero; owned entries of the result are set.
    pub fn cycle(&mut self) -> &[f32] {
        cycle(&mut self.levels, &mut self.bottom);
        &self.levels[0].x
    }
}

impl Preconditioner for Multigrid {
    fn apply(&mut self, r: &[f32], z: &mut [f32]) {
        self.right_hand_side().copy_from_slice(r);
        z.copy_from_slice(self.cycle());
    }
}

/// `x ≈ A⁻¹ b` on the first of these levels.
fn cycle(levels: &mut [Level], bottom: &mut Option<Direct>) {
    let (fine, coarser) = levels.split_first_mut().expect("a level");
    fine.forward_from_zero();
    fine.halo.update_ghosts(&mut fine.x);
    if let Some(coarse) = coarser.first_mut() {
        fine.restrict();
        for (b, r) in coarse.b.iter_mut().zip(&fine.restricted) {
            *b = *r as f32;
        }
        krylov_cycle(coarser, bottom);
        fine.prolong(&coarser[0].e);
    } else if let Some(bottom) = bottom {
        fine.restrict();
        fine.prolong(bottom.solve(&fine.restricted));
    }
    fine.backward();
}

/// `e ≈ A⁻¹ b` by up to two steps of flexible CG; b becomes what is left. Ghosts of e are valid.
fn krylov_cycle(levels: &mut [Level], bottom: &mut Option<Direct>) {
    cycle(levels, bottom);
    levels[0].multiply(0);
    let [zb, zv, bv, vv, bb] = {
        let Level { halo, b, x, v: [v, _], .. } = &levels[0];
        halo.dots([(x, b), (x, v), (b, v), (v, v), (b, b)])
    };
    if zv <= 0.0 || !zv.is_finite() {
        levels[0].e.copy_from_slice(&levels[0].x.clone());
        return;
    }
    let alpha = zb / zv;
    let level = &mut levels[0];
    std::mem::swap(&mut level.e, &mut level.x);
    let left = bb - 2.0 * alpha * bv + alpha * alpha * vv;
    if left <= SECOND_STEP * SECOND_STEP * bb {
        for e in &mut level.e {
            *e *= alpha as f32;
        }
        return;
    }
    for (b, v) in level.b.iter_mut().zip(&level.v[0]) {
        *b -= alpha as f32 * v;
    }
    cycle(levels, bottom);
    levels[0].multiply(1);
    let level = &mut levels[0];
    let [zv1, zv2, zb2] = {
        let Level { halo, b, x, v: [v1, v2], .. } = &*level;
        halo.dots([(x, v1), (x, v2), (x, b)])
    };
    // Second direction, made conjugate to the first.
    let rho = zv2 - zv1 * zv1 / zv;
    let (first, second) =
        if rho > 0.0 { (alpha - zv1 * zb2 / (zv * rho), zb2 / rho) } else { (alpha, 0.0) };
    for (e, x) in level.e.iter_mut().zip(&level.x) {
        *e = first as f32 * *e + second as f32 * x;
    }
}
