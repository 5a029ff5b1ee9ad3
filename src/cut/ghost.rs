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
    /// Mean size of the two elements [m].
    pub h: f64,
}

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
            h: 0.5 * (t[0].size() + t[1].size()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::boxes::tensor_box;

    #[test]
    fn linear_functions_have_no_jump_and_a_kink_has_its_size() {
        let mesh = tensor_box([&[0.0, 1.0, 2.5], &[0.0, 0.7], &[0.0, 1.2]]);
        let mut seen = 0;
        for e in 0..mesh.tets.len() as u32 {
            for f in 0..4 {
                let face = FACES[f].map(|c| mesh.tets[e as usize][c]);
                let other = (0..mesh.tets.len() as u32)
                    .find(|&g| g != e && face.iter().all(|n| mesh.tets[g as usize].contains(n)));
                let Some(other) = other else { continue };
                let ghost = GhostFace::new(&mesh, [e, other], f);
                let jump = |u: &dyn Fn([f64; 3]) -> f64| -> f64 {
                    (0..5).map(|i| ghost.jump[i] * u(mesh.nodes[ghost.nodes[i] as usize])).sum()
                };
                assert!(jump(&|x| 3.0 + 2.0 * x[0] - x[1] + 0.5 * x[2]).abs() < 1e-12);
                if face.iter().all(|&n| mesh.nodes[n as usize][0] == 1.0) {
                    assert!((jump(&|x| (x[0] - 1.0).abs()).abs() - 2.0).abs() < 1e-12);
                    seen += 1;
                }
            }
        }
        assert_eq!(seen, 4);
    }
}
