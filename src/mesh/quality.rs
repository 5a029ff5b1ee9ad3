//! Is this a mesh one can compute on, and how good is it? Shape of an element: 3 r_in / R_circ, 1 for
//! the regular tetrahedron, 0 for a flat one.

use super::faces::FaceTable;
use super::{FACES, Mesh, MeshError};
use crate::mesh::tetrahedron::Tetrahedron;
use std::fmt;

/// Elements below this share of their longest edge cubed have no volume.
const FLAT: f64 = 1e-12;
/// Nodes closer than this share of the mesh's extent are at one place.
const SAME: f64 = 1e-9;

/// Numbers that describe a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Quality {
    /// Number of nodes.
    pub nodes: usize,
    /// Number of tetrahedra.
    pub tets: usize,
    /// Volume of all tetrahedra [m³].
    pub volume: f64,
    /// Smallest and largest element size h_e [m].
    pub size: [f64; 2],
    /// Smallest and mean shape, 0..1.
    pub shape: [f64; 2],
    /// Smallest angle between two faces of an element [degrees].
    pub dihedral: f64,
    /// Name, number of faces and area [m²] of each boundary.
    pub boundaries: Vec<(String, usize, f64)>,
}

impl fmt::Display for Quality {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "mesh: {} nodes, {} tetrahedra, {:.6} m³", self.nodes, self.tets, self.volume)?;
        write!(
            f,
            "      size {:.4} to {:.4} m, shape (3 r/R) at least {:.3}, mean {:.3}, angles at least \
             {:.1}°",
            self.size[0], self.size[1], self.shape[0], self.shape[1], self.dihedral
        )?;
        for (name, faces, area) in &self.boundaries {
            write!(f, "\n      boundary {name}: {faces} faces, {area:.6} m²")?;
        }
        Ok(())
    }
}

/// Checks a whole mesh and measures it, in time linear in its size (but for one sort of the nodes).
///
/// # Errors
/// Nothing to compute on, coordinates that are no numbers, inverted, flat or overlapping elements,
/// nodes of no element or at the same place, several pieces.
///
/// # Panics
/// If the boundary faces are not exactly the exterior faces: `boxes` and `import` make them so.
pub fn check(mesh: &Mesh) -> Result<Quality, MeshError> {
    if mesh.tets.is_empty() {
        return Err(MeshError::Empty { because: "" });
    }
    finite_nodes(mesh)?;
    let mut quality = Quality {
        nodes: mesh.nodes.len(),
        tets: mesh.tets.len(),
        volume: 0.0,
        size: [f64::INFINITY, 0.0],
        shape: [f64::INFINITY, 0.0],
        dihedral: f64::INFINITY,
        boundaries: mesh.boundary_names.iter().map(|n| (n.clone(), 0, 0.0)).collect(),
    };
    for element in 0..mesh.tets.len() {
        let tet = Tetrahedron::of(mesh, element);
        if let Some(error) = flat(mesh, element, tet.volume) {
            return Err(error);
        }
        if tet.volume < 0.0 {
            let (volume, corners) = (tet.volume, Box::new(mesh.corners(element)));
            return Err(MeshError::Inverted { element, volume, corners });
        }
        let (h, shape) = (tet.size(), shape(mesh.corners(element), tet.volume));
        quality.volume += tet.volume;
        quality.size = [quality.size[0].min(h), quality.size[1].max(h)];
        quality.shape = [quality.shape[0].min(shape), quality.shape[1] + shape];
        quality.dihedral = quality.dihedral.min(smallest_angle(&tet));
    }
    quality.shape[1] /= mesh.tets.len() as f64;
    distinct_nodes(mesh)?;
    one_piece(mesh)?;
    let table = FaceTable::new(mesh)?;
    for f in &mesh.boundary {
        let corners = mesh.tets[f.element as usize];
        let (found, elements) = table.find(f.nodes);
        let outward = FACES.iter().any(|face| {
            (0..3).any(|turn| (0..3).all(|v| corners[face[(v + turn) % 3]] == f.nodes[v]))
        });
        assert!(
            elements == 1 && found.is_some_and(|found| found.element == f.element) && outward,
            "a boundary face is the outside of one element, seen from it: {f:?}"
        );
        let boundary = &mut quality.boundaries[f.name as usize];
        boundary.1 += 1;
        boundary.2 += area(f.nodes.map(|n| mesh.nodes[n as usize]));
    }
    let mut faces: Vec<_> = mesh.boundary.iter().map(|f| (f.element, f.nodes)).collect();
    faces.sort_unstable();
    faces.dedup();
    let exterior = table.exterior().len();
    assert!(
        faces.len() == exterior && mesh.boundary.len() == exterior,
        "every exterior face has one name: {} boundary faces, {exterior} exterior faces",
        mesh.boundary.len()
    );
    Ok(quality)
}

