//! The free surface: a conservative Allen-Cahn phase field φ (1 liquid, 0 gas) on P1 tetrahedra.
//!
//! ```text
//!     ∂φ/∂t + u·∇φ = ∇·R,   R = γ(δ∇φ − φ(1−φ) ∇φ/|∇φ|)          Chiu & Lin 2011; METHOD.md, 2
//! ```
//!
//! φ lives at half time levels: a step with uⁿ takes φ^{n−½} to φ^{n+½}.
//!
//! `initial` φ of a signed distance · `profile` the tanh inside an element · `transport` the implicit
//! convective step and why it conserves · `convection` its elements · `boundary` flux through faces · `inflow` φ prescribed · `regularise` R in ψ form ·
//! `plain` R as the paper has it · `water` connected bodies · `volume` correction and ledger.
//!
//! Where a structure cuts an element, its integrals run over the fluid part and φ* = φ_h; `margin` φ at its nodes
//! inside the structure.
//!
//! May name `cut`, `mesh`, `fem`, `linear`, `case`; knows nothing of the flow that makes the velocity.

mod boundary;
mod convection;
pub mod inflow;
pub mod initial;
mod margin;
mod plain;
pub mod profile;
mod regularise;
#[cfg(test)]
mod tests;
pub mod transport;
pub mod volume;
pub mod water;

use crate::case::{self, FreeSurface, Regularisation, VolumeCorrection};
use crate::cut::{Cell, CutMesh, Extension};
use crate::fem::dot;
use crate::linear::{Diverged, NodeGraph};
use crate::mesh::MeshPart;
use crate::mesh::tetrahedron::volume;
use profile::{OUTER, Profile, logit};
use transport::Given;
pub use transport::Transport;
pub use volume::{Ledger, VolumeReport};

/// How the regularisation enters.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Form {
    /// Sub-steps in ψ after transport.
    Psi,
    /// [11], inside the transport step.
    Plain,
    /// Without conservation: moves by curvature.
    Curvature,
}

