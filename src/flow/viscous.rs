//! Where viscosity rules a step, θ Δt ν/h² ≫ 1, what the solver's preconditioner needs to know of it.

use super::material::Material;
use crate::fem::constraints::Constraints;
use crate::fem::dot;
use crate::linear::block_csr::ElementSlots;
use crate::linear::{BlockCsr, ViscousOperators};
use crate::mesh::MeshPart;
use crate::mesh::tetrahedron::Tetrahedron;

/// Gauss-Seidel sweeps alone are cheaper up to this viscous number θ Δt ν/h².
const LIMIT: f64 = 4.0;

/// Whether viscosity rules a step of length `dt`; `smallest` is the size of the smallest element.
pub fn rules(material: &Material, smallest: f64, dt: f64, theta: f64) -> bool {
    theta * dt * material.kinematic_viscosity() > LIMIT * smallest * smallest
}

/// The operators of this step, of the pattern of `pressure`; `slots` say where elements go.
pub fn operators(
    part: &MeshPart,
    material: &Material,
    constraints: &Constraints,
    pressure: &BlockCsr<1>,
    slots: &ElementSlots,
    dt: f64,
    theta: f64,
) -> ViscousOperators {
    let n = part.n_owned();
    let mut velocity: [BlockCsr<1>; 3] =
        std::array::from_fn(|_| BlockCsr::with_pattern_of(pressure));
    let mut mobility = vec![0.0; n];
    for (e, tet) in part.mesh.tets[..part.n_assembled_elements].iter().enumerate() {
        let x = tet.map(|n| part.mesh.nodes[n as usize]);
        let t = Tetrahedron::new(x);
        let material = material.element(tet, &x, &t);
        let (mass, stress) = (material.rho * t.volume / (20.0 * dt), theta * material.mu);
        for i in 0..4 {
            if slots[e][4 * i] == u32::MAX {
                continue;
            }
            mobility[tet[i] as usize] += 0.25 * t.volume / stress;
            for j in 0..4 {
                let (gi, gj) = (&t.grad[i], &t.grad[j]);
                let same = if i == j { 2.0 } else { 1.0 };
                let gg = dot(*gi, *gj);
                for (c, velocity) in velocity.iter_mut().enumerate() {
                    velocity.values[slots[e][4 * i + j] as usize][0][0] +=
                        mass * same + stress * t.volume * (gg + gi[c] * gj[c]);
                }
            }
        }
    }
    for i in 0..n {
        for entry in pressure.row(i) {
            let j = pressure.columns[entry] as usize;
            for (c, velocity) in velocity.iter_mut().enumerate() {
                let free = |node: usize| {
                    let row = constraints.nodes[node].free[c];
                    (0..3).all(|k| (row[k] - f64::from(u8::from(k == c))).abs() < 1e-12)
                };
                if i != j && !(free(i) && free(j)) {
                    velocity.values[entry][0][0] = 0.0;
                }
            }
        }
    }
    let given = |i: usize| constraints.nodes[i].pressure_given == 1;
    let pressure = mobility.iter().enumerate();
    ViscousOperators {
        velocity,
        pressure: pressure.map(|(i, m)| if given(i) { 0.0 } else { 1.0 / m }).collect(),
    }
}
