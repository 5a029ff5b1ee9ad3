//! The velocity of a structure's surface, imposed weakly on the wall in a cut element (METHOD.md, 5).
//!
//! Nitsche's method, n out of the fluid, ū the surface's velocity:
//!
//! ```text
//!     no-slip   − ∮ w·σn + ∮ (u−ū)·2με(w)n − ∮ q (u−ū)·n + ∮ β_t (u−ū)·w + ∮ β_n (u−ū)·n w·n
//!     slip      the same of normal components alone: − ∮ (w·n) n·σn + ∮ (u−ū)·n n·2με(w)n − …
//!     β_t = 2 μA/V + ½ρ|a−ū|,   β_n = ½ρh/Δt,      A area of the wall, V volume of the whole element
//! ```
//!
//! and on a slip wall β_t acts on the normal component. Traction is taken when the volume's is: viscosity at
//! n+θ, pressure at n+½; what constrains, at n+1. The paper's variant is `∮ p̄ (u−ū)·w` alone.
//!
//! The adjoint term has the sign that makes the viscous terms skew (Freund & Stenberg 1995; Burman 2012): the
//! form is coercive for every β > 0 and every cut. With the other sign, two cylinders (R/h = 16, torque) need
//! β_t ≥ 20 to 30 μ/h to be stable at all, and err by 1.1e-3 where this one, with 6 μA/V, errs by 1.6e-4.
//!
//! Of 1, 2 and 6 times μA/V, 2 is best: more holds the velocity of all corners of cut elements to that of the wall, as if
//! it stood where they are. The drag of a sphere in a stream (Re 32, eight, ten, 12 elements across, over that of 24) is
//! then 1.06, 1.04, 1.03 with 6, and 0.98, 0.98, 1.00 with 1, which leaves traction of first order; the torque between
//! cylinders (12 elements a radius) errs by +1.3e-3 with 6, by −1.2e-3 with 2.
//!
//! These terms, summed over the rows of an element, are what the fluid does to the body: with w a rigid motion
//! the adjoint term vanishes and the others are the wall's reaction, exactly as the discrete momentum has it.

use super::weak_form::{Element, ElementSystem, unknowns};
use crate::cut::tetrahedron::Pieces;
use crate::cut::{Motion, Surface, Wall};
use crate::fem::region::Region;
use crate::fem::{dot, norm};

/// Of μA/V.
const VISCOUS: f64 = 2.0;
/// Of ρ|u| and of ρh/Δt.
const INERTIA: f64 = 0.5;

/// How walls are imposed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// Nitsche's.
    Nitsche,
    /// The paper's, with this p̄ [Pa s/m].
    Penalty(f64),
}

/// The wall in a cut element.
#[derive(Clone, Copy, Debug)]
pub struct WallElement<'a> {
    /// The element's known data.
    pub element: &'a Element,
    /// Its wall.
    pub pieces: &'a Pieces,
    /// Whose it is.
    pub surface: &'a Surface,
    /// Places of the corners [m].
    pub x: &'a [[f64; 3]; 4],
    /// How it is imposed.
    pub method: Method,
    /// The flow through the wall, `∮ q ū·n`, is in the continuity equation as the volume that it sweeps.
    pub swept: bool,
}

