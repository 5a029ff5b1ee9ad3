//! An order of nodes in which neighbours are close: reverse Cuthill-McKee (George and Liu, Computer
//! Solution of Large Sparse Positive Definite Systems, 1981). Good for caches and for Gauss-Seidel.

/// The nodes `0..n` in their new order, from the tetrahedra that join them. Corners from `n` on are
/// ignored.
pub fn reverse_cuthill_mckee(n: usize, tets: &[[u32; 4]]) -> Vec<u32> {
    // Tetrahedra around each node.
    let inside = || {
        let of = |(e, tet): (u32, &[u32; 4])| tet.map(|node| (node as usize, e));
        (0u32..).zip(tets).flat_map(of).filter(|(node, _)| *node < n)
    };
    let mut start = vec![0u32; n + 2];
    inside().for_each(|(node, _)| start[node + 2] += 1);
    for node in 0..n {
        start[node + 2] += start[node + 1];
    }
    let mut around = vec![0u32; start[n + 1] as usize];
    for (node, e) in inside() {
        around[start[node + 1] as usize] = e;
        start[node + 1] += 1;
    }
    let tets_of =
        |node: u32| &around[start[node as usize] as usize..start[node as usize + 1] as usize];
    let degree = |node: u32| tets_of(node).len();

    // Breadth first from `root`: appends the nodes it reaches, those of low degree first.
    let mut seen = vec![0u32; n];
    let mut pass = 0;
    let mut sweep = |root: u32, order: &mut Vec<u32>, done: &[bool]| {
        pass += 1;
        let mut next = order.len();
        order.push(root);
        seen[root as usize] = pass;
        while next < order.len() {
            let first = order.len();
            for &e in tets_of(order[next]) {
                for node in tets[e as usize] {
                    let at = node as usize;
                    if at < n && !done[at] && seen[at] != pass {
                        seen[at] = pass;
                        order.push(node);
                    }
                }
            }
            order[first..].sort_unstable_by_key(|&node| (degree(node), node));
            next += 1;
        }
    };
    let mut order = Vec::with_capacity(n);
    let mut done = vec![false; n];
    for node in 0..n as u32 {
        if done[node as usize] {
            continue;
        }
        // The far end of the far end is a corner of the domain.
        let first = order.len();
        let mut root = node;
        for _ in 0..2 {
            sweep(root, &mut order, &done);
            root = order[order.len() - 1];
            order.truncate(first);
        }
        sweep(root, &mut order, &done);
        order[first..].iter().for_each(|&node| done[node as usize] = true);
    }
    order.reverse();
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::boxes::tensor_box;

    #[test]
    fn every_node_once_and_neighbours_close() {
        let lines = |n: usize| (0..=n).map(|i| i as f64).collect::<Vec<_>>();
        // Longest along z, where the box's own order jumps least; so number it the wrong way round.
        let mesh = tensor_box([&lines(20), &lines(4), &lines(3)]);
        let order = reverse_cuthill_mckee(mesh.nodes.len(), &mesh.tets);
        let mut position = vec![usize::MAX; order.len()];
        order.iter().enumerate().for_each(|(i, &node)| position[node as usize] = i);
        assert!(position.iter().all(|&p| p < order.len()));
        let bandwidth = |at: &dyn Fn(u32) -> usize| {
            let spread = |tet: &[u32; 4]| {
                let at = tet.map(at);
                at.iter().max().unwrap() - at.iter().min().unwrap()
            };
            mesh.tets.iter().map(spread).max().unwrap()
        };
        let (own, new) = (bandwidth(&|n| n as usize), bandwidth(&|n| position[n as usize]));
        // A layer across the box has 20 nodes, one along it 105.
        assert!(own > 105 && new <= 60, "bandwidth {own} became {new}");
    }

    #[test]
    fn separate_pieces_and_outside_corners() {
        let order = reverse_cuthill_mckee(6, &[[0, 2, 4, 9], [1, 3, 5, 7]]);
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, [0, 1, 2, 3, 4, 5]);
        assert!(reverse_cuthill_mckee(0, &[]).is_empty());
    }
}
