//! The ghost penalty (Burman 2010): `Σ_F c ∫_F [∂ₙu]·[∂ₙw]` over the faces of cut elements.
//!
//! A cut element may hold as little fluid as it likes; the penalty ties its gradient to its neighbours', so
//! that its nodes have equations of ordinary size. It vanishes for linear functions. On a face, the jump of
//! the normal derivative is one number, `Σ g_i u_i` over the five nodes of both elements.

use crate::fem::{dot, norm, triangle_normal};
use crate::mesh::tetrahedron::Tetrahedron;
use crate::mesh::{FACES, Mesh};

/// A face between two elements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GhostFace {
    /// The face's three nodes, then the opposite ones.
    pub nodes: [u32; 5],
    /// The two elements.
    pub elements: [u32; 2],
    /// [∂ₙN_i] [1/m]
    pub jump: [f64; 5],
    /// [m²]
    pub area: f64,
    /// Mean size of the two elements; in flat ones what it is in a cube's six tetrahedra of the same height over
    /// the face [m].
    pub h: f64,
}

/// Size over least height of a cube's six tetrahedra: 2^(2/3).
const SIZE_OVER_HEIGHT: f64 = 1.587_401_051_968_199_5;

impl GhostFace {
    /// Face `f` of the first element, shared with the second.
    pub fn new(mesh: &Mesh, elements: [u32; 2], f: usize) -> Self {
        let tets = elements.map(|e| mesh.tets[e as usize]);
        let t = elements.map(|e| Tetrahedron::of(mesh, e as usize));
        let face = FACES[f].map(|c| tets[0][c]);
        let across =
            tets[1].into_iter().find(|n| !face.contains(n)).expect("elements share a face");
        let area = triangle_normal(face.map(|n| mesh.nodes[n as usize]));
        let size = norm(area);
        let height = 1.5 * (t[0].volume + t[1].volume) / size;
        let nodes = [face[0], face[1], face[2], tets[0][f], across];
        let slope = |side: usize, n: u32| {
            let corner = tets[side].iter().position(|&m| m == n);
            corner.map_or(0.0, |c| dot(t[side].grad[c], area) / size)
        };
        Self {
            nodes,
            elements,
            jump: nodes.map(|n| slope(0, n) - slope(1, n)),
            area: size,
            h: f64::min(0.5 * (t[0].size() + t[1].size()), SIZE_OVER_HEIGHT * height),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::boxes::tensor_box;

    /// Its entry at a node, over γ ρ/Δt and an element's volume: twelve at most in a cube's six tetrahedra.
    #[test]
    fn in_flat_elements_it_is_as_large_as_in_a_cubes() {
        for flat in [1.0, 0.3, 0.1, 0.01] {
            let mesh = tensor_box([&[0.0, flat, 2.0 * flat], &[0.0, 1.0, 2.0], &[0.0, 0.7, 1.4]]);
            let largest = faces(&mesh).map(|face| {
                let volume = Tetrahedron::of(&mesh, face.elements[0] as usize).volume;
                let slope = face.jump[3].abs().max(face.jump[4].abs());
                face.area * face.h.powi(3) * slope.powi(2) / volume
            });
            let largest = largest.fold(0.0, f64::max);
            assert!((4.0..12.0 + 1e-9).contains(&largest), "{largest} where flat by {flat}");
        }
    }

    fn faces(mesh: &Mesh) -> impl Iterator<Item = GhostFace> + '_ {
        (0..mesh.tets.len() as u32).flat_map(move |e| {
            FACES.iter().enumerate().filter_map(move |(f, corners)| {
                let face = corners.map(|c| mesh.tets[e as usize][c]);
                let shares = |tet: &[u32; 4]| face.iter().all(|n| tet.contains(n));
                let other =
                    (e + 1..mesh.tets.len() as u32).find(|&o| shares(&mesh.tets[o as usize]));
                other.map(|other| GhostFace::new(mesh, [e, other], f))
            })
        })
    }

    #[test]
    fn linear_functions_have_no_jump_and_a_kink_has_its_size() {
        let mesh = tensor_box([&[0.0, 1.0, 2.5], &[0.0, 0.7], &[0.0, 1.2]]);
        let mut seen = 0;
        for face in faces(&mesh) {
            let jump = |u: &dyn Fn([f64; 3]) -> f64| -> f64 {
                (0..5).map(|i| face.jump[i] * u(mesh.nodes[face.nodes[i] as usize])).sum()
            };
            assert!(jump(&|x| 3.0 + 2.0 * x[0] - x[1] + 0.5 * x[2]).abs() < 1e-12);
            if face.nodes[..3].iter().all(|&n| mesh.nodes[n as usize][0] == 1.0) {
                assert!((jump(&|x| (x[0] - 1.0).abs()).abs() - 2.0).abs() < 1e-12);
                seen += 1;
            }
        }
        assert_eq!(seen, 2);
    }
}
