//! `∮ N_i f u·n` over one boundary face, f the chord φ_h, the profile φ*, or their difference.

use super::profile::{Profile, profile_weight, sigmoid};
use crate::fem::quadrature::TRIANGLE_QUARTIC;
use crate::fem::{dot, triangle_normal};
use crate::mesh::{BoundaryFace, MeshPart};

/// What is carried through a face.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OpenFace {
    /// φ_h.
    Chord,
    /// φ* − φ_h.
    Excess,
    /// φ*.
    Profile,
}

/// At the face's three nodes [m³/s].
pub fn face_flux(
    part: &MeshPart,
    face: &BoundaryFace,
    velocity: &[[f64; 3]],
    profile: &Profile,
    what: OpenFace,
) -> [f64; 3] {
    let w = match profile.in_band(&part.mesh.tets[face.element as usize]) {
        Some(nodes) if what != OpenFace::Chord => profile_weight(nodes),
        _ => 0.0,
    };
    if w == 0.0 && what == OpenFace::Excess {
        return [0.0; 3];
    }
    let normal = triangle_normal(face.nodes.map(|n| part.mesh.nodes[n as usize]));
    let un = face.nodes.map(|n| dot(velocity[n as usize], normal));
    if un == [0.0; 3] {
        return [0.0; 3];
    }
    let nodes = face.nodes.map(|n| profile.nodes[n as usize]);
    let mut flux = [0.0; 3];
    for (l, weight) in TRIANGLE_QUARTIC {
        let at = |f: [f64; 3]| l[0] * f[0] + l[1] * f[1] + l[2] * f[2];
        let chord = at(nodes.map(|n| n.phi));
        let excess = if w > 0.0 { w * (sigmoid(at(nodes.map(|n| n.s))) - chord) } else { 0.0 };
        let f = match what {
            OpenFace::Chord => chord,
            OpenFace::Excess => excess,
            OpenFace::Profile => chord + excess,
        };
        for i in 0..3 {
            flux[i] += weight * l[i] * at(un) * f;
        }
    }
    flux
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::boxes::tensor_box;

    #[test]
    fn a_chord_is_integrated_exactly_and_the_parts_add_up() {
        let part = MeshPart::single(tensor_box([&[0.0, 2.0], &[0.0, 1.0], &[0.0, 1.0]]));
        let phi: Vec<f64> = part.mesh.nodes.iter().map(|x| 0.2 + 0.5 * x[1]).collect();
        let u: Vec<[f64; 3]> = part.mesh.nodes.iter().map(|x| [1.0 + x[1], 5.0, 0.0]).collect();
        let mut profile = Profile::default();
        profile.set(&phi, false);
        let total = |what| {
            let mut sum = 0.0;
            for face in part.mesh.boundary.iter().filter(|f| f.name == 1) {
                sum += face_flux(&part, face, &u, &profile, what).iter().sum::<f64>();
            }
            sum
        };
        // ∫ (0.2 + y/2)(1 + y) dy over 0..1
        let exact = 0.2 + 0.7 / 2.0 + 0.5 / 3.0;
        assert!((total(OpenFace::Chord) - exact).abs() < 1e-14);
        let sum = total(OpenFace::Chord) + total(OpenFace::Excess);
        assert!((total(OpenFace::Profile) - sum).abs() < 1e-15);
        assert!(total(OpenFace::Excess) != 0.0);
    }
}
