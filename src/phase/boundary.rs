//! `∮ N_i φ* u·n` over one boundary face, chord φ_h and rest w(σ(ψ_h/δ) − φ_h) apart.

use super::profile::{logit, sigmoid};
use crate::cut::tetrahedron::split_triangle;
use crate::cut::{Cell, CutMesh};
use crate::fem::quadrature::TRIANGLE_QUARTIC;
use crate::fem::{dot, triangle_normal};
use crate::mesh::{BoundaryFace, MeshPart};

/// Outward flux at the face's three nodes [m³/s].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FaceFlux {
    /// `∮ N_i φ_h u·n`.
    pub chord: [f64; 3],
    /// `∮ N_i (φ* − φ_h) u·n`.
    pub excess: [f64; 3],
}

/// Through the fluid part of a face of an element whose profile weight is `w`, with nodal φ.
pub fn face_flux(
    part: &MeshPart,
    cut: &CutMesh,
    face: &BoundaryFace,
    velocity: &[[f64; 3]],
    phi: &[f64],
    w: f64,
) -> FaceFlux {
    let mut flux = FaceFlux::default();
    let normal = triangle_normal(face.nodes.map(|n| part.mesh.nodes[n as usize]));
    let un = face.nodes.map(|n| dot(velocity[n as usize], normal));
    if un == [0.0; 3] {
        return flux;
    }
    let phi = face.nodes.map(|n| phi[n as usize]);
    let psi = phi.map(logit);
    let mut add = |share: f64, corners: [[f64; 3]; 3]| {
        for (m, weight) in TRIANGLE_QUARTIC {
            let l: [f64; 3] = std::array::from_fn(|i| (0..3).map(|c| m[c] * corners[c][i]).sum());
            let at = |f: [f64; 3]| l[0] * f[0] + l[1] * f[1] + l[2] * f[2];
            let chord = at(phi);
            let excess = if w > 0.0 { w * (sigmoid(at(psi)) - chord) } else { 0.0 };
            let carried = share * weight * at(un);
            for i in 0..3 {
                flux.chord[i] += carried * l[i] * chord;
                flux.excess[i] += carried * l[i] * excess;
            }
        }
    };
    match cut.cell(face.element as usize) {
        Cell::Solid => {}
        Cell::Whole => add(1.0, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
        Cell::Cut(_) => {
            let d = face.nodes.map(|n| cut.distance[n as usize]);
            for piece in split_triangle(&d) {
                let [a, b, c] = piece;
                add(dot(a, crate::cut::surface::cross(b, c)).abs(), piece);
            }
        }
    }
    flux
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::boxes::tensor_box;

    #[test]
    fn chords_are_exact_and_profiles_nearly() {
        let part = MeshPart::single(tensor_box([&[0.0, 2.0], &[0.0, 1.0], &[0.0, 1.0]]));
        let u: Vec<[f64; 3]> = part.mesh.nodes.iter().map(|x| [1.0 + x[1], 5.0, 0.0]).collect();
        let total = |phi: &dyn Fn(f64) -> f64| {
            let phi: Vec<f64> = part.mesh.nodes.iter().map(|x| phi(x[1])).collect();
            let (mut chord, mut excess) = (0.0, 0.0);
            for face in part.mesh.boundary.iter().filter(|f| f.name == 1) {
                let flux = face_flux(&part, &CutMesh::whole(), face, &u, &phi, 1.0);
                chord += flux.chord.iter().sum::<f64>();
                excess += flux.excess.iter().sum::<f64>();
            }
            (chord, excess)
        };
        let (chord, _) = total(&|y| 0.2 + 0.5 * y);
        // ∫ (0.2 + y/2)(1 + y) dy over 0..1
        assert!((chord - (0.2 + 0.7 / 2.0 + 0.5 / 3.0)).abs() < 1e-14);
        let (chord, excess) = total(&|y| sigmoid(2.0 * y - 0.5));
        let n = 10_000;
        let exact: f64 = (0..n)
            .map(|i| (i as f64 + 0.5) / n as f64)
            .map(|y| sigmoid(2.0 * y - 0.5) * (1.0 + y) / n as f64)
            .sum();
        assert!((chord + excess - exact).abs() < 1e-5, "{} {exact}", chord + excess);
        assert!(excess.abs() > 1e-3);
    }
}
