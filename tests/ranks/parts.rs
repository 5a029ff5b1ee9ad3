//! Distributed meshes against the same mesh on one rank.

use fcm_fsi::fem::tetrahedron::Tetrahedron;
use fcm_fsi::mesh::balance::Balance;
use fcm_fsi::mesh::boxes::tensor_box;
use fcm_fsi::mesh::{Mesh, MeshPart};
use partition::Communicator;
use std::collections::{BTreeMap, BTreeSet};

/// Sides of the box [m].
const SIDES: [f64; 3] = [2.0, 1.0, 0.7];

/// A box of 8 x 5 x 4 cells, inner nodes moved so that no two tetrahedra are alike.
fn jittered_box() -> Mesh {
    let cells = [8, 5, 4];
    let lines = [0, 1, 2].map(|a| {
        (0..=cells[a]).map(|i| SIDES[a] * i as f64 / cells[a] as f64).collect::<Vec<f64>>()
    });
    let mut mesh = tensor_box([&lines[0], &lines[1], &lines[2]]);
    for (i, x) in mesh.nodes.iter_mut().enumerate() {
        for a in 0..3 {
            if x[a] > 0.0 && x[a] < SIDES[a] {
                x[a] += 0.02 * (7.0 * (3 * i + a) as f64).sin();
            }
        }
    }
    mesh
}

/// The box on all ranks, and whole on each of them.
fn distributed_and_whole(comm: &Communicator, refine: u32) -> (MeshPart, MeshPart) {
    let mesh = (comm.rank() == 0).then(jittered_box);
    let part = MeshPart::distribute(comm, mesh, refine).unwrap();
    let alone = Communicator::single();
    (part, MeshPart::distribute(&alone, Some(jittered_box()), refine).unwrap())
}

/// An element: its global id and its corners' in order.
fn named(part: &MeshPart, e: usize) -> (u64, [u64; 4]) {
    (part.element_global[e], part.mesh.tets[e].map(|node| part.nodes.global[node as usize]))
}

/// Every node and element has one owner, and all have the names, corners and places that they have
/// on one rank.
pub fn everything_is_owned_once(comm: &Communicator) {
    for refine in 0..2 {
        let (part, whole) = distributed_and_whole(comm, refine);
        let mut nodes = comm.all_gather(&part.nodes.global[..part.n_owned()]).concat();
        nodes.sort_unstable();
        assert!(nodes.iter().copied().eq(0..whole.n_local() as u64));
        let mut elements = comm.all_gather(&part.element_global[..part.n_owned_elements]).concat();
        elements.sort_unstable();
        assert!(elements.iter().copied().eq(0..whole.mesh.tets.len() as u64));

        let places: BTreeMap<u64, [f64; 3]> =
            whole.nodes.global.iter().copied().zip(whole.mesh.nodes.iter().copied()).collect();
        for (global, x) in part.nodes.global.iter().zip(&part.mesh.nodes) {
            assert_eq!(places[global], *x);
        }
        let corners: BTreeMap<u64, [u64; 4]> =
            (0..whole.mesh.tets.len()).map(|e| named(&whole, e)).collect();
        for e in 0..part.mesh.tets.len() {
            let (global, nodes) = named(&part, e);
            assert_eq!(corners[&global], nodes);
        }
        let ghosts: Vec<_> =
            part.nodes.ghost_owner.iter().zip(&part.nodes.global[part.n_owned()..]).collect();
        assert!(ghosts.windows(2).all(|pair| pair[0] < pair[1]), "ghosts by (owner, global)");
        assert_eq!(part.mesh.boundary_names, whole.mesh.boundary_names);
    }
}

