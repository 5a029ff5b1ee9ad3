//! The state of a case in progress, and its step. `run` goes to the end, with output · `time_step` how long a step is ·
//! `checkpoint` restart · `energy` where energy is and goes · `warnings` what is said before it runs.

mod checkpoint;
mod energy;
mod run;
mod time_step;
mod warnings;

use crate::bodies::{Bodies, Load, Tracked};
use crate::case::Case;
use crate::coupling::riders::Rider;
use crate::coupling::{self, Failure, Structures};
use crate::cut::{CutMesh, Extension};
use crate::flow::{BodyLoad, Flow, FlowReport, Material};
use crate::linear::Diverged;
use crate::mesh::MeshPart;
use crate::mesh::balance::Balance;
use crate::mesh::quality::Quality;
use crate::obstacles::Obstacles;
use crate::phase::{Phase, VolumeReport, inflow::Inflow};
use crate::report::gauges::Gauges;
use crate::report::stages::Stages;
use crate::setup::{self, SetupError};
use energy::Ledger;
use partition::Communicator;
pub use run::Options;

/// A case in progress on this rank.
pub struct Simulation {
    /// What is computed.
    pub case: Case,
    /// This rank's part of the mesh.
    pub part: MeshPart,
    /// Where the structures stand.
    pub cut: CutMesh,
    structures: Structures,
    /// What the fluid did to each structure over the last step: obstacles first, then bodies.
    pub loads: Vec<BodyLoad>,
    /// What it did to each body where that rests on something and the cut does not see it.
    hidden: Vec<Load>,
    /// Velocity and pressure, unless the velocity is given.
    pub flow: Option<Flow>,
    /// The free surface, if there are two fluids.
    pub phase: Option<Phase>,
    /// Rigid bodies, if there are any.
    pub bodies: Option<Bodies>,
    /// Densities and gravity as the flow sees them.
    pub material: Material,
    /// The account of energy, if it is asked for.
    pub energy: Option<Ledger>,
    /// Where time stands.
    pub clock: Clock,
    /// What each stage has cost.
    pub stages: Stages,
    /// Of the mesh before refinement, on rank 0.
    pub quality: Option<Quality>,
    size: Size,
    /// (6V)^(1/3) of the smallest element [m].
    smallest: f64,
    gauges: Option<Gauges>,
    /// Gauges on surfaces.
    riders: Vec<Rider>,
    inflow: Inflow,
    inflow_values: Vec<(u32, f64)>,
    /// Points of bodies that are recorded.
    tracked: Vec<Tracked>,
    /// The given velocity, and no fine-scale velocity, where there is no flow.
    given: Vec<[f64; 3]>,
    no_fine_scale: Vec<[f64; 3]>,
}

/// Of the whole mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Size {
    nodes: u64,
    elements: u64,
}

/// Why a run stops.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// It did not start.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// A file cannot be read or written.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// A linear solver failed.
    #[error(
        "step {step} from t = {t:.6e} s, Δt = {dt:.3e} s: {equation}: {source}; a smaller \
         time.max_cfl or time.step may help"
    )]
    Solver {
        /// Which equation.
        equation: &'static str,
        /// Step number.
        step: u64,
        /// Time at its start [s].
        t: f64,
        /// Its length [s].
        dt: f64,
        /// The solver's numbers.
        source: Diverged,
    },
    /// Flow and bodies did not agree.
    #[error(
        "step {step} from t = {t:.6e} s, Δt = {dt:.3e} s: bodies and flow: the walls' velocities still \
         change by {residual:.1e} of themselves after {passes} passes; a smaller time.max_cfl or time.step \
         may help"
    )]
    Coupling {
        /// Step number.
        step: u64,
        /// Time at its start [s].
        t: f64,
        /// Its length [s].
        dt: f64,
        /// Passes made.
        passes: u32,
        /// Change over velocity.
        residual: f64,
    },
}

/// What one step did.
#[derive(Clone, Copy, Debug, Default)]
pub struct StepReport {
    /// Length of the step [s].
    pub dt: f64,
    /// The flow's solve.
    pub flow: FlowReport,
    /// Passes of flow and bodies.
    pub passes: u32,
    /// Iterations of the phase transport.
    pub phase_iterations: u32,
    /// The water's account.
    pub volume: VolumeReport,
}

