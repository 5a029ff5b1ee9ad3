//! Nodes joined by elements, across ranks.
//!
//! Union-find on each rank, then owners' names pass to ghosts until nothing changes: an edge that joins two
//! ranks' nodes is seen by both.

use super::MeshPart;

/// The name of nodes that are in no group.
pub const NONE: u64 = u64::MAX;

/// The root of `i`; halves the path to it.
pub fn root(parent: &mut [u32], mut i: u32) -> u32 {
    while parent[i as usize] != i {
        parent[i as usize] = parent[parent[i as usize] as usize];
        i = parent[i as usize];
    }
    i
}

/// Groups of the local nodes that are `member`, joined by common elements. A group's name is its smallest
/// global node number, so it does not depend on the ranks. Collective.
pub fn connected(part: &MeshPart, member: impl Fn(usize) -> bool) -> Vec<u64> {
    let n = part.n_local();
    let mut parent: Vec<u32> = (0..n as u32).collect();
    for tet in &part.mesh.tets {
        let mut first = None;
        for &i in tet.iter().filter(|&&i| member(i as usize)) {
            let a = root(&mut parent, i);
            let b = root(&mut parent, *first.get_or_insert(i));
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    for i in 0..n as u32 {
        parent[i as usize] = root(&mut parent, i);
    }
    let mut names: Vec<u64> =
        (0..n).map(|i| if member(i) { part.nodes.global[i] } else { NONE }).collect();
    loop {
        // Roots come before their members.
        for i in 0..n {
            let r = parent[i] as usize;
            names[r] = names[r].min(names[i]);
        }
        for i in 0..n {
            names[i] = names[parent[i] as usize];
        }
        let ghosts = names[part.n_owned()..].to_vec();
        part.exchange.update_ghosts(&mut names);
        if !part.comm.any(ghosts != names[part.n_owned()..]) {
            return names;
        }
    }
}
