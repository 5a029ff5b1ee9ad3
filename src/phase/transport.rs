//! `∂φ/∂t + ũ·∇φ = r(φ)` over one step: Crank-Nicolson, SUPG [14, 15], profile correction.
//!
//! For every node i, with φ* the profile of `phase::profile` (φ* = φ_h where it is off):
//!
//!     ∫ N_i ∂tφ* + ∫ N_i ũ·∇φ_h − ∫ (ũ·∇N_i)(φ*−φ_h) + ∮ N_i u·n (φ*−φ_h)
//!     + Σ_e ∫ τ ũ_e·∇N_i (∂tφ* + ũ_e·∇φ*) = (N_i, r),    τ = [(2/Δt)² + (2|ũ_e|/h_e)²]^(-1/2)
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
//! φ* is nonlinear in φ: corrector passes solve `A δφ = −residual`, A the matrix for φ* = φ_h. What is
//! left of the residual when they stop, and what the regularisation (which conserves ∫φ_h) does to
//! ∫(φ*−φ_h), is not lost: `excess_i`, what the scheme *owes* node i beyond ∫N_i φ_h, enters the next step in
//! place of ∫N_i(φ*−φ_h). `Σ_i (∫N_i φ_h + excess_i)` therefore changes by the boundary flux alone, to
//! round-off, whatever the tolerances; the integral ∫φ* follows it one step behind.

use super::boundary::{OpenFace, face_flux};
use super::plain;
use super::profile::moments;
use super::{Form, Phase};
use crate::fem::dot;
use crate::fem::tetrahedron::Tetrahedron;
use crate::linear::block_csr::ElementSlots;
use crate::linear::relaxation::SymmetricGaussSeidel;
use crate::linear::{
    BlockCsr, DistributedOperator, Diverged, Halo, KrylovSettings, OwnedProduct, Workspace, fgmres,
};
use crate::mesh::MeshPart;

/// Passes allowed for the nonlinear terms; each gains a factor of 5 to 20.
const PASSES: u32 = 4;
/// How far one pass reduces the residual it is given.
const PASS_TOLERANCE: f64 = 1e-2;
/// Change of φ per step that counts as none.
const FLOOR: f64 = 1e-14;

/// What a transport step did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Transport {
    /// Passes over the nonlinear terms.
    pub passes: u32,
    /// Linear iterations of all passes.
    pub iterations: u32,
    /// First residual, as a change of φ (root of the sum of squares over nodes).
    pub initial: f64,
    /// Last known residual.
    pub residual: f64,
}

/// Matrix and vectors of the transport step, kept between steps.
#[derive(Clone, Debug)]
pub struct Solver {
    pub(super) matrix: BlockCsr<1>,
    slots: ElementSlots,
    halo: Halo,
    smoother: SymmetricGaussSeidel,
    krylov: Workspace,
    /// Residual's part that does not depend on the new level; owned rows, not divided by mass.
    constant: Vec<f64>,
    residual: Vec<f64>,
    /// ∫N_i(φ*−φ_h) at the new level.
    pub(super) excess: Vec<f64>,
    change: Vec<f64>,
    product: Vec<f64>,
}

/// ũ against the shape functions of one element.
struct Convection {
    /// `b[k][j]` = ũ(x_k)·∇N_j.
    b: [[f64; 4]; 4],
    /// ũ_e·∇N_j.
    mean: [f64; 4],
    tau: f64,
}

impl Convection {
    #[inline]
    fn new(t: &Tetrahedron, u: [[f64; 3]; 4], fine: [f64; 3], dt: f64) -> Self {
        let b = u.map(|u| {
            let u = [u[0] - fine[0], u[1] - fine[1], u[2] - fine[2]];
            t.grad.map(|g| dot(u, g))
        });
        let mean = std::array::from_fn(|j| 0.25 * (b[0][j] + b[1][j] + b[2][j] + b[3][j]));
        let um: [f64; 3] =
            std::array::from_fn(|c| 0.25 * (u[0][c] + u[1][c] + u[2][c] + u[3][c]) - fine[c]);
        let h = t.size();
        let tau = 1.0 / (4.0 / (dt * dt) + 4.0 * dot(um, um) / (h * h)).sqrt();
        Self { b, mean, tau }
    }
}

