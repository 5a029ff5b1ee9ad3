//! Fixed point `x = G(x)` of the step by least squares over the passes so far (IQN-ILS, Degroote, Bathe &
//! Vierendeels 2009): with `r = G(x) − x`,
//!
//! ```text
//!     x ← x + Σ c_i Δx_i + ω (r + Σ c_i Δr_i),   c = argmin |r + Σ c_i Δr_i|
//! ```
//!
//! where Δr_i, Δx_i are differences of earlier passes to the last one. What they leave of r is relaxed as the stiffest
//! direction of the body seen so far wants it, `1/ω = max |Δr| / |Δx|`, at least as the estimated added mass does,
//! `1 + m_a/m`. (Taken whole, ω = 1, it grows by the true m_a/m a pass until it is among the Δx_i: of a plate near the
//! ground, in whose way the water goes out, by ten.) Of a body that moves much less than others Δr is what *they* do to
//! it and says nothing of its own stiffness: |Δx| counts as at least a tenth of the largest body's.

use super::added_mass::Light;
use nalgebra::{DMatrix, DVector};

/// Singular values below this fraction of the largest are noise.
const NOISE: f64 = 1e-6;

/// A body's change counts as at least this fraction of the largest body's when its stiffness is seen: what is stiffer than
/// it seems can grow to that fraction and is seen then.
const LEAST_CHANGE: f64 = 0.1;

/// The passes of one step.
#[derive(Clone, Debug)]
pub struct QuasiNewton {
    /// 1/ω of each body.
    stiffness: Vec<f64>,
    /// (x, r) of each pass.
    passes: Vec<(DVector<f64>, DVector<f64>)>,
    /// The first of them that still says how r changes with x.
    first: usize,
}

impl QuasiNewton {
    /// For the velocities of these bodies.
    pub fn new(light: &[Light]) -> Self {
        Self {
            stiffness: light.iter().map(|l| 1.0 + l.ratio).collect(),
            passes: Vec::new(),
            first: 0,
        }
    }

    /// Bodies answer in another way from the next pass on: how r has changed with x holds no longer, but for how much.
    pub fn forget(&mut self) {
        self.first = self.passes.len();
    }

    /// What to try after `x` gave `g` = G(x).
    pub fn next(&mut self, x: DVector<f64>, g: DVector<f64>) -> DVector<f64> {
        let r = g - &x;
        if let Some((x_last, r_last)) = self.passes.last() {
            let change = |now: &DVector<f64>, last: &DVector<f64>, body: usize| {
                (now.fixed_rows::<6>(6 * body) - last.fixed_rows::<6>(6 * body)).norm()
            };
            let bodies = self.stiffness.len();
            let largest = (0..bodies).map(|body| change(&x, x_last, body)).fold(0.0, f64::max);
            if largest > 0.0 {
                for (body, stiffness) in self.stiffness.iter_mut().enumerate() {
                    let dx = change(&x, x_last, body).max(LEAST_CHANGE * largest);
                    *stiffness = stiffness.max(change(&r, r_last, body) / dx);
                }
            }
        }
        let (mut next, mut left) = (x.clone(), r.clone());
        let known = &self.passes[self.first..];
        if !known.is_empty() {
            let dx = DMatrix::from_fn(x.len(), known.len(), |i, k| known[k].0[i] - x[i]);
            let dr = DMatrix::from_fn(r.len(), known.len(), |i, k| known[k].1[i] - r[i]);
            let svd = dr.clone().svd(true, true);
            let least = NOISE * svd.singular_values.max();
            let c = svd.solve(&-&r, least).expect("both bases were asked for");
            next += dx * &c;
            left += dr * c;
        }
        for (i, next) in next.iter_mut().enumerate() {
            *next += left[i] / self.stiffness[i / 6];
        }
        self.passes.push((x, r));
        next
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two bodies in each other's water: x = G(x) = a − M x with |M| > 1, for which the plain iteration diverges.
    #[allow(non_snake_case)]
    #[test]
    fn a_linear_added_mass_is_solved_in_as_many_passes_as_it_has_directions() {
        let n = 12;
        let M = DMatrix::from_fn(n, n, |i, j| {
            if i == j { 4.0 + i as f64 } else { 0.3 / (1.0 + (i + j) as f64) }
        });
        let a = DVector::from_fn(n, |i, _| (i as f64).sin());
        let light = [0, 1].map(|body| Light { body, arm: 1.0, ratio: 5.0, held: false });
        let mut newton = QuasiNewton::new(&light);
        let mut x = DVector::zeros(n);
        let mut passes = 0;
        loop {
            let g = &a - &M * &x;
            if (&g - &x).norm() < 1e-9 {
                break;
            }
            passes += 1;
            assert!(passes <= n + 3, "{}", (&g - &x).norm());
            x = newton.next(x, g);
        }
        let exact = (DMatrix::identity(n, n) + M).lu().solve(&a).expect("a regular matrix");
        assert!((x - exact).norm() < 1e-8);
    }

    /// A plate near the ground, whose added mass is twenty times the estimated one across it and in two turns: what a pass
    /// leaves out of what it knows must not grow by that factor until it is known, also if all is forgotten once.
    #[allow(non_snake_case)]
    #[test]
    fn what_is_not_known_yet_does_not_grow() {
        let M = DVector::from_vec(vec![0.3, 0.5, 13.0, 9.0, 11.0, 0.4]);
        let a = DVector::from_vec(vec![1.0, -0.5, -0.3, 0.7, 1.2, 0.1]);
        let mut newton = QuasiNewton::new(&[Light { body: 0, arm: 1.0, ratio: 0.65, held: false }]);
        let mut x = DVector::zeros(6);
        let mut left = Vec::new();
        for pass in 0..12 {
            let g = &a - M.component_mul(&x);
            left.push((&g - &x).norm());
            if pass == 2 {
                newton.forget();
            }
            x = newton.next(x, g);
        }
        assert!(left[2..].iter().all(|&l| l <= left[0]), "{left:?}");
        assert!(left[11] < 1e-9 * left[0], "{left:?}");
    }

    /// The second body hangs, all but balanced, in the water that the first one moves: that its r changes while it hardly
    /// moves must not hold it fast.
    #[allow(non_snake_case)]
    #[test]
    fn a_body_at_rest_is_not_held_by_what_its_neighbour_does() {
        let mut M = DMatrix::from_diagonal_element(12, 12, 0.5);
        M.view_mut((6, 0), (6, 6)).fill_with_identity();
        let a = DVector::from_fn(12, |i, _| if i < 6 { 1.0 + i as f64 } else { 1e-9 });
        let light = [0, 1].map(|body| Light { body, arm: 1.0, ratio: 0.5, held: false });
        let mut newton = QuasiNewton::new(&light);
        let mut x = DVector::zeros(12);
        let mut left = Vec::new();
        for _ in 0..12 {
            let g = &a - &M * &x;
            left.push((&g - &x).norm());
            x = newton.next(x, g);
        }
        assert!(left[11] < 1e-6 * left[0], "{left:?}");
    }
}