/// Time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    /// Now [s].
    pub t: f64,
    /// Steps done.
    pub step: u64,
    /// Time the phase field stands at [s]: half a step off, where there is a flow.
    pub t_phase: f64,
    /// Last step [s].
    pub dt: f64,
    /// Where time stood before it [s].
    pub before: f64,
}

impl Clock {
    fn tick(&mut self, dt: f64) {
        self.before = self.t;
        self.t += dt;
        self.dt = dt;
        self.step += 1;
    }
}

impl Simulation {
    /// From a case. Collective.
    ///
    /// # Errors
    /// What is wrong with the case or its mesh.
    pub fn new(case: Case, comm: &Communicator) -> Result<Self, SetupError> {
        let mut stages = Stages::default();
        let (part, quality) = stages.time("mesh", || setup::mesh(&case, comm))?;
        let clock = comm.clock();
        let balance = Balance::of(&part);
        let inflow = Inflow::new(&case, &part);
        let obstacles = Obstacles::new(&case, setup::solids::obstacles(&case, comm)?);
        let bodies = setup::bodies::bodies(&case, &part, &obstacles.solids(0.0))?;
        let (bodies, tracked) = bodies.unzip();
        let structures = Structures::new(&case, &part, obstacles, bodies.as_ref());
        let cut = structures.cut(&part, bodies.as_ref(), 0.0);
        let solid = if structures.move_at_all() { &[][..] } else { &cut.dry_nodes };
        let gauges = Some(Gauges::new(&case, &part, solid)?);
        let riders = structures.riders(&case, bodies.as_ref())?;
        let graph = setup::graph(&part);
        let phase = setup::phase(&case, &part, &cut, &graph, &inflow);
        let material = setup::material(&case, &part, phase.as_ref());
        let flow = setup::flow(&case, &part, &cut, &graph);
        let energy = flow.as_ref().filter(|_| case.output.energy);
        let energy = energy.map(|flow| Ledger::new(&part, &cut, flow, &material, bodies.as_ref()));
        let mut given = Vec::new();
        let mut no_fine_scale = Vec::new();
        if flow.is_none() {
            given.resize(part.n_local(), [0.0; 3]);
            no_fine_scale.resize(part.mesh.tets.len(), [0.0; 3]);
            prescribe(&case, &part, 0.0, &mut given);
        }
        let smallest = setup::smallest_cell(&part);
        stages.add("set-up", clock.elapsed());
        Ok(Self {
            case,
            cut,
            loads: vec![BodyLoad::default(); structures.first_body() + structures.placed.len()],
            structures,
            hidden: Vec::new(),
            flow,
            phase,
            material,
            energy,
            clock: Clock { t: 0.0, step: 0, t_phase: 0.0, dt: 0.0, before: 0.0 },
            stages,
            quality,
            size: Size { nodes: balance.nodes(), elements: balance.elements() },
            smallest,
            gauges,
            riders,
            inflow,
            inflow_values: Vec::new(),
            tracked: tracked.unwrap_or_default(),
            bodies,
            given,
            no_fine_scale,
            part,
        })
    }

