//! Uniform red refinement: each tetrahedron into eight, each boundary triangle into four.
//!
//! Corners are cut off at the edges' midpoints; the octahedron that remains is cut along its shortest
//! diagonal, which keeps the shapes of descendants good (Bey, Computing 55 (1995) 355; Zhang,
//! Houston J. Math. 21 (1995) 541).

use super::BoundaryFace;
use super::piece::{Piece, PieceNode, PieceTet};

/// Edges of a tetrahedron; opposite ones are 0 and 5, 1 and 4, 2 and 3.
const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// The edge between two corners.
const EDGE_OF: [[usize; 4]; 4] = [[6, 0, 1, 2], [0, 6, 3, 4], [1, 3, 6, 5], [2, 4, 5, 6]];

/// One level of refinement of a piece. `number` gives the global ids of the midpoints of edges (pairs
/// of global ids, smaller first, in ascending order): ascending too, and above all ids of nodes.
/// Children of element e are 8 e ... 8 e + 7.
pub fn refine_piece(piece: &Piece, number: impl FnOnce(&[[u64; 2]]) -> Vec<u64>) -> Piece {
    let x = |node: u32| piece.nodes[node as usize].x;
    let key = |a: u32, b: u32| u64::from(a.min(b)) << 32 | u64::from(a.max(b));
    let mut edges = Vec::with_capacity(6 * piece.tets.len());
    for tet in &piece.tets {
        edges.extend(EDGES.map(|[a, b]| key(tet.nodes[a], tet.nodes[b])));
    }
    edges.sort_unstable();
    edges.dedup();
    edges.shrink_to_fit();

    // Local order is global order: sorted here is sorted everywhere.
    let ends = |edge: u64| [(edge >> 32) as u32, edge as u32];
    let named: Vec<[u64; 2]> =
        edges.iter().map(|&edge| ends(edge).map(|n| piece.nodes[n as usize].global)).collect();
    let ids = number(&named);
    drop(named);
    let mut nodes = Vec::with_capacity(piece.nodes.len() + edges.len());
    nodes.extend_from_slice(&piece.nodes);
    for (&edge, global) in edges.iter().zip(ids) {
        let [a, b] = ends(edge).map(x);
        let middle = std::array::from_fn(|i| 0.5 * (a[i] + b[i]));
        nodes.push(PieceNode { global, x: middle });
    }
    debug_assert!(nodes.windows(2).all(|pair| pair[0].global < pair[1].global));

    let first = piece.nodes.len();
    let middle = |a: u32, b: u32| {
        let at = edges.binary_search(&key(a, b)).expect("every edge of an element is listed");
        (first + at) as u32
    };
    let mut tets = Vec::with_capacity(8 * piece.tets.len());
    let mut boundary = Vec::with_capacity(4 * piece.boundary.len());
    let mut faces = piece.boundary.iter().peekable();
    for (e, tet) in (0u32..).zip(&piece.tets) {
        let middles = EDGES.map(|[a, b]| middle(tet.nodes[a], tet.nodes[b]));
        let children = children(tet.nodes, middles, tet.nodes.map(x));
        tets.extend(
            (0..).zip(children).map(|(k, nodes)| PieceTet { global: 8 * tet.global + k, nodes }),
        );
        let start = boundary.len();
        while let Some(face) = faces.next_if(|face| face.element == e) {
            let [a, b, c] = face.nodes;
            let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
            for nodes in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]] {
                let child = children.iter().position(|tet| nodes.iter().all(|n| tet.contains(n)));
                let child = child.expect("a boundary face is a face of its element");
                let element = 8 * e + child as u32;
                boundary.push(BoundaryFace { nodes, element, name: face.name });
            }
        }
        boundary[start..].sort_by_key(|face| face.element);
    }
    Piece { nodes, tets, boundary }
}

