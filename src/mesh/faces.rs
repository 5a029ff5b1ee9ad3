//! Which elements share which face: the face table of a whole mesh.

use super::{FACES, Mesh, MeshError};

/// One face seen from one element.
#[derive(Clone, Copy)]
struct Side {
    /// The two larger node numbers, sorted; the smallest is the row.
    others: [u32; 2],
    /// `FACES` goes round it in the sense smallest → larger → largest.
    forward: bool,
    face: u8,
    element: u32,
}

/// All faces of all elements, in rows by their smallest node, equal faces side by side.
pub struct FaceTable {
    start: Vec<usize>,
    sides: Vec<Side>,
}

/// A face as its nodes in rising order, and whether `nodes` goes round it in that sense.
fn sorted(nodes: [u32; 3]) -> ([u32; 3], bool) {
    let mut s = nodes;
    s.sort_unstable();
    let first = nodes.iter().position(|&n| n == s[0]).unwrap_or(0);
    (s, nodes[(first + 1) % 3] == s[1])
}

/// An element's side of the mesh surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Exterior {
    /// The element.
    pub element: u32,
    /// Which of its `FACES`.
    pub face: u8,
}

impl FaceTable {
    /// Of elements that are positively oriented.
    ///
    /// # Errors
    /// `Overlap`: two elements on the same side of a face.
    pub fn new(mesh: &Mesh) -> Result<Self, MeshError> {
        let corners = |tet: &[u32; 4], f: usize| FACES[f].map(|v| tet[v]);
        let mut start = vec![0usize; mesh.nodes.len() + 1];
        for tet in &mesh.tets {
            for f in 0..4 {
                let [a, b, c] = corners(tet, f);
                start[a.min(b).min(c) as usize + 1] += 1;
            }
        }
        for i in 1..start.len() {
            start[i] += start[i - 1];
        }
        let empty = Side { others: [0; 2], forward: false, face: 0, element: 0 };
        let mut sides = vec![empty; 4 * mesh.tets.len()];
        let mut next = start.clone();
        for (element, tet) in (0..).zip(&mesh.tets) {
            for f in 0..4 {
                let ([a, b, c], forward) = sorted(corners(tet, f));
                let place = &mut next[a as usize];
                sides[*place] = Side { others: [b, c], forward, face: f as u8, element };
                *place += 1;
            }
        }
        for row in start.windows(2) {
            let row = &mut sides[row[0]..row[1]];
            row.sort_unstable_by_key(|s| (s.others, s.element));
            for equal in row.chunk_by(|a, b| a.others == b.others) {
                // A face has two sides; so of three elements two overlap.
                for (i, a) in equal.iter().enumerate() {
                    if let Some(b) = equal[..i].iter().find(|b| b.forward == a.forward) {
                        let nodes = corners(&mesh.tets[a.element as usize], a.face as usize);
                        return Err(MeshError::Overlap {
                            elements: [b.element, a.element],
                            at: mesh.centre(nodes),
                        });
                    }
                }
            }
        }
        Ok(Self { start, sides })
    }

    /// Faces of one element only, by element and face.
    pub fn exterior(&self) -> Vec<Exterior> {
        let mut exterior = Vec::new();
        for row in self.start.windows(2) {
            for equal in self.sides[row[0]..row[1]].chunk_by(|a, b| a.others == b.others) {
                if let [s] = equal {
                    exterior.push(Exterior { element: s.element, face: s.face });
                }
            }
        }
        exterior.sort_unstable();
        exterior
    }

    /// The one or two elements at the face with these nodes, in any order; none if it is no face.
    pub fn find(&self, nodes: [u32; 3]) -> (Option<Exterior>, usize) {
        let ([a, b, c], _) = sorted(nodes);
        let row = &self.sides[self.start[a as usize]..self.start[a as usize + 1]];
        let from = row.partition_point(|s| s.others < [b, c]);
        let count = row[from..].iter().take_while(|s| s.others == [b, c]).count();
        let first = row[from..from + count].first();
        (first.map(|s| Exterior { element: s.element, face: s.face }), count)
    }
}
