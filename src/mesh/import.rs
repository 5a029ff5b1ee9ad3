//! A mesh from elsewhere: tetrahedra and named triangles become a `Mesh`.

use super::faces::FaceTable;
use super::quality::{finite_nodes, flat};
use super::{BoundaryFace, FACES, Mesh, MeshError};
use crate::mesh::tetrahedron::Tetrahedron;

/// Name of boundary faces that carry no other.
pub const UNNAMED: &str = "unnamed";

/// Turns inverted tetrahedra over, leaves out nodes of no tetrahedron, and makes every exterior face
/// a boundary face: with the name (index into `names`) of its triangle, or `UNNAMED`.
///
/// # Errors
/// Places that are no numbers, nodes that do not exist, flat or overlapping elements, triangles
/// inside the mesh, away from it or with two names.
pub fn import(
    nodes: Vec<[f64; 3]>,
    tets: Vec<[u32; 4]>,
    triangles: &[([u32; 3], u32)],
    names: Vec<String>,
) -> Result<Mesh, MeshError> {
    let mut mesh = Mesh { nodes, tets, boundary: Vec::new(), boundary_names: names };
    finite_nodes(&mesh)?;
    existing(&mesh, "tetrahedron", mesh.tets.iter().map(|t| &t[..]))?;
    existing(&mesh, "surface triangle", triangles.iter().map(|t| &t.0[..]))?;
    for element in 0..mesh.tets.len() {
        let volume = Tetrahedron::of(&mesh, element).volume;
        if let Some(error) = flat(&mesh, element, volume) {
            return Err(error);
        }
        if volume < 0.0 {
            mesh.tets[element].swap(2, 3);
        }
    }
    let table = FaceTable::new(&mesh)?;
    let exterior = table.exterior();
    let none = u32::MAX;
    let mut name = vec![none; exterior.len()];
    for &(nodes, n) in triangles {
        let at = || mesh.centre(nodes);
        let named = |i: u32| mesh.boundary_names[i as usize].clone();
        let face = match table.find(nodes) {
            (Some(face), 1) => face,
            (Some(_), _) => return Err(MeshError::Interior { name: named(n), at: at() }),
            (None, _) => return Err(MeshError::Loose { name: named(n), at: at() }),
        };
        let i = exterior.binary_search(&face).expect("a face of one element is exterior");
        if name[i] != none && name[i] != n {
            return Err(MeshError::TwoNames { at: at(), names: [named(name[i]), named(n)] });
        }
        name[i] = n;
    }
    if name.contains(&none) {
        let known = mesh.boundary_names.iter().position(|n| n == UNNAMED);
        let unnamed = known.unwrap_or_else(|| {
            mesh.boundary_names.push(UNNAMED.into());
            mesh.boundary_names.len() - 1
        }) as u32;
        name.iter_mut().filter(|n| **n == none).for_each(|n| *n = unnamed);
    }
    for (face, name) in exterior.into_iter().zip(name) {
        let tet = mesh.tets[face.element as usize];
        let nodes = FACES[face.face as usize].map(|v| tet[v]);
        mesh.boundary.push(BoundaryFace { nodes, element: face.element, name });
    }
    mesh.drop_unused_nodes();
    Ok(mesh)
}

fn existing<'a>(
    mesh: &Mesh,
    what: &'static str,
    all: impl Iterator<Item = &'a [u32]>,
) -> Result<(), MeshError> {
    let nodes = mesh.nodes.len();
    for (index, corners) in all.enumerate() {
        if let Some(&node) = corners.iter().find(|&&n| n as usize >= nodes) {
            return Err(MeshError::NoSuchNode { what, index, node, nodes });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::boxes::tensor_box;
    use crate::mesh::quality::check;

    /// A box taken apart: its tetrahedra and its boundary as named triangles.
    fn parts() -> (Mesh, Vec<([u32; 3], u32)>) {
        let mesh = tensor_box([&[0.0, 1.0, 2.0], &[0.0, 1.0], &[0.0, 1.0, 3.0]]);
        let triangles = mesh.boundary.iter().map(|f| (f.nodes, f.name)).collect();
        (mesh, triangles)
    }

    #[test]
    fn a_box_taken_apart_is_put_together_again() {
        let (mesh, mut triangles) = parts();
        let mut nodes = mesh.nodes.clone();
        nodes.push([9.0; 3]); // of no element
        let mut tets = mesh.tets.clone();
        tets[3].swap(0, 1); // inverted
        triangles.iter_mut().step_by(2).for_each(|t| t.0.swap(0, 1));
        triangles.reverse();
        triangles.retain(|t| t.1 != 2);
        let put = import(nodes, tets, &triangles, mesh.boundary_names.clone()).unwrap();
        assert_eq!(put.nodes, mesh.nodes);
        assert_eq!(put.boundary_names.last().unwrap(), UNNAMED);
        check(&put).unwrap();
        let key = |mesh: &Mesh, f: &BoundaryFace| {
            let mut nodes = f.nodes;
            nodes.sort_unstable();
            (nodes, mesh.boundary_names[f.name as usize].replace("y_min", UNNAMED))
        };
        let mut a: Vec<_> = mesh.boundary.iter().map(|f| key(&mesh, f)).collect();
        let mut b: Vec<_> = put.boundary.iter().map(|f| key(&put, f)).collect();
        a.sort();
        b.sort();
        assert_eq!(a, b);
    }

    #[test]
    fn misplaced_surfaces_are_errors() {
        let (mesh, triangles) = parts();
        let error = |extra: ([u32; 3], u32)| {
            let mut triangles = triangles.clone();
            triangles.push(extra);
            let Mesh { nodes, tets, boundary_names, .. } = mesh.clone();
            import(nodes, tets, &triangles, boundary_names).unwrap_err().to_string()
        };
        let (first, name) = triangles[0];
        let (is, other) = (&mesh.boundary_names[name as usize], &mesh.boundary_names[5]);
        let wanted = format!("belongs to \"{is}\" and to \"{other}\": each face");
        assert!(error((first, 5)).contains(&wanted));
        let inside = mesh.tets[0];
        let interior = FACES
            .map(|f| f.map(|v| inside[v]))
            .into_iter()
            .find(|f| FaceTable::new(&mesh).unwrap().find(*f).1 == 2)
            .unwrap();
        assert!(error((interior, 5)).starts_with("surface \"z_max\" lies inside the mesh at ("));
        assert!(error(([0, 1, 17], 5)).contains("is no face of any tetrahedron"));
        assert!(error(([0, 1, 18], 5)).contains("names node 18; the mesh has 18 nodes"));
    }
}
