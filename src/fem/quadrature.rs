//! Quadrature on the unit simplex: `∫ f ≈ V Σ w_q f(λ_q)` with barycentric points λ_q, `Σ w_q = 1`.
//!
//! Fully symmetric rules with positive weights and inner points. An orbit of type (b, b, b, 1−3b) on
//! the tetrahedron, (b, b, 1−2b) on the triangle, is given by `b`.

/// ∫ over a tetrahedron, exact for cubics: the orbits `b` of 4 points each, and each point's weight.
/// Named by orbit because sums over an orbit share factors (see `phase::profile`).
pub const TETRAHEDRON_CUBIC: [(f64, f64); 2] = [
    (0.328_054_696_711_426_6, 0.138_527_966_511_862_14),
    (0.106_952_273_932_930_68, 0.111_472_033_488_137_86),
];

/// ∫ over a triangle, exact for quartics: 6 points (λ, weight).
pub const TRIANGLE_QUARTIC: [([f64; 3], f64); 6] = {
    const A: f64 = 0.445_948_490_915_964_9;
    const B: f64 = 0.091_576_213_509_770_74;
    const WA: f64 = 0.223_381_589_678_011_47;
    const WB: f64 = 0.109_951_743_655_321_87;
    [
        ([A, A, 1.0 - 2.0 * A], WA),
        ([A, 1.0 - 2.0 * A, A], WA),
        ([1.0 - 2.0 * A, A, A], WA),
        ([B, B, 1.0 - 2.0 * B], WB),
        ([B, 1.0 - 2.0 * B, B], WB),
        ([1.0 - 2.0 * B, B, B], WB),
    ]
};

#[cfg(test)]
mod tests {
    use super::*;

    fn factorial(n: i32) -> f64 {
        (1..=n).map(f64::from).product()
    }

    #[test]
    fn tetrahedron_cubic_is_exact_for_every_monomial_of_degree_3() {
        for p in 0i32..256 {
            let p = [p & 3, p >> 2 & 3, p >> 4 & 3, p >> 6];
            if p.iter().sum::<i32>() > 3 {
                continue;
            }
            let exact = 6.0 * p.iter().map(|&k| factorial(k)).product::<f64>()
                / factorial(p.iter().sum::<i32>() + 3);
            let mut sum = 0.0;
            for (b, w) in TETRAHEDRON_CUBIC {
                for k in 0..4 {
                    let at: f64 = (0..4)
                        .map(|i| (if i == k { 1.0 - 3.0 * b } else { b }).powi(p[i]))
                        .product();
                    sum += w * at;
                }
            }
            assert!((sum - exact).abs() < 1e-15, "{p:?}: {sum} {exact}");
        }
    }

    #[test]
    fn triangle_quartic_is_exact_for_every_monomial_of_degree_4() {
        for p in 0i32..125 {
            let p = [p % 5, p / 5 % 5, p / 25];
            if p.iter().sum::<i32>() > 4 {
                continue;
            }
            let exact = 2.0 * p.iter().map(|&k| factorial(k)).product::<f64>()
                / factorial(p.iter().sum::<i32>() + 2);
            let sum: f64 = TRIANGLE_QUARTIC
                .iter()
                .map(|(l, w)| w * (0..3).map(|i| l[i].powi(p[i])).product::<f64>())
                .sum();
            assert!((sum - exact).abs() < 1e-15, "{p:?}: {sum} {exact}");
        }
    }
}
