//! A x = b by Krylov methods: flexible GMRES (Saad 1993) and flexible CG (Notay 2000).
//!
//! Right-preconditioned, so that the residual that is minimised is the true one. The residual is
//! recomputed from `x` before convergence is claimed. Anything else is an error with numbers.

#![allow(non_snake_case)]

use super::operator::{InnerProduct, Operator, Preconditioner};

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KrylovSettings {
    /// Residual to reach, relative to the initial one.
    pub relative: f64,
    /// Residual that is small enough whatever the initial one was.
    pub absolute: f64,
    /// Iterations (applications of the preconditioner) allowed.
    pub max_iterations: u32,
    /// Basis vectors of FGMRES before it starts anew (15 is as good as 30, and half the memory).
    pub restart: u32,
}

impl Default for KrylovSettings {
    fn default() -> Self {
        Self { relative: 1e-3, absolute: 0.0, max_iterations: 200, restart: 15 }
    }
}

/// A solve that reached its tolerance. Residuals are norms of the given inner product.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Converged {
    /// Applications of the preconditioner.
    pub iterations: u32,
    /// ‖b − A x₀‖.
    pub initial: f64,
    /// ‖b − A x‖, recomputed.
    pub residual: f64,
}

/// Why a solve was given up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// All iterations used.
    MaxIterations,
    /// A whole cycle gained less than 1 %.
    Stagnated,
    /// NaN or infinity in the residual.
    NotFinite,
    /// CG met a direction of non-positive energy: operator or preconditioner is not positive.
    NotPositive,
}

impl std::fmt::Display for Reason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Reason::MaxIterations => "all iterations used",
            Reason::Stagnated => "stagnated",
            Reason::NotFinite => "not finite",
            Reason::NotPositive => "operator or preconditioner not positive",
        })
    }
}

/// A solve that did not reach its tolerance.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "linear solve: {reason} after {iterations} iterations, residual {residual:.3e} of {initial:.3e}"
)]
pub struct Diverged {
    /// Applications of the preconditioner.
    pub iterations: u32,
    /// ‖b − A x₀‖.
    pub initial: f64,
    /// Last known residual.
    pub residual: f64,
    /// What went wrong.
    pub reason: Reason,
}

/// Vectors of a Krylov method, kept between solves so that solving allocates nothing.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    basis: Vec<f64>,
    /// Preconditioned vectors. A is applied to them as they are: f32 loses nothing.
    preconditioned: Vec<f32>,
    /// What is preconditioned.
    narrow: Vec<f32>,
    z: Vec<f64>,
    r: Vec<f64>,
    /// Columns of the Hessenberg matrix, turned triangular, each with room for all directions and two.
    hessenberg: Vec<f64>,
    again: Vec<f64>,
    givens: Vec<[f64; 2]>,
    g: Vec<f64>,
}

/// Orthogonalise a second time when so much of a squared norm has cancelled.
const CANCELLED: f64 = 1e-2;

/// Where the last `LOOK` iterations before a restart left more than this of the residual, there is none: directions
/// are kept, up to `MORE` times those asked for. What is left then belongs to a few bad cells, which a restart would
/// have to find again.
const SLOW: f64 = 0.25;
const LOOK: usize = 5;
const MORE: usize = 4;

impl Workspace {
    /// For `m` directions of length `n`.
    ///
    /// Memory of a new vector of zeros is taken when it is written to: directions that no solve needs cost none.
    fn make_room(&mut self, n: usize, m: usize) {
        if self.basis.len() < (m + 1) * n {
            self.basis = vec![0.0; (m + 1) * n];
        }
        if self.preconditioned.len() < m * n {
            self.preconditioned = vec![0.0; m * n];
        }
        self.narrow.resize(n, 0.0);
        self.hessenberg.resize(m * (m + 2), 0.0);
        self.again.resize(m + 2, 0.0);
        self.givens.resize(m, [0.0; 2]);
        self.g.resize(m + 1, 0.0);
    }
}

