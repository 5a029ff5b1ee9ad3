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
use crate::fem::number::{Real, f32x4, f64x4};
use crate::fem::region::Region;
use crate::fem::tetrahedron::Tetrahedron;
use crate::fem::{dot, norm};

/// One element's known data, or that of four. Its `Region` is the part that is fluid.
#[derive(Clone, Copy, Debug)]
pub struct Element<R = f64> {
    /// Gradients and volume.
    pub geometry: Tetrahedron<R>,
    /// Density, viscosity, gravity.
    pub material: ElementMaterial<R>,
    /// uⁿ at the corners [m/s].
    pub u: [[R; 3]; 4],
    /// Advecting velocity at n+½ at the corners [m/s].
    pub a: [[R; 3]; 4],
    /// ∇²uⁿ, which linear functions have none of [1/(m s)].
    pub laplacian: [R; 3],
    /// Time step [s].
    pub dt: f64,
    /// The time step that τ and τ_c are of [s].
    pub dt_tau: f64,
    /// Weight of n+1: ½ Crank-Nicolson, 1 implicit Euler.
    pub theta: f64,
}

/// What an element adds to the equations: what some solution x leaves of them, in double precision, and the matrix of
/// its change, in single. Row and column 3 of a block are continuity and pressure.
#[derive(Clone, Copy, Debug, Default)]
pub struct ElementSystem<R: Real = f64> {
    /// What test node i's rows hold against: inertia of uⁿ and force; of continuity, all that is known.
    pub rhs: [[R; 4]; 4],
    /// What x leaves of them.
    pub left: [[R; 4]; 4],
    /// `matrix[4 i + j]`: block of test node i, trial node j.
    pub matrix: [[[R::Single; 4]; 4]; 16],
    /// Pressure operator `∫ ((Δt_eff + τ)/ρ) ∇N_i·∇N_j` for the preconditioner.
    pub pressure: [R::Single; 16],
}

impl ElementSystem {
    /// What node i's momentum rows leave of the solution, the other way round [N].
    pub fn momentum(&self, i: usize) -> [f64; 3] {
        let [a, b, c, _] = self.left[i];
        [-a, -b, -c]
    }
}

impl ElementSystem<f64x4> {
    /// Each one's, with or without matrix.
    #[inline]
    pub fn unpacked(&self, matrix: bool, four: &mut [ElementSystem; 4]) {
        for i in 0..4 {
            let [rhs, left] = [self.rhs[i], self.left[i]].map(f64x4::transpose);
            for (e, system) in four.iter_mut().enumerate() {
                system.rhs[i] = rhs[e].to_array();
                system.left[i] = left[e].to_array();
            }
        }
        if !matrix {
            return;
        }
        for (at, block) in self.matrix.iter().enumerate() {
            for (r, row) in block.iter().enumerate() {
                for (system, row) in four.iter_mut().zip(f32x4::transpose(*row)) {
                    system.matrix[at][r] = row.to_array();
                }
            }
            for (system, pressure) in four.iter_mut().zip(self.pressure[at].to_array()) {
                system.pressure[at] = pressure;
            }
        }
    }
}