/// The eight children of a tetrahedron: `v` its corners, `m` the midpoints of its `EDGES`, `x` the
/// corners' coordinates. All are oriented as their parent.
fn children(v: [u32; 4], m: [u32; 6], x: [[f64; 3]; 4]) -> [[u32; 4]; 8] {
    let square = |p: [f64; 3], q: [f64; 3]| (0..3).map(|i| (p[i] - q[i]).powi(2)).sum::<f64>();
    let length = |edge: usize| square(x[EDGES[edge][0]], x[EDGES[edge][1]]);
    let middle = |edge: usize| {
        let [a, b] = EDGES[edge].map(|corner| x[corner]);
        std::array::from_fn(|i| 0.5 * (a[i] + b[i]))
    };
    // Diagonals join midpoints of opposite edges. Of two equally short ones (all boxes have such) the
    // one between the more equal edges keeps the shapes: children of Kuhn's tetrahedra are Kuhn's.
    let cost = |edge: usize| {
        square(middle(edge), middle(5 - edge)) + 1e-6 * (length(edge) - length(5 - edge)).abs()
    };
    let shortest = (1..3).fold(0, |best, edge| if cost(edge) < cost(best) { edge } else { best });
    let [a, b] = EDGES[shortest];
    let [c, d] = EDGES[5 - shortest];
    let between = |p: usize, q: usize| m[EDGE_OF[p][q]];
    // Around the diagonal ab-cd, in the sense that makes a, b, c, d positive; else the other way.
    let mut ring = [between(a, c), between(a, d), between(b, d), between(b, c)];
    if shortest == 1 {
        ring.reverse();
    }
    let [p, q] = [m[shortest], m[5 - shortest]];
    [
        [v[0], m[0], m[1], m[2]],
        [m[0], v[1], m[3], m[4]],
        [m[1], m[3], v[2], m[5]],
        [m[2], m[4], m[5], v[3]],
        [p, q, ring[0], ring[1]],
        [p, q, ring[1], ring[2]],
        [p, q, ring[2], ring[3]],
        [p, q, ring[3], ring[0]],
    ]
}

#[cfg(test)]
mod tests {
    use crate::mesh::boxes::tensor_box;
    use crate::mesh::{Mesh, MeshPart};
    use std::collections::HashMap;

    fn refined(mesh: &Mesh, levels: u32) -> Mesh {
        let comm = MeshPart::single(mesh.clone()).comm;
        MeshPart::distribute(&comm, Some(mesh.clone()), levels).unwrap().mesh
    }
    fn edge(mesh: &Mesh, a: u32, b: u32) -> nalgebra::Vector3<f64> {
        let [a, b] = [a, b].map(|n| nalgebra::Vector3::from(mesh.nodes[n as usize]));
        b - a
    }
    fn volume(mesh: &Mesh, [a, b, c, d]: [u32; 4]) -> f64 {
        edge(mesh, a, b).cross(&edge(mesh, a, c)).dot(&edge(mesh, a, d)) / 6.0
    }
    /// Mean ratio 12 (3 V)^(2/3) / Σ l²: 1 for the regular tetrahedron, 0 for a flat one.
    fn quality(mesh: &Mesh, tet: [u32; 4]) -> f64 {
        let squares = super::EDGES.map(|[a, b]| edge(mesh, tet[a], tet[b]).norm_squared());
        12.0 * (3.0 * volume(mesh, tet)).cbrt().powi(2) / squares.iter().sum::<f64>()
    }
    fn worst(mesh: &Mesh) -> f64 {
        mesh.tets.iter().map(|&tet| quality(mesh, tet)).fold(f64::INFINITY, f64::min)
    }
    fn areas(mesh: &Mesh) -> Vec<f64> {
        let mut areas = vec![0.0; mesh.boundary_names.len()];
        for face in &mesh.boundary {
            let [a, b, c] = face.nodes;
            areas[face.name as usize] += 0.5 * edge(mesh, a, b).cross(&edge(mesh, a, c)).norm();
        }
        areas
    }
    /// A box whose inner nodes are moved by up to a fifth of a cell: no two tetrahedra are alike.
    fn jittered(n: usize) -> Mesh {
        let h = 1.0 / n as f64;
        let lines: Vec<f64> = (0..=n).map(|i| i as f64 * h).collect();
        let mut mesh = tensor_box([&lines, &lines, &lines]);
        let mut random = 1u64;
        for x in mesh.nodes.iter_mut().flatten() {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            if *x > 0.0 && *x < 1.0 {
                *x += 0.2 * h * ((random >> 11) as f64 / (1u64 << 52) as f64 - 1.0);
            }
        }
        mesh
    }

