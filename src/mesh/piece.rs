//! Some elements of a distributed mesh, with all that belongs to them: what travels between ranks
//! before each has its part.

use super::{BoundaryFace, Mesh};
/// A node under its name in the whole mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PieceNode {
    /// Global id.
    pub global: u64,
    /// Coordinates [m].
    pub x: [f64; 3],
}

/// A tetrahedron under its name in the whole mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PieceTet {
    /// Global id.
    pub global: u64,
    /// Corner nodes, indices into `Piece::nodes`.
    pub nodes: [u32; 4],
}
/// Elements, their nodes and their boundary faces.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Piece {
    /// In ascending order of global id.
    pub nodes: Vec<PieceNode>,
    /// In any order that does not depend on the ranks' speed.
    pub tets: Vec<PieceTet>,
    /// In ascending order of element.
    pub boundary: Vec<BoundaryFace>,
}

impl Piece {
    /// A whole mesh; its order gives the global ids.
    pub fn whole(mesh: Mesh) -> Self {
        let Mesh { nodes, tets, mut boundary, .. } = mesh;
        boundary.sort_by_key(|face| face.element);
        Self {
            nodes: (0..).zip(nodes).map(|(global, x)| PieceNode { global, x }).collect(),
            tets: (0..).zip(tets).map(|(global, nodes)| PieceTet { global, nodes }).collect(),
            boundary,
        }
    }
    /// The listed elements alone. `scratch`: `u32::MAX` for each node, before and after.
    pub fn subset(&self, tets: &[u32], scratch: &mut [u32]) -> Self {
        let mut used = Vec::with_capacity(tets.len());
        for &e in tets {
            for node in self.tets[e as usize].nodes {
                if scratch[node as usize] == u32::MAX {
                    scratch[node as usize] = 0;
                    used.push(node);
                }
            }
        }
        used.sort_unstable();
        for (local, &node) in (0..).zip(&used) {
            scratch[node as usize] = local;
        }
        let here = |node: u32| scratch[node as usize];
        let (mut elements, mut boundary) = (Vec::with_capacity(tets.len()), Vec::new());
        for (element, &e) in (0..).zip(tets) {
            let PieceTet { global, nodes } = self.tets[e as usize];
            elements.push(PieceTet { global, nodes: nodes.map(here) });
            boundary.extend(self.faces_of(e).iter().map(|face| BoundaryFace {
                nodes: face.nodes.map(here),
                element,
                name: face.name,
            }));
        }
        let nodes = used.iter().map(|&node| self.nodes[node as usize]).collect();
        used.iter().for_each(|&node| scratch[node as usize] = u32::MAX);
        Self { nodes, tets: elements, boundary }
    }
    /// Boundary faces of one element.
    pub fn faces_of(&self, element: u32) -> &[BoundaryFace] {
        let start = self.boundary.partition_point(|face| face.element < element);
        let n = self.boundary[start..].iter().take_while(|face| face.element == element).count();
        &self.boundary[start..start + n]
    }
    /// Lists of elements by value, from the value of each element.
    pub fn elements_by(values: &[u32], n_values: usize) -> Vec<Vec<u32>> {
        let mut lists = vec![Vec::new(); n_values];
        for (e, &value) in (0..).zip(values) {
            lists[value as usize].push(e);
        }
        lists
    }
}
