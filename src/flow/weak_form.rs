//! What one element adds to a step's linear system: SUPG/PSPG/LSIC on P1/P1, Crank-Nicolson [5].
//!
//! Unknowns `u = uⁿ⁺¹`, `p = pⁿ⁺½`; `u_θ = θ u + (1−θ) uⁿ`, `a` the velocity extrapolated to n+½:
//!
//! ```text
//!     ∫ w·ρ( (u−uⁿ)/Δt + a·∇u_θ ) + ∫ 2με(w):ε(u_θ) − ∫ p ∇·w + ∫ q ∇·u
//!     + ∫ τ { a·∇w + ∇q/ρ }·R + ∫ τ_c ρ ∇·w ∇·u = ∫ w·F,
//!     R = ρ( (u−uⁿ)/Δt + a·∇u_θ ) + ∇p − F − 2ε(u_θ)∇μ − μ∇²uⁿ.
//! ```
//!
//! ∇²uⁿ is recovered from the neighbourhood (`viscous_force`).
//!
//! The fine-scale velocity `u' = (τ/ρ) R` makes `u − u'` divergence-free against every P1 function:
//! `∫ q ∇·u + ∫ ∇q·u' = 0` is the continuity equation of this very form.

use super::material::ElementMaterial;
use super::stabilisation::{tau, tau_c};
use crate::fem::region::Region;
use crate::fem::tetrahedron::Tetrahedron;
use crate::fem::{dot, norm};

/// One element's known data. Its `Region` is the part that is fluid.
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
    /// ∇²uⁿ, which linear functions have none of [1/(m s)].
    pub laplacian: [f64; 3],
    /// Time step [s].
    pub dt: f64,
    /// Weight of n+1: ½ Crank-Nicolson, 1 implicit Euler.
    pub theta: f64,
}

/// An element's 4×4 blocks and right-hand side; row and column 3 of a block are continuity and
/// pressure.
#[derive(Clone, Copy, Debug, Default)]
pub struct ElementSystem {
    /// `matrix[4 i + j]`: block of test node i, trial node j.
    pub matrix: [[[f64; 4]; 4]; 16],
    /// Of test node i.
    pub rhs: [[f64; 4]; 4],
    /// Pressure operator `∫ ((Δt_eff + τ)/ρ) ∇N_i·∇N_j` for the preconditioner.
    pub pressure: [f64; 16],
}

impl ElementSystem {
    /// What corner values `x` leave of the equations of test node `i`.
    #[inline]
    pub fn left(&self, i: usize, x: &[[f64; 4]; 4]) -> [f64; 4] {
        let mut left = self.rhs[i];
        for (block, x) in self.matrix[4 * i..4 * i + 4].iter().zip(x) {
            for (left, row) in left.iter_mut().zip(block) {
                *left -= (row[0] * x[0] + row[1] * x[1]) + (row[2] * x[2] + row[3] * x[3]);
            }
        }
        left
    }

    /// What node i's momentum rows leave of this solution, the other way round [N].
    pub fn momentum(&self, i: usize, u: &[[f64; 3]; 4], p: &[f64; 4]) -> [f64; 3] {
        let x = std::array::from_fn(|j| [u[j][0], u[j][1], u[j][2], p[j]]);
        let [a, b, c, _] = self.left(i, &x);
        [-a, -b, -c]
    }
}

/// What the terms of the momentum equations take [W].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Powers {
    /// ∫w·ρ(u−uⁿ)/Δt
    pub inertia: f64,
    /// ∫w·ρ a·∇u_θ
    pub convection: f64,
    /// ∫2με(w):ε(u_θ)
    pub viscous: f64,
    /// ∫τ a·∇w·R
    pub streamline: f64,
    /// ∫τ_c ρ ∇·w ∇·u
    pub divergence: f64,
    /// −∫p ∇·w
    pub pressure: f64,
    /// −∫w·F
    pub force: f64,
}

