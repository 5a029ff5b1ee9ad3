//! The tetrahedral mesh: pure geometry, and this rank's piece of it.

pub mod balance;
pub mod boxes;
pub mod chord;
pub mod connected;
pub mod error;
mod faces;
pub mod import;
pub mod locate;
pub mod number;
mod order;
pub mod part;
mod piece;
pub mod quality;
mod refine;
pub mod tetrahedron;

pub use error::MeshError;
pub use part::MeshPart;

/// Faces of a tetrahedron, face `i` opposite corner `i`, normals out of a positive one.
pub const FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

/// A triangle of the boundary, seen from the fluid: its normal (right-hand rule) points out.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BoundaryFace {
    /// Corner nodes.
    pub nodes: [u32; 3],
    /// The element it is a face of.
    pub element: u32,
    /// Index into `Mesh::boundary_names`.
    pub name: u32,
}

/// Nodes, tetrahedra and named boundary faces.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Coordinates [m].
    pub nodes: Vec<[f64; 3]>,
    /// Corner nodes, positively oriented: det(x1−x0, x2−x0, x3−x0) > 0.
    pub tets: Vec<[u32; 4]>,
    /// Boundary faces; each belongs to one element and has one name.
    pub boundary: Vec<BoundaryFace>,
    /// Names of boundaries.
    pub boundary_names: Vec<String>,
}

impl Mesh {
    /// Places of an element's corners.
    #[inline]
    pub fn corners(&self, element: usize) -> [[f64; 3]; 4] {
        self.tets[element].map(|n| self.nodes[n as usize])
    }

    /// Mean of the places of three nodes.
    pub fn centre(&self, nodes: [u32; 3]) -> [f64; 3] {
        let x = nodes.map(|n| self.nodes[n as usize]);
        std::array::from_fn(|k| (x[0][k] + x[1][k] + x[2][k]) / 3.0)
    }

    /// Leaves out nodes of no element; the others keep their order.
    pub fn drop_unused_nodes(&mut self) {
        let mut number = vec![u32::MAX; self.nodes.len()];
        for &i in self.tets.iter().flatten() {
            number[i as usize] = 0;
        }
        let mut kept = 0;
        for (i, n) in number.iter_mut().enumerate().filter(|(_, n)| **n == 0) {
            self.nodes[kept as usize] = self.nodes[i];
            *n = kept;
            kept += 1;
        }
        self.nodes.truncate(kept as usize);
        let faces = self.boundary.iter_mut().flat_map(|f| &mut f.nodes);
        for i in self.tets.iter_mut().flatten().chain(faces) {
            *i = number[*i as usize];
        }
    }
}
