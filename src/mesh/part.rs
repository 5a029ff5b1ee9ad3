//! This rank's piece of the mesh and its halo (METHOD.md, 4).
//!
//! The reader splits the mesh and deals out the elements; each rank refines its own; then ownership
//! and halo are found between the ranks that share nodes and faces. Only the reader ever holds the
//! mesh, unrefined.

use super::order::reverse_cuthill_mckee;
use super::piece::{Piece, PieceNode, PieceTet};
use super::refine::refine_piece;
use super::{BoundaryFace, FACES, Mesh, MeshError};
use partition::rendezvous::{self, Owner};
use partition::{Communicator, Exchange, IndexMap, metis};

/// What a piece of work costs a rank: `comm.clock()` measures it.
pub use partition::Cost;
/// Makes a structure of plain data fit for halo exchange; names all its fields.
pub use partition::item;

item!(BoundaryFace { nodes, element, name });
item!(PieceNode { global, x });
item!(PieceTet { global, nodes });

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
    /// No element from here on touches an owned node: assembly may stop before it.
    pub n_assembled_elements: usize,
    /// Boundary faces of owned elements: the first of `mesh.boundary`.
    pub n_owned_faces: usize,
    /// Global id of each local element.
    pub element_global: Vec<u64>,
    /// Faces between this rank's METIS elements and other ranks'.
    pub n_cut_faces: usize,
    /// The ranks that share the mesh.
    pub comm: Communicator,
}

impl MeshPart {
    /// The whole mesh on one rank, in its own order.
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
            n_assembled_elements: ne,
            n_owned_faces: nf,
            element_global: (0..ne as u64).collect(),
            n_cut_faces: 0,
            comm,
        }
    }
    /// No mesh at all: bodies without a fluid. Collective.
    pub fn nothing(comm: &Communicator) -> Self {
        let mut part = Self::single(Mesh::default());
        part.exchange = Exchange::new(comm, &part.nodes);
        part.comm = comm.clone();
        part
    }
    /// Splits the reader's mesh (rank 0 passes it, the others `None`) over all ranks, refined `refine`
    /// times. Global ids are the reader's, then the refinement's; they do not depend on the number of
    /// ranks. Collective.
    pub fn distribute(
        comm: &Communicator,
        mesh: Option<Mesh>,
        refine: u32,
    ) -> Result<Self, MeshError> {
        let (mut piece, names, mut n_nodes) = deal(comm, mesh)?;
        for _ in 0..refine {
            let before = n_nodes;
            piece = refine_piece(&piece, |edges| {
                let (numbers, n) = rendezvous::number(comm, edges, before);
                n_nodes += n;
                numbers.into_iter().map(|number| before + number).collect()
            });
        }
        let ids: Vec<u64> = piece.nodes.iter().map(|node| node.global).collect();
        let mut around = vec![0u32; ids.len()];
        for &node in piece.tets.iter().flat_map(|tet| &tet.nodes) {
            around[node as usize] += 1;
        }
        let owners = rendezvous::owners(comm, &ids, &around, n_nodes);
        drop((ids, around));
        let (wanted, n_cut_faces) = elements_wanted(comm, &piece, &owners, n_nodes);
        let owner_of: Vec<u32> = owners.iter().map(|owner| owner.rank).collect();
        let ghosts = exchange_elements(comm, &piece, &owner_of, &wanted);
        let part = assemble(comm, piece, owner_of, ghosts, names, n_cut_faces);
        partition::return_memory();
        Ok(part)
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
    /// Elements that touch an owned node: all that a sum over elements at owned nodes needs.
    pub fn assembled(&self) -> &[[u32; 4]] {
        &self.mesh.tets[..self.n_assembled_elements]
    }
    /// Owned and ghost nodes.
    pub fn n_local(&self) -> usize {
        self.nodes.len()
    }
}

/// The reader splits its mesh and sends each rank its elements: this rank's, the names of boundaries,
/// the number of nodes in the mesh.
fn deal(comm: &Communicator, mesh: Option<Mesh>) -> Result<(Piece, Vec<String>, u64), MeshError> {
    assert!(mesh.is_some() == (comm.rank() == 0), "rank 0 alone reads the mesh");
    let split = mesh.as_ref().map_or(Ok(Vec::new()), |mesh| {
        let mut used = vec![false; mesh.nodes.len()];
        mesh.tets.as_flattened().iter().for_each(|&node| used[node as usize] = true);
        if let Some(node) = used.iter().position(|used| !used) {
            return Err(MeshError::Orphan { node }.to_string());
        }
        metis::split(&mesh.tets, comm.size(), &[]).map_err(|e| e.to_string())
    });
    let split = comm.agree(split).map_err(|reason| MeshError::Undistributed { reason })?;
    let (names, n_nodes) = mesh.as_ref().map_or((Vec::new(), 0), |mesh| {
        (mesh.boundary_names.join("\0").into_bytes(), mesh.nodes.len() as u64)
    });
    let names = String::from_utf8(comm.broadcast(0, names)).expect("names are text");
    let names = names.split('\0').filter(|name| !name.is_empty()).map(String::from).collect();
    let n_nodes = comm.sum_u64(n_nodes);
    let piece = match mesh.map(Piece::whole) {
        Some(whole) if comm.size() == 1 => whole,
        Some(whole) => {
            let mut scratch = vec![u32::MAX; whole.nodes.len()];
            let lists = Piece::elements_by(&split, comm.size());
            for (to, list) in lists.iter().enumerate().skip(1) {
                let theirs = whole.subset(list, &mut scratch);
                comm.send_list(to, &theirs.nodes);
                comm.send_list(to, &theirs.tets);
                comm.send_list(to, &theirs.boundary);
            }
            whole.subset(&lists[0], &mut scratch)
        }
        None => Piece {
            nodes: comm.receive_list(0),
            tets: comm.receive_list(0),
            boundary: comm.receive_list(0),
        },
    };
    Ok((piece, names, n_nodes))
}

