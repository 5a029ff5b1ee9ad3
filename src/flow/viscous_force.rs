//! The viscous force per volume over μ, ∇²u, that the strong residual of linear elements lacks (after Jansen, Collis,
//! Whiting and Shakib 1999).
//!
//! Without it the pressure's stabilisation wants `∂ₙp = ρ(F − Du/Dt)·n` at a wall, and the pressure there is wrong by
//! a cell's width times `μ∇²u`. Gradients averaged at the nodes have a divergence; next to walls, where averages are
//! one-sided, the force is that of the nearest nodes that have a better one.

use crate::cut::{Cell, CutMesh, Extension};
use crate::fem::constraints::Constraint;
use crate::mesh::MeshPart;
use crate::mesh::tetrahedron::Tetrahedron;

/// ∇²u at the local nodes of the velocity `u` [1/(m s)]. Collective.
pub fn laplacian(
    part: &MeshPart,
    cut: &CutMesh,
    constraints: &[Constraint],
    u: &[[f64; 3]],
) -> Vec<[f64; 3]> {
    let mesh = &part.mesh;
    let wall = |n: u32| constraints[n as usize].free == [[0.0; 3]; 3] || cut.is_near(n as usize);
    let mut gradient = vec![[0.0f64; 9]; part.n_local()];
    let mut volume = vec![0.0; part.n_local()];
    for (e, tet) in mesh.tets.iter().enumerate() {
        if matches!(cut.cell(e), Cell::Solid) {
            continue;
        }
        let t = Tetrahedron::of(mesh, e);
        let mut du = [0.0; 9];
        for (&n, g) in tet.iter().zip(t.grad) {
            for k in 0..9 {
                du[k] += t.volume * g[k % 3] * u[n as usize][k / 3];
            }
        }
        for &n in tet {
            volume[n as usize] += t.volume;
            (0..9).for_each(|k| gradient[n as usize][k] += du[k]);
        }
    }
    for (g, v) in gradient.iter_mut().zip(&volume).take(part.n_owned()) {
        if *v > 0.0 {
            *g = g.map(|g| g / v);
        }
    }
    part.exchange.update_ghosts(&mut gradient);

    let mut laplacian = vec![[0.0; 3]; part.n_local()];
    volume.fill(0.0);
    for (e, tet) in mesh.tets.iter().enumerate() {
        if matches!(cut.cell(e), Cell::Solid) || tet.iter().any(|&n| wall(n)) {
            continue;
        }
        let t = Tetrahedron::of(mesh, e);
        let mut sum = [0.0; 3];
        for (&n, g) in tet.iter().zip(t.grad) {
            let du = &gradient[n as usize];
            for k in 0..3 {
                sum[k] +=
                    t.volume * (g[0] * du[3 * k] + g[1] * du[3 * k + 1] + g[2] * du[3 * k + 2]);
            }
        }
        for &n in tet {
            volume[n as usize] += t.volume;
            (0..3).for_each(|k| laplacian[n as usize][k] += sum[k]);
        }
    }
    // 0: has one; 1: needs one; 2: has none and needs none.
    let mut state = vec![0u8; part.n_local()];
    for (i, (l, v)) in laplacian.iter_mut().zip(&volume).enumerate().take(part.n_owned()) {
        if *v > 0.0 {
            *l = l.map(|l| l / v);
        } else {
            state[i] = 1;
        }
    }
    cut.dry_nodes.iter().for_each(|&n| state[n as usize] = 2);
    part.exchange.update_ghosts(&mut state);
    part.exchange.update_ghosts(&mut laplacian);
    Extension::of_states(part, state, [0.0; 3]).apply(part, &mut laplacian);
    laplacian
}
