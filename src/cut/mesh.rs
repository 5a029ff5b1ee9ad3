//! All elements of a rank: whole, cut or solid; the nodes without fluid; the faces of cut elements.

use super::extension::Extension;
use super::ghost::GhostFace;
use super::level_set::LevelSet;
use super::tetrahedron::{Part, Pieces, cut};
use crate::fem::constraints::FluidBody;
use crate::fem::region::Region;
use crate::mesh::connected::connected;
use crate::mesh::tetrahedron::{Tetrahedron, volume};
use crate::mesh::{FACES, Mesh, MeshPart};

/// How a local element stands to the structures.
#[derive(Clone, Copy, Debug)]
pub enum Cell<'a> {
    /// All fluid.
    Whole,
    /// Fluid on one side of a wall.
    Cut(&'a CutElement),
    /// No fluid.
    Solid,
}

/// An element with fluid on one side of a wall.
#[derive(Clone, Copy, Debug)]
pub struct CutElement {
    /// Its local number.
    pub element: u32,
    /// Fluid part and wall.
    pub pieces: Pieces,
    /// The structure whose wall it is.
    pub body: u32,
    /// Centroid of the wall [m].
    pub x: [f64; 3],
}

const WHOLE: u32 = u32::MAX;
const SOLID: u32 = u32::MAX - 1;

/// The mesh as the structures leave it.
#[derive(Clone, Debug, Default)]
pub struct CutMesh {
    /// Signed distance of local nodes to the structures [m], positive in fluid; empty without structures.
    pub distance: Vec<f64>,
    /// The elements that are cut.
    pub elements: Vec<CutElement>,
    /// Local nodes with no fluid in any element around them.
    pub dry_nodes: Vec<u32>,
    /// Faces between two elements with fluid of which one is cut.
    pub ghost_faces: Vec<GhostFace>,
    /// What the moments ∫N_i of local nodes have gained since the structures stood elsewhere [m³]; empty if they
    /// never did.
    pub gained: Vec<f64>,
    /// `WHOLE`, `SOLID` or an index into `elements`; empty without structures.
    state: Vec<u32>,
    /// 1 for local nodes with whole elements only around them; empty without structures.
    far: Vec<u8>,
}

impl CutMesh {
    /// A mesh without structures.
    pub fn whole() -> Self {
        Self::default()
    }

    /// Cuts the local elements of `part`. `body_at` names the
    /// structure nearest to a point, of those nearest to the element's nodes.
    pub fn new(
        part: &MeshPart,
        levels: LevelSet,
        body_at: impl Fn([f64; 3], [u32; 4]) -> u32,
    ) -> Self {
        let mesh = &part.mesh;
        let mut state = vec![WHOLE; mesh.tets.len()];
        let mut elements = Vec::new();
        let (mut dry, mut far) = (vec![1u8; mesh.nodes.len()], vec![1u8; mesh.nodes.len()]);
        for (e, tet) in mesh.tets.iter().enumerate() {
            let d = tet.map(|n| levels.distance[n as usize]);
            let near = d.iter().any(|&d| d <= 0.0);
            if near {
                let x = mesh.corners(e);
                match cut(&Tetrahedron::new(x), &x, &d) {
                    Part::Whole => {}
                    Part::Solid => state[e] = SOLID,
                    Part::Cut(pieces) => {
                        state[e] = elements.len() as u32;
                        let at = if pieces.wall.size > 0.0 {
                            pieces.wall.mean(&x)
                        } else {
                            pieces.fluid.mean(&x)
                        };
                        let bodies = tet.map(|n| levels.body[n as usize]);
                        let same = bodies.iter().all(|&b| b == bodies[0]);
                        let body = if same { bodies[0] } else { body_at(at, bodies) };
                        elements.push(CutElement { element: e as u32, pieces, body, x: at });
                    }
                }
            }
            let side = if state[e] != SOLID { &mut dry } else { &mut far };
            tet.iter().for_each(|&n| side[n as usize] = 0);
            if state[e] < SOLID {
                tet.iter().for_each(|&n| far[n as usize] = 0);
            }
        }
        // A node's owner sees all elements around it.
        part.exchange.update_ghosts(&mut dry);
        part.exchange.update_ghosts(&mut far);
        let dry_nodes = (0u32..).zip(dry).filter(|(_, dry)| *dry == 1).map(|(n, _)| n).collect();
        let ghost_faces = ghost_faces(mesh, &state, &elements);
        Self {
            distance: levels.distance,
            elements,
            dry_nodes,
            ghost_faces,
            gained: Vec::new(),
            state,
            far,
        }
    }