/// Every coordinate is a number.
pub(super) fn finite_nodes(mesh: &Mesh) -> Result<(), MeshError> {
    let finite = |x: &[f64; 3]| x.iter().all(|x| x.is_finite());
    match mesh.nodes.iter().position(|x| !finite(x)) {
        Some(node) => Err(MeshError::NotANumber { node, at: mesh.nodes[node] }),
        None => Ok(()),
    }
}

/// The error of an element whose volume is nothing beside its longest edge.
pub(super) fn flat(mesh: &Mesh, element: usize, volume: f64) -> Option<MeshError> {
    let corners = mesh.corners(element);
    let mut longest: f64 = 0.0;
    for i in 0..4 {
        for j in 0..i {
            longest = longest.max(distance(corners[i], corners[j]));
        }
    }
    let edge = longest;
    // Not so for volumes that overflow, either.
    let solid = volume.abs() > FLAT * edge.powi(3);
    (!solid).then_some(MeshError::Flat { element, volume, edge, corners: corners.into() })
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}

/// Heron's formula in Kahan's form.
fn area([a, b, c]: [[f64; 3]; 3]) -> f64 {
    let mut edges = [distance(a, b), distance(b, c), distance(c, a)];
    edges.sort_by(f64::total_cmp);
    let [c, b, a] = edges;
    let product = (a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c));
    0.25 * product.max(0.0).sqrt()
}

/// 3 r_in / R_circ with r_in = 3V / ΣA and 24 V R_circ the Heron product of the three products of
/// opposite edges.
fn shape(x: [[f64; 3]; 4], volume: f64) -> f64 {
    let surface: f64 = FACES.iter().map(|f| area(f.map(|v| x[v]))).sum();
    let opposite =
        |i: usize, j: usize, k: usize, l: usize| distance(x[i], x[j]) * distance(x[k], x[l]);
    let (p, q, r) = (opposite(0, 1, 2, 3), opposite(0, 2, 1, 3), opposite(0, 3, 1, 2));
    let heron = (p + q + r) * (p + q - r) * (p - q + r) * (q + r - p);
    let inner = 3.0 * volume / surface;
    let outer = heron.max(0.0).sqrt() / (24.0 * volume);
    3.0 * inner / outer
}

/// cos of the angle between faces i and j is −∇N_i·∇N_j / |∇N_i||∇N_j|.
fn smallest_angle(tet: &Tetrahedron) -> f64 {
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let length = tet.grad.map(|g| dot(g, g).sqrt());
    let mut cosine: f64 = -1.0;
    for i in 0..4 {
        for j in 0..i {
            cosine = cosine.max(-dot(tet.grad[i], tet.grad[j]) / (length[i] * length[j]));
        }
    }
    cosine.min(1.0).acos().to_degrees()
}

/// No two nodes at one place. Sorted along a direction in which grid planes do not coincide, equal
/// nodes are neighbours.
fn distinct_nodes(mesh: &Mesh) -> Result<(), MeshError> {
    const GENERIC: [f64; 3] = [0.537_231_841, 0.612_377_173, 0.579_943_307];
    let extent = mesh.nodes.iter().flatten().fold(0.0f64, |m, x| m.max(x.abs()));
    let mut along: Vec<(f64, usize)> = mesh
        .nodes
        .iter()
        .enumerate()
        .map(|(i, x)| ((0..3).map(|k| GENERIC[k] * x[k]).sum(), i))
        .collect();
    along.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    for (place, &(p, i)) in along.iter().enumerate() {
        for &(_, j) in along[place + 1..].iter().take_while(|n| n.0 - p <= 2.0 * SAME * extent) {
            if distance(mesh.nodes[i], mesh.nodes[j]) <= SAME * extent {
                let nodes = [i.min(j), i.max(j)];
                return Err(MeshError::SamePlace { nodes, at: mesh.nodes[i] });
            }
        }
    }
    Ok(())
}

