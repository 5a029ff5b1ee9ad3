//! What one element adds to the transport step: the matrix for φ* = φ_h, and the profile's part.

use super::boundary::face_flux;
use super::profile::{Node, OUTER, moments, tangent};
use super::transport::Given;
use super::{Form, Phase};
use crate::cut::{Cell, CutMesh};
use crate::fem::dot;
use crate::fem::number::{Real, corners, f64x4, fours, packed};
use crate::fem::region::{Region, Whole};
use crate::mesh::MeshPart;
use crate::mesh::tetrahedron::Tetrahedron;

/// ũ against the shape functions of one element, or of four.
struct Convection<R = f64> {
    /// ũ_e.
    u: [R; 3],
    /// `b[k][j]` = ũ(x_k)·∇N_j.
    b: [[R; 4]; 4],
    /// ũ_e·∇N_j.
    mean: [R; 4],
    tau: R,
}

impl<R: Real> Convection<R> {
    #[inline(always)]
    fn new(
        t: &Tetrahedron<R>,
        fluid: &impl Region<R>,
        u: [[R; 3]; 4],
        fine: [R; 3],
        dt: f64,
    ) -> Self {
        let u = u.map(|u| [u[0] - fine[0], u[1] - fine[1], u[2] - fine[2]]);
        let b = u.map(|u| t.grad.map(|g| dot(u, g)));
        let um = fluid.mean(&u);
        let mean = t.grad.map(|g| dot(um, g));
        let h = t.size();
        let rate = R::of(4.0 / (dt * dt)) + R::of(4.0) * dot(um, um) / (h * h);
        Self { u: um, b, mean, tau: R::of(1.0) / rate.square_root() }
    }
}

/// Four elements that the interface is in.
struct Four {
    t: Tetrahedron<f64x4>,
    convection: Convection<f64x4>,
    nodes: [Node<f64x4>; 4],
    w: f64x4,
}

impl Four {
    #[inline(always)]
    fn new(
        phase: &Phase,
        part: &MeshPart,
        given: &Given<'_>,
        weight: &[f32],
        four: [usize; 4],
    ) -> Self {
        let tets = four.map(|e| part.mesh.tets[e]);
        let t = Tetrahedron::new(corners(&tets, &part.mesh.nodes));
        let u = corners(&tets, given.velocity);
        let fine = [0, 1, 2].map(|k| packed(&four, |&e| given.fine_scale[e][k]));
        Self {
            convection: Convection::new(&t, &Whole(t.volume), u, fine, given.dt),
            t,
            nodes: phase.profile.corners(&tets),
            w: packed(&four, |&e| f64::from(weight[e])),
        }
    }
}

/// The matrix for φ* = φ_h, rows divided by the lumped mass, and Δt (C + K) φⁿ in `constant`, with the
/// diffusion γδ of the forms that have it.
pub(super) fn assemble(phase: &mut Phase, part: &MeshPart, cut: &CutMesh, given: &Given<'_>) {
    phase.solver.chord.clear();
    phase.solver.constant.fill(0.0);
    for e in 0..part.assembled().len() {
        let t = Tetrahedron::of(&part.mesh, e);
        match cut.cell(e) {
            Cell::Whole => add_element(phase, part, given, e, &t, &Whole(t.volume)),
            Cell::Cut(c) => add_element(phase, part, given, e, &t, &c.pieces.fluid),
            Cell::Solid => {}
        }
    }
    // When the walls moved, cells lost water of the old φ: what flows through walls is to be of the old φ too, and ∫φ
    // is kept. A mass of (V + V_old)/2 does it; nodes may have lost more than they have left. Those that gained, whose
    // mass would become less than what they have, are owed it (`Phase::advance`).
    let s = &mut phase.solver;
    for (i, gained) in cut.gained.iter().enumerate().take(part.n_owned()) {
        let at = s.chord.pattern.diagonals()[i] as usize;
        s.chord.values[at][0][0] -= 0.5 * gained.min(0.0) * phase.inverse_lumped[i];
    }
}

