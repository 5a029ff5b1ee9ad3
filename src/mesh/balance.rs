//! How evenly the mesh is spread over the ranks, and what the cuts cost.

use super::MeshPart;
use super::part::item;

/// What one rank holds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Share {
    /// METIS elements.
    pub owned_elements: u64,
    /// These and the halo's.
    pub local_elements: u64,
    /// Matrix rows.
    pub owned_nodes: u64,
    /// Nodes of other ranks seen here.
    pub ghost_nodes: u64,
    /// Ranks that want nodal values from here.
    pub neighbours: u64,
    /// Faces between this rank's METIS elements and others'.
    pub cut_faces: u64,
}
item!(Share { owned_elements, local_elements, owned_nodes, ghost_nodes, neighbours, cut_faces });

/// Every rank's share.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Balance {
    /// In rank order.
    pub ranks: Vec<Share>,
}

impl Balance {
    /// Of a distributed mesh. Collective; the same on every rank.
    pub fn of(part: &MeshPart) -> Self {
        let mine = Share {
            owned_elements: part.n_owned_elements as u64,
            local_elements: part.mesh.tets.len() as u64,
            owned_nodes: part.n_owned() as u64,
            ghost_nodes: (part.n_local() - part.n_owned()) as u64,
            neighbours: part.exchange.readers().count() as u64,
            cut_faces: part.n_cut_faces as u64,
        };
        Self { ranks: part.comm.all_gather(&[mine]).concat() }
    }
    /// Elements of the mesh.
    pub fn elements(&self) -> u64 {
        self.ranks.iter().map(|share| share.owned_elements).sum()
    }
    /// Nodes of the mesh.
    pub fn nodes(&self) -> u64 {
        self.ranks.iter().map(|share| share.owned_nodes).sum()
    }
    /// Faces between ranks.
    pub fn edge_cut(&self) -> u64 {
        self.ranks.iter().map(|share| share.cut_faces).sum::<u64>() / 2
    }
    /// Largest over mean number of METIS elements.
    pub fn imbalance(&self) -> f64 {
        self.largest(|share| share.owned_elements)
    }
    /// Largest over mean number of matrix rows.
    pub fn node_imbalance(&self) -> f64 {
        self.largest(|share| share.owned_nodes)
    }
    fn largest(&self, of: impl Fn(&Share) -> u64) -> f64 {
        let total: u64 = self.ranks.iter().map(&of).sum();
        let largest = self.ranks.iter().map(&of).max().unwrap_or(0);
        largest as f64 * self.ranks.len() as f64 / total.max(1) as f64
    }
}
