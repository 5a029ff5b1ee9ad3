//! What one element adds to a step's linear system: SUPG/PSPG/LSIC on P1/P1, Crank-Nicolson [5].
//!
//! Unknowns `u = uⁿ⁺¹`, `p = pⁿ⁺½`; `u_θ = θ u + (1−θ) uⁿ`, `a` the velocity extrapolated to n+½:
//!
//! ```text
//!     ∫ w·ρ( (u−uⁿ)/Δt + a·∇u_θ ) + ∫ 2με(w):ε(u_θ) − ∫ p ∇·w + ∫ q ∇·u
//!     + ∫ τ { a·∇w + ∇q/ρ }·R + ∫ τ_c ρ ∇·w ∇·u = ∫ w·F,
//!     R = ρ( (u−uⁿ)/Δt + a·∇u_θ ) + ∇p − F − 2ε(u_θ)∇μ.
//! ```
//!
//! The fine-scale velocity `u' = (τ/ρ) R` makes `u − u'` divergence-free against every P1 function:
//! `∫ q ∇·u + ∫ ∇q·u' = 0` is the continuity equation of this very form.

use super::material::ElementMaterial;
use super::stabilisation::{tau, tau_c};
use crate::fem::tetrahedron::Tetrahedron;
use crate::fem::{dot, norm};

/// One element's known data.
#[derive(Clone, Copy, Debug)]
pub struct Element {
    /// Gradients and volume.
    pub geometry: Tetrahedron,
    /// Density, viscosity, gravity.
    pub material: ElementMaterial,
    /// uⁿ at the corners [m/s].
    pub u: [[f64; 3]; 4],
    /// Advecting velocity at n+½ at the corners [m/s].
    pub a: [[f64; 3]; 4],
    /// Time step [s].
    pub dt: f64,
    /// Weight of n+1: ½ Crank-Nicolson, 1 implicit Euler.
    pub theta: f64,
}

/// An element's 4×4 blocks and right-hand side; row and column 3 of a block are continuity and
/// pressure.
#[derive(Clone, Copy, Debug)]
pub struct ElementSystem {
    /// `matrix[4 i + j]`: block of test node i, trial node j.
    pub matrix: [[[f64; 4]; 4]; 16],
    /// Of test node i.
    pub rhs: [[f64; 4]; 4],
    /// Pressure operator `∫ ((Δt_eff + τ)/ρ) ∇N_i·∇N_j` for the preconditioner.
    pub pressure: [f64; 16],
}

struct Parameters {
    a: [f64; 3],
    tau: f64,
    tau_c: f64,
    speed: f64,
    h: f64,
}

impl Element {
    #[inline]
    fn parameters(&self) -> Parameters {
        let a: [f64; 3] = std::array::from_fn(|k| 0.25 * (0..4).map(|i| self.a[i][k]).sum::<f64>());
        let nu = self.material.mu / self.material.rho;
        let (speed, h) = (norm(a), self.geometry.size());
        Parameters { a, tau: tau(self.dt, speed, h, nu), tau_c: tau_c(speed, h, nu), speed, h }
    }

