//! `∂φ/∂t + ũ·∇φ = r(φ)` over one step: Crank-Nicolson, SUPG [14, 15], profile correction.
//!
//! For every node i, with φ* the profile of `phase::profile` (φ* = φ_h where it is off):
//!
//! ```text
//!     ∫ N_i ∂tφ* + ∫ N_i ũ·∇φ_h − ∫ (ũ·∇N_i)(φ*−φ_h) + ∮ N_i u·n (φ*−φ_h)
//!     + Σ_e ∫ τ ũ_e·∇N_i (∂tφ* + ũ_e·∇φ*) = (N_i, r),    τ = [(2/Δt)² + (2|ũ_e|/h_e)²]^(-1/2)
//! ```
//!
//! Terms without ∂t are means of the old and the new level; ũ is the velocity at mid-step and ũ_e its
//! mean over the element.
//!
//! **Why this form keeps ∫φ.** The velocity is not u_h, whose divergence vanishes only up to the
//! pressure stabilisation, but `ũ = u_h − u'` with the fine-scale velocity u' = τ/ρ R_m of PSPG,
//! constant in each element. The flow's continuity equation *is* `∫ ũ·∇q = ∮ q u·n` for every P1 q.
//! Summed over i (ΣN_i = 1, Σ∇N_i = 0) all that is left is `d/dt ∫φ* + ∫ ũ·∇φ_h + ∮ u·n (φ*−φ_h)`, and
//! with q = φ_h the middle term is `∮ φ_h u·n`: the total changes by what crosses the boundary, `∮ φ* u·n`.
//! Constants are kept too, each term being zero by itself. The form `−∫ φ ũ·∇N_i` would conserve for any
//! ũ, but keep constants only where ũ is divergence-free in that same weak sense: with u_h alone it
//! makes ripples in still depths of water and air.
//!
//! φ* is nonlinear in φ: passes of Newton's method, with w kept at its old value over the step. What is
//! left of the residual when they stop, and what the regularisation (which conserves ∫φ_h) does to
//! ∫(φ*−φ_h), is not lost: `excess_i`, what the scheme *owes* node i beyond ∫N_i φ_h, enters the next step in
//! place of ∫N_i(φ*−φ_h). `Σ_i (∫N_i φ_h + excess_i)` therefore changes by the boundary flux alone, to
//! round-off, whatever the tolerances; the integral ∫φ* follows it one step behind.

use super::boundary::face_flux;
use super::convection::{Level, add_profile, add_tangent, assemble};
use super::plain;
use super::profile::{OUTER, profile_weight};
use super::{Form, Phase};
use crate::cut::{Cell, CutMesh};
use crate::linear::relaxation::SymmetricGaussSeidel;
use crate::linear::{
    BlockCsr, DistributedOperator, Diverged, InnerProduct, KrylovSettings, NodeGraph, Operator,
    OwnedProduct, Workspace, fgmres,
};
use crate::mesh::MeshPart;

/// Passes allowed for the nonlinear terms: Newton's, and those of the paper's regularisation, which has no
/// tangent here and gains little by more.
const PASSES: [u32; 2] = [25, 6];
/// How far the linear solve of one of Newton's passes reduces the residual it is given. The others are not
/// driven to convergence: they are solved to the end, or what they leave would depend on the ranks.
const PASS_TOLERANCE: f64 = 1e-3;
/// Growth of the residual from which the tangent is not trusted. At the clip of ψ it stays for a pass or two.
const GROWTH: f64 = 2.0;
/// Change of φ per step that counts as none (root of the sum of squares over nodes).
const FLOOR: f64 = 1e-14;

/// What a step did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Transport {
    /// Linear solves: passes over the nonlinear terms.
    pub passes: u32,
    /// Linear iterations of all passes.
    pub iterations: u32,
    /// First residual, as a change of φ (root of the sum of squares over nodes).
    pub initial: f64,
    /// Last residual; carried into the next step.
    pub residual: f64,
    /// Regularisation speed γ [m/s].
    pub speed: f64,
    /// Explicit regularisation sub-steps.
    pub sub_steps: u32,
}

/// What a step is given.
#[derive(Clone, Copy, Debug)]
pub(super) struct Given<'a> {
    pub dt: f64,
    pub velocity: &'a [[f64; 3]],
    pub fine_scale: &'a [[f64; 3]],
    pub inflow: &'a [(u32, f64)],
    pub speed: f64,
}