/// Every node belongs to an element, and elements that share nodes reach every other.
fn one_piece(mesh: &Mesh) -> Result<(), MeshError> {
    let mut root: Vec<u32> = (0..mesh.nodes.len() as u32).collect();
    let mut used = vec![false; mesh.nodes.len()];
    fn find(root: &mut [u32], mut i: u32) -> u32 {
        while root[i as usize] != i {
            root[i as usize] = root[root[i as usize] as usize];
            i = root[i as usize];
        }
        i
    }
    for tet in &mesh.tets {
        let first = find(&mut root, tet[0]);
        for &n in tet {
            used[n as usize] = true;
            let other = find(&mut root, n);
            root[other as usize] = first;
        }
    }
    if let Some(node) = used.iter().position(|used| !used) {
        return Err(MeshError::Orphan { node });
    }
    let roots: Vec<usize> = (0..root.len()).filter(|&i| root[i] as usize == i).collect();
    match roots[..] {
        [.., last] if roots.len() > 1 => {
            Err(MeshError::Pieces { pieces: roots.len(), at: mesh.nodes[last] })
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::boxes::tensor_box;

    fn cube() -> Mesh {
        tensor_box([&[0.0, 1.0, 2.0]; 3].map(|l: &[f64; 3]| &l[..]))
    }

    #[test]
    fn numbers_of_known_tetrahedra() {
        let regular = [[1.0, 1.0, 1.0], [-1.0, 1.0, -1.0], [1.0, -1.0, -1.0], [-1.0, -1.0, 1.0]];
        let tet = Tetrahedron::new(regular);
        assert!((shape(regular, tet.volume) - 1.0).abs() < 1e-14);
        assert!((smallest_angle(&tet) - (1f64 / 3.0).acos().to_degrees()).abs() < 1e-12);
        // Kuhn's tetrahedron of a cube: r = 1/(2 + 2√2), R = √3/2, dihedral angles 45°, 60°, 90°.
        let q = check(&cube()).unwrap();
        let kuhn = 3.0 / (2.0 + 8f64.sqrt()) / 0.75f64.sqrt();
        assert!((q.shape[0] - kuhn).abs() < 1e-14 && (q.shape[1] - kuhn).abs() < 1e-14);
        assert!((q.dihedral - 45.0).abs() < 1e-12);
        assert!((q.size[0] - 2f64.sqrt().cbrt()).abs() < 1e-14 && (q.volume - 8.0).abs() < 1e-13);
        assert_eq!((q.nodes, q.tets), (27, 48));
        assert!(q.boundaries.iter().all(|b| b.1 == 8 && (b.2 - 4.0).abs() < 1e-14));
        assert!(q.to_string().starts_with("mesh: 27 nodes, 48 tetrahedra, 8.000000 m³\n"));
    }

    #[test]
    fn bad_meshes_are_errors_with_numbers() {
        let error = |change: fn(&mut Mesh)| {
            let mut mesh = cube();
            change(&mut mesh);
            check(&mesh).unwrap_err().to_string()
        };
        assert_eq!(
            error(|m| m.tets[5].swap(0, 1)),
            "tetrahedron 5 is inverted: volume -1.667e-1 m³, corners (0, 1, 0) (0, 0, 0) (1, 1, 1) \
             (1, 1, 0)"
        );
        assert!(error(|m| m.nodes[13] = [0.0, 1.0, 1.0]).contains("is flat"));
        assert!(error(|m| m.nodes[13][2] = 1e200).contains("is flat"));
        assert_eq!(error(|m| m.nodes[13][1] = f64::NAN), "node 13: its place is (1, NaN, 1)");
        assert_eq!(error(|m| m.nodes.push([5.0; 3])), "node 27 belongs to no tetrahedron");
        assert!(error(|m| m.tets.clear()).contains("no tetrahedra"));
        let twice = error(|m| m.tets.push(m.tets[7]));
        assert!(twice.starts_with("tetrahedra [7, 48] overlap"), "{twice}");
        let apart = |m: &mut Mesh, by: f64| {
            let n = m.nodes.len() as u32;
            m.nodes.extend(cube().nodes.iter().map(|x| [x[0] + by, x[1], x[2]]));
            m.tets.extend(cube().tets.iter().map(|t| t.map(|i| i + n)));
            m.boundary.clear();
        };
        let mut mesh = cube();
        apart(&mut mesh, 3.0);
        assert!(check(&mesh).unwrap_err().to_string().contains("falls into 2 pieces"));
        let mut mesh = cube();
        apart(&mut mesh, 2.0);
        let error = check(&mesh).unwrap_err().to_string();
        assert!(error.contains("are both at (2, ") && error.contains("Coherence"), "{error}");
    }

    #[test]
    #[should_panic(expected = "every exterior face has one name")]
    fn a_lost_boundary_face_is_a_broken_invariant() {
        let mut mesh = cube();
        mesh.boundary.pop();
        let _ = check(&mesh);
    }
}