impl Solver {
    pub(super) fn new(part: &MeshPart) -> Self {
        let n = part.n_local();
        let (matrix, slots) = BlockCsr::of_elements(&part.mesh.tets, part.n_owned());
        let halo = Halo::new(&part.comm, &part.nodes, &part.exchange, &matrix);
        let zeros = vec![0.0; n];
        Self {
            matrix,
            slots,
            halo,
            smoother: SymmetricGaussSeidel::default(),
            krylov: Workspace::default(),
            constant: zeros.clone(),
            residual: zeros.clone(),
            excess: zeros.clone(),
            change: zeros.clone(),
            product: zeros,
        }
    }
}

/// φ, excess and the nodal outflow of `phase` one step further. Collective.
///
/// `speed` is the regularisation's γ for the forms that treat it here.
pub(super) fn step(
    phase: &mut Phase,
    part: &MeshPart,
    dt: f64,
    velocity: &[[f64; 3]],
    fine_scale: &[[f64; 3]],
    inflow: &[(u32, f64)],
    speed: f64,
) -> Result<Transport, Diverged> {
    let n_owned = part.n_owned();
    let gamma_delta = if phase.form == Form::Psi { 0.0 } else { speed * phase.delta };
    let nonlinear = phase.profile_correction || phase.form != Form::Psi;

    phase.before.copy_from_slice(&phase.phi);
    phase.profile.set(&phase.phi, phase.profile_correction);
    assemble(phase, part, dt, velocity, fine_scale, gamma_delta);
    for i in 0..n_owned {
        phase.solver.constant[i] -= phase.excess[i];
    }
    let mut s = std::mem::take(&mut phase.solver.constant);
    add_nonlinear(phase, part, dt, velocity, fine_scale, speed, Level::Old, &mut s);
    phase.solver.constant = s;

    for &(i, phi) in inflow {
        phase.phi[i as usize] = phi;
        if (i as usize) < n_owned {
            fix_row(&mut phase.solver.matrix, i as usize);
        }
    }
    phase.solver.smoother.setup(&phase.solver.matrix);

    let mut report = Transport::default();
    let mut target = FLOOR;
    loop {
        if nonlinear && report.passes > 0 {
            phase.profile.set(&phase.phi, phase.profile_correction);
        }
        residual(phase, part, dt, velocity, fine_scale, inflow, speed);
        let s = &mut phase.solver;
        let product = OwnedProduct::plain::<1>(&s.halo);
        let size = crate::linear::InnerProduct::dot(&product, &s.residual, &s.residual).sqrt();
        report.residual = size;
        if report.passes == 0 {
            report.initial = size;
            target = FLOOR.max(phase.tolerance * size);
        }
        // A NaN goes to the Krylov method, which reports it.
        if size <= target || report.passes == if nonlinear { PASSES } else { 1 } {
            break;
        }
        let settings = KrylovSettings {
            relative: if nonlinear { PASS_TOLERANCE } else { 0.0 },
            absolute: target,
            max_iterations: phase.max_iterations,
            restart: 30,
        };
        let operator = DistributedOperator::new(&s.matrix, &s.halo);
        for r in &mut s.residual {
            *r = -*r;
        }
        s.change.fill(0.0);
        let solved = fgmres(
            &operator,
            &mut s.smoother,
            &product,
            &s.residual,
            &mut s.change,
            &settings,
            &mut s.krylov,
        )?;
        report.iterations += solved.iterations;
        report.passes += 1;
        for i in 0..n_owned {
            phase.phi[i] += s.change[i];
        }
        part.exchange.update_ghosts(&mut phase.phi);
    }

    // What is owed: the profile's part as it now stands, less what the passes left over.
    for i in 0..n_owned {
        let left = phase.solver.residual[i] * phase.lumped[i];
        phase.excess[i] = phase.solver.excess[i] - left;
    }
    for &(i, _) in inflow {
        if (i as usize) < n_owned {
            phase.excess[i as usize] = phase.solver.excess[i as usize];
        }
    }
    flux_through_open_faces(phase, part, dt, velocity);
    Ok(report)
}

