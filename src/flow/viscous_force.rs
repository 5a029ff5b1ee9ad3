//! The viscous force per volume over μ, ∇²u, that the strong residual of linear elements lacks (after Jansen, Collis,
//! Whiting and Shakib 1999).
//!
//! Without it the pressure's stabilisation wants `∂ₙp = ρ(F − Du/Dt)·n` at a wall, and the pressure there is wrong by
//! a cell's width times `μ∇²u`. Gradients averaged at the nodes have a divergence; on walls, where averages are
//! one-sided, gradients are continued from the inside. It is taken from the velocity that the
//! step begins with; with the one extrapolated to the middle, steps of Courant number 6 were unstable.

use crate::cut::{Cell, CutMesh};
use crate::fem::constraints::{Constraint, Nodes};
use crate::fem::dot;
use crate::mesh::MeshPart;
use crate::mesh::tetrahedron::Tetrahedron;

/// How much of it a flat element takes: τ∇²u of a velocity that alternates from node to node must stay below that
/// velocity, else it grows from step to step. 1 for cells of a cube.
pub fn share(t: &Tetrahedron) -> f64 {
    let steep: f64 = t.grad.iter().map(|g| dot(*g, *g)).sum();
    (8.0 / (t.size().powi(2) * steep)).min(1.0)
}

/// ∇²u at the local nodes of the velocity `u` [1/(m s)]. Collective.
pub fn laplacian(
    part: &MeshPart,
    cut: &CutMesh,
    constraints: &Nodes,
    u: &[[f64; 3]],
) -> Vec<[f64; 3]> {
    let mesh = &part.mesh;
    // Rounding may leave a little free in a corner of slip walls.
    let held = |c: &Constraint| c.free.as_flattened().iter().all(|f| f.abs() < 1e-9);
    let outer = |n: u32| held(&constraints[n as usize]) || !cut.is_in_fluid(n as usize);
    let elements = || {
        let fluid = |e: &usize| !matches!(cut.cell(*e), Cell::Solid);
        (0..mesh.tets.len()).filter(fluid).map(|e| (&mesh.tets[e], Tetrahedron::of(mesh, e)))
    };
    // ∂u_k/∂x_b in place 3 k + b.
    let slope = |tet: &[u32; 4], t: &Tetrahedron| {
        let mut du = [0.0; 9];
        for (&n, g) in tet.iter().zip(t.grad) {
            (0..9).for_each(|k| du[k] += g[k % 3] * u[n as usize][k / 3]);
        }
        du
    };

    let mut gradient = Mean::new(part);
    for (tet, t) in elements() {
        let du = slope(tet, &t);
        tet.iter().filter(|&&n| !outer(n)).for_each(|&n| gradient.add(n, t.volume, &du));
    }
    gradient.finish(part);
    // An element's gradient is the mean of its nodes'.
    for (tet, t) in elements() {
        let count = tet.iter().filter(|&&n| outer(n)).count() as f64;
        if count > 0.0 {
            let mut rest = slope(tet, &t).map(|g| 4.0 * g / count);
            for &n in tet.iter().filter(|&&n| !outer(n)) {
                let inner = gradient.values[n as usize];
                (0..9).for_each(|k| rest[k] -= inner[k] / count);
            }
            tet.iter()
                .filter(|&&n| outer(n))
                .for_each(|&n| gradient.add(n, t.volume * count, &rest));
        }
    }
    gradient.finish(part);

    let mut laplacian = Mean::new(part);
    for (tet, t) in elements() {
        let mut sum = [0.0; 3];
        for (&n, g) in tet.iter().zip(t.grad) {
            let du = &gradient.values[n as usize];
            (0..3).for_each(|k| {
                sum[k] += g[0] * du[3 * k] + g[1] * du[3 * k + 1] + g[2] * du[3 * k + 2]
            });
        }
        tet.iter().for_each(|&n| laplacian.add(n, t.volume, &sum));
    }
    laplacian.finish(part);
    laplacian.values
}

/// Weighted means at the local nodes.
struct Mean<const C: usize> {
    values: Vec<[f64; C]>,
    weights: Vec<f64>,
}

impl<const C: usize> Mean<C> {
    fn new(part: &MeshPart) -> Self {
        Self { values: vec![[0.0; C]; part.n_local()], weights: vec![0.0; part.n_local()] }
    }

    fn add(&mut self, node: u32, weight: f64, value: &[f64; C]) {
        self.weights[node as usize] += weight;
        let sum = &mut self.values[node as usize];
        (0..C).for_each(|k| sum[k] += weight * value[k]);
    }

    /// Divides what has been added since the last time by its weights. Collective.
    fn finish(&mut self, part: &MeshPart) {
        for (value, weight) in self.values.iter_mut().zip(&mut self.weights).take(part.n_owned()) {
            if *weight > 0.0 {
                *value = value.map(|v| v / *weight);
                *weight = 0.0;
            }
        }
        part.exchange.update_ghosts(&mut self.values);
    }
}
