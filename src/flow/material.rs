//! Density, viscosity and gravity of one element.
//!
//! `ρ = ρ_l φ + ρ_g (1−φ)`, `μ` alike [12,13], φ clipped to [0,1]. Gravity in edge form: the force
//! `ρg` is interpolated in Whitney's edge elements from `E_ij = ∫_edge ρ g·dl = ρ̄_ij g·(x_j − x_i)`,
//!
//! ```text
//!     ρ̄_ij = ρ_g + (ρ_l−ρ_g) [I(ψ_j) − I(ψ_i)]/(ψ_j − ψ_i),   I(s) = δ ln(1 + e^{s/δ}),
//!     F_e = ¼ Σ_{i<j} E_ij (∇N_j − ∇N_i).
//! ```
//!
//! Where the surface is flat, E is the difference of a nodal function and F_e its gradient, exactly,
//! on any mesh: still water stays still. The element's inertia density is the mean of the six ρ̄_ij.

use crate::case::{self, Case, Fluid};
use crate::fem::dot;
use crate::fem::number::{Real, f64x4, scalars};
use crate::fem::tetrahedron::Tetrahedron;

/// ψ is used up to this many δ from the surface, where φ differs from 0 or 1 by 1e-13.
const CLIP: f64 = 30.0;

/// What the fluids are, and their state at the nodes.
#[derive(Clone, Debug)]
pub struct Material {
    liquid: Fluid,
    gas: Fluid,
    gravity: [f64; 3],
    form: case::Gravity,
    /// φ clipped to [0, 1].
    phi: Vec<f64>,
    /// ψ/δ, and I(ψ)/δ.
    psi: Vec<f64>,
    integral: Vec<f64>,
    /// What liquid moves by against the fluid in each element, the other way round [m/s]; empty: none.
    flux: Vec<[f64; 3]>,
}

/// One element's material, constant in it but for the viscosity's gradient.
#[derive(Clone, Copy, Debug)]
pub struct ElementMaterial<R = f64> {
    /// Inertia density [kg/m³].
    pub rho: R,
    /// Mean viscosity [Pa s].
    pub mu: R,
    /// ∇μ [Pa s/m].
    pub grad_mu: [R; 3],
    /// Gravity force per volume that node i's momentum row sees [N/m³]; all four the same in edge
    /// form. Their mean is the force in the stabilisation terms.
    pub force: [[R; 3]; 4],
}

impl<R: Real> ElementMaterial<R> {
    /// Adds a force per mass given at the corners [m/s²].
    pub fn add_force(&mut self, f: &[[R; 3]; 4]) {
        for k in 0..3 {
            let sum = (f[0][k] + f[1][k]) + (f[2][k] + f[3][k]);
            for i in 0..4 {
                self.force[i][k] += R::of(0.2) * self.rho * (sum + f[i][k]);
            }
        }
    }
}

/// φ in [0, 1], ψ/δ and I(ψ)/δ.
fn profile(phi: f64) -> (f64, f64, f64) {
    let phi = phi.clamp(0.0, 1.0);
    // NaN is passed on, to be found by the solver.
    let psi = (phi / (1.0 - phi)).ln().clamp(-CLIP, CLIP);
    (phi, psi, psi.max(0.0) + (-psi.abs()).exp().ln_1p())
}

impl Material {
    /// Liquid everywhere, on `n` nodes.
    pub fn new(case: &Case, n: usize) -> Self {
        let (phi, psi, integral) = profile(1.0);
        Self {
            liquid: case.liquid,
            gas: case.gas.unwrap_or(case.liquid),
            gravity: case.gravity,
            form: case.flow.gravity,
            phi: vec![phi; n],
            psi: vec![psi; n],
            integral: vec![integral; n],
            flux: Vec::new(),
        }
    }

    /// Takes over the phase field's nodal values.
    pub fn set_phase(&mut self, phi: &[f64]) {
        for (i, &value) in phi.iter().enumerate() {
            // Most of the mesh is all liquid or gas, and stays so.
            if value.clamp(0.0, 1.0) != self.phi[i] {
                (self.phi[i], self.psi[i], self.integral[i]) = profile(value);
            }
        }
    }