/// The matrix for φ* = φ_h, rows times Δt/m_i, and Δt (C + K) φⁿ in `constant`.
fn assemble(
    phase: &mut Phase,
    part: &MeshPart,
    dt: f64,
    velocity: &[[f64; 3]],
    fine_scale: &[[f64; 3]],
    gamma_delta: f64,
) {
    let n_owned = part.n_owned();
    let Solver { matrix, slots, constant, .. } = &mut phase.solver;
    matrix.clear();
    constant.fill(0.0);
    for (e, tet) in part.mesh.tets.iter().enumerate() {
        let n = tet.map(|n| n as usize);
        let t = Tetrahedron::of(&part.mesh, e);
        let c = Convection::new(&t, n.map(|n| velocity[n]), fine_scale[e], dt);
        let phi = n.map(|n| phase.phi[n]);
        let grad = t.gradient(phi);
        let m = (1.0 / 20.0) * t.volume;
        let along = (0..4).map(|j| c.mean[j] * phi[j]).sum::<f64>();
        for i in 0..4 {
            if n[i] >= n_owned {
                continue;
            }
            let supg = t.volume * c.tau * c.mean[i];
            let diffusion = gamma_delta * t.volume;
            let galerkin = (0..4).map(|j| (4.0 * c.mean[j] + c.b[i][j]) * phi[j]).sum::<f64>();
            constant[n[i]] += dt * (m * galerkin + supg * along + diffusion * dot(t.grad[i], grad));
            let scale = phase.inverse_lumped[n[i]];
            for j in 0..4 {
                let mass = if i == j { 2.0 * m } else { m } + 0.25 * supg;
                let space = m * (4.0 * c.mean[j] + c.b[i][j])
                    + supg * c.mean[j]
                    + diffusion * dot(t.grad[i], t.grad[j]);
                matrix.values[slots[e][4 * i + j] as usize][0][0] +=
                    scale * (mass + 0.5 * dt * space);
            }
        }
    }
}

/// Which end of the step.
#[derive(Clone, Copy, PartialEq)]
enum Level {
    Old,
    New,
}

