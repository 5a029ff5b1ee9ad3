//! The interface's profile inside an element: `φ* = φ_h + w (σ(ψ_h/δ) − φ_h)`, `σ(s) = 1/(1+e^{−s})`.
//!
//! P1 draws chords under a profile that is a few elements wide. The nodal values of
//! `ψ = δ ln(φ/(1−φ))`, interpolated linearly, give the profile its shape back (METHOD.md, 2). `w` fades
//! the correction out where it has no meaning: by a smoothstep of `q = min φ(1−φ)` over the nodes,
//! away from the interface, and by one of the range of ψ, in elements that are steeper than any
//! profile δ can make on this mesh (splashes thinner than an element).
//!
//! Quadrature without exponentials per element: at a point of an orbit (b, b, b, 1−3b),
//! `e^{−s} = Π_j e^{−b s_j} · e^{−(1−4b) s_k}`, a product of powers kept at the nodes.

use crate::fem::number::{Real, f64x4};
use crate::fem::quadrature::TETRAHEDRON_CUBIC;

/// φ(1−φ) below which an element or a node has no interface.
pub const OUTER: f64 = 1e-4;
/// −φ(1−φ), which is the overshoot, from which on it counts as one.
pub const OVERSHOOT: f64 = 0.002;
/// φ(1−φ) from which on it has one fully.
const INNER: f64 = 1e-3;
/// |ψ| ≤ CLIP δ.
const CLIP: f64 = 11.0;
/// Less than σ(−CLIP).
const LEAST: f64 = 1.6e-5;
/// Range of ψ/δ over an element where the profile correction begins to fade, and where it is gone.
const STEEP: [f64; 2] = [2.5, 4.0];