#[inline]
fn add_element(
    phase: &mut Phase,
    part: &MeshPart,
    given: &Given<'_>,
    e: usize,
    t: &Tetrahedron,
    fluid: &impl Region,
) {
    let (n_owned, dt) = (part.n_owned(), given.dt);
    let gamma_delta = if phase.form == Form::Psi { 0.0 } else { given.speed * phase.delta };
    let n = part.mesh.tets[e].map(|n| n as usize);
    let c = Convection::new(t, fluid, n.map(|n| given.velocity[n]), given.fine_scale[e], dt);
    let phi = n.map(|n| phase.phi[n]);
    let s = &mut phase.solver;
    let grad = t.gradient(phi);
    let volume = fluid.volume();
    let diffusion = gamma_delta * volume;
    let along: f64 = (0..4).map(|j| c.mean[j] * phi[j]).sum();
    // In the flow's continuity equation u' acts over the whole element. What it carries through the part that
    // is not fluid goes to the nodes by their mass: so ∫φ is kept, and small nodes are not overrun.
    let hidden = t.volume - volume;
    for i in 0..4 {
        if n[i] >= n_owned {
            continue;
        }
        let supg = volume * c.tau * c.mean[i];
        // ∫ N_i ũ·∇N_j
        let mut convection = fluid.weighted(i, &c.b);
        if hidden > 0.0 {
            let around: f64 = n.iter().map(|&n| phase.lumped[n]).sum();
            let share = phase.lumped[n[i]] / around * hidden;
            for (c, g) in convection.iter_mut().zip(&t.grad) {
                *c -= share * dot(given.fine_scale[e], *g);
            }
        }
        let galerkin: f64 = (0..4).map(|j| convection[j] * phi[j]).sum();
        s.constant[n[i]] += dt * (galerkin + supg * along + diffusion * dot(t.grad[i], grad));
        let scale = phase.inverse_lumped[n[i]];
        let at = s.graph.entries(e, &part.mesh.tets[e], i);
        for j in 0..4 {
            let mass = fluid.second(i, j) + c.tau * c.mean[i] * fluid.first(j);
            let space = convection[j] + supg * c.mean[j] + diffusion * dot(t.grad[i], t.grad[j]);
            s.chord.values[at[j]][0][0] += scale * (mass + 0.5 * dt * space);
        }
    }
}

/// Which end of the step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Level {
    /// `−` the mass in the SUPG test; the Galerkin test's is `phase.excess`.
    Old,
    /// `+` the mass; in the Galerkin test it is left in `solver.excess`.
    New,
}

/// The profile's part (of whole elements: where a structure cuts, φ* = φ_h) at the level `phase.profile` is of, added to `out` (owned rows): half the
/// step's fluxes and SUPG, and the masses as `level` says.
pub(super) fn add_profile(
    phase: &mut Phase,
    part: &MeshPart,
    given: &Given<'_>,
    level: Level,
    out: &mut [f64],
) {
    let n_owned = part.n_owned();
    let half = 0.5 * given.dt;
    let sign = if level == Level::New { 1.0 } else { -1.0 };
    phase.solver.excess.fill(0.0);
    let weight = std::mem::take(&mut phase.solver.weight);
    let band = (0..part.assembled().len()).filter(|&e| weight[e] > 0.0);
    for (four, count) in fours(band) {
        let Four { t, convection: c, nodes, w } = Four::new(phase, part, given, &weight, four);
        let of = f64x4::splat;
        let p = moments(nodes.each_ref(), w);
        // ∫ ũ_e·(∇φ* − ∇φ_h) over the unit volume.
        let sloping = [0, 1, 2, 3].map(|j| c.mean[j] * (p.slope * nodes[j].s - w * nodes[j].phi));
        let along = of(half) * ((sloping[0] + sloping[1]) + (sloping[2] + sloping[3]));
        let total = (p.excess[0] + p.excess[1]) + (p.excess[2] + p.excess[3]);
        let moved = c.tau * of(1.0 / given.dt) * (along - total);
        let moved = c.u.map(|u| (moved * u).to_array());
        let rows = [0, 1, 2, 3].map(|i| {
            let flux = (c.b[0][i] * p.excess[0] + c.b[1][i] * p.excess[1])
                + (c.b[2][i] * p.excess[2] + c.b[3][i] * p.excess[3]);
            let streamline = c.tau * c.mean[i] * (of(sign) * total + along);
            (t.volume * (streamline - of(half) * flux)).to_array()
        });
        let excess = p.excess.map(|excess| (t.volume * excess).to_array());
        for (l, &e) in four.iter().take(count).enumerate() {
            if level == Level::Old && phase.form == Form::Psi {
                phase.flux[e] = moved.map(|moved| moved[l]);
            }
            for (i, n) in part.mesh.tets[e].into_iter().enumerate() {
                if (n as usize) < n_owned {
                    out[n as usize] += rows[i][l];
                    phase.solver.excess[n as usize] += excess[i][l];
                }
            }
        }
    }
    for face in &part.mesh.boundary {
        let w = f64::from(weight[face.element as usize]);
        if w == 0.0 {
            continue;
        }
        let flux = face_flux(part, &CutMesh::whole(), face, given.velocity, &phase.phi, w).excess;
        for (&i, f) in face.nodes.iter().zip(flux) {
            if (i as usize) < n_owned {
                out[i as usize] += half * f;
            }
        }
    }
    phase.solver.weight = weight;
}