    /// One step of the paper's algorithm: the free surface, where the structures stand, velocity and pressure.
    /// Collective.
    ///
    /// The phase field stands at the middle of the flow's steps: it moves from tⁿ⁻½ to tⁿ⁺½ with uⁿ, and
    /// its densities are those in the middle of the flow's step (a leapfrog: waves neither grow nor decay). Where
    /// told walls move it is carried from step to step by the step that u has come from; with equal steps that is
    /// the same.
    ///
    /// # Errors
    /// A solver that does not converge.
    pub fn step(&mut self, dt: f64) -> Result<StepReport, RunError> {
        let Self { part, clock, stages, .. } = self;
        let (step, t) = (clock.step + 1, clock.t);
        let failed = |equation| move |source| RunError::Solver { equation, step, t, dt, source };
        let mut report = StepReport { dt, ..StepReport::default() };

        if let Some(phase) = &mut self.phase {
            let middle = t + 0.5 * dt;
            let (dt_phase, velocity, fine_scale) = match &self.flow {
                // Walls have moved: by the velocity's own step, over which cells have gained what walls swept.
                // Over another, water would be lost or made where steps grow and shrink.
                Some(flow) if !self.cut.gained.is_empty() => (clock.dt, &flow.u, &flow.fine_scale),
                Some(flow) => (middle - clock.t_phase, &flow.u, &flow.fine_scale),
                None => {
                    prescribe(&self.case, part, middle, &mut self.given);
                    (dt, &self.given, &self.no_fine_scale)
                }
            };
            let inflow = &mut self.inflow_values;
            self.inflow.values(part, velocity, phase, [t, dt_phase], inflow);
            phase.take_back(self.material.set_flux(Vec::new()));
            let moved = stages
                .time("free surface", || {
                    phase.advance(part, &self.cut, dt_phase, velocity, fine_scale, inflow)
                })
                .map_err(failed("free surface"))?;
            report.phase_iterations = moved.iterations;
            clock.t_phase += dt_phase;
            report.volume = stages.time("volume", || phase.restore_volume(part, &self.cut));
            if let Some(flow) = &mut self.flow {
                let (flux, material) = (phase.lend_flux(), &mut self.material);
                let phi = &phase.phi;
                stages.time("free surface", || {
                    flow.take_phase(part, &self.cut, material, phi, flux, dt_phase)
                });
            }
            if let (Some(ledger), Some(flow)) = (&mut self.energy, &self.flow) {
                ledger.surface_moved(part, &self.cut, flow, &mut self.material, phase);
            }
        }
        if self.flow.is_some() && self.structures.move_at_all() {
            let before = std::mem::take(&mut self.cut);
            let gravity = self.case.gravity;
            stages.time("cut", || {
                self.cut = self.structures.cut(part, self.bodies.as_ref(), t + dt);
                let coming = Extension::new(part, &before, &self.cut, gravity);
                let going = Extension::new(part, &self.cut, &before, gravity);
                // Bodies have moved over the step before this one: what they sweep in this is not known yet.
                if self.bodies.is_none() {
                    self.cut.compare(part, &before, &going);
                }
                if let Some(phase) = &mut self.phase {
                    phase.follow(part, &self.cut, &coming, &going);
                }
                if let Some(flow) = &mut self.flow {
                    flow.follow(part, &self.cut, &coming, gravity);
                }
            });
        }
        if let Some(phase) = &self.phase {
            self.material.set_phase(&phase.phi);
        }
        if let Some(flow) = &mut self.flow {
            let (structures, bodies) = (&mut self.structures, self.bodies.as_mut());
            let (cut, material) = (&self.cut, &self.material);
            let done = coupling::advance(
                &self.case,
                part,
                cut,
                material,
                flow,
                structures,
                bodies,
                [t, dt],
            )
            .map_err(|failure| match failure {
                Failure::Flow(source) => failed("velocity and pressure")(source),
                Failure::Coupling { passes, residual } => {
                    RunError::Coupling { step, t, dt, passes, residual }
                }
            })?;
            if let (Some(ledger), Some(flow)) = (&mut self.energy, &self.flow) {
                let step = flow.step_energy(part, &self.cut, &done.surfaces, &self.material);
                let (first, bodies) = (self.structures.first_body(), self.bodies.as_ref());
                stages.time("energy", || ledger.add(&step, &done, first, bodies, dt));
            }
            stages.add("flow: assembly", done.flow.assembly);
            stages.add("flow: solve", done.flow.solve);
            if !self.structures.placed.is_empty() {
                stages.add("bodies", done.bodies);
            }
            (report.flow, report.passes) = (done.flow, done.passes);
            (self.loads, self.hidden) = (done.loads, done.hidden);
            if let Some(bodies) = &mut self.bodies {
                bodies.take_out(&self.structures.mesh, &self.structures.placed);
            }
        } else if let Some(bodies) = &mut self.bodies {
            let loads = vec![Load::default(); bodies.state.len()];
            stages.time("bodies", || bodies.advance(dt, &loads));
        }
        clock.tick(dt);
        Ok(report)
    }

    /// u at local nodes [m/s], computed or given.
    pub fn velocity(&self) -> &[[f64; 3]] {
        self.flow.as_ref().map_or(&self.given, |flow| &flow.u)
    }
}

/// The given velocity at time `t`.
fn prescribe(case: &Case, part: &MeshPart, t: f64, velocity: &mut [[f64; 3]]) {
    if let Some(formula) = &case.prescribed_velocity {
        for (u, &x) in velocity.iter_mut().zip(&part.mesh.nodes) {
            *u = std::array::from_fn(|k| formula[k].at(x, t));
        }
    }
}
