//! The paper's regularisation, inside the transport step: `∇·R`, `R = γ(δ∇φ − φ(1−φ) n)` [11, 14], and
//! the form without conservation, `γ(δ∇²φ − φ(1−φ)(1−2φ)/δ)`.
//!
//! The diffusion is in the matrix (Crank-Nicolson); here are the other parts. Both parts of R are
//! integrated by parts with no flux through walls, so `Σ_i` of them is zero. Neither is in the SUPG
//! residual: on P1 the diffusion is zero inside elements, and ∇·(φ(1−φ)n), which it balances at
//! rest, would act alone.

use super::profile::Profile;
use crate::cut::CutMesh;
use crate::fem::norm;
use crate::mesh::MeshPart;
use crate::mesh::tetrahedron::Tetrahedron;

/// `out_i −= c ∫ ∇N_i·n φ(1−φ)`, n = ∇φ/|∇φ|; owned rows.
pub(super) fn compression(
    part: &MeshPart,
    cut: &CutMesh,
    profile: &Profile,
    c: f64,
    out: &mut [f64],
) {
    for (e, tet) in part.mesh.tets.iter().enumerate() {
        let volume = cut.fluid_volume(&part.mesh, e);
        if volume == 0.0 {
            continue;
        }
        let n = tet.map(|n| &profile.nodes[n as usize]);
        // Exact for P1 on a whole element: ∫ φ_h(1−φ_h).
        let sum = n[0].phi + n[1].phi + n[2].phi + n[3].phi;
        let squares: f64 = n.iter().map(|n| n.phi * n.phi).sum();
        let q = 0.25 * sum - 0.05 * (sum * sum + squares);
        if q <= 0.0 {
            continue;
        }
        let t = Tetrahedron::of(&part.mesh, e);
        let g = t.gradient(n.map(|n| n.phi));
        let size = norm(g);
        if size == 0.0 {
            continue;
        }
        let flux = c * q * volume / size;
        for i in 0..4 {
            let at = tet[i] as usize;
            if at < part.n_owned() {
                out[at] -= flux * crate::fem::dot(t.grad[i], g);
            }
        }
    }
}

/// `out_i += c m_i φ(1−φ)(1−2φ)`.
pub(super) fn reaction(profile: &Profile, lumped: &[f64], c: f64, out: &mut [f64]) {
    for ((out, node), m) in out.iter_mut().zip(&profile.nodes).zip(lumped) {
        *out += c * m * node.q * (1.0 - 2.0 * node.phi);
    }
}