    #[test]
    fn volume_areas_and_names_stay() {
        let mesh = jittered(3);
        let before = areas(&mesh);
        let fine = refined(&mesh, 2);
        assert_eq!(fine.tets.len(), 64 * mesh.tets.len());
        assert_eq!(fine.boundary.len(), 16 * mesh.boundary.len());
        assert!(fine.tets.iter().all(|&tet| volume(&fine, tet) > 0.0));
        let total: f64 = fine.tets.iter().map(|&tet| volume(&fine, tet)).sum();
        assert!((total - 1.0).abs() < 1e-13);
        assert_eq!(fine.boundary_names, mesh.boundary_names);
        assert!(areas(&fine).iter().zip(before).all(|(a, b)| (a - b).abs() < 1e-13));
    }

    #[test]
    fn every_face_is_shared_by_two_or_a_boundary() {
        let fine = refined(&jittered(2), 2);
        let mut sides: HashMap<[u32; 3], Vec<u32>> = HashMap::new();
        let sorted = |mut face: [u32; 3]| {
            face.sort_unstable();
            face
        };
        for (e, tet) in (0..).zip(&fine.tets) {
            for [a, b, c] in crate::mesh::FACES {
                sides.entry(sorted([tet[a], tet[b], tet[c]])).or_default().push(e);
            }
        }
        for face in &fine.boundary {
            assert_eq!(sides.remove(&sorted(face.nodes)), Some(vec![face.element]));
            // The normal points away from the fourth corner.
            let tet = fine.tets[face.element as usize];
            let inner = tet.into_iter().find(|n| !face.nodes.contains(n)).unwrap();
            let [a, b, c] = face.nodes;
            assert!(volume(&fine, [a, b, c, inner]) < 0.0);
        }
        assert!(sides.values().all(|elements| elements.len() == 2));
    }

    /// Kuhn's tetrahedra, of which boxes are made, have children like themselves, whatever the sides
    /// of the box (Bey's theorem: at most three classes; for Kuhn's, one and its mirror image).
    #[test]
    fn boxes_keep_their_quality() {
        let mesh = tensor_box([&[0.0, 1.0, 2.0], &[0.0, 0.7], &[0.0, 0.45]]);
        let before = worst(&mesh);
        for levels in 1..4 {
            let after = worst(&refined(&mesh, levels));
            assert!(
                (after - before).abs() < 1e-12,
                "{before} became {after} after {levels} levels"
            );
        }
    }

    #[test]
    fn quality_settles_under_repeated_refinement() {
        let mut random = 1u64;
        let mut number = || {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (random >> 11) as f64 / (1u64 << 53) as f64
        };
        for _ in 0..20 {
            let nodes: Vec<[f64; 3]> = (0..4).map(|_| [number(), number(), number()]).collect();
            let mut mesh = Mesh { nodes, tets: vec![[0, 1, 2, 3]], ..Mesh::default() };
            if volume(&mesh, mesh.tets[0]) < 0.0 {
                mesh.tets[0].swap(0, 1);
            }
            let series: Vec<f64> = (0..6).map(|levels| worst(&refined(&mesh, levels))).collect();
            assert!(
                series[5] > (1.0 - 1e-9) * series[3] && series[5] > 0.8 * series[0],
                "{series:?}"
            );
        }
    }
}
