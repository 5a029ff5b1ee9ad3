//! How much viscosity has to say in a step; where it rules, θ Δt ν/h² ≫ 1, what the solver's preconditioner needs to know.

use super::material::Material;
use crate::cut::{Cell, CutMesh};
use crate::fem::constraints::Constraints;
use crate::fem::region::Region;
use crate::linear::{BlockCsr, SaddleCsr, ViscousOperators};
use crate::mesh::MeshPart;
use crate::mesh::tetrahedron::Tetrahedron;

/// Gauss-Seidel sweeps alone are cheaper up to this viscous number θ Δt ν/h².
const LIMIT: f64 = 4.0;

/// Δt ν/h² from which on the strong residual needs the viscous force: below, cells are far too large for what
/// viscosity does in them.
const NEGLIGIBLE: f64 = 1e-3;

/// Whether viscosity is felt at all in a step of length `dt`.
pub fn matters(material: &Material, smallest: f64, dt: f64) -> bool {
    dt * material.kinematic_viscosity() > NEGLIGIBLE * smallest * smallest
}

/// Whether viscosity rules a step of length `dt`; `smallest` is the size of the smallest element.
pub fn rules(material: &Material, smallest: f64, dt: f64, theta: f64) -> bool {
    theta * dt * material.kinematic_viscosity() > LIMIT * smallest * smallest
}

/// The operators of this step, from its momentum `matrix`, boundary conditions and walls included: where
/// viscosity rules, its convection does not matter.
pub fn operators(
    part: &MeshPart,
    cut: &CutMesh,
    material: &Material,
    constraints: &Constraints,
    matrix: &SaddleCsr,
    theta: f64,
) -> ViscousOperators {
    let n = part.n_owned();
    let mut velocity: [BlockCsr<1>; 3] = std::array::from_fn(|_| BlockCsr::zero(&matrix.pattern));
    let mut mobility = vec![0.0; n];
    for (e, tet) in part.assembled().iter().enumerate() {
        let cell = cut.cell(e);
        if matches!(cell, Cell::Solid) {
            continue;
        }
        let x = part.mesh.corners(e);
        let t = Tetrahedron::new(x);
        let stress = theta * material.element(tet, &x).mu;
        for i in (0..4).filter(|&i| (tet[i] as usize) < n) {
            let volume = match cell {
                Cell::Cut(c) => c.pieces.fluid.first(i),
                _ => 0.25 * t.volume,
            };
            mobility[tet[i] as usize] += volume / stress;
        }
    }
    for i in 0..n {
        for entry in matrix.row(i) {
            let (j, block) = (matrix.pattern.columns[entry] as usize, matrix.block(i, entry));
            for (c, velocity) in velocity.iter_mut().enumerate() {
                let free = |node: usize| {
                    let row = constraints.nodes[node].free[c];
                    (0..3).all(|k| (row[k] - f64::from(u8::from(k == c))).abs() < 1e-12)
                };
                if i == j || (free(i) && free(j)) {
                    velocity.values[entry] = [[block[c][c]]];
                }
            }
        }
    }
    let given = |i: usize| constraints.nodes[i].pressure_given == 1;
    let pressure = mobility.iter().enumerate();
    ViscousOperators {
        velocity,
        pressure: pressure
            .map(|(i, &m)| if given(i) || m == 0.0 { 0.0 } else { 1.0 / m })
            .collect(),
    }
}