    /// Finds what the moments have gained since `before`. What nodes lose that have no fluid left is lost by
    /// those of `going`. Collective.
    pub fn compare(&mut self, part: &MeshPart, before: &CutMesh, going: &Extension) {
        let mut gained = vec![0.0; part.n_local()];
        for (e, tet) in part.mesh.tets.iter().enumerate() {
            let mut add = |cut: &CutMesh, sign: f64| {
                let first = match cut.cell(e) {
                    Cell::Whole => [0.25 * volume(&part.mesh.corners(e)); 4],
                    Cell::Cut(c) => c.pieces.fluid.first,
                    Cell::Solid => [0.0; 4],
                };
                tet.iter().zip(first).for_each(|(&n, m)| gained[n as usize] += sign * m);
            };
            match (self.cell(e), before.cell(e)) {
                (Cell::Whole, Cell::Whole) | (Cell::Solid, Cell::Solid) => {}
                _ => {
                    add(self, 1.0);
                    add(before, -1.0);
                }
            }
        }
        going.hand_over(part, &mut gained);
        self.gained = gained;
    }

    /// How local element `e` stands to the structures.
    #[inline]
    pub fn cell(&self, e: usize) -> Cell<'_> {
        match self.state.get(e) {
            None | Some(&WHOLE) => Cell::Whole,
            Some(&SOLID) => Cell::Solid,
            Some(&at) => Cell::Cut(&self.elements[at as usize]),
        }
    }

    /// The elements without walls among the first `n`.
    pub fn uncut(&self, n: usize) -> impl Iterator<Item = usize> + '_ {
        (0..n).filter(|&e| self.state.get(e).is_none_or(|&state| state == WHOLE))
    }

    /// The cut elements among the first `n`.
    pub fn cut(&self, n: usize) -> impl Iterator<Item = &CutElement> {
        self.elements.iter().take_while(move |c| (c.element as usize) < n)
    }

    /// Volume of fluid in local element `e` [m³].
    #[inline]
    pub fn fluid_volume(&self, mesh: &Mesh, e: usize) -> f64 {
        match self.cell(e) {
            Cell::Whole => volume(&mesh.corners(e)),
            Cell::Cut(c) => c.pieces.fluid.size,
            Cell::Solid => 0.0,
        }
    }

    /// Whether local node `i` is in the fluid.
    #[inline]
    pub fn is_in_fluid(&self, i: usize) -> bool {
        self.distance.get(i).is_none_or(|d| *d > 0.0)
    }

    /// The connected bodies of fluid; empty without structures. Collective.
    pub fn bodies_of_fluid(&self, part: &MeshPart) -> Vec<FluidBody> {
        if self.state.is_empty() {
            return Vec::new();
        }
        let names = connected(part, |i| self.distance[i] > 0.0);
        let body = |(name, far): (u64, &u8)| FluidBody { name, near_wall: *far == 0 };
        names.into_iter().zip(&self.far).map(body).collect()
    }

    /// The cut elements among those that this rank integrates over.
    pub fn owned<'a>(&'a self, part: &MeshPart) -> impl Iterator<Item = &'a CutElement> {
        self.cut(part.n_owned_elements)
    }
}

/// Faces between two elements with fluid of which one is cut, in an order that does not depend on the ranks'
/// numbers of nodes elsewhere.
fn ghost_faces(mesh: &Mesh, state: &[u32], cut: &[CutElement]) -> Vec<GhostFace> {
    let mut near = vec![false; mesh.nodes.len()];
    for c in cut {
        mesh.tets[c.element as usize].iter().for_each(|&n| near[n as usize] = true);
    }
    let sides = || {
        let wet = mesh.tets.iter().zip(0u32..).zip(state).filter(|(_, state)| **state != SOLID);
        wet.flat_map(|((tet, e), _)| {
            let near = tet.map(|n| near[n as usize]);
            FACES.iter().zip(0u8..).filter(move |(c, _)| c.iter().all(|&c| near[c])).map(
                move |(corners, f)| {
                    let mut face = corners.map(|c| tet[c]);
                    face.sort_unstable();
                    (face, e, f)
                },
            )
        })
    };
    // Sorted: by the first node at once, then the few that share it.
    let mut start = vec![0u32; mesh.nodes.len() + 1];
    sides().for_each(|(face, ..)| start[face[0] as usize + 1] += 1);
    (1..start.len()).for_each(|n| start[n] += start[n - 1]);
    let mut sorted = vec![([0; 3], 0, 0); start[mesh.nodes.len()] as usize];
    let mut next = start.clone();
    for side in sides() {
        let at = &mut next[side.0[0] as usize];
        sorted[*at as usize] = side;
        *at += 1;
    }
    start.windows(2).for_each(|w| sorted[w[0] as usize..w[1] as usize].sort_unstable());
    let is_cut = |e: u32| state[e as usize] != WHOLE;
    sorted
        .chunk_by(|a, b| a.0 == b.0)
        .filter_map(|pair| match *pair {
            [(_, e, f), (_, g, _)] if is_cut(e) || is_cut(g) => {
                Some(GhostFace::new(mesh, [e, g], usize::from(f)))
            }
            _ => None,
        })
        .collect()
}
