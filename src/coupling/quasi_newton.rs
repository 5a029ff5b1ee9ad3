//! Fixed point `x = G(x)` of the step by least squares over the passes so far (IQN-ILS, Degroote, Bathe &
//! Vierendeels 2009): with `r = G(x) − x`,
//!
//! ```text
//!     x ← G(x) + Σ c_i ΔG_i,   c = argmin |r + Σ c_i Δr_i|
//! ```
//!
//! where Δr_i, ΔG_i are differences of earlier passes to the last one. The first pass is relaxed as the
//! estimated added mass wants it, `x ← x + r / (1 + m_a/m)`.

use super::added_mass::Light;
use nalgebra::{DMatrix, DVector};

/// Singular values below this fraction of the largest are noise.
const NOISE: f64 = 1e-6;

/// The passes of one step.
#[derive(Clone, Debug)]
pub struct QuasiNewton {
    relaxation: DVector<f64>,
    /// (r, G(x)) of each pass.
    passes: Vec<(DVector<f64>, DVector<f64>)>,
}

impl QuasiNewton {
    /// For the velocities of these bodies.
    pub fn new(light: &[Light]) -> Self {
        let relaxation = DVector::from_fn(6 * light.len(), |i, _| 1.0 / (1.0 + light[i / 6].ratio));
        Self { relaxation, passes: Vec::new() }
    }

    /// What to try after `x` gave `g` = G(x).
    pub fn next(&mut self, x: DVector<f64>, g: DVector<f64>) -> DVector<f64> {
        let r = &g - &x;
        let n = self.passes.len();
        let next = if n == 0 {
            x + r.component_mul(&self.relaxation)
        } else {
            let dr = DMatrix::from_fn(r.len(), n, |i, k| self.passes[k].0[i] - r[i]);
            let dg = DMatrix::from_fn(r.len(), n, |i, k| self.passes[k].1[i] - g[i]);
            let svd = dr.svd(true, true);
            let least = NOISE * svd.singular_values.max();
            let c = svd.solve(&-&r, least).expect("both bases were asked for");
            &g + dg * c
        };
        self.passes.push((r, g));
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
}