/// For each rank, this rank's elements that it needs: those that touch a node it owns, and the face
/// neighbours of its own elements and of all that touch a node it owns. Also the number of faces
/// between this rank's elements and others'.
fn elements_wanted(
    comm: &Communicator,
    piece: &Piece,
    owners: &[Owner],
    n_nodes: u64,
) -> (Vec<Vec<u32>>, usize) {
    let me = comm.rank() as u32;
    // Ranks other than this that own a node of the element.
    let readers = |e: u32| {
        let nodes = piece.tets[e as usize].nodes;
        let ranks = nodes.map(|node| owners[node as usize].rank);
        (0..4)
            .filter(move |&i| ranks[i] != me && !ranks[..i].contains(&ranks[i]))
            .map(move |i| ranks[i])
    };
    let mut wanted = vec![Vec::new(); comm.size()];
    let mut near: Vec<bool> = owners.iter().map(|owner| owner.shared).collect();
    for e in 0..piece.tets.len() as u32 {
        for rank in readers(e) {
            wanted[rank as usize].push(e);
            piece.tets[e as usize].nodes.iter().for_each(|&node| near[node as usize] = true);
        }
    }

    // Faces whose two elements may be needed together.
    let mut faces: Vec<([u32; 3], u32)> = Vec::new();
    for (e, tet) in (0..).zip(&piece.tets) {
        for corners in FACES {
            let mut face = corners.map(|corner| tet.nodes[corner]);
            if face.iter().all(|&node| near[node as usize]) {
                face.sort_unstable();
                faces.push((face, e));
            }
        }
    }
    faces.sort_unstable();
    let mut open: Vec<([u64; 3], u32)> = Vec::new();
    for sides in faces.chunk_by(|a, b| a.0 == b.0) {
        match *sides {
            [(_, e), (_, f)] => {
                for (one, other) in [(e, f), (f, e)] {
                    for rank in readers(one).filter(|&rank| readers(other).all(|r| r != rank)) {
                        wanted[rank as usize].push(other);
                    }
                }
            }
            [(face, e)] if face.iter().all(|&node| owners[node as usize].shared) => {
                open.push((face.map(|node| piece.nodes[node as usize].global), e));
            }
            _ => {}
        }
    }

    // Across an open face is another rank's element: this rank needs it, and so does every rank that
    // needs this side for a node. Its rank is asked to send it.
    let keys: Vec<[u64; 3]> = open.iter().map(|face| face.0).collect();
    let across = rendezvous::partners(comm, &keys, n_nodes);
    let mut requests: Vec<Vec<(u32, u32)>> = vec![Vec::new(); comm.size()];
    for (&(_, e), partner) in open.iter().zip(&across) {
        if let Some((holder, face)) = *partner {
            let to = std::iter::once(me).chain(readers(e)).filter(|&rank| rank != holder);
            requests[holder as usize].extend(to.map(|rank| (face, rank)));
        }
    }
    for (face, rank) in comm.exchange_lists(requests).into_iter().flatten() {
        wanted[rank as usize].push(open[face as usize].1);
    }
    for list in &mut wanted {
        list.sort_unstable();
        list.dedup();
    }
    (wanted, across.iter().flatten().count())
}

/// Elements from another rank, and the owner of each of their nodes.
type Ghosts = (Piece, Vec<u32>);

/// Sends each rank the elements it wants; returns what each rank sent here.
fn exchange_elements(
    comm: &Communicator,
    piece: &Piece,
    owner_of: &[u32],
    wanted: &[Vec<u32>],
) -> Vec<Ghosts> {
    let mut scratch = vec![u32::MAX; piece.nodes.len()];
    let (mut nodes, mut tets, mut faces) = (Vec::new(), Vec::new(), Vec::new());
    for list in wanted {
        let theirs = piece.subset(list, &mut scratch);
        let owner = |node: &PieceNode| {
            let at = piece.nodes.binary_search_by_key(&node.global, |own| own.global);
            owner_of[at.expect("a subset's nodes are the piece's")]
        };
        nodes.push(theirs.nodes.iter().map(|node| (*node, owner(node))).collect::<Vec<_>>());
        tets.push(theirs.tets);
        faces.push(theirs.boundary);
    }
    let (nodes, tets, faces) =
        (comm.exchange_lists(nodes), comm.exchange_lists(tets), comm.exchange_lists(faces));
    (nodes.into_iter().zip(tets).zip(faces))
        .map(|((nodes, tets), boundary)| {
            let (nodes, owners) = nodes.into_iter().unzip();
            (Piece { nodes, tets, boundary }, owners)
        })
        .collect()
}