/// Terms beyond the matrix at one level, evaluated at `phase.profile`: half the step's fluxes, and the
/// mass of φ*−φ_h: with ± in the SUPG test; in the Galerkin test only at the new level (the old
/// one's is `excess`).
fn add_nonlinear(
    phase: &mut Phase,
    part: &MeshPart,
    dt: f64,
    velocity: &[[f64; 3]],
    fine_scale: &[[f64; 3]],
    speed: f64,
    level: Level,
    out: &mut [f64],
) {
    let n_owned = part.n_owned();
    if phase.profile_correction {
        let sign = if level == Level::New { 1.0 } else { -1.0 };
        let mass = &mut phase.solver.excess;
        mass.fill(0.0);
        for (e, tet) in part.mesh.tets.iter().enumerate() {
            let Some(nodes) = phase.profile.in_band(tet) else { continue };
            let Some(p) = moments(nodes) else { continue };
            let n = tet.map(|n| n as usize);
            let t = Tetrahedron::of(&part.mesh, e);
            let c = Convection::new(&t, n.map(|n| velocity[n]), fine_scale[e], dt);
            // ∫ ũ_e·(∇φ* − ∇φ_h) over the unit volume.
            let along: f64 =
                (0..4).map(|j| c.mean[j] * (p.slope * nodes[j].s - p.w * nodes[j].phi)).sum();
            let total = p.excess.iter().sum::<f64>();
            let half = 0.5 * dt;
            for i in 0..4 {
                if n[i] < n_owned {
                    let flux: f64 = (0..4).map(|k| c.b[k][i] * p.excess[k]).sum();
                    out[n[i]] += t.volume
                        * (c.tau * c.mean[i] * (sign * total + half * along) - half * flux);
                    mass[n[i]] += t.volume * p.excess[i];
                }
            }
        }
        for face in &part.mesh.boundary {
            let flux = face_flux(part, face, velocity, &phase.profile, OpenFace::Excess);
            for (&i, f) in face.nodes.iter().zip(flux) {
                if (i as usize) < n_owned {
                    out[i as usize] += 0.5 * dt * f;
                }
            }
        }
        if level == Level::New {
            for i in 0..n_owned {
                out[i] += phase.solver.excess[i];
            }
        }
    }
    match phase.form {
        Form::Psi => {}
        Form::Plain => plain::compression(part, &phase.profile, 0.5 * dt * speed, out),
        Form::Curvature => plain::reaction(
            &phase.profile,
            &phase.lumped,
            0.5 * dt * speed / phase.delta,
            &mut out[..n_owned],
        ),
    }
}

/// Residual at `phase.phi`, rows divided by the lumped mass: as a change of φ.
fn residual(
    phase: &mut Phase,
    part: &MeshPart,
    dt: f64,
    velocity: &[[f64; 3]],
    fine_scale: &[[f64; 3]],
    inflow: &[(u32, f64)],
    speed: f64,
) {
    let n_owned = part.n_owned();
    let mut r = std::mem::take(&mut phase.solver.residual);
    r[..n_owned].copy_from_slice(&phase.solver.constant[..n_owned]);
    r[n_owned..].fill(0.0);
    add_nonlinear(phase, part, dt, velocity, fine_scale, speed, Level::New, &mut r);
    let s = &mut phase.solver;
    for ((c, new), old) in s.change.iter_mut().zip(&phase.phi).zip(&phase.before) {
        *c = new - old;
    }
    let operator = DistributedOperator::new(&s.matrix, &s.halo);
    crate::linear::Operator::apply(&operator, &mut s.change, &mut s.product);
    for i in 0..n_owned {
        r[i] = r[i] * phase.inverse_lumped[i] + s.product[i];
    }
    for &(i, _) in inflow {
        r[i as usize] = 0.0;
    }
    s.residual = r;
}

/// Row i becomes φ_i = given.
fn fix_row(matrix: &mut BlockCsr<1>, i: usize) {
    for at in matrix.row(i) {
        matrix.values[at] = [[0.0]];
    }
    let at = matrix.diagonal(i);
    matrix.values[at] = [[1.0]];
}

/// Liquid volume that came in at each node over the step: `−Δt ∮ N_i φ* u·n`, mean of both levels.
fn flux_through_open_faces(phase: &mut Phase, part: &MeshPart, dt: f64, velocity: &[[f64; 3]]) {
    let n_owned = part.n_owned();
    phase.inflow.fill(0.0);
    for old in [true, false] {
        if phase.open_faces.is_empty() {
            return;
        }
        let phi = if old { &phase.before } else { &phase.phi };
        phase.profile.set(phi, false);
        let what = if phase.profile_correction { OpenFace::Profile } else { OpenFace::Chord };
        for &f in &phase.open_faces {
            let face = &part.mesh.boundary[f as usize];
            let flux = face_flux(part, face, velocity, &phase.profile, what);
            for (&i, f) in face.nodes.iter().zip(flux) {
                if (i as usize) < n_owned {
                    phase.inflow[i as usize] -= 0.5 * dt * f;
                }
            }
        }
    }
}