    /// Takes `flux` of the phase field; returns the one before.
    pub fn set_flux(&mut self, flux: Vec<[f64; 3]>) -> Vec<[f64; 3]> {
        std::mem::replace(&mut self.flux, flux)
    }

    /// What mass moves by beyond the velocity in element `e` of density `rho` [m/s].
    pub fn drift(&self, e: usize, rho: f64) -> [f64; 3] {
        let c = (self.gas.density - self.liquid.density) / rho;
        self.flux.get(e).map_or([0.0; 3], |r| r.map(|r| c * r))
    }

    /// g [m/s²]
    pub fn gravity(&self) -> [f64; 3] {
        self.gravity
    }

    /// φ at node `i`, in [0, 1].
    pub fn phase(&self, i: usize) -> f64 {
        self.phi[i]
    }

    /// Density of the liquid [kg/m³].
    pub fn liquid_density(&self) -> f64 {
        self.liquid.density
    }

    /// Density at node `i` [kg/m³].
    pub fn density(&self, i: usize) -> f64 {
        self.gas.density + (self.liquid.density - self.gas.density) * self.phi[i]
    }

    /// The larger of the fluids' kinematic viscosities [m²/s].
    pub fn kinematic_viscosity(&self) -> f64 {
        let nu = |fluid: Fluid| fluid.viscosity / fluid.density;
        nu(self.liquid).max(nu(self.gas))
    }

    /// Viscosity at node `i` [Pa s].
    pub fn viscosity(&self, i: usize) -> f64 {
        self.gas.viscosity + (self.liquid.viscosity - self.gas.viscosity) * self.phi[i]
    }

    /// Of the element with these nodes and corners.
    #[inline(always)]
    pub fn element(&self, tet: &[u32; 4], x: &[[f64; 3]; 4]) -> ElementMaterial {
        if self.is_pure(tet) { self.pure(&[*tet; 1], |[rho]| rho) } else { self.mixed_one(tet, x) }
    }

    #[inline(never)]
    fn mixed_one(&self, tet: &[u32; 4], x: &[[f64; 3]; 4]) -> ElementMaterial {
        let nodal = [&self.phi, &self.psi, &self.integral];
        self.mixed(nodal.map(|v| tet.map(|n| v[n as usize])), x, &Tetrahedron::new(*x))
    }

    /// Of four.
    #[inline(always)]
    pub fn elements(
        &self,
        tets: &[[u32; 4]; 4],
        x: &[[f64x4; 3]; 4],
        t: &Tetrahedron<f64x4>,
    ) -> ElementMaterial<f64x4> {
        if tets.iter().all(|tet| self.is_pure(tet)) {
            return self.pure(tets, f64x4::from);
        }
        self.mixed(
            [scalars(tets, &self.phi), scalars(tets, &self.psi), scalars(tets, &self.integral)],
            x,
            t,
        )
    }

    /// Whether φ has one value in the element.
    #[inline]
    pub fn is_pure(&self, tet: &[u32; 4]) -> bool {
        let [a, b, c, d] = tet.map(|n| self.phi[n as usize]);
        a == b && a == c && a == d
    }

    /// Where each element has one value of φ.
    #[inline(always)]
    fn pure<R: Real, const N: usize>(
        &self,
        tets: &[[u32; 4]; N],
        together: impl Fn([f64; N]) -> R,
    ) -> ElementMaterial<R> {
        let rho = together(tets.map(|tet| self.density(tet[0] as usize)));
        let mu = together(tets.map(|tet| self.viscosity(tet[0] as usize)));
        let force = self.gravity.map(|g| rho * R::of(g));
        ElementMaterial { rho, mu, grad_mu: [R::default(); 3], force: [force; 4] }
    }

