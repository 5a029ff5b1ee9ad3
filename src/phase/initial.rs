//! The initial phase field: `φ = ½(1 + tanh(ψ/2δ))` of a signed distance, and the cell size δ is
//! measured by.

use super::profile::sigmoid;
use crate::mesh::MeshPart;
use crate::mesh::tetrahedron::Tetrahedron;

/// Typical cell size h where the interface is [m]: the mean of (6V)^(1/3) over the elements that
/// `distance` (nodal, positive in liquid) changes sign in, over all elements if there is none. It is the
/// grid spacing of a uniform box. One h, and so one δ, for the whole mesh. Collective.
pub fn cell_size(part: &MeshPart, distance: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    for e in 0..part.n_owned_elements {
        let d = part.mesh.tets[e].map(|n| distance[n as usize]);
        let h = (6.0 * Tetrahedron::of(&part.mesh, e).volume).cbrt();
        let cut = d.iter().any(|&d| d > 0.0) && d.iter().any(|&d| d <= 0.0);
        sums[0] += h;
        sums[1] += 1.0;
        if cut {
            sums[2] += h;
            sums[3] += 1.0;
        }
    }
    part.comm.sum_all(&mut sums);
    if sums[3] > 0.0 { sums[2] / sums[3] } else { sums[0] / sums[1] }
}

/// φ of a nodal signed distance.
pub fn profile(distance: &[f64], delta: f64) -> Vec<f64> {
    distance.iter().map(|d| sigmoid(d / delta)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::boxes::tensor_box;

    #[test]
    fn the_cell_size_is_the_grid_spacing_at_the_interface() {
        let fine: Vec<f64> = (0..=8).map(|i| i as f64 * 0.1).collect();
        let mut graded = fine.clone();
        graded.extend((1..=4).map(|i| 0.8 + 0.3 * i as f64));
        let part = MeshPart::single(tensor_box([&fine, &fine, &graded]));
        let distance: Vec<f64> = part.mesh.nodes.iter().map(|x| 0.43 - x[2]).collect();
        assert!((cell_size(&part, &distance) - 0.1).abs() < 1e-14);
        let all = cell_size(&part, &vec![1.0; part.n_local()]);
        assert!(all > 0.1 && all < 0.15);
    }

    #[test]
    fn the_profile_is_a_tanh() {
        let phi = profile(&[0.0, 0.3, -0.3], 0.1);
        assert_eq!(phi[0], 0.5);
        assert!((phi[1] - 0.5 * (1.0 + 1.5f64.tanh())).abs() < 1e-15);
        assert!((phi[1] + phi[2] - 1.0).abs() < 1e-15);
    }
}