/// Named arrays from which a run can be continued.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// One value for each local node.
    pub nodal: Vec<(&'static str, Vec<f64>)>,
    /// The same on every rank.
    pub global: Vec<(&'static str, Vec<f64>)>,
}

/// The phase field and all it needs to move.
#[derive(Clone, Debug)]
pub struct Phase {
    /// φ of local nodes; ghosts valid.
    pub phi: Vec<f64>,
    /// φ as the last step had transported it, and as it was regularised then, before its volume was corrected.
    pub stages: [Vec<f64>; 2],
    /// δ [m].
    delta: f64,
    /// h [m].
    cell: f64,
    form: Form,
    mobility: f64,
    /// Reduced by the gas's weight [m/s²].
    gravity: f64,
    profile_correction: bool,
    volume_correction: VolumeCorrection,
    tolerance: f64,
    max_iterations: u32,
    open_faces: Vec<u32>,
    ledger: Ledger,
    /// What the scheme owes each owned node beyond ∫N_i φ_h [m³] (see `transport`).
    excess: Vec<f64>,
    /// Liquid that came in at each owned node since the volume was last corrected [m³].
    inflow: Vec<f64>,
    /// Lumped mass, and its inverse, of local nodes.
    lumped: Vec<f64>,
    inverse_lumped: Vec<f64>,
    /// Nodes inside structures with fluid around them.
    margin: margin::Margin,
    /// Volume of fluid around local nodes over their lumped mass.
    ratio: Vec<f64>,
    /// λ_e of `regularise`.
    stiffness: Vec<f32>,
    /// R + S of local elements over the last step: the regularisation's, mean of its sub-steps, and SUPG's [m/s]. Empty
    /// while it is lent.
    flux: Vec<[f64; 3]>,
    solver: transport::Solver,
    // Scratch.
    profile: Profile,
    before: Vec<f64>,
    /// Σ_e V_e n_e and Σ_e V_e over the band's elements around a node, for `regularise`.
    normal: Vec<[f64; 4]>,
    /// Mean of ∇ψ_h over them.
    slope: Vec<[f64; 3]>,
    nodal_volume: Vec<f64>,
    band: Vec<(u32, u32, f64)>,
}

impl Phase {
    /// From nodal φ (ghosts valid), for cells of size `cell` at the interface (`initial::cell_size`).
    ///
    /// `open_faces`: boundary faces (indices into `part.mesh.boundary`) that liquid may cross; what
    /// crosses them is booked, what leaks through others is not. Collective.
    pub fn new(
        part: &MeshPart,
        cut: &CutMesh,
        graph: &NodeGraph,
        settings: &FreeSurface,
        solver: &case::Solver,
        cell: f64,
        mut phi: Vec<f64>,
        open_faces: Vec<u32>,
    ) -> Self {
        let n = part.n_local();
        assert_eq!(phi.len(), n, "a value of φ for each local node");
        dry(&mut phi, cut);
        let mut phase = Self {
            stages: [phi.clone(), phi.clone()],
            delta: delta(settings, cell),
            cell,
            form: match (settings.conservative, settings.regularisation) {
                (false, _) => Form::Curvature,
                (true, Regularisation::Plain) => Form::Plain,
                (true, Regularisation::Psi) => Form::Psi,
            },
            mobility: settings.mobility,
            gravity: 0.0,
            profile_correction: settings.profile_correction,
            volume_correction: settings.volume_correction,
            tolerance: solver.phase_tolerance,
            max_iterations: solver.max_iterations,
            open_faces,
            ledger: Ledger::default(),
            excess: vec![0.0; n],
            inflow: vec![0.0; n],
            inverse_lumped: Vec::new(),
            lumped: Vec::new(),
            margin: margin::Margin::default(),
            ratio: vec![0.0; n],
            stiffness: vec![0.0; part.mesh.tets.len()],
            flux: vec![[0.0; 3]; part.mesh.tets.len()],
            solver: transport::Solver::new(part, graph),
            profile: Profile::default(),
            before: phi.clone(),
            normal: vec![[0.0; 4]; n],
            slope: vec![[0.0; 3]; n],
            nodal_volume: Vec::new(),
            band: Vec::new(),
            phi,
        };
        phase.set_geometry(part, cut);
        phase.open_ledger(part, cut);
        // `volume` has left the profile's part here.
        phase.excess.copy_from_slice(&phase.solver.excess);
        phase
    }

    /// Lets gravity, reduced by the gas's weight [m/s²], make waves. Without, nothing pulls the surface level.
    pub fn feel(&mut self, reduced_gravity: f64) {
        self.gravity = reduced_gravity;
    }

    /// Takes over which parts of the elements are fluid. Collective.
    fn set_geometry(&mut self, part: &MeshPart, cut: &CutMesh) {
        // Volume around each node, and ∫N_i.
        let mut sums = vec![[0.0; 2]; part.n_local()];
        for (e, tet) in part.mesh.tets.iter().enumerate() {
            let mut add = |volume: f64, first: [f64; 4]| {
                for (&n, first) in tet.iter().zip(first) {
                    let sum = &mut sums[n as usize];
                    *sum = [sum[0] + volume, sum[1] + first];
                }
            };
            match cut.cell(e) {
                Cell::Whole => {
                    let volume = volume(&part.mesh.corners(e));
                    add(volume, [0.25 * volume; 4]);
                }
                Cell::Cut(c) => add(c.pieces.fluid.size, c.pieces.fluid.first),
                Cell::Solid => {}
            }
        }
        part.exchange.update_ghosts(&mut sums);
        let inverse = |m: f64| if m > 0.0 { 1.0 / m } else { 0.0 };
        self.lumped = sums.iter().map(|s| s[1]).collect();
        self.inverse_lumped = sums.iter().map(|s| inverse(s[1])).collect();
        let mut ratio: Vec<f64> = sums.iter().map(|s| s[0] * inverse(s[1])).collect();
        self.margin = margin::Margin::new(part, cut, &ratio);
        // They take no part in the sub-steps.
        self.margin.nodes.iter().for_each(|&i| ratio[i as usize] = 4.0);
        regularise::set_stiffness(&part.mesh, &self.ratio, &ratio, &mut self.stiffness);
        self.ratio = ratio;
    }

    /// The structures have moved: nodes that are wet now and were not take φ from those of `coming`, and nodes
    /// that were and are no more leave what they are owed to those of `going`. Collective.
    pub fn follow(
        &mut self,
        part: &MeshPart,
        cut: &CutMesh,
        coming: &Extension,
        going: &Extension,
    ) {
        let (phi, _) = self.phi.as_chunks_mut::<1>();
        coming.apply(part, phi);
        dry(&mut self.phi, cut);
        going.hand_over(part, &mut self.excess);
        self.set_geometry(part, cut);
    }

    /// One step of length `dt` with the velocity at its middle. Collective.
    ///
    /// `velocity` [m/s] at local nodes, `fine_scale` u' [m/s] of local elements (zero for a given,
    /// divergence-free velocity), `inflow` local nodes where φ is prescribed. On `Err`, φ is the last
    /// iterate.
    ///
    /// # Errors
    /// The linear solver did not reach its tolerance.
    pub fn advance(
        &mut self,
        part: &MeshPart,
        cut: &CutMesh,
        dt: f64,
        velocity: &[[f64; 3]],
        fine_scale: &[[f64; 3]],
        inflow: &[(u32, f64)],
    ) -> Result<Transport, Diverged> {
        let top = (0..part.n_owned())
            .filter(|&i| self.phi[i] * (1.0 - self.phi[i]) > OUTER)
            .map(|i| dot(velocity[i], velocity[i]))
            .fold(0.0, f64::max);
        let speed = self.mobility * part.max(top).sqrt();
        let given = Given { dt, velocity, fine_scale, inflow, speed };
        self.flux.clear();
        self.flux.resize(part.mesh.tets.len(), [0.0; 3]);
        let mut report = transport::step(self, part, cut, &given)?;
        self.stages[0].copy_from_slice(&self.phi);
        if self.form == Form::Psi {
            convection::add_streamline_flux(self, part, cut, &given);
            report.sub_steps = regularise::sub_steps(self, part, cut, dt, speed);
        }
        // When the walls moved, cells gained and lost water of the old φ; what has flowed through walls since went with
        // the mean of old and new. At nodes that lost, `convection::assemble` has put that right.
        for (i, gained) in cut.gained.iter().enumerate().take(part.n_owned()) {
            self.excess[i] += 0.5 * gained.max(0.0) * (self.stages[0][i] - self.before[i]);
        }
        margin::settle(self, part);
        self.stages[1].copy_from_slice(&self.phi);
        Ok(report)
    }

    /// δ [m].
    pub fn delta(&self) -> f64 {
        self.delta
    }

    /// h, the cell size at the interface [m].
    pub fn cell(&self) -> f64 {
        self.cell
    }

    /// R + S of local elements over the last step [m/s]: liquid moves by −(R + S) against the fluid. Empty but in
    /// ψ form. To be given back before the next step.
    pub fn lend_flux(&mut self) -> Vec<[f64; 3]> {
        if self.form == Form::Psi { std::mem::take(&mut self.flux) } else { Vec::new() }
    }

    /// What was lent: its memory is used again.
    pub fn take_back(&mut self, flux: Vec<[f64; 3]>) {
        if self.form == Form::Psi {
            self.flux = flux;
        }
    }

    /// Targets and sums of the volume correction.
    pub fn ledger(&self) -> &Ledger {
        &self.ledger
    }

    /// ψ = δ ln(φ/(1−φ)) of local nodes [m], clipped at ±11δ.
    pub fn psi(&self, out: &mut [f64]) {
        for (psi, &phi) in out.iter_mut().zip(&self.phi) {
            *psi = self.delta * logit(phi);
        }
    }

    /// Everything that later steps depend on. Body names are stored plus one, 0 for none.
    pub fn state(&self) -> State {
        let l = &self.ledger;
        let mut nodal = vec![("phi", self.phi.clone()), ("phase_excess", self.excess.clone())];
        if !l.names.is_empty() {
            let names = l.names.iter().map(|&n| n.wrapping_add(1) as f64).collect();
            nodal.push(("water_body", names));
        }
        let bodies = l.bodies.iter().flat_map(|b| [b.name as f64, b.target]).collect();
        let global = vec![
            ("phase_size", vec![self.cell, self.delta]),
            ("water_account", vec![l.spray, l.target, l.corrected, l.moved]),
            ("water_bodies", bodies),
        ];
        State { nodal, global }
    }

    /// Continues from `state`, taken from a phase field with the same settings (on any number of ranks);
    /// ghosts of its nodal arrays need not be valid. Collective.
    ///
    /// # Panics
    /// If an array is missing or has the wrong length.
    pub fn restore(&mut self, part: &MeshPart, state: &State) {
        let find = |list: &[(&'static str, Vec<f64>)], name: &str| {
            let found = list.iter().find(|(n, _)| *n == name);
            found.unwrap_or_else(|| panic!("phase state has an array {name}")).1.clone()
        };
        let nodal = |name: &str| {
            let mut values = find(&state.nodal, name);
            assert_eq!(values.len(), part.n_local(), "{name} has a value for each local node");
            part.exchange.update_ghosts(&mut values);
            values
        };
        self.phi = nodal("phi");
        self.excess = nodal("phase_excess");
        if !self.ledger.names.is_empty() {
            let names = nodal("water_body");
            self.ledger.names = names.iter().map(|&n| (n as u64).wrapping_sub(1)).collect();
        }
        let size = find(&state.global, "phase_size");
        [self.cell, self.delta] = size[..].try_into().expect("h and δ");
        let account = find(&state.global, "water_account");
        let bodies = find(&state.global, "water_bodies");
        let l = &mut self.ledger;
        [l.spray, l.target, l.corrected, l.moved] = account[..].try_into().expect("4 sums");
        l.bodies = bodies
            .chunks_exact(2)
            .map(|b| volume::Body { name: b[0] as u64, target: b[1] })
            .collect();
    }
}

/// Where there is no fluid there is no liquid.
fn dry(phi: &mut [f64], cut: &CutMesh) {
    cut.dry_nodes.iter().for_each(|&i| phi[i as usize] = 0.0);
}

/// δ of these settings for cells of size `cell` [m].
pub fn delta(settings: &FreeSurface, cell: f64) -> f64 {
    settings.thickness.unwrap_or(settings.thickness_cells * cell)
}
