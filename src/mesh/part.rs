//! This rank's piece of the mesh and its halo (METHOD §7 ownership).

use super::Mesh;
use partition::{Communicator, Exchange, IndexMap};

/// Makes a structure of plain data fit for halo exchange; names all its fields.
pub use partition::item;

/// A rank's elements: its METIS elements first, then those touching a node it owns, then their face
/// neighbours. Integrals run over `mesh.tets[..n_owned_elements]`, matrix rows over owned nodes
/// (assembled from all local elements). `mesh.boundary` holds every boundary face of every local
/// element, those of owned elements first (`n_owned_faces`).
#[derive(Clone, Debug)]
pub struct MeshPart {
    /// Local geometry: node `i` here is local index `i` of `nodes`.
    pub mesh: Mesh,
    /// Owned nodes first, then ghosts.
    pub nodes: IndexMap,
    /// Halo of nodal values.
    pub exchange: Exchange,
    /// Elements that METIS gave to this rank: the first of `mesh.tets`.
    pub n_owned_elements: usize,
    /// Boundary faces of owned elements: the first of `mesh.boundary`.
    pub n_owned_faces: usize,
    /// Global id of each local element.
    pub element_global: Vec<u64>,
    /// The ranks that share the mesh.
    pub comm: Communicator,
}

impl MeshPart {
    /// The whole mesh on one rank.
    pub fn single(mesh: Mesh) -> Self {
        let comm = Communicator::single();
        let nodes = IndexMap::single(mesh.nodes.len());
        let exchange = Exchange::new(&comm, &nodes);
        let (ne, nf) = (mesh.tets.len(), mesh.boundary.len());
        Self {
            mesh,
            nodes,
            exchange,
            n_owned_elements: ne,
            n_owned_faces: nf,
            element_global: (0..ne as u64).collect(),
            comm,
        }
    }
    /// Sum over ranks.
    pub fn sum(&self, x: f64) -> f64 {
        self.comm.sum(x)
    }
    /// Largest over ranks.
    pub fn max(&self, x: f64) -> f64 {
        self.comm.max(x)
    }
    /// Number of nodes this rank owns.
    pub fn n_owned(&self) -> usize {
        self.nodes.n_owned
    }
    /// Owned and ghost nodes.
    pub fn n_local(&self) -> usize {
        self.nodes.len()
    }
}
