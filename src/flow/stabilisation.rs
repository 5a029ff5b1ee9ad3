//! Stabilisation parameters, the paper's [6-10], τ_c with a floor.

use crate::fem::number::Real;

/// Least τ_c, in h²/Δt. [7] is zero at rest, where nothing then damps the divergence that the pressure's
/// stabilisation leaves to u_h. Times the profile's excess φ* − φ_h it is a source of φ: still air under a
/// slanting lid would grow currents, e-fold in t √(g/H) = 7. A tenth of this is enough against it. Waves on 20 cells
/// of depth do not feel it; on 6 cells, with 740 steps a period, five times as much takes a tenth of their height.
const REST: f64 = 0.02;

/// A step is at most this much shorter for τ than the one before ...
const SHRINKS: f64 = 1.02;
/// ... and at most this much longer than it is.
const LONGER: f64 = 2.0;

/// The time step that τ and τ_c are of, after one where they were of `before` (zero at the beginning) [s].
///
/// Continuity has `u_h + u'`, u' = −τ R. Where R is large, before a wave's front that hits something, a smaller τ leaves u_h with
/// divergence that one step has to take away: halved with Δt, pressures there were 30 % too high for a step. So τ
/// follows shorter steps slowly.
pub fn time_step(dt: f64, before: f64) -> f64 {
    dt.max((before / SHRINKS).min(LONGER * dt))
}

/// τ = [ (2/Δt)² + (2|u|/h)² + (4ν/h²)² ]^(-1/2)  [s]
#[inline]
pub fn tau<R: Real>(dt: f64, speed: R, h: R, nu: R) -> R {
    let n = R::of;
    let (a, b, c) = (n(2.0 / dt), n(2.0) * speed / h, n(4.0) * nu / (h * h));
    n(1.0) / (a * a + b * b + c * c).square_root()
}

/// τ_c = max[ (h/2) |u| ξ(Re_e), h²/(50 Δt) ], Re_e = |u| h/(2ν), ξ = Re_e/3 up to 3, else 1  [m²/s].
/// Zero viscosity is Re_e = ∞.
#[inline]
pub fn tau_c<R: Real>(dt: f64, speed: R, h: R, nu: R) -> R {
    let n = R::of;
    // Re_e / 3 as a quotient of at most one: ν = 0 is legal, and so is rest.
    let (re, three) = (speed * h, n(6.0) * nu);
    let xi = re / re.larger(three).larger(n(f64::MIN_POSITIVE));
    (n(0.5) * h * speed * xi).larger(n(REST / dt) * h * h)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shorter_steps_are_followed_slowly() {
        assert_eq!(time_step(0.01, 0.0), 0.01);
        assert_eq!(time_step(0.012, 0.01), 0.012);
        assert_eq!(time_step(0.008, 0.0105), 0.0105 / SHRINKS);
        assert_eq!(time_step(0.001, 0.01), 0.002);
    }

    #[test]
    fn limits_of_the_parameters() {
        let (dt, h) = (0.01, 0.1);
        assert!((tau(dt, 0.0, h, 0.0) - dt / 2.0).abs() < 1e-16);
        assert!((tau(1e30, 3.0, h, 0.0) - h / 6.0).abs() < 1e-16);
        assert!((tau(1e30, 0.0, h, 2.0) - h * h / 8.0).abs() < 1e-16);
        assert!((tau_c(dt, 0.0, h, 0.0) - 0.02).abs() < 1e-16);
        assert_eq!(tau_c(dt, 2.0, h, 0.0), 0.1);
        // Re_e = 2·0.1/(2·0.1) = 1: ξ = 1/3.
        assert!((tau_c(dt, 2.0, h, 0.1) - 0.1 / 3.0).abs() < 1e-16);
    }
}