/// A rank holds its METIS elements, all that touch a node it owns and their face neighbours, in this
/// order, with all their boundary faces, and nothing else.
pub fn halos_are_complete(comm: &Communicator) {
    for refine in 0..2 {
        let (part, whole) = distributed_and_whole(comm, refine);
        let owned: BTreeSet<u64> = part.nodes.global[..part.n_owned()].iter().copied().collect();
        let metis: BTreeSet<u64> =
            part.element_global[..part.n_owned_elements].iter().copied().collect();
        let mut across: BTreeMap<[u64; 3], Vec<u64>> = BTreeMap::new();
        let faces = |mut nodes: [u64; 4]| {
            nodes.sort_unstable();
            [0, 1, 2, 3].map(|skip| {
                let mut kept = (0..4).filter(|&i| i != skip).map(|i| nodes[i]);
                std::array::from_fn(|_| kept.next().unwrap())
            })
        };
        for e in 0..whole.mesh.tets.len() {
            let (global, nodes) = named(&whole, e);
            faces(nodes).iter().for_each(|face| across.entry(*face).or_default().push(global));
        }
        let mut touching = BTreeSet::new();
        let mut core = metis.clone();
        for e in 0..whole.mesh.tets.len() {
            let (global, nodes) = named(&whole, e);
            if nodes.iter().any(|node| owned.contains(node)) && !metis.contains(&global) {
                touching.insert(global);
                core.insert(global);
            }
        }
        let mut neighbours = BTreeSet::new();
        for sides in across.values().filter(|sides| sides.iter().any(|e| core.contains(e))) {
            neighbours.extend(sides.iter().filter(|e| !core.contains(e)));
        }
        let layers = [0, part.n_owned_elements, part.n_assembled_elements, part.mesh.tets.len()];
        for (layer, expected) in [metis, touching, neighbours].iter().enumerate() {
            let range = layers[layer]..layers[layer + 1];
            let held: BTreeSet<u64> = part.element_global[range.clone()].iter().copied().collect();
            assert_eq!(held.len(), range.len(), "an element is held once");
            assert_eq!(held, *expected, "layer {layer} with {refine} refinements");
        }

        // Boundary faces: by element, corners in order and name.
        let faces_of = |part: &MeshPart| -> Vec<(u64, [u64; 3], u32)> {
            let name = |face: &fcm_fsi::mesh::BoundaryFace| {
                let nodes = face.nodes.map(|node| part.nodes.global[node as usize]);
                (part.element_global[face.element as usize], nodes, face.name)
            };
            part.mesh.boundary.iter().map(name).collect()
        };
        let local: BTreeSet<u64> = part.element_global.iter().copied().collect();
        let mut expected = faces_of(&whole);
        expected.retain(|face| local.contains(&face.0));
        expected.sort_unstable();
        let mut held = faces_of(&part);
        held.sort_unstable();
        assert_eq!(held, expected);
        let of_owned =
            |face: &fcm_fsi::mesh::BoundaryFace| (face.element as usize) < part.n_owned_elements;
        assert_eq!(part.n_owned_faces, part.mesh.boundary.partition_point(of_owned));
        assert_eq!(part.n_owned_faces, part.mesh.boundary.iter().filter(|f| of_owned(f)).count());
    }
}

/// A node belongs to one of the ranks with most METIS elements around it.
pub fn owners_have_most_elements(comm: &Communicator) {
    let (part, whole) = distributed_and_whole(comm, 0);
    let mut holder = vec![0; whole.mesh.tets.len()];
    let lists = comm.all_gather(&part.element_global[..part.n_owned_elements]);
    for (rank, list) in lists.iter().enumerate() {
        list.iter().for_each(|&e| holder[e as usize] = rank);
    }
    let mut around = vec![vec![0; comm.size()]; whole.n_local()];
    for e in 0..whole.mesh.tets.len() {
        let (global, nodes) = named(&whole, e);
        nodes.iter().for_each(|&node| around[node as usize][holder[global as usize]] += 1);
    }
    for &node in &part.nodes.global[..part.n_owned()] {
        let counts = &around[node as usize];
        assert_eq!(counts[comm.rank()], *counts.iter().max().unwrap(), "node {node}");
    }
}