/// An element on its way to its local number.
struct Placed {
    /// 0: a METIS element, 1: touches an owned node, 2: a face neighbour.
    layer: u8,
    global: u64,
    nodes: [u32; 4],
    piece: u32,
    /// Its number in its piece.
    element: u32,
}

/// Gives local numbers to nodes, elements and faces.
fn assemble(
    comm: &Communicator,
    piece: Piece,
    owner_of: Vec<u32>,
    ghosts: Vec<Ghosts>,
    boundary_names: Vec<String>,
    n_cut_faces: usize,
) -> MeshPart {
    let me = comm.rank() as u32;
    let mut pieces = vec![(piece, owner_of)];
    pieces.extend(ghosts);

    // All nodes once, owned first, ghosts by (owner, global).
    let mut table: Vec<(bool, u32, u64, [f64; 3])> = Vec::new();
    for (piece, owners) in &pieces {
        let named = |(node, &owner): (&PieceNode, &u32)| (owner != me, owner, node.global, node.x);
        table.extend(piece.nodes.iter().zip(owners).map(named));
    }
    table.sort_unstable_by_key(|node| (node.0, node.1, node.2));
    table.dedup_by_key(|node| (node.0, node.1, node.2));
    let n_owned = table.partition_point(|node| !node.0);

    let mut elements: Vec<Placed> = Vec::new();
    let mut local: Vec<Vec<u32>> = Vec::new();
    for (p, (piece, owners)) in (0..).zip(&pieces) {
        let place = |(node, &owner): (&PieceNode, &u32)| {
            let key = (owner != me, owner, node.global);
            let at = table.binary_search_by_key(&key, |node| (node.0, node.1, node.2));
            at.expect("every node is in the table") as u32
        };
        let here: Vec<u32> = piece.nodes.iter().zip(owners).map(place).collect();
        for (element, tet) in (0..).zip(&piece.tets) {
            let nodes = tet.nodes.map(|node| here[node as usize]);
            let touches = nodes.iter().any(|&node| (node as usize) < n_owned);
            let layer = if p == 0 { 0 } else { 2 - touches as u8 };
            elements.push(Placed { layer, global: tet.global, nodes, piece: p, element });
        }
        local.push(here);
    }

    // Owned nodes in an order where neighbours are close, elements as their nodes.
    let tets: Vec<[u32; 4]> = elements.iter().map(|element| element.nodes).collect();
    let order = reverse_cuthill_mckee(n_owned, &tets);
    drop(tets);
    let mut number: Vec<u32> = (0..table.len() as u32).collect();
    (0..).zip(&order).for_each(|(new, &old)| number[old as usize] = new);
    elements.iter_mut().for_each(|element| {
        element.nodes = element.nodes.map(|node| number[node as usize]);
    });
    elements.sort_unstable_by_key(|e| (e.layer, e.nodes.iter().min().copied(), e.global));
    let node_at = |new: usize| &table[if new < n_owned { order[new] as usize } else { new }];

    let mut mesh = Mesh { boundary_names, ..Mesh::default() };
    mesh.nodes = (0..table.len()).map(|new| node_at(new).3).collect();
    mesh.tets = elements.iter().map(|element| element.nodes).collect();
    let n_owned_elements = pieces[0].0.tets.len();
    let mut n_owned_faces = 0;
    for (new, placed) in elements.iter().enumerate() {
        if new == n_owned_elements {
            n_owned_faces = mesh.boundary.len();
        }
        let nodes = &local[placed.piece as usize];
        for face in pieces[placed.piece as usize].0.faces_of(placed.element) {
            mesh.boundary.push(BoundaryFace {
                nodes: face.nodes.map(|node| number[nodes[node as usize] as usize]),
                element: new as u32,
                name: face.name,
            });
        }
    }
    if elements.len() == n_owned_elements {
        n_owned_faces = mesh.boundary.len();
    }
    let nodes = IndexMap {
        global: (0..table.len()).map(|new| node_at(new).2).collect(),
        n_owned,
        ghost_owner: table[n_owned..].iter().map(|node| node.1).collect(),
    };
    MeshPart {
        exchange: Exchange::new(comm, &nodes),
        mesh,
        nodes,
        n_owned_elements,
        n_assembled_elements: elements.partition_point(|element| element.layer < 2),
        n_owned_faces,
        element_global: elements.iter().map(|element| element.global).collect(),
        n_cut_faces,
        comm: comm.clone(),
    }
}
