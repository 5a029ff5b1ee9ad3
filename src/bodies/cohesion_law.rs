//! The cohesive law [28]: `σ(δ) = (27/4) σ_c (δ/δ_f)(1 − δ/δ_f)²` up to `δ_f`, nothing after.
//!
//! Its peak is σ_c at δ_f/3; opening a face for good takes 9/16 σ_c δ_f per area.

use crate::case::{Compression, Unloading};

/// Strength and opening of a bond.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Law {
    /// σ_c [Pa].
    pub strength: f64,
    /// δ_f [m].
    pub opening: f64,
    /// After the opening shrinks.
    pub unloading: Unloading,
    /// Under compression.
    pub compression: Compression,
    /// Fraction of critical damping of two clusters on their bond.
    pub damping: f64,
}

/// Largest opening of a point that is broken for good.
pub const BROKEN: f64 = f64::INFINITY;

impl Law {
    /// `(27/4) σ_c/δ_f`, the slope at zero [Pa/m].
    pub fn stiffness(&self) -> f64 {
        6.75 * self.strength / self.opening
    }

    /// σ(δ)/δ on the curve [Pa/m].
    #[inline]
    pub fn secant(&self, delta: f64) -> f64 {
        let left = 1.0 - delta / self.opening;
        if left > 0.0 { self.stiffness() * left * left } else { 0.0 }
    }

    /// ∫σ dδ on the curve [J/m²].
    pub fn work(&self, delta: f64) -> f64 {
        let d = (delta / self.opening).min(1.0);
        6.75 * self.strength * self.opening * d * d * (0.5 - 2.0 / 3.0 * d + 0.25 * d * d)
    }

    /// Energy stored at an opening and spent for good, per area [J/m²]; `largest` opening so far.
    pub fn energy(&self, delta: f64, largest: f64) -> (f64, f64) {
        if largest == BROKEN {
            return (0.0, self.work(self.opening));
        }
        match self.unloading {
            Unloading::Curve => (self.work(delta), 0.0),
            Unloading::Damage => {
                let secant = self.secant(largest);
                let stored = 0.5 * secant * delta * delta;
                (stored, self.work(largest) - 0.5 * secant * largest * largest)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn peak_energy_and_slope_are_those_of_the_formula() {
        let law = Law {
            strength: 1e4,
            opening: 1e-3,
            unloading: Unloading::Curve,
            compression: Compression::Bond,
            damping: 0.0,
        };
        let sigma = |d: f64| law.secant(d) * d;
        assert!((sigma(law.opening / 3.0) - 1e4).abs() < 1e-8);
        assert!((law.work(law.opening) - 0.5625 * 10.0).abs() < 1e-12);
        assert!((law.stiffness() - 6.75e7).abs() < 1e-6);
        // Work is the integral of the stress.
        let n = 1000;
        let mut sum = 0.0;
        for i in 0..n {
            sum += sigma((f64::from(i) + 0.5) / f64::from(n) * 0.7e-3) * 0.7e-3 / f64::from(n);
        }
        assert!((sum - law.work(0.7e-3)).abs() < 1e-6 * sum);
        assert_eq!(law.energy(0.0, BROKEN), (0.0, law.work(law.opening)));
    }
}