/// Values of the unknowns at an element's corners.
#[inline]
pub fn unknowns(u: &[[f64; 3]; 4], p: &[f64; 4]) -> [[f64; 4]; 4] {
    std::array::from_fn(|j| [u[j][0], u[j][1], u[j][2], p[j]])
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

struct Parameters<R> {
    a: [R; 3],
    tau: R,
    tau_c: R,
    speed: R,
    h: R,
}

/// Σ n_b ∂u/∂x_b
#[inline]
fn along<R: Real>(n: [R; 3], du: &[[R; 3]; 3]) -> [R; 3] {
    [0, 1, 2].map(|k| dot(n, du[k]))
}

/// (∇u + ∇uᵀ) n
#[inline]
fn two_eps<R: Real>(n: [R; 3], du: &[[R; 3]; 3]) -> [R; 3] {
    [0, 1, 2].map(|k| dot(n, du[k]) + dot(n, [du[0][k], du[1][k], du[2][k]]))
}

impl<R: Real> Element<R> {
    #[inline]
    fn parameters(&self, fluid: &impl Region<R>) -> Parameters<R> {
        let a = fluid.mean(&self.a);
        let nu = self.material.mu / self.material.rho;
        let (speed, h) = (norm(a), self.geometry.size());
        Parameters {
            a,
            tau: tau(self.dt_tau, speed, h, nu),
            tau_c: tau_c(self.dt_tau, speed, h, nu),
            speed,
            h,
        }
    }

    /// What `x` leaves of the equations, matrix and pressure operator, integrated over the fluid part, the pressure's
    /// stabilisation over the whole element: R is constant in it, and so every node has a pressure equation
    /// of ordinary size, however little fluid there is.
    ///
    /// Without `matrix` the rows alone.
    #[inline]
    pub fn system(
        &self,
        fluid: &impl Region<R>,
        x: &[[R; 4]; 4],
        matrix: bool,
        system: &mut ElementSystem<R>,
    ) {
        let parameters = self.parameters(fluid);
        self.rows(fluid, &parameters, x, system);
        if matrix {
            self.matrix(fluid, &parameters, system);
        }
    }

    /// `rhs` and `left`.
    #[inline]
    fn rows(
        &self,
        fluid: &impl Region<R>,
        parameters: &Parameters<R>,
        x: &[[R; 4]; 4],
        system: &mut ElementSystem<R>,
    ) {
        let Element { geometry, material, u, a, laplacian, dt, theta, .. } = self;
        let (grad, v) = (&geometry.grad, fluid.volume());
        let ElementMaterial { rho, mu, grad_mu, force } = *material;
        let Parameters { a: am, tau, tau_c, .. } = *parameters;
        let (new, old) = (R::of(*theta), R::of(1.0 - theta));
        let pspg = tau / rho * geometry.volume;
        let supg = tau * v;
        let (mass, viscous) = (rho * R::of(1.0 / dt), mu * v);

        let velocity = x.map(|[u, v, w, _]| [u, v, w]);
        let change =
            [0, 1, 2, 3].map(|i: usize| [0, 1, 2].map(|k: usize| velocity[i][k] - u[i][k]));
        let gradient =
            |u: &[[R; 3]; 4]| [0, 1, 2].map(|k| geometry.gradient([0, 1, 2, 3].map(|i| u[i][k])));
        let (d_old, d_new) = (gradient(u), gradient(&velocity));
        let grad_p = geometry.gradient(x.map(|x| x[3]));
        // ∇u_θ
        let du = [0, 1, 2]
            .map(|k: usize| [0, 1, 2].map(|b: usize| new * d_new[k][b] + old * d_old[k][b]));
        // R: what is known, everything with uⁿ, and the force; and all of it.
        let moved = |d: &[[R; 3]; 3]| {
            let (along, bent) = (along(am, d), two_eps(grad_mu, d));
            [0, 1, 2].map(|k| rho * along[k] - bent[k])
        };
        let (mean, moved_old, moved) = (fluid.mean(u), moved(&d_old), moved(&du));
        let mean_change = fluid.mean(&change);
        let given = [0, 1, 2].map(|k| {
            let f = R::of(0.25) * (force[0][k] + force[1][k] + (force[2][k] + force[3][k]));
            -f - mu * laplacian[k]
        });
        let known = [0, 1, 2].map(|k| old * moved_old[k] - mass * mean[k] + given[k]);
        let residual = [0, 1, 2].map(|k| moved[k] + mass * mean_change[k] + grad_p[k] + given[k]);
        let divergence = d_new[0][0] + d_new[1][1] + d_new[2][2];
        let pressure = (fluid.first(0) * x[0][3] + fluid.first(1) * x[1][3])
            + (fluid.first(2) * x[2][3] + fluid.first(3) * x[3][3]);
        let isotropic = tau_c * rho * v * divergence - pressure;

        let ElementSystem { rhs, left, .. } = system;
        for i in 0..4 {
            let (gi, weight) = (grad[i], fluid.first(i));
            // ∫N_i a
            let ai = fluid.weighted(i, a);
            let streamline = supg * dot(am, gi);
            let (was, gained) = (fluid.weighted(i, u), fluid.weighted(i, &change));
            let (along, bent) = (along(ai, &du), two_eps(gi, &du));
            for k in 0..3 {
                let force = weight * force[i][k];
                rhs[i][k] = mass * was[k] + force;
                left[i][k] = force
                    - mass * gained[k]
                    - (rho * along[k] + viscous * bent[k])
                    - (streamline * residual[k] + gi[k] * isotropic);
            }
            rhs[i][3] = -pspg * dot(gi, known);
            left[i][3] = -(weight * divergence + pspg * dot(gi, residual));
        }
    }

    /// `matrix`, which is the derivative of −`left` by x, and `pressure`.
    #[inline]
    fn matrix(
        &self,
        fluid: &impl Region<R>,
        parameters: &Parameters<R>,
        system: &mut ElementSystem<R>,
    ) {
        let Element { geometry, material, a, dt, theta, .. } = self;
        let (grad, v) = (&geometry.grad, fluid.volume());
        let ElementMaterial { rho, mu, grad_mu, .. } = *material;
        let Parameters { a: am, tau, tau_c, speed, h } = *parameters;
        let n = R::of;
        let s = grad.map(|g| dot(am, g));
        let pspg = tau / rho * geometry.volume;
        let (mass, rho_theta) = (rho * n(1.0 / dt), rho * n(*theta));
        let dt_eff = n(1.0) / (n(1.0 / dt) + n(2.0 * theta) * speed / h);
        let laplace = (dt_eff / rho * v + pspg).single();
        let bent = grad_mu.map(|g| n(-theta) * g);
        let share = n(1.0) / v;
        // The trial function in R, without ∇μ's second part: ρ(N_j/Δt + θ a·∇N_j) − θ∇N_j·∇μ.
        let trial = [0, 1, 2, 3].map(|j| {
            (mass * share * fluid.first(j) + rho_theta * s[j] + dot(bent, grad[j])).single()
        });
        let first = [0, 1, 2, 3].map(|j| fluid.first(j).single());
        let streamline = s.map(|s| (tau * v * s).single());
        let carried = [0, 1, 2, 3].map(|i| fluid.weighted(i, a).map(|a| (rho_theta * a).single()));
        let gradient = grad.map(|g| g.map(R::single));
        let bent = bent.map(R::single);
        let (pspg, mass) = (pspg.single(), mass.single());
        let viscous = (n(*theta) * mu * v).single();
        let lsic = (tau_c * rho * v).single();

        let ElementSystem { matrix, pressure, .. } = system;
        for i in 0..4 {
            let gi = gradient[i];
            // What multiplies ∂N_j/∂x_k in column c of row k: from 2με, and from SUPG with ∇μ.
            let test = [0, 1, 2].map(|c| viscous * gi[c] + streamline[i] * bent[c]);
            for j in 0..4 {
                let gj = gradient[j];
                let gg = dot(gi, gj);
                let isotropic = gj.map(|g| lsic * g);
                let scalar = mass * fluid.second(i, j).single()
                    + dot(carried[i], gj)
                    + streamline[i] * trial[j]
                    + viscous * gg;
                let block = &mut matrix[4 * i + j];
                for k in 0..3 {
                    for c in 0..3 {
                        let both = gj[k] * test[c] + gi[k] * isotropic[c];
                        block[k][c] = if k == c { both + scalar } else { both };
                    }
                    block[k][3] = gj[k] * streamline[i] - gi[k] * first[j];
                }
                for c in 0..3 {
                    block[3][c] = first[i] * gj[c] + pspg * (trial[j] * gi[c] + gg * bent[c]);
                }
                block[3][3] = pspg * gg;
                pressure[4 * i + j] = laplace * gg;
            }
        }
    }
}

impl<R: Real> Element<R> {
    /// Advects with `drift` besides [m/s].
    #[inline]
    pub fn carry(&mut self, drift: [R; 3]) {
        for a in &mut self.a {
            for k in 0..3 {
                a[k] += drift[k];
            }
        }
    }

    /// u' = (τ/ρ) R at the centroid, after the solve [m/s]; in the continuity equation it acts over the
    /// whole element.
    #[inline]
    pub fn fine_scale(&self, fluid: &impl Region<R>, u_new: &[[R; 3]; 4], p: &[R; 4]) -> [R; 3] {
        let Parameters { a, tau, .. } = self.parameters(fluid);
        let ElementMaterial { rho, mu, grad_mu, force } = self.material;
        let grad_p = self.geometry.gradient(*p);
        let (theta, old) = (R::of(self.theta), R::of(1.0 - self.theta));
        let du = [0, 1, 2].map(|k: usize| {
            let mid = [0, 1, 2, 3].map(|i: usize| theta * u_new[i][k] + old * self.u[i][k]);
            self.geometry.gradient(mid)
        });
        let (now, was) = (fluid.mean(u_new), fluid.mean(&self.u));
        let (along, bent) = (along(a, &du), two_eps(grad_mu, &du));
        [0, 1, 2].map(|k| {
            let inertia = (now[k] - was[k]) * R::of(1.0 / self.dt) + along[k];
            let f = R::of(0.25) * ((force[0][k] + force[1][k]) + (force[2][k] + force[3][k]));
            tau / rho * (rho * inertia + grad_p[k] - f - bent[k] - mu * self.laplacian[k])
        })
    }

    /// ∫ ½ρ u² of nodal velocities [J].
    #[inline]
    pub fn kinetic_energy(&self, fluid: &impl Region<R>, u: &[[R; 3]; 4]) -> R {
        let square = [0, 1, 2, 3].map(|i| dot(u[i], fluid.weighted(i, u)));
        R::of(0.5) * self.material.rho * ((square[0] + square[1]) + (square[2] + square[3]))
    }

    /// −∫ ρ g·x [J].
    #[inline]
    pub fn potential_energy(&self, fluid: &impl Region<R>, x: &[[R; 3]; 4], g: [f64; 3]) -> R {
        -self.material.rho * dot(g.map(R::of), fluid.integral(x))
    }
}

impl Element {
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
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::number::packed;
    use crate::fem::region::Whole;

    /// Vectors of length 1, reproducible.
    struct Any(f64);

    impl Any {
        fn vectors(&mut self) -> [[f64; 3]; 4] {
            [0; 4].map(|_| {
                [0; 3].map(|_| {
                    self.0 = (self.0 * 97.31 + 0.177).fract();
                    self.0 - 0.5
                })
            })
        }
    }

    fn element(any: &mut Any) -> Element {
        let regular = [[0.1, 0.0, 0.2], [0.7, 0.1, 0.0], [0.2, 0.6, -0.1], [0.0, 0.3, 0.8]];
        let moved = any.vectors();
        let corner = |i: usize, k: usize| regular[i][k] + 0.1 * moved[i][k];
        let geometry = Tetrahedron::new([0, 1, 2, 3].map(|i| [0, 1, 2].map(|k| corner(i, k))));
        let force = any.vectors();
        let material = ElementMaterial { rho: 7.0, mu: 0.3, grad_mu: [0.2, -0.1, 0.4], force };
        let (u, a) = (any.vectors(), any.vectors());
        let laplacian = [0.4, -0.2, 0.1];
        Element { geometry, material, u, a, laplacian, dt: 0.07, dt_tau: 0.1, theta: 0.5 }
    }

    fn system<R: Real>(
        element: &Element<R>,
        fluid: &impl Region<R>,
        x: &[[R; 4]; 4],
    ) -> ElementSystem<R> {
        let mut system = ElementSystem::default();
        element.system(fluid, x, true, &mut system);
        system
    }

    /// Rows are affine in x: their difference between two x is the matrix times theirs.
    #[test]
    fn the_matrix_is_the_change_of_the_rows() {
        let mut any = Any(0.4);
        let element = element(&mut any);
        let fluid = Whole(element.geometry.volume);
        let mut unknowns = || unknowns(&any.vectors(), &any.vectors().map(|v| v[0]));
        let (x, y) = (unknowns(), unknowns());
        let [at_x, at_y] = [x, y].map(|x| system(&element, &fluid, &x));
        for i in 0..4 {
            for r in 0..4 {
                let terms = |j: usize, c: usize| {
                    f64::from(at_x.matrix[4 * i + j][r][c]) * (y[j][c] - x[j][c])
                };
                let all = (0..16).map(|k| terms(k / 4, k % 4));
                let size: f64 = all.clone().map(f64::abs).sum();
                let change = at_x.left[i][r] - at_y.left[i][r];
                assert!((all.sum::<f64>() - change).abs() < 1e-6 * size, "row {r} of node {i}");
            }
        }
    }

    /// The four as one.
    fn together(four: &[Element; 4]) -> Element<f64x4> {
        let vectors = |of: fn(&Element) -> &[[f64; 3]; 4]| {
            [0, 1, 2, 3].map(|i| [0, 1, 2].map(|k| packed(four, |e| of(e)[i][k])))
        };
        Element {
            geometry: Tetrahedron {
                grad: vectors(|e| &e.geometry.grad),
                volume: packed(four, |e| e.geometry.volume),
            },
            material: ElementMaterial {
                rho: packed(four, |e| e.material.rho),
                mu: packed(four, |e| e.material.mu),
                grad_mu: [0, 1, 2].map(|k| packed(four, |e| e.material.grad_mu[k])),
                force: vectors(|e| &e.material.force),
            },
            u: vectors(|e| &e.u),
            a: vectors(|e| &e.a),
            laplacian: [0, 1, 2].map(|k| packed(four, |e| e.laplacian[k])),
            dt: four[0].dt,
            dt_tau: four[0].dt_tau,
            theta: four[0].theta,
        }
    }

    #[test]
    fn four_at_once_are_each_by_itself() {
        let mut any = Any(0.2);
        let four = [0; 4].map(|_| element(&mut any));
        let x = [0; 4].map(|_| unknowns(&any.vectors(), &any.vectors().map(|v| v[0])));
        let all = together(&four);
        let mut systems = [ElementSystem::default(); 4];
        let packed = std::array::from_fn(|i| std::array::from_fn(|c| packed(&x, |x| x[i][c])));
        system(&all, &Whole(all.geometry.volume), &packed).unpacked(true, &mut systems);
        for ((element, x), system) in four.iter().zip(&x).zip(&systems) {
            let single = self::system(element, &Whole(element.geometry.volume), x);
            let close = |a: f64, b: f64, size: f64| assert!((a - b).abs() < size, "{a} {b}");
            for i in 0..4 {
                for c in 0..4 {
                    close(single.rhs[i][c], system.rhs[i][c], 1e-13);
                    close(single.left[i][c], system.left[i][c], 1e-13);
                }
            }
            for (a, b) in single.matrix.as_flattened().iter().zip(system.matrix.as_flattened()) {
                (0..4).for_each(|c| close(a[c].into(), b[c].into(), 1e-6));
            }
            for (a, b) in single.pressure.iter().zip(&system.pressure) {
                close((*a).into(), (*b).into(), 1e-6);
            }
        }
    }

    /// Tested with any w, the terms one by one are the rows all together.
    #[test]
    fn powers_add_up_to_the_system() {
        let mut any = Any(0.3);
        let element = element(&mut any);
        let (w, new) = (any.vectors(), any.vectors());
        let p = any.vectors().map(|v| v[0]);
        let fluid = Whole(element.geometry.volume);
        let system = system(&element, &fluid, &unknowns(&new, &p));
        let rows: f64 = (0..4).map(|i| dot(w[i], system.momentum(i))).sum();
        let terms = element.powers(&fluid, &w, &new, &p);
        let Powers { inertia, convection, viscous, streamline, divergence, pressure, force } =
            terms;
        let sum = inertia + convection + viscous + streamline + divergence + pressure + force;
        assert!((sum - rows).abs() < 1e-12 * (inertia.abs() + viscous.abs()), "{sum}, not {rows}");
    }
}