/// Ghosts get owners' values; what elements add to ghosts reaches the owners.
pub fn halo_of_a_mesh(comm: &Communicator) {
    let (part, _) = distributed_and_whole(comm, 1);
    let value = |i: usize| [part.nodes.global[i] as f64, part.mesh.nodes[i][0], 1.0];
    let mut x: Vec<[f64; 3]> = (0..part.n_local()).map(value).collect();
    x[part.n_owned()..].fill([f64::NAN; 3]);
    part.exchange.update_ghosts(&mut x);
    assert!((0..part.n_local()).all(|i| x[i] == value(i)));

    let count = |elements: &[[u32; 4]]| {
        let mut around = vec![0i32; part.n_local()];
        elements.as_flattened().iter().for_each(|&node| around[node as usize] += 1);
        around
    };
    // METIS elements of all ranks around a node are the local elements around it.
    let mut sum = count(&part.mesh.tets[..part.n_owned_elements]);
    part.exchange.sum_to_owners(&mut sum);
    let local = count(&part.mesh.tets[..part.n_assembled_elements]);
    assert_eq!(sum[..part.n_owned()], local[..part.n_owned()]);
}

/// Volume, and row sums of the mass matrix assembled without communication, as on one rank.
pub fn integrals_and_rows(comm: &Communicator) {
    for refine in 0..2 {
        let (part, whole) = distributed_and_whole(comm, refine);
        let volume = |e: usize| Tetrahedron::of(&part.mesh, e).volume;
        let total = part.sum((0..part.n_owned_elements).map(volume).sum());
        let exact: f64 = SIDES.iter().product();
        assert!((total - exact).abs() < 1e-14 * exact * 100.0, "volume {total}");

        let rows = |part: &MeshPart| {
            let mut rows = vec![0.0; part.n_local()];
            for (e, tet) in part.mesh.tets.iter().enumerate() {
                let share = Tetrahedron::of(&part.mesh, e).volume / 4.0;
                tet.iter().for_each(|&node| rows[node as usize] += share);
            }
            rows
        };
        let serial: BTreeMap<u64, f64> =
            whole.nodes.global.iter().copied().zip(rows(&whole)).collect();
        for (row, global) in rows(&part)[..part.n_owned()].iter().zip(&part.nodes.global) {
            let expected = serial[global];
            assert!((row - expected).abs() < 1e-14 * expected, "node {global}: {row} {expected}");
        }
    }
}

/// The ranks' shares add up, are even, and the cuts are counted once.
pub fn shares_are_even(comm: &Communicator) {
    let (part, whole) = distributed_and_whole(comm, 1);
    let balance = Balance::of(&part);
    assert_eq!(balance.nodes(), whole.n_local() as u64);
    assert_eq!(balance.elements(), whole.mesh.tets.len() as u64);
    assert!(balance.imbalance() < 1.05, "elements: {}", balance.imbalance());
    assert!(balance.node_imbalance() < 1.12, "nodes: {}", balance.node_imbalance());
    // A plane cut across the box's two shorter sides has 4 * 2 * 5 * 4 refined triangles.
    let planes = (comm.size() - 1) as u64;
    let plane = 4 * 2 * 5 * 4;
    assert!(balance.edge_cut() <= planes * plane * 3 / 2, "{} faces cut", balance.edge_cut());
    assert!(balance.edge_cut() >= planes.min(1) * plane * 3 / 4, "{}", balance.edge_cut());
}

/// Parts are the same at every run; ranks may have nothing.
pub fn few_elements_and_reruns(comm: &Communicator) {
    let (one, _) = distributed_and_whole(comm, 0);
    let (two, _) = distributed_and_whole(comm, 0);
    assert!(one.mesh == two.mesh && one.nodes == two.nodes);
    let tet = Mesh {
        nodes: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        tets: vec![[0, 1, 2, 3]],
        ..Mesh::default()
    };
    for refine in 0..2 {
        let tet = (comm.rank() == 0).then(|| tet.clone());
        let part = MeshPart::distribute(comm, tet, refine).unwrap();
        assert_eq!(comm.sum_u64(part.n_owned_elements as u64), 8u64.pow(refine));
        assert_eq!(comm.sum_u64(part.n_owned() as u64), [4, 10][refine as usize]);
    }
}

/// A mesh that cannot be distributed is an error with the same words on all ranks.
pub fn loose_nodes_are_refused(comm: &Communicator) {
    let mesh = (comm.rank() == 0).then(|| {
        let mut mesh = jittered_box();
        mesh.nodes.push([0.5; 3]);
        mesh
    });
    let message = MeshPart::distribute(comm, mesh, 0).unwrap_err().to_string();
    assert_eq!(message, "the mesh cannot be distributed: node 270 belongs to no tetrahedron");
}
