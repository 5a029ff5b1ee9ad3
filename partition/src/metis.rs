//! Parts of a tetrahedral mesh with equal work and few faces between them: METIS on the dual graph
//! (elements are neighbours if they share three nodes). Karypis and Kumar, SIAM J. Sci. Comput. 20
//! (1998) 359.

use ::metis::option::Seed;
use ::metis::{Graph, mesh_to_dual};
use std::sync::{Mutex, PoisonError};

/// METIS starts from random matchings: the same at every run.
const SEED: i32 = 20_250;

/// Why a mesh could not be split.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PartitionError {
    /// Beyond METIS's 32-bit indices.
    #[error(
        "{elements} elements are too many to be split by one rank (at most {}): start from a coarser \
         mesh and refine it after it is distributed",
        i32::MAX / 4
    )]
    TooLarge {
        /// Number of elements.
        elements: usize,
    },
    /// METIS gave up.
    #[error("METIS could not split {elements} elements into {parts} parts: {reason}")]
    Metis {
        /// Number of elements.
        elements: usize,
        /// Parts asked for.
        parts: usize,
        /// METIS's word for it.
        reason: String,
    },
}

/// The part, `0..n_parts`, of each tetrahedron (corner nodes of each). `weights`: work of each
/// tetrahedron, positive; empty if all are equal. The same input gives the same parts.
pub fn split(
    tets: &[[u32; 4]],
    n_parts: usize,
    weights: &[i32],
) -> Result<Vec<u32>, PartitionError> {
    assert!(weights.is_empty() || weights.len() == tets.len(), "one weight an element");
    let elements = tets.len();
    if elements <= n_parts || n_parts == 1 {
        // METIS handles neither.
        return Ok((0..elements).map(|e| (e % n_parts) as u32).collect());
    }
    if elements > i32::MAX as usize / 4 {
        return Err(PartitionError::TooLarge { elements });
    }
    let failed = |reason: String| PartitionError::Metis { elements, parts: n_parts, reason };
    let starts: Vec<i32> = (0..=elements as i32).map(|e| 4 * e).collect();
    let nodes: Vec<i32> = tets.as_flattened().iter().map(|&node| node as i32).collect();
    let dual = mesh_to_dual(&starts, &nodes, 3).map_err(|e| failed(e.to_string()))?;
    drop((starts, nodes));
    let mut graph = Graph::new(1, n_parts as i32, dual.xadj(), dual.adjncy())
        .map_err(|e| failed(e.to_string()))?
        .set_option(Seed(SEED));
    if !weights.is_empty() {
        graph = graph.set_vwgt(weights);
    }
    // METIS draws from the C library's one sequence of random numbers: two threads at once would change each other's.
    static ALONE: Mutex<()> = Mutex::new(());
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let mut part = vec![0; elements];
    graph.part_kway(&mut part).map_err(|e| failed(e.to_string()))?;
    Ok(part.into_iter().map(|part| part as u32).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bar of `n` tetrahedra, each sharing a face with the next.
    fn bar(n: u32) -> Vec<[u32; 4]> {
        (0..n).map(|e| [e, e + 1, e + 2, e + 3]).collect()
    }

    #[test]
    fn a_bar_is_cut_once() {
        let part = split(&bar(100), 2, &[]).unwrap();
        let cuts = part.windows(2).filter(|pair| pair[0] != pair[1]).count();
        let second = part.iter().filter(|&&p| p == 1).count();
        assert!(cuts == 1 && (48..=52).contains(&second), "{cuts} cuts, {second} of 100");
        assert_eq!(part, split(&bar(100), 2, &[]).unwrap());
    }

    #[test]
    fn weights_are_balanced() {
        let weights: Vec<i32> = (0..100).map(|e| if e < 20 { 4 } else { 1 }).collect();
        let part = split(&bar(100), 2, &weights).unwrap();
        let work: i32 = (0..100).filter(|&e| part[e] == 0).map(|e| weights[e]).sum();
        assert!((76..=84).contains(&work), "{work} of 160");
    }

    #[test]
    fn few_elements_and_one_part() {
        assert_eq!(split(&bar(3), 1, &[]).unwrap(), [0, 0, 0]);
        assert_eq!(split(&bar(3), 5, &[]).unwrap(), [0, 1, 2]);
        assert!(split(&[], 3, &[]).unwrap().is_empty());
    }
}
