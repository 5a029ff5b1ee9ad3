//! Regularisation in ψ form (METHOD §3): n explicit conservative sub-steps after transport,
//!
//!     m_i Δφ_i = −(Δt/n) Σ_e V_e ∇N_i·s_e (∇ψ_h − n_e),   n_e = ∇ψ_h/|∇ψ_h|,   s_e = Γ w(q) q G
//!
//! with `q = min φ(1−φ)` over the element's nodes and the gate `G = d²/(d²+0.1²)`, `d = |∇ψ_h| − 1`. A flat
//! profile of width δ, at any slope, has ∇ψ_h = n_e in every element: nothing moves, to round-off.
//!
//! Explicit limit: since dψ/dφ = δ/(φ(1−φ)) and q is the smallest φ(1−φ), the linearised diffusivity is at
//! most Γδ, and the largest eigenvalue of the lumped step at most Γδ λ, λ = 4 λ_max(Σ_i ∇N_i ∇N_iᵀ) of
//! the worst element. n is chosen from it; if 6 are not enough, Γ is reduced in the elements concerned.

use super::Phase;
use super::profile::window;
use crate::fem::norm;
use crate::fem::tetrahedron::Tetrahedron;
use crate::mesh::{Mesh, MeshPart};
use nalgebra::Matrix3;

/// Fewest and most sub-steps.
const SUB_STEPS: [u32; 2] = [2, 6];
/// Largest Γδλ Δt/n: 2 is the limit of stability, 1 that of monotone decay.
const LIMIT: f64 = 1.6;
/// Slope error |∇ψ| − 1 at which the gate is half open.
const GATE: f64 = 0.1;

/// λ_e = 4 λ_max(Σ_i ∇N_i ∇N_iᵀ) of every element [1/m²].
pub(super) fn stiffness(mesh: &Mesh) -> Vec<f32> {
    (0..mesh.tets.len())
        .map(|e| {
            let g = Tetrahedron::of(mesh, e).grad;
            let sum = Matrix3::from_fn(|r, c| (0..4).map(|i| g[i][r] * g[i][c]).sum::<f64>());
            (4.0 * sum.symmetric_eigenvalues().max()) as f32
        })
        .collect()
}

/// `phase.phi` regularised over Δt with Γ = `speed`; returns the number of sub-steps. Collective.
pub(super) fn sub_steps(phase: &mut Phase, part: &MeshPart, dt: f64, speed: f64) -> u32 {
    phase.profile.set(&phase.phi, false);
    let mut stiffest = 0.0f32;
    for (e, tet) in part.mesh.tets.iter().enumerate() {
        if phase.profile.in_band(tet).is_some() {
            stiffest = stiffest.max(phase.stiffness[e]);
        }
    }
    let worst = speed * phase.delta * part.max(f64::from(stiffest)) * dt;
    if worst == 0.0 {
        return 0;
    }
    let n = ((worst / LIMIT).ceil() as u32).clamp(SUB_STEPS[0], SUB_STEPS[1]);
    for sub in 0..n {
        if sub > 0 {
            phase.profile.set(&phase.phi, false);
        }
        sub_step(phase, part, dt / f64::from(n), speed);
        part.exchange.update_ghosts(&mut phase.phi);
    }
    n
}

fn sub_step(phase: &mut Phase, part: &MeshPart, dt: f64, speed: f64) {
    let n_owned = part.n_owned();
    let most = LIMIT / (phase.delta * dt);
    for (e, tet) in part.mesh.tets.iter().enumerate() {
        let Some(nodes) = phase.profile.in_band(tet) else { continue };
        let t = Tetrahedron::of(&part.mesh, e);
        let slope = t.gradient(nodes.map(|n| phase.delta * n.s));
        let size = norm(slope);
        let d = size - 1.0;
        if size < 1e-12 {
            continue;
        }
        let q = nodes[0].q.min(nodes[1].q).min(nodes[2].q.min(nodes[3].q));
        let speed = speed.min(most / f64::from(phase.stiffness[e]));
        let s = speed * window(q) * q * (d * d / (d * d + GATE * GATE));
        // ∇ψ − n = ∇ψ d/|∇ψ|
        let flux = dt * t.volume * s * d / size;
        for i in 0..4 {
            let at = tet[i] as usize;
            if at < n_owned {
                phase.phi[at] -=
                    flux * crate::fem::dot(t.grad[i], slope) * phase.inverse_lumped[at];
            }
        }
    }
}