/// 0 for `x ≤ 0`, 1 for `x ≥ 1`, once differentiable.
#[inline]
pub fn smoothstep(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// w(q): 0 without interface, 1 with.
#[inline]
pub fn window(q: f64) -> f64 {
    smoothstep((q - OUTER) * (1.0 / (INNER - OUTER)))
}

/// ψ/δ, clipped.
#[inline]
pub fn logit(phi: f64) -> f64 {
    if phi < LEAST {
        -CLIP
    } else if phi > 1.0 - LEAST {
        CLIP
    } else {
        (phi / (1.0 - phi)).ln().clamp(-CLIP, CLIP)
    }
}

/// σ(s).
#[inline]
pub fn sigmoid(s: f64) -> f64 {
    1.0 / (1.0 + (-s).exp())
}

/// What elements ask of a node.
#[derive(Clone, Copy, Debug)]
pub struct Node<R = f64> {
    /// φ.
    pub phi: R,
    /// φ(1−φ).
    pub q: R,
    /// ψ/δ, clipped.
    pub s: R,
    /// e^{−b s} and e^{−(1−4b) s} of both orbits; NaN if they have not been asked for.
    powers: [R; 4],
}

/// Of no φ yet.
const UNKNOWN: Node = Node { phi: f64::NAN, q: 0.0, s: 0.0, powers: [f64::NAN; 4] };

fn powers_of(s: f64) -> [f64; 4] {
    let [(a, _), (b, _)] = TETRAHEDRON_CUBIC;
    [-a, 4.0 * a - 1.0, -b, 4.0 * b - 1.0].map(|e| (e * s).exp())
}

impl<R: Real> Node<R> {
    /// d(ψ/δ)/dφ; 0 where ψ is clipped.
    #[inline]
    pub fn ds(&self) -> R {
        R::of(CLIP).where_larger(self.s.larger(-self.s), R::of(1.0) / self.q, R::default())
    }
}

/// φ at the nodes, prepared for the element loops.
#[derive(Clone, Debug, Default)]
pub struct Profile {
    /// One for each local node.
    pub nodes: Vec<Node>,
    /// Where φ stands: a byte each, as loops over all elements ask for little else.
    place: Vec<Place>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Place {
    Pure,
    /// φ(1−φ) above `OUTER`.
    Band,
    /// φ outside [0, 1] by `OVERSHOOT`.
    Outside,
}

impl Profile {
    /// Of these nodal values; `powers` only if moments will be asked for.
    pub fn set(&mut self, phi: &[f64], powers: bool) {
        self.nodes.resize(phi.len(), UNKNOWN);
        self.place.resize(phi.len(), Place::Pure);
        let clipped = [powers_of(-CLIP), powers_of(CLIP)];
        for ((node, place), &phi) in self.nodes.iter_mut().zip(&mut self.place).zip(phi) {
            // Most of the mesh is all liquid or gas, and stays so.
            if node.phi == phi && !(powers && node.powers[0].is_nan()) {
                continue;
            }
            let (q, s) = (phi * (1.0 - phi), logit(phi));
            *place = match q {
                q if q > OUTER => Place::Band,
                q if q <= -OVERSHOOT => Place::Outside,
                _ => Place::Pure,
            };
            let powers = match s.abs() == CLIP {
                true => clipped[usize::from(s > 0.0)],
                false if powers => powers_of(s),
                false => [f64::NAN; 4],
            };
            *node = Node { phi, q, s, powers };
        }
    }

    /// The corners of four elements.
    #[inline(always)]
    pub fn corners(&self, tets: &[[u32; 4]; 4]) -> [Node<f64x4>; 4] {
        let zero = f64x4::default();
        let mut corners = [Node { phi: zero, q: zero, s: zero, powers: [zero; 4] }; 4];
        for (i, corner) in corners.iter_mut().enumerate() {
            let [a, b, c, d] = [0, 1, 2, 3].map(|l| &self.nodes[tets[l][i] as usize]);
            corner.phi = f64x4::from([a.phi, b.phi, c.phi, d.phi]);
            corner.q = f64x4::from([a.q, b.q, c.q, d.q]);
            corner.s = f64x4::from([a.s, b.s, c.s, d.s]);
            for k in 0..4 {
                let [a, b, c, d] = [a, b, c, d].map(|n| n.powers[k]);
                corner.powers[k] = f64x4::from([a, b, c, d]);
            }
        }
        corners
    }

    /// The element's nodes if the interface reaches it.
    #[inline]
    pub fn in_band(&self, tet: &[u32; 4]) -> Option<[&Node; 4]> {
        let inside = tet.iter().all(|&n| self.place[n as usize] == Place::Band);
        inside.then(|| tet.map(|n| &self.nodes[n as usize]))
    }

    /// Whether φ leaves [0, 1] at a node of the element.
    #[inline]
    pub fn overshoots(&self, tet: &[u32; 4]) -> bool {
        tet.iter().any(|&n| self.place[n as usize] == Place::Outside)
    }
}

/// Integrals over an element of unit volume.
#[derive(Clone, Copy, Debug)]
pub struct Moments<R = f64> {
    /// ∫ N_i (φ* − φ_h).
    pub excess: [R; 4],
    /// w ∫ σ(1−σ): `∫ ∇φ* = slope ∇ψ/δ + (1−w) ∇φ_h`.
    pub slope: R,
}

/// w of an element in the band.
#[inline]
pub fn profile_weight(n: [&Node; 4]) -> f64 {
    let q = n[0].q.min(n[1].q).min(n[2].q.min(n[3].q));
    let s = n.map(|n| n.s);
    let range = s[0].max(s[1]).max(s[2].max(s[3])) - s[0].min(s[1]).min(s[2].min(s[3]));
    window(q) * smoothstep((STEEP[1] - range) * (1.0 / (STEEP[1] - STEEP[0])))
}

/// σ at the four points of an orbit.
#[inline(always)]
fn sigma<R: Real>(n: [&Node<R>; 4], orbit: usize) -> [R; 4] {
    let p = n.map(|n| n.powers[2 * orbit]);
    let common = p[0] * p[1] * (p[2] * p[3]);
    n.map(|n| R::of(1.0) / (R::of(1.0) + common * n.powers[2 * orbit + 1]))
}

#[inline(always)]
fn total<R: Real>(v: [R; 4]) -> R {
    v[0] + v[1] + (v[2] + v[3])
}

/// Of an element with this w.
#[inline(always)]
pub fn moments<R: Real>(n: [&Node<R>; 4], w: R) -> Moments<R> {
    let of = R::of;
    // ∫ N_i σ, and ∫ σ(1−σ).
    let (mut value, mut slope) = ([R::default(); 4], R::default());
    for (o, (b, weight)) in TETRAHEDRON_CUBIC.into_iter().enumerate() {
        let sigma = sigma(n, o);
        let sum = of(weight * b) * total(sigma);
        for k in 0..4 {
            value[k] += sum + of(weight * (1.0 - 4.0 * b)) * sigma[k];
            slope += of(weight) * sigma[k] * (of(1.0) - sigma[k]);
        }
    }
    let chord = total(n.map(|n| n.phi));
    let excess = [0, 1, 2, 3].map(|i| w * (value[i] - of(1.0 / 20.0) * (chord + n[i].phi)));
    Moments { excess, slope: w * slope }
}

/// Derivatives of [`Moments`] by the nodal values.
#[derive(Clone, Copy, Debug)]
pub struct Tangent<R = f64> {
    /// ∂excess_i/∂φ_j.
    pub excess: [[R; 4]; 4],
    /// The slope itself.
    pub slope: R,
    /// ∂slope/∂φ_j.
    pub curvature: [R; 4],
}

/// At fixed w.
#[inline(always)]
pub fn tangent<R: Real>(n: [&Node<R>; 4], w: R) -> Tangent<R> {
    let of = R::of;
    let (mut excess, mut curvature) = ([[R::default(); 4]; 4], [R::default(); 4]);
    let mut slope = R::default();
    for (o, (b, weight)) in TETRAHEDRON_CUBIC.into_iter().enumerate() {
        let c = 1.0 - 4.0 * b;
        let sigma = sigma(n, o);
        let d = sigma.map(|sigma| of(weight) * sigma * (of(1.0) - sigma));
        let bent = [0, 1, 2, 3].map(|k| d[k] * (of(1.0) - of(2.0) * sigma[k]));
        let (sum, sum_bent) = (total(d), of(b) * total(bent));
        slope += sum;
        let (all, own) = (of(b * b) * sum, d.map(|d| of(b * c) * d));
        for i in 0..4 {
            curvature[i] += sum_bent + of(c) * bent[i];
            for j in 0..4 {
                excess[i][j] += all + (own[i] + own[j]);
            }
            excess[i][i] += of(c * c) * d[i];
        }
    }
    for j in 0..4 {
        let ds = n[j].ds();
        curvature[j] = w * ds * curvature[j];
        for i in 0..4 {
            let chord = of(if i == j { 0.1 } else { 0.05 });
            excess[i][j] = w * (excess[i][j] * ds - chord);
        }
    }
    Tangent { excess, slope: w * slope, curvature }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn element(s: [f64; 4]) -> Moments {
        let mut profile = Profile::default();
        profile.set(&s.map(sigmoid), true);
        {
            let nodes = profile.in_band(&[0, 1, 2, 3]).unwrap();
            moments(nodes, profile_weight(nodes))
        }
    }

    /// ∫ over the unit-volume tetrahedron by Gauss points of a collapsed cube, exact to degree 9.
    fn reference(f: impl Fn([f64; 4]) -> f64) -> f64 {
        let gauss = [
            (0.046_910_077_030_668, 0.118_463_442_528_094_5),
            (0.230_765_344_947_158_4, 0.239_314_335_249_683_2),
            (0.5, 0.284_444_444_444_444_4),
            (0.769_234_655_052_841_6, 0.239_314_335_249_683_2),
            (0.953_089_922_969_332, 0.118_463_442_528_094_5),
        ];
        let mut sum = 0.0;
        for (r, wr) in gauss {
            for (s, ws) in gauss {
                for (t, wt) in gauss {
                    let l = [1.0 - r, r * (1.0 - s), r * s * (1.0 - t), r * s * t];
                    sum += 6.0 * wr * ws * wt * r * r * s * f(l);
                }
            }
        }
        sum
    }

    #[test]
    fn moments_match_a_fine_quadrature() {
        for s in [[0.3, -0.2, 0.7, -0.9], [2.0, 1.2, 2.5, 3.1], [-1.0, -2.2, -0.4, -1.5]] {
            let m = element(s);
            let at = |l: [f64; 4]| sigmoid((0..4).map(|i| l[i] * s[i]).sum());
            for i in 0..4 {
                let exact = reference(|l| {
                    l[i] * (at(l) - (0..4).map(|j| l[j] * sigmoid(s[j])).sum::<f64>())
                });
                assert!((m.excess[i] - exact).abs() < 4e-5, "{} {exact}", m.excess[i]);
            }
            let exact = reference(|l| at(l) * (1.0 - at(l)));
            assert!((m.slope - exact).abs() < 2e-4 * exact, "{} {exact}", m.slope);
        }
    }

    #[test]
    fn the_tangent_is_the_derivative_of_the_moments() {
        let phi = [0.2, 0.45, 0.6, 0.31];
        let at = |phi: [f64; 4]| {
            let mut profile = Profile::default();
            profile.set(&phi, true);
            let nodes = std::array::from_fn(|i| &profile.nodes[i]);
            (moments(nodes, 0.7), tangent(nodes, 0.7))
        };
        let (m, t) = at(phi);
        assert!((t.slope - m.slope).abs() < 1e-15);
        for j in 0..4 {
            let shifted =
                |by: f64| at(std::array::from_fn(|i| phi[i] + if i == j { by } else { 0.0 })).0;
            let (plus, minus) = (shifted(1e-5), shifted(-1e-5));
            let difference = (plus.slope - minus.slope) / 2e-5;
            assert!((t.curvature[j] - difference).abs() < 1e-9, "{t:?} {difference}");
            for i in 0..4 {
                let difference = (plus.excess[i] - minus.excess[i]) / 2e-5;
                assert!((t.excess[i][j] - difference).abs() < 1e-9, "{t:?} {difference}");
            }
        }
    }

    #[test]
    fn a_constant_has_no_excess_and_a_distant_element_no_moments() {
        let m = element([0.4; 4]);
        assert!(m.excess.iter().all(|x| x.abs() < 1e-16));
        let mut profile = Profile::default();
        profile.set(&[1.0, 0.5, -1e-9, 1.0 + 1e-9], true);
        assert!(profile.in_band(&[0, 1, 2, 3]).is_none());
        assert!(profile.in_band(&[1, 1, 1, 1]).is_some());
    }

    #[test]
    fn logit_is_clipped_at_both_ends() {
        assert_eq!(logit(0.0), -CLIP);
        assert_eq!(logit(-0.3), -CLIP);
        assert_eq!(logit(1.0), CLIP);
        assert_eq!(logit(1.2), CLIP);
        assert!((sigmoid(logit(0.3)) - 0.3).abs() < 1e-15);
    }
}