/// Vectors with a fourth entry each, so that a row of a block fills SIMD lanes.
#[inline]
fn lanes(v: [[f64; 3]; 4], last: [f64; 4]) -> [[f64; 4]; 4] {
    std::array::from_fn(|i| [v[i][0], v[i][1], v[i][2], last[i]])
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
    fn parameters(&self, fluid: &impl Region) -> Parameters {
        let a = fluid.mean(&self.a);
        let nu = self.material.mu / self.material.rho;
        let (speed, h) = (norm(a), self.geometry.size());
        Parameters {
            a,
            tau: tau(self.dt, speed, h, nu),
            tau_c: tau_c(self.dt, speed, h, nu),
            speed,
            h,
        }
    }

    /// Matrix, right-hand side and pressure operator, integrated over the fluid part, the pressure's
    /// stabilisation over the whole element: R is constant in it, and so every node has a pressure equation
    /// of ordinary size, however little fluid there is.
    #[inline]
    pub fn system(&self, fluid: &impl Region) -> ElementSystem {
        let Element { geometry, material, u, a, laplacian, dt, theta } = self;
        let (grad, v) = (&geometry.grad, fluid.volume());
        let ElementMaterial { rho, mu, grad_mu, force } = *material;
        let Parameters { a: am, tau, tau_c, speed, h } = self.parameters(fluid);
        let old = 1.0 - theta;

        // What is known of R: everything with uⁿ, and the force.
        let du: [[f64; 3]; 3] =
            std::array::from_fn(|k| geometry.gradient(std::array::from_fn(|i| u[i][k])));
        let mut known = [0.0; 3];
        let mean_u = fluid.mean(u);
        for k in 0..3 {
            let mean = mean_u[k];
            let f = 0.25 * (force[0][k] + force[1][k] + force[2][k] + force[3][k]);
            let two_eps: [f64; 3] = std::array::from_fn(|b| du[k][b] + du[b][k]);
            known[k] = rho * (-mean / dt + old * dot(am, du[k]))
                - f
                - old * dot(two_eps, grad_mu)
                - mu * laplacian[k];
        }

        let s = grad.map(|g| dot(am, g));
        let g_mu = grad.map(|g| dot(grad_mu, g));
        // Mean of each shape function.
        let share: [f64; 4] = std::array::from_fn(|i| fluid.first(i) / v);
        let pspg = tau / rho * geometry.volume;
        let supg = tau * v;
        let lsic = tau_c * rho * v;
        let visc = theta * mu * v;
        let mass = rho / dt;
        let dt_eff = 1.0 / (1.0 / dt + 2.0 * theta * speed / h);
        let laplace = dt_eff / rho * v + pspg;

        // What multiplies ∂N_i/∂x_k in row k of block (i, j); what stands in its continuity row, ∇N_i·∇N_j times the last.
        let trial =
            lanes(grad.map(|g| g.map(|g| lsic * g)), std::array::from_fn(|j| -fluid.first(j)));
        let along = lanes(*grad, [0.0; 4]);
        let bent = grad_mu.map(|g| -theta * g);
        let continuity = [pspg * bent[0], pspg * bent[1], pspg * bent[2], pspg];

        let mut system = ElementSystem::default();
        for i in 0..4 {
            let gi = &grad[i];
            // ∫N_i a
            let ai = fluid.weighted(i, a);
            let ui = fluid.weighted(i, u);
            let weight = fluid.first(i);
            for k in 0..3 {
                let two_eps: [f64; 3] = std::array::from_fn(|b| du[k][b] + du[b][k]);
                system.rhs[i][k] = mass * ui[k]
                    - old * (rho * dot(ai, du[k]) + mu * v * dot(two_eps, *gi))
                    + weight * force[i][k]
                    - supg * s[i] * known[k];
            }
            system.rhs[i][3] = -pspg * dot(*gi, known);
            let streamline = supg * s[i];
            // What multiplies ∂N_j/∂x_k in row k.
            let mut test = [0.0, 0.0, 0.0, streamline];
            for k in 0..3 {
                test[k] = visc * gi[k] + streamline * bent[k];
            }
            for j in 0..4 {
                let gj = &grad[j];
                let gg = dot(*gi, *gj);
                // The trial function in R, without ∇μ's second part: ρ(N_j/Δt + θ a·∇N_j) − θ∇N_j·∇μ.
                let r = rho * (share[j] / dt + theta * s[j]) - theta * g_mu[j];
                let scalar = mass * fluid.second(i, j)
                    + theta * rho * dot(ai, *gj)
                    + streamline * r
                    + visc * gg;
                let block = &mut system.matrix[4 * i + j];
                for k in 0..3 {
                    for c in 0..4 {
                        block[k][c] = gj[k] * test[c] + gi[k] * trial[j][c];
                    }
                    block[k][k] += scalar;
                }
                for c in 0..4 {
                    block[3][c] =
                        weight * along[j][c] + pspg * r * along[i][c] + gg * continuity[c];
                }
                system.pressure[4 * i + j] = laplace * gg;
            }
        }
        system
    }

    /// u' = (τ/ρ) R at the centroid, after the solve [m/s]; in the continuity equation it acts over the
    /// whole element.
    #[inline]
    pub fn fine_scale(&self, fluid: &impl Region, u_new: &[[f64; 3]; 4], p: &[f64; 4]) -> [f64; 3] {
        let Parameters { a, tau, .. } = self.parameters(fluid);
        let ElementMaterial { rho, mu, grad_mu, force } = self.material;
        let grad_p = self.geometry.gradient(*p);
        let theta = self.theta;
        let du: [[f64; 3]; 3] = std::array::from_fn(|k| {
            self.geometry.gradient(std::array::from_fn(|i| {
                theta * u_new[i][k] + (1.0 - theta) * self.u[i][k]
            }))
        });
        let (new, old) = (fluid.mean(u_new), fluid.mean(&self.u));
        std::array::from_fn(|k| {
            let change = new[k] - old[k];
            let f: f64 = (0..4).map(|i| force[i][k]).sum::<f64>() * 0.25;
            let two_eps: [f64; 3] = std::array::from_fn(|b| du[k][b] + du[b][k]);
            tau / rho
                * (rho * (change / self.dt + dot(a, du[k])) + grad_p[k]
                    - f
                    - dot(two_eps, grad_mu)
                    - mu * self.laplacian[k])
        })
    }

    /// What each term of the momentum equations takes when they are tested with `w` [W], after the solve. Their sum
    /// is `w·(A x − b)`.
    pub fn powers(
        &self,
        fluid: &impl Region,
        w: &[[f64; 3]; 4],
        u_new: &[[f64; 3]; 4],
        p: &[f64; 4],
    ) -> Powers {
        let Parameters { a: am, tau_c, .. } = self.parameters(fluid);
        let ElementMaterial { rho, mu, force, .. } = self.material;
        let (theta, v) = (self.theta, fluid.volume());
        let gradient = |u: &[[f64; 3]; 4]| -> [[f64; 3]; 3] {
            std::array::from_fn(|k| self.geometry.gradient(u.map(|u| u[k])))
        };
        let mid = |i: usize, k: usize| theta * u_new[i][k] + (1.0 - theta) * self.u[i][k];
        let (dw, new) = (gradient(w), gradient(u_new));
        let du = gradient(&std::array::from_fn(|i| std::array::from_fn(|k| mid(i, k))));
        let divergence = |d: &[[f64; 3]; 3]| d[0][0] + d[1][1] + d[2][2];
        let fine_scale = self.fine_scale(fluid, u_new, p);
        let change: [[f64; 3]; 4] =
            std::array::from_fn(|i| std::array::from_fn(|k| u_new[i][k] - self.u[i][k]));
        let mut powers = Powers {
            divergence: tau_c * rho * v * divergence(&dw) * divergence(&new),
            pressure: -divergence(&dw) * (0..4).map(|j| fluid.first(j) * p[j]).sum::<f64>(),
            ..Powers::default()
        };
        for k in 0..3 {
            powers.streamline += v * rho * dot(am, dw[k]) * fine_scale[k];
            powers.viscous +=
                (0..3).map(|b| mu * v * dw[k][b] * (du[k][b] + du[b][k])).sum::<f64>();
        }
        for i in 0..4 {
            let along = fluid.weighted(i, &self.a);
            let convected = [0, 1, 2].map(|k| dot(along, du[k]));
            powers.inertia += rho / self.dt * dot(w[i], fluid.weighted(i, &change));
            powers.convection += rho * dot(w[i], convected);
            powers.force -= fluid.first(i) * dot(w[i], force[i]);
        }
        powers
    }

    /// ∫ ½ρ u² of nodal velocities [J].
    #[inline]
    pub fn kinetic_energy(&self, fluid: &impl Region, u: &[[f64; 3]; 4]) -> f64 {
        let square: f64 = (0..4).map(|i| dot(u[i], fluid.weighted(i, u))).sum();
        0.5 * self.material.rho * square
    }

    /// −∫ ρ g·x [J].
    #[inline]
    pub fn potential_energy(&self, fluid: &impl Region, x: &[[f64; 3]; 4], g: [f64; 3]) -> f64 {
        -self.material.rho * dot(g, fluid.integral(x))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::region::Whole;

    /// Tested with any w, the terms one by one are the rows all together.
    #[test]
    fn powers_add_up_to_the_system() {
        let mut seed = 0.3_f64;
        let mut any = || {
            seed = (seed * 97.31 + 0.177).fract();
            seed - 0.5
        };
        let mut vectors = || [0; 4].map(|_| [any(), any(), any()]);
        let x = [[0.1, 0.0, 0.2], [0.7, 0.1, 0.0], [0.2, 0.6, -0.1], [0.0, 0.3, 0.8]];
        let force = vectors();
        let material = ElementMaterial { rho: 7.0, mu: 0.3, grad_mu: [0.2, -0.1, 0.4], force };
        let geometry = Tetrahedron::new(x);
        let (u, a, w, new) = (vectors(), vectors(), vectors(), vectors());
        let p = vectors().map(|v| v[0]);
        let laplacian = [0.4, -0.2, 0.1];
        let element = Element { geometry, material, u, a, laplacian, dt: 0.07, theta: 0.5 };
        let fluid = Whole(geometry.volume);
        let system = element.system(&fluid);
        let mut rows = 0.0;
        for i in 0..4 {
            rows += dot(w[i], system.momentum(i, &new, &p));
        }
        let terms = element.powers(&fluid, &w, &new, &p);
        let Powers { inertia, convection, viscous, streamline, divergence, pressure, force } =
            terms;
        let sum = inertia + convection + viscous + streamline + divergence + pressure + force;
        assert!((sum - rows).abs() < 1e-12 * (inertia.abs() + viscous.abs()), "{sum}, not {rows}");
    }
}