/// Matrix and vectors of the transport step, kept between steps.
#[derive(Clone, Debug)]
pub(super) struct Solver {
    /// The matrix for φ* = φ_h.
    pub chord: BlockCsr<1>,
    /// That of a pass, with the profile's tangent.
    pub matrix: BlockCsr<1>,
    pub graph: NodeGraph,
    /// w of each element in this step.
    pub weight: Vec<f32>,
    smoother: SymmetricGaussSeidel,
    krylov: Workspace,
    /// The residual's part that does not depend on the new level [m³].
    pub constant: Vec<f64>,
    residual: Vec<f64>,
    /// ∫N_i(φ*−φ_h) of the profile last evaluated [m³].
    pub excess: Vec<f64>,
    change: Vec<f64>,
    last: Vec<f64>,
    difference: Vec<f64>,
    product: Vec<f64>,
}

impl Solver {
    pub fn new(part: &MeshPart, graph: &NodeGraph) -> Self {
        let zeros = vec![0.0; part.n_local()];
        Self {
            chord: BlockCsr::zero(&graph.pattern),
            matrix: BlockCsr::zero(&graph.pattern),
            graph: graph.clone(),
            weight: vec![0.0; part.mesh.tets.len()],
            smoother: SymmetricGaussSeidel::default(),
            krylov: Workspace::default(),
            constant: zeros.clone(),
            residual: zeros.clone(),
            excess: zeros.clone(),
            change: zeros.clone(),
            last: zeros.clone(),
            difference: zeros.clone(),
            product: zeros,
        }
    }
}

/// φ, `excess` and `inflow` of `phase` one step further. Collective.
pub(super) fn step(
    phase: &mut Phase,
    part: &MeshPart,
    cut: &CutMesh,
    given: &Given<'_>,
) -> Result<Transport, Diverged> {
    let n_owned = part.n_owned();
    let nonlinear = phase.profile_correction || phase.form != Form::Psi;
    let (passes, relative) = match phase.form {
        _ if !nonlinear => (1, 0.0),
        Form::Psi => (PASSES[0], PASS_TOLERANCE),
        _ => (PASSES[1], 0.0),
    };

    phase.before.copy_from_slice(&phase.phi);
    phase.profile.set(&phase.phi, phase.profile_correction);
    assemble(phase, part, cut, given);
    let mut constant = std::mem::take(&mut phase.solver.constant);
    if phase.profile_correction {
        for (e, tet) in part.mesh.tets.iter().enumerate() {
            let weight = match cut.cell(e) {
                Cell::Whole => phase.profile.in_band(tet).map_or(0.0, profile_weight),
                _ => 0.0,
            };
            phase.solver.weight[e] = weight as f32;
        }
        add_profile(phase, part, given, Level::Old, &mut constant);
    }
    add_plain(phase, part, cut, given, &mut constant);
    for i in 0..n_owned {
        constant[i] -= phase.excess[i];
    }
    phase.solver.constant = constant;

    for &(i, phi) in given.inflow {
        phase.phi[i as usize] = phi;
    }
    part.exchange.update_ghosts(&mut phase.phi);

    let mut report = Transport { speed: given.speed, ..Transport::default() };
    let (mut target, mut newton, mut last) = (FLOOR, phase.profile_correction, false);
    loop {
        residual(phase, part, cut, given);
        let s = &mut phase.solver;
        let product = OwnedProduct::plain::<1>(&s.graph.halo);
        let size = product.dot(&s.residual, &s.residual).sqrt();
        if report.passes > 0 && nonlinear && !last && size > GROWTH * report.residual {
            // Here φ* does not behave as its tangent says: back, and on with that of φ_h.
            (last, newton) = (!newton, false);
            phase.phi.copy_from_slice(&s.last);
            continue;
        }
        report.residual = size;
        if report.passes == 0 {
            report.initial = size;
            target = FLOOR.max(phase.tolerance * size);
        }
        // A NaN goes on to the Krylov method, which reports it.
        if last || size <= target || report.passes == passes {
            break;
        }
        set_matrix(phase, part, cut, given, newton);
        let s = &mut phase.solver;
        let product = OwnedProduct::plain::<1>(&s.graph.halo);
        let settings = KrylovSettings {
            relative,
            absolute: target,
            max_iterations: phase.max_iterations,
            restart: 15,
        };
        for r in &mut s.residual {
            *r = -*r;
        }
        s.last.copy_from_slice(&phase.phi);
        let solved = fgmres(
            &DistributedOperator::new(&s.matrix, &s.graph.halo),
            &mut s.smoother.with(&s.matrix),
            &product,
            &s.residual,
            &mut s.change,
            &settings,
            &mut s.krylov,
        )?;
        report.iterations += solved.iterations;
        report.passes += 1;
        for i in 0..n_owned {
            phase.phi[i] = bounded(phase.phi[i], s.change[i], phase.before[i]);
        }
        part.exchange.update_ghosts(&mut phase.phi);
    }

    // What is owed: the profile's part as it now stands, less what the passes left over.
    for i in 0..n_owned {
        let left = phase.solver.residual[i] * phase.lumped[i];
        phase.excess[i] = phase.solver.excess[i] - left;
    }
    book_inflow(phase, part, cut, given);
    Ok(report)
}