/// Flexible GMRES(restart) from zero. With a fixed preconditioner it is GMRES.
///
/// `b`, `x` of local length; `x` is set. On `Err`, `x` holds the last iterate, unless it was not finite.
pub fn fgmres(
    A: &impl Operator,
    M: &mut impl Preconditioner,
    product: &impl InnerProduct,
    b: &[f64],
    x: &mut [f64],
    settings: &KrylovSettings,
    work: &mut Workspace,
) -> Result<Converged, Diverged> {
    let (n, restart) = (x.len(), settings.restart.max(1) as usize);
    let most = MORE * restart;
    work.make_room(n, most);

    x.fill(0.0);
    work.basis[..n].copy_from_slice(b);
    let initial = product.dot(b, b).sqrt();
    let mut residual = initial;
    let target = settings.absolute.max(settings.relative * initial);
    let mut iterations = 0;
    let fail = |reason, iterations, residual| Diverged { iterations, initial, residual, reason };
    loop {
        if !residual.is_finite() {
            return Err(fail(Reason::NotFinite, iterations, residual));
        }
        if residual <= target {
            return Ok(Converged { iterations, initial, residual });
        }
        if iterations >= settings.max_iterations {
            return Err(fail(Reason::MaxIterations, iterations, residual));
        }
        work.g[0] = residual;
        scale(1.0 / residual, &mut work.basis[..n]);
        let (mut k, mut m, mut mark) = (0, restart, residual);
        loop {
            let (V, w) = work.basis.split_at_mut((k + 1) * n);
            let z = &mut work.preconditioned[k * n..(k + 1) * n];
            narrow(1.0, &V[k * n..], &mut work.narrow);
            M.apply(&work.narrow, z);
            A.apply(z, &mut w[..n]);
            let h = &mut work.hessenberg[k * (most + 2)..(k + 1) * (most + 2)];
            orthogonalise(product, &mut work.basis, n, k + 1, h, &mut work.again);
            iterations += 1;
            for (j, [c, s]) in work.givens[..k].iter().enumerate() {
                (h[j], h[j + 1]) = (c * h[j] + s * h[j + 1], c * h[j + 1] - s * h[j]);
            }
            let length = h[k].hypot(h[k + 1]);
            let [c, s] = [h[k] / length, h[k + 1] / length];
            work.givens[k] = [c, s];
            h[k] = length;
            (work.g[k], work.g[k + 1]) = (c * work.g[k], -s * work.g[k]);
            let estimate = work.g[k + 1].abs();
            k += 1;
            if !estimate.is_finite() {
                return Err(fail(Reason::NotFinite, iterations, estimate));
            }
            if k == m && m < most && estimate > SLOW * mark {
                m = most.min(m + restart);
            }
            if estimate <= target || k == m || iterations >= settings.max_iterations {
                break;
            }
            if k + LOOK == m {
                mark = estimate;
            }
        }
        // R y = g, x += Z y.
        for j in (0..k).rev() {
            for i in j + 1..k {
                work.g[j] -= work.hessenberg[i * (most + 2) + j] * work.g[i];
            }
            work.g[j] /= work.hessenberg[j * (most + 2) + j];
        }
        for (z, y) in work.preconditioned.chunks_exact(n).zip(&work.g[..k]) {
            for (x, z) in x.iter_mut().zip(z) {
                *x += y * f64::from(*z);
            }
        }
        let before = residual;
        residual = self::residual(A, product, b, x, &mut work.basis[..n]);
        if residual > target && residual > 0.99 * before {
            return Err(fail(Reason::Stagnated, iterations, residual));
        }
    }
}

/// `w = V[k]` minus its parts along `V[..k]`, scaled to length 1; `h[..k]` those parts, `h[k]` the
/// length. One reduction (Pythagoras gives the length), two more if nearly all of w cancels.
fn orthogonalise(
    product: &impl InnerProduct,
    basis: &mut [f64],
    n: usize,
    k: usize,
    h: &mut [f64],
    again: &mut [f64],
) {
    let w_at = k * n;
    product.dots(&basis[..w_at + n], &basis[w_at..w_at + n], &mut h[..=k]);
    let before = h[k];
    subtract(basis, n, k, h);
    let mut left = before - h[..k].iter().map(|h| h * h).sum::<f64>();
    if left < CANCELLED * before {
        product.dots(&basis[..w_at + n], &basis[w_at..w_at + n], &mut again[..=k]);
        subtract(basis, n, k, again);
        for (h, again) in h[..k].iter_mut().zip(again.iter()) {
            *h += again;
        }
        left = product.dot(&basis[w_at..w_at + n], &basis[w_at..w_at + n]);
    }
    h[k] = left.max(0.0).sqrt();
    if h[k] > 0.0 {
        scale(1.0 / h[k], &mut basis[w_at..w_at + n]);
    }
}