    /// Matrix, right-hand side and pressure operator.
    #[inline]
    pub fn system(&self) -> ElementSystem {
        let Element { geometry, material, u, a, dt, theta } = self;
        let (grad, v) = (&geometry.grad, geometry.volume);
        let ElementMaterial { rho, mu, grad_mu, force } = *material;
        let Parameters { a: am, tau, tau_c, speed, h } = self.parameters();
        let old = 1.0 - theta;

        // What is known of R: everything with uⁿ, and the force.
        let du: [[f64; 3]; 3] =
            std::array::from_fn(|k| geometry.gradient(std::array::from_fn(|i| u[i][k])));
        let mut known = [0.0; 3];
        for k in 0..3 {
            let mean = 0.25 * (u[0][k] + u[1][k] + u[2][k] + u[3][k]);
            let f = 0.25 * (force[0][k] + force[1][k] + force[2][k] + force[3][k]);
            let two_eps: [f64; 3] = std::array::from_fn(|b| du[k][b] + du[b][k]);
            known[k] = rho * (-mean / dt + old * dot(am, du[k])) - f - old * dot(two_eps, grad_mu);
        }

        let s = grad.map(|g| dot(am, g));
        let g_mu = grad.map(|g| dot(grad_mu, g));
        let sum_a: [f64; 3] = std::array::from_fn(|k| a[0][k] + a[1][k] + a[2][k] + a[3][k]);
        let sum_u: [f64; 3] = std::array::from_fn(|k| u[0][k] + u[1][k] + u[2][k] + u[3][k]);
        let pspg = tau / rho * v;
        let supg = tau * v;
        let lsic = tau_c * rho * v;
        let visc = theta * mu * v;
        let mass = rho * v / (20.0 * dt);
        let dt_eff = 1.0 / (1.0 / dt + 2.0 * theta * speed / h);
        let laplace = (dt_eff + tau) / rho * v;

        let mut system =
            ElementSystem { matrix: [[[0.0; 4]; 4]; 16], rhs: [[0.0; 4]; 4], pressure: [0.0; 16] };
        for i in 0..4 {
            let gi = &grad[i];
            // ∫N_i a
            let ai: [f64; 3] = std::array::from_fn(|k| v / 20.0 * (sum_a[k] + a[i][k]));
            for k in 0..3 {
                let two_eps: [f64; 3] = std::array::from_fn(|b| du[k][b] + du[b][k]);
                system.rhs[i][k] = mass * (sum_u[k] + u[i][k])
                    - old * (rho * dot(ai, du[k]) + mu * v * dot(two_eps, *gi))
                    + 0.25 * v * force[i][k]
                    - supg * s[i] * known[k];
            }
            system.rhs[i][3] = -pspg * dot(*gi, known);
            for j in 0..4 {
                let gj = &grad[j];
                let gg = dot(*gi, *gj);
                let same = if i == j { 2.0 } else { 1.0 };
                // The trial function in R, without ∇μ's second part: ρ(N_j/Δt + θ a·∇N_j) − θ∇N_j·∇μ.
                let r = rho * (0.25 / dt + theta * s[j]) - theta * g_mu[j];
                let scalar = mass * same + theta * rho * dot(ai, *gj) + supg * s[i] * r + visc * gg;
                let block = &mut system.matrix[4 * i + j];
                for k in 0..3 {
                    for b in 0..3 {
                        block[k][b] = visc * gi[b] * gj[k] + lsic * gi[k] * gj[b]
                            - supg * s[i] * theta * gj[k] * grad_mu[b];
                    }
                    block[k][k] += scalar;
                    block[k][3] = -0.25 * v * gi[k] + supg * s[i] * gj[k];
                    block[3][k] = 0.25 * v * gj[k] + pspg * (gi[k] * r - theta * gg * grad_mu[k]);
                }
                block[3][3] = pspg * gg;
                system.pressure[4 * i + j] = laplace * gg;
            }
        }
        system
    }

    /// u' = (τ/ρ) R at the centroid, after the solve [m/s].
    #[inline]
    pub fn fine_scale(&self, u_new: &[[f64; 3]; 4], p: &[f64; 4]) -> [f64; 3] {
        let Parameters { a, tau, .. } = self.parameters();
        let ElementMaterial { rho, grad_mu, force, .. } = self.material;
        let grad_p = self.geometry.gradient(*p);
        let theta = self.theta;
        let du: [[f64; 3]; 3] = std::array::from_fn(|k| {
            self.geometry.gradient(std::array::from_fn(|i| {
                theta * u_new[i][k] + (1.0 - theta) * self.u[i][k]
            }))
        });
        std::array::from_fn(|k| {
            let change: f64 = (0..4).map(|i| u_new[i][k] - self.u[i][k]).sum::<f64>() * 0.25;
            let f: f64 = (0..4).map(|i| force[i][k]).sum::<f64>() * 0.25;
            let two_eps: [f64; 3] = std::array::from_fn(|b| du[k][b] + du[b][k]);
            tau / rho
                * (rho * (change / self.dt + dot(a, du[k])) + grad_p[k] - f - dot(two_eps, grad_mu))
        })
    }

    /// ∫ ½ρ u² of nodal velocities [J].
    #[inline]
    pub fn kinetic_energy(&self, u: &[[f64; 3]; 4]) -> f64 {
        let mut square = 0.0;
        for k in 0..3 {
            let sum = u[0][k] + u[1][k] + u[2][k] + u[3][k];
            square += sum * sum + u.iter().map(|u| u[k] * u[k]).sum::<f64>();
        }
        0.5 * self.material.rho * self.geometry.volume / 20.0 * square
    }

    /// −∫ ρ g·x [J].
    #[inline]
    pub fn potential_energy(&self, x: &[[f64; 3]; 4], g: [f64; 3]) -> f64 {
        let height: f64 = x.iter().map(|&x| -dot(g, x)).sum::<f64>() * 0.25;
        self.material.rho * self.geometry.volume * height
    }
}
