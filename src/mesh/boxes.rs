//! Tetrahedral boxes: a tensor grid of cells, six tetrahedra each, mirrored from cell to cell.

use super::{BoundaryFace, Mesh};

/// Kuhn's six tetrahedra of a unit cell as paths 000 → 111 along the axes in each order.
const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];

/// A box from its grid lines along x, y, z. Diagonals alternate from cell to cell, so that no
/// direction is preferred. Boundaries: `x_min x_max y_min y_max z_min z_max`.
pub fn tensor_box(lines: [&[f64]; 3]) -> Mesh {
    let n = [lines[0].len() - 1, lines[1].len() - 1, lines[2].len() - 1];
    let node = |p: [usize; 3]| (p[0] + (n[0] + 1) * (p[1] + (n[1] + 1) * p[2])) as u32;
    let mut mesh = Mesh {
        boundary_names: ["x_min", "x_max", "y_min", "y_max", "z_min", "z_max"]
            .map(String::from)
            .to_vec(),
        ..Mesh::default()
    };
    for k in 0..=n[2] {
        for j in 0..=n[1] {
            for i in 0..=n[0] {
                mesh.nodes.push([lines[0][i], lines[1][j], lines[2][k]]);
            }
        }
    }
    for k in 0..n[2] {
        for j in 0..n[1] {
            for i in 0..n[0] {
                let cell = [i, j, k];
                let odd = (i + j + k) % 2 == 1;
                for (o, order) in ORDERS.iter().enumerate() {
                    // Corner offsets of the path, mirrored in every odd cell index.
                    let mut offset = [0usize; 3];
                    let mut tet = [0u32; 4];
                    let mut on = [[0usize; 3]; 4];
                    for v in 0..4 {
                        if v > 0 {
                            offset[order[v - 1]] = 1;
                        }
                        let mut p = [0; 3];
                        for a in 0..3 {
                            p[a] =
                                cell[a] + if cell[a] % 2 == 1 { 1 - offset[a] } else { offset[a] };
                        }
                        on[v] = p;
                        tet[v] = node(p);
                    }
                    // Even permutations are positive in an unmirrored cell.
                    if (o >= 3) != odd {
                        tet.swap(2, 3);
                        on.swap(2, 3);
                    }
                    let element = mesh.tets.len() as u32;
                    for f in [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]] {
                        for a in 0..3 {
                            for (side, at) in [(0, 0), (1, n[a])] {
                                if f.iter().all(|&v: &usize| on[v][a] == at) {
                                    mesh.boundary.push(BoundaryFace {
                                        nodes: f.map(|v| tet[v]),
                                        element,
                                        name: (2 * a + side) as u32,
                                    });
                                }
                            }
                        }
                    }
                    mesh.tets.push(tet);
                }
            }
        }
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::tetrahedron::Tetrahedron;

    #[test]
    fn volumes_and_boundary_normals_sum() {
        let x: Vec<f64> = (0..=5).map(|i| i as f64 * 0.2).collect();
        let z = [0.0, 0.1, 0.5];
        let mesh = tensor_box([&x, &x, &z]);
        let volume: f64 = (0..mesh.tets.len()).map(|e| Tetrahedron::of(&mesh, e).volume).sum();
        assert!((volume - 0.5).abs() < 1e-14);
        assert!((0..mesh.tets.len()).all(|e| Tetrahedron::of(&mesh, e).volume > 0.0));
        let mut area = [0.0; 6];
        for f in &mesh.boundary {
            let [a, b, c] = f.nodes.map(|n| nalgebra::Vector3::from(mesh.nodes[n as usize]));
            let normal = 0.5 * (b - a).cross(&(c - a));
            let outward = if f.name % 2 == 0 { -1.0 } else { 1.0 };
            area[f.name as usize] += outward * normal[f.name as usize / 2];
        }
        for (a, b) in area.iter().zip([0.5, 0.5, 0.5, 0.5, 1.0, 1.0]) {
            assert!((a - b).abs() < 1e-14);
        }
    }
}
