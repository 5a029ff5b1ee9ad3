//! The tetrahedral mesh: pure geometry, and this rank's piece of it.

pub mod boxes;
pub mod part;

pub use part::MeshPart;

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