/// w −= Σ h_j v_j, in pieces that stay in the cache.
fn subtract(basis: &mut [f64], n: usize, k: usize, h: &[f64]) {
    let (V, w) = basis.split_at_mut(k * n);
    for (at, w) in (0..n).step_by(PIECE).zip(w[..n].chunks_mut(PIECE)) {
        for (j, h) in h[..k].iter().enumerate() {
            let v = &V[j * n + at..j * n + at + w.len()];
            for (w, v) in w.iter_mut().zip(v) {
                *w -= h * v;
            }
        }
    }
}

/// Length of the pieces that batched vector operations work on.
pub(super) const PIECE: usize = 1024;

/// v = a w, in single precision.
fn narrow(a: f64, w: &[f64], v: &mut [f32]) {
    for (v, w) in v.iter_mut().zip(w) {
        *v = (a * w) as f32;
    }
}

fn scale(a: f64, x: &mut [f64]) {
    for x in x {
        *x *= a;
    }
}

/// r = b − A x and its norm.
fn residual(
    A: &impl Operator,
    product: &impl InnerProduct,
    b: &[f64],
    x: &mut [f64],
    r: &mut [f64],
) -> f64 {
    A.apply(x, r);
    for (r, b) in r.iter_mut().zip(b) {
        *r = b - *r;
    }
    product.dot(r, r).sqrt()
}

/// Flexible conjugate gradients from the initial guess in `x`. A must be self-adjoint and positive
/// in the given inner product; the preconditioner may be slightly nonlinear or unsymmetric
/// (`β` of Polak and Ribière).
pub fn cg(
    A: &impl Operator,
    M: &mut impl Preconditioner,
    product: &impl InnerProduct,
    b: &[f64],
    x: &mut [f64],
    settings: &KrylovSettings,
    work: &mut Workspace,
) -> Result<Converged, Diverged> {
    let n = x.len();
    work.r.resize(2 * n, 0.0);
    work.z.resize(n, 0.0);
    work.make_room(n, 1);
    let (z, p) = (&mut work.z, &mut work.basis[..n]);
    let narrow_z = &mut work.preconditioned[..n];

    let initial = residual(A, product, b, x, &mut work.r[..n]);
    let target = settings.absolute.max(settings.relative * initial);
    let (mut iterations, mut residual) = (0, initial);
    let mut last_true = initial;
    let fail = |reason, iterations, residual| Diverged { iterations, initial, residual, reason };
    // Of the last step; 0 starts anew from the steepest direction.
    let (mut alpha, mut rho) = (0.0, 0.0);
    loop {
        if !residual.is_finite() {
            return Err(fail(Reason::NotFinite, iterations, residual));
        }
        if residual <= target {
            residual = self::residual(A, product, b, x, &mut work.r[..n]);
            if residual <= target {
                return Ok(Converged { iterations, initial, residual });
            }
            if residual.is_finite() && iterations > 0 && residual > 0.99 * last_true {
                return Err(fail(Reason::Stagnated, iterations, residual));
            }
            (last_true, rho) = (residual, 0.0);
        }
        if iterations >= settings.max_iterations {
            return Err(fail(Reason::MaxIterations, iterations, residual));
        }
        narrow(1.0 / residual, &work.r[..n], &mut work.narrow);
        M.apply(&work.narrow, narrow_z);
        for (z, narrow) in z.iter_mut().zip(&*narrow_z) {
            *z = residual * f64::from(*narrow);
        }
        let mut zr_zq = [0.0; 2];
        product.dots(&work.r, z, &mut zr_zq);
        // β = (z, r − r_old)/ρ with r − r_old = −α q.
        let beta = if rho == 0.0 { 0.0 } else { -alpha * zr_zq[1] / rho };
        rho = zr_zq[0];
        for (p, z) in p.iter_mut().zip(z.iter()) {
            *p = if beta == 0.0 { *z } else { z + beta * *p };
        }
        let (r, q) = work.r.split_at_mut(n);
        A.apply(p, q);
        let pq = product.dot(p, q);
        iterations += 1;
        if !pq.is_finite() || !rho.is_finite() {
            return Err(fail(Reason::NotFinite, iterations, residual));
        }
        if pq <= 0.0 || rho <= 0.0 {
            return Err(fail(Reason::NotPositive, iterations, residual));
        }
        alpha = rho / pq;
        for (x, p) in x.iter_mut().zip(p.iter()) {
            *x += alpha * p;
        }
        for (r, q) in r.iter_mut().zip(q.iter()) {
            *r -= alpha * q;
        }
        residual = product.dot(r, r).sqrt();
    }
}