/// φ + δφ, but inside (0, 1) where the old φ had a profile: there φ is a function of ψ.
#[inline]
fn bounded(phi: f64, change: f64, old: f64) -> f64 {
    if old * (1.0 - old) <= OUTER || phi <= 0.0 || phi >= 1.0 {
        phi + change
    } else if change < 0.0 {
        phi * (change / phi).exp()
    } else {
        1.0 - (1.0 - phi) * (-change / (1.0 - phi)).exp()
    }
}

/// Residual at `phase.phi`, rows divided by the lumped mass: a change of φ. Zero where φ is given.
fn residual(phase: &mut Phase, part: &MeshPart, cut: &CutMesh, given: &Given<'_>) {
    let n_owned = part.n_owned();
    let mut r = std::mem::take(&mut phase.solver.residual);
    r[..n_owned].copy_from_slice(&phase.solver.constant[..n_owned]);
    r[n_owned..].fill(0.0);
    if phase.profile_correction || phase.form != Form::Psi {
        phase.profile.set(&phase.phi, phase.profile_correction);
    }
    if phase.profile_correction {
        add_profile(phase, part, given, Level::New, &mut r);
        for i in 0..n_owned {
            r[i] += phase.solver.excess[i];
        }
    }
    add_plain(phase, part, cut, given, &mut r);
    let s = &mut phase.solver;
    for ((d, new), old) in s.difference.iter_mut().zip(&phase.phi).zip(&phase.before) {
        *d = new - old;
    }
    DistributedOperator::new(&s.chord, &s.graph.halo).apply(&mut s.difference, &mut s.product);
    for i in 0..n_owned {
        r[i] = r[i] * phase.inverse_lumped[i] + s.product[i];
    }
    for &(i, _) in given.inflow {
        r[i as usize] = 0.0;
    }
    for i in phase.margin.nodes.iter().map(|&i| i as usize).take_while(|&i| i < n_owned) {
        phase.margin.parked[i] = -r[i] * phase.lumped[i];
        r[i] = 0.0;
    }
    s.residual = r;
}

/// The paper's regularisation at the level `phase.profile` is of, half a step of it.
fn add_plain(phase: &Phase, part: &MeshPart, cut: &CutMesh, given: &Given<'_>, out: &mut [f64]) {
    let gamma = 0.5 * given.dt * given.speed;
    match phase.form {
        Form::Psi => {}
        Form::Plain => plain::compression(part, cut, &phase.profile, gamma, out),
        Form::Curvature => {
            let rows = &mut out[..part.n_owned()];
            plain::reaction(&phase.profile, &phase.lumped, gamma / phase.delta, rows);
        }
    }
}

/// The matrix of a pass, with or without the tangent of the profile's part; rows of given φ, of the
/// margin and of nodes without fluid become φ_i = given. The preconditioner follows.
fn set_matrix(phase: &mut Phase, part: &MeshPart, cut: &CutMesh, given: &Given<'_>, newton: bool) {
    let Solver { matrix, chord, .. } = &mut phase.solver;
    matrix.values.clone_from(&chord.values);
    if newton {
        add_tangent(phase, part, given);
    }
    let Solver { matrix, smoother, .. } = &mut phase.solver;
    let given = given.inflow.iter().map(|&(i, _)| i);
    let fixed = given.chain(cut.dry_nodes.iter().chain(&phase.margin.nodes).copied());
    let fixed = fixed.map(|i| i as usize);
    for i in fixed.filter(|&i| i < part.n_owned()) {
        for at in matrix.row(i) {
            matrix.values[at] = [[0.0]];
        }
        let at = matrix.pattern.diagonals()[i] as usize;
        matrix.values[at] = [[1.0]];
    }
    smoother.setup(matrix);
}

/// Liquid that came in at each owned node over the step: `−Δt ∮ N_i φ* u·n` over the open faces, mean
/// of both levels.
fn book_inflow(phase: &mut Phase, part: &MeshPart, cut: &CutMesh, given: &Given<'_>) {
    phase.inflow.fill(0.0);
    if phase.open_faces.is_empty() {
        return;
    }
    for old in [true, false] {
        let phi = if old { &phase.before } else { &phase.phi };
        for &f in &phase.open_faces {
            let face = &part.mesh.boundary[f as usize];
            let w = f64::from(phase.solver.weight[face.element as usize]);
            let flux = face_flux(part, cut, face, given.velocity, phi, w);
            for (i, &node) in face.nodes.iter().enumerate() {
                if (node as usize) < part.n_owned() {
                    phase.inflow[node as usize] -=
                        0.5 * given.dt * (flux.chord[i] + flux.excess[i]);
                }
            }
        }
    }
}