impl WallElement<'_> {
    /// ū at the corners: a rigid motion is linear.
    fn velocity(&self) -> [[f64; 3]; 4] {
        let motion: &Motion = &self.surface.motion;
        self.x.map(|x| motion.at(x))
    }

    /// [β_t, β_n].
    fn beta(&self, velocity: &[[f64; 3]; 4]) -> [f64; 2] {
        if let Method::Penalty(p) = self.method {
            return [p, 0.0];
        }
        let Element { geometry, material, a, dt, .. } = self.element;
        let h = geometry.size();
        let past: [[f64; 3]; 4] =
            std::array::from_fn(|i| std::array::from_fn(|k| a[i][k] - velocity[i][k]));
        let speed = norm(self.pieces.wall.mean(&past));
        let viscous = VISCOUS * material.mu * self.pieces.wall.size / geometry.volume;
        [viscous + INERTIA * material.rho * speed, INERTIA * material.rho * h / dt]
    }

    /// Adds the wall to the element's system, where `x` are the unknowns.
    pub fn add(&self, x: &[[f64; 4]; 4], system: &mut ElementSystem) {
        if self.pieces.wall.size > 0.0 {
            let velocity = self.velocity();
            self.terms(&velocity, self.beta(&velocity), x, system);
        }
    }

    fn terms(
        &self,
        velocity: &[[f64; 3]; 4],
        beta: [f64; 2],
        x: &[[f64; 4]; 4],
        system: &mut ElementSystem,
    ) {
        let Element { geometry, material, u, theta, .. } = self.element;
        let Pieces { wall, normal: n, .. } = self.pieces;
        let consistent = if self.method == Method::Nitsche { 1.0 } else { 0.0 };
        let mu = consistent * material.mu;
        let old = 1.0 - theta;
        let slip = self.surface.wall == Wall::Slip;
        // T_j u_j is 2ε(u)n of the shape function j; on a slip wall its normal part.
        let traction = geometry.grad.map(|g| {
            let gn = dot(g, *n);
            let t: [[f64; 3]; 3] = std::array::from_fn(|k| {
                std::array::from_fn(|b| {
                    if slip {
                        2.0 * gn * n[k] * n[b]
                    } else {
                        g[k] * n[b] + if k == b { gn } else { 0.0 }
                    }
                })
            });
            t
        });
        let [along, across] = if slip { [0.0, beta[0] + beta[1]] } else { beta };
        let sum = wall.integral(velocity);
        for i in 0..4 {
            let s = wall.first[i];
            let v = wall.weighted(i, velocity);
            let vn = dot(v, *n);
            let mut rhs = [0.0; 4];
            for k in 0..3 {
                // Adjoint: 2ε(w)n is the transpose.
                let adjoint: f64 = (0..3).map(|b| traction[i][b][k] * sum[b]).sum();
                let known: f64 = (0..4).map(|j| dot(traction[j][k], u[j])).sum();
                rhs[k] = along * v[k] + across * vn * n[k] + mu * adjoint + old * mu * s * known;
            }
            if !self.swept {
                rhs[3] = -consistent * vn;
            }
            for k in 0..4 {
                system.rhs[i][k] += rhs[k];
                system.left[i][k] += rhs[k];
            }
            for j in 0..4 {
                let m = wall.second[i][j];
                let mut block = [[0.0; 4]; 4];
                for k in 0..3 {
                    for b in 0..3 {
                        block[k][b] = across * m * n[k] * n[b]
                            + mu * (wall.first[j] * traction[i][b][k]
                                - theta * s * traction[j][k][b]);
                    }
                    block[k][k] += along * m;
                    block[k][3] = consistent * m * n[k];
                    block[3][k] = -consistent * m * n[k];
                }
                for (k, row) in block.iter().enumerate() {
                    for c in 0..4 {
                        system.left[i][k] -= row[c] * x[j][c];
                        system.matrix[4 * i + j][k][c] += row[c] as f32;
                    }
                }
            }
        }
    }

    /// Force on the body in each corner's momentum equation [N], after the solve: the reaction of the weak
    /// form, and the part of it that is traction σn.
    pub fn reaction(&self, u: &[[f64; 3]; 4], p: &[f64; 4]) -> [[[f64; 3]; 4]; 2] {
        let velocity = self.velocity();
        let of = |method: Method, beta: [f64; 2]| {
            let mut system = ElementSystem::default();
            Self { method, ..*self }.terms(&velocity, beta, &unknowns(u, p), &mut system);
            std::array::from_fn(|i| system.momentum(i))
        };
        if self.pieces.wall.size == 0.0 {
            return [[[0.0; 3]; 4]; 2];
        }
        [of(self.method, self.beta(&velocity)), of(Method::Nitsche, [0.0; 2])]
    }
}
