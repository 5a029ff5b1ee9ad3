//! What viscosity adds to the Schur preconditioner where it rules: Δt ν/h² ≫ 1.
//!
//! There `S⁻¹ ≈ L⁻¹ + θμ M⁻¹` (Cahouet & Chabard 1988), M lumped; and the velocity block is like a
//! Laplacian, of which a Gauss-Seidel sweep leaves the smooth part: one multigrid cycle per component
//! on `∫ (ρ/Δt) u·w + θ 2με(u):ε(w)` of that component alone takes it.

#![allow(non_snake_case)]

use super::block_csr::BlockCsr;
use super::distributed::Halo;
use super::multigrid::Multigrid;

/// The operators, of the pattern of the system. Rows and columns of a component that is given, or tied
/// to others, have nothing but their diagonal entry.
#[derive(Clone, Debug)]
pub struct ViscousOperators {
    /// The momentum matrix between equal components c: `∫ (ρ/Δt) N_i N_j + θμ (∇N_i·∇N_j + ∂N_i/∂x_c ∂N_j/∂x_c)`
    /// and what else it has.
    pub velocity: [BlockCsr<1>; 3],
    /// `1 / ∫ N_i/θμ` of each owned node [Pa s/m³]; zero where the pressure is given.
    pub pressure: Vec<f64>,
}

/// Their part of the preconditioner.
#[derive(Clone, Debug)]
pub struct ViscousCorrection {
    velocity: [Multigrid; 3],
    /// Components to be left alone.
    given: [Vec<bool>; 3],
    pressure: Vec<f32>,
}

impl ViscousCorrection {
    /// For matrices of the pattern that `halo` was made for.
    pub fn new(halo: &Halo) -> Self {
        Self {
            velocity: std::array::from_fn(|_| Multigrid::new(halo)),
            given: Default::default(),
            pressure: Vec::new(),
        }
    }

    /// Takes this step's operators. Collective.
    pub fn setup(&mut self, operators: &ViscousOperators) {
        for (c, V) in operators.velocity.iter().enumerate() {
            self.velocity[c].setup(V);
            let alone = |i: usize| V.entries(i).all(|(j, v)| j == i || v[0][0] == 0.0);
            self.given[c] = (0..V.n_rows()).map(alone).collect();
        }
        self.pressure = operators.pressure.iter().map(|p| *p as f32).collect();
    }

    /// z_p += θμ M⁻¹ r_p.
    pub fn add_pressure(&self, r: &[[f32; 4]], z: &mut [[f32; 4]]) {
        for ((z, r), p) in z.iter_mut().zip(r).zip(&self.pressure) {
            z[3] += p * r[3];
        }
    }

    /// z_u += V⁻¹ r_u by a cycle for each component. Collective.
    pub fn add_velocity(&mut self, r: &[[f32; 4]], z: &mut [[f32; 4]]) {
        for (c, (multigrid, given)) in self.velocity.iter_mut().zip(&self.given).enumerate() {
            for ((b, r), given) in multigrid.right_hand_side().iter_mut().zip(r).zip(given) {
                *b = if *given { 0.0 } else { r[c] };
            }
            for ((z, x), given) in z.iter_mut().zip(multigrid.cycle()).zip(given) {
                z[c] += if *given { 0.0 } else { *x };
            }
        }
    }
}