/// What SUPG moves φ by, `ũ_e τ` times the mean of `∂tφ* + ũ_e·∇φ*`, added to `phase.flux`, which has the profile's
/// part of the old level. To be called with the new φ and its profile.
pub(super) fn add_streamline_flux(
    phase: &mut Phase,
    part: &MeshPart,
    cut: &CutMesh,
    given: &Given<'_>,
) {
    for (e, tet) in part.assembled().iter().enumerate() {
        let mixed = |phi: &[f64]| {
            tet.iter().any(|&n| {
                let phi = phi[n as usize];
                (phi * (1.0 - phi)).abs() > OUTER
            })
        };
        if !mixed(&phase.phi) && !mixed(&phase.before) {
            continue;
        }
        let t = Tetrahedron::of(&part.mesh, e);
        let flux = match cut.cell(e) {
            Cell::Whole => streamline_flux(phase, given, e, tet, &t, &Whole(t.volume)),
            Cell::Cut(c) => streamline_flux(phase, given, e, tet, &t, &c.pieces.fluid),
            Cell::Solid => continue,
        };
        (0..3).for_each(|k| phase.flux[e][k] += flux[k]);
    }
}

#[inline]
fn streamline_flux(
    phase: &Phase,
    given: &Given<'_>,
    e: usize,
    tet: &[u32; 4],
    t: &Tetrahedron,
    fluid: &impl Region,
) -> [f64; 3] {
    let n = tet.map(|n| n as usize);
    let u = n.map(|n| given.velocity[n]);
    let c = Convection::new(t, fluid, u, given.fine_scale[e], given.dt);
    let (old, new) = (n.map(|n| phase.before[n]), n.map(|n| phase.phi[n]));
    let change: f64 = (0..4).map(|i| fluid.first(i) * (new[i] - old[i])).sum();
    let along: f64 = (0..4).map(|i| c.mean[i] * 0.5 * (new[i] + old[i])).sum();
    let mut residual = change / (fluid.volume() * given.dt) + along;
    let w = f64::from(phase.solver.weight[e]);
    if w > 0.0 {
        let nodes = tet.map(|n| &phase.profile.nodes[n as usize]);
        let p = moments(nodes, w);
        let slope: f64 = (0..4).map(|j| c.mean[j] * (p.slope * nodes[j].s - w * new[j])).sum();
        residual += p.excess.iter().sum::<f64>() / given.dt + 0.5 * slope;
    }
    c.u.map(|u| c.tau * u * residual)
}

/// Adds the derivative of the profile's part at the new level, at `phase.profile`, to the matrix.
pub(super) fn add_tangent(phase: &mut Phase, part: &MeshPart, given: &Given<'_>) {
    let n_owned = part.n_owned();
    let half = f64x4::splat(0.5 * given.dt);
    let weight = std::mem::take(&mut phase.solver.weight);
    let band = (0..part.assembled().len()).filter(|&e| weight[e] > 0.0);
    for (four, count) in fours(band) {
        let Four { t, convection: c, nodes, w } = Four::new(phase, part, given, &weight, four);
        let p = tangent(nodes.each_ref(), w);
        let g = p.excess;
        let sloping = [0, 1, 2, 3].map(|j| c.mean[j] * nodes[j].s);
        let along = (sloping[0] + sloping[1]) + (sloping[2] + sloping[3]);
        let mut rows = [[[0.0; 4]; 4]; 4];
        for j in 0..4 {
            let column = (g[0][j] + g[1][j]) + (g[2][j] + g[3][j]);
            let along = c.mean[j] * (p.slope * nodes[j].ds() - w) + along * p.curvature[j];
            let streamline = c.tau * (column + half * along);
            for i in 0..4 {
                let flux = (c.b[0][i] * g[0][j] + c.b[1][i] * g[1][j])
                    + (c.b[2][i] * g[2][j] + c.b[3][i] * g[3][j]);
                let value = g[i][j] - half * flux + c.mean[i] * streamline;
                rows[i][j] = (t.volume * value).to_array();
            }
        }
        let s = &mut phase.solver;
        for (l, &e) in four.iter().take(count).enumerate() {
            let tet = &part.mesh.tets[e];
            for i in (0..4).filter(|&i| (tet[i] as usize) < n_owned) {
                let scale = phase.inverse_lumped[tet[i] as usize];
                let at = s.graph.entries(e, tet, i);
                for j in 0..4 {
                    s.matrix.values[at[j]][0][0] += scale * rows[i][j][l];
                }
            }
        }
    }
    phase.solver.weight = weight;
}