    /// From φ, ψ/δ and I(ψ)/δ at the corners.
    #[inline(always)]
    fn mixed<R: Real>(
        &self,
        [phi, psi, integral]: [[R; 4]; 3],
        x: &[[R; 3]; 4],
        t: &Tetrahedron<R>,
    ) -> ElementMaterial<R> {
        let of = R::of;
        let share = |gas: f64, liquid: f64, phi: R| of(gas) + of(liquid - gas) * phi;
        let density = |phi: R| share(self.gas.density, self.liquid.density, phi);
        let mean = of(0.25) * ((phi[0] + phi[1]) + (phi[2] + phi[3]));
        let mu = share(self.gas.viscosity, self.liquid.viscosity, mean);
        let dmu = self.liquid.viscosity - self.gas.viscosity;
        let grad_mu = t.gradient(phi).map(|g| of(dmu) * g);
        match self.form {
            case::Gravity::Edge => {
                let (mut rho, mut force) = (R::default(), [R::default(); 3]);
                for i in 0..3 {
                    for j in i + 1..4 {
                        let step = psi[j] - psi[i];
                        // The mean of φ along the edge: of its ends where ψ hardly changes, to O(step²/12) ~ 1e-9.
                        let liquid = (step * step).where_larger(
                            of(1e-8),
                            (integral[j] - integral[i]) / step,
                            of(0.5) * (phi[i] + phi[j]),
                        );
                        let edge = density(liquid);
                        rho += of(1.0 / 6.0) * edge;
                        let along = [0, 1, 2].map(|k: usize| x[j][k] - x[i][k]);
                        let e = of(0.25) * edge * dot(self.gravity.map(of), along);
                        for k in 0..3 {
                            force[k] += e * (t.grad[j][k] - t.grad[i][k]);
                        }
                    }
                }
                ElementMaterial { rho, mu, grad_mu, force: [force; 4] }
            }
            case::Gravity::Quadrature => {
                let nodal = phi.map(density);
                let sum = (nodal[0] + nodal[1]) + (nodal[2] + nodal[3]);
                // ∫N_i ρ_h over V/4: (Σρ + ρ_i)/5.
                let force = nodal.map(|r| self.gravity.map(|g| of(0.2 * g) * (sum + r)));
                ElementMaterial { rho: of(0.25) * sum, mu, grad_mu, force }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn water_and_air(form: case::Gravity, g: [f64; 3], phi: Vec<f64>) -> Material {
        let mut material = Material {
            liquid: Fluid { density: 1000.0, viscosity: 1e-3 },
            gas: Fluid { density: 1.0, viscosity: 1e-5 },
            gravity: g,
            form,
            phi: vec![f64::NAN; phi.len()],
            psi: phi.clone(),
            integral: phi.clone(),
            flux: Vec::new(),
        };
        material.set_phase(&phi);
        material
    }

    /// Hydrostatic pressure of the tanh profile: P(ψ) = ∫ρ dψ, and F_e must be |g| times its
    /// interpolant's gradient on any tetrahedron, whatever the slope of the flat surface.
    #[test]
    fn edge_force_is_the_gradient_of_hydrostatic_pressure() {
        let delta = 0.3;
        let g = [3.0, -1.0, -9.0];
        let up = g.map(|v| -v / crate::fem::norm(g));
        let x = [[0.1, 0.0, 0.2], [0.7, 0.1, 0.0], [0.2, 0.6, -0.1], [0.0, 0.3, 0.8]];
        let t = Tetrahedron::new(x);
        let psi = x.map(|p| 0.25 - dot(up, p));
        let phi = psi.map(|s| 0.5 * (1.0 + (s / (2.0 * delta)).tanh())).to_vec();
        let material = water_and_air(case::Gravity::Edge, g, phi);
        let m = material.element(&[0, 1, 2, 3], &x);
        let pressure =
            psi.map(|s| crate::fem::norm(g) * (s + 999.0 * delta * (s / delta).exp().ln_1p()));
        let expected = t.gradient(pressure);
        for k in 0..3 {
            assert!((m.force[0][k] - expected[k]).abs() < 1e-9 * 9000.0);
        }
        assert!(m.rho > 1.0 && m.rho < 1000.0);
    }

    #[test]
    fn pure_elements_weigh_rho_g() {
        let x = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]];
        for (value, rho) in [(1.0, 1000.0), (0.0, 1.0)] {
            let m = water_and_air(case::Gravity::Edge, [0., 0., -10.], vec![value; 4]);
            let e = m.element(&[0, 1, 2, 3], &x);
            assert_eq!((e.rho, e.force[2]), (rho, [0., 0., -10. * rho]));
        }
    }
}
