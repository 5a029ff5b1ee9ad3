//! The run: state, one step, output, restart.

mod checkpoint;
mod energy;

use crate::bodies::{Bodies, Load, Tracked};
use crate::case::{Case, MeshSource};
use crate::coupling::riders::Rider;
use crate::coupling::thickness::Thin;
use crate::coupling::{self, Failure, Structures};
use crate::cut::{CutMesh, Extension};
use crate::fem::courant_rate;
use crate::flow::{BodyLoad, Flow, FlowReport, Material};
use crate::linear::Diverged;
use crate::mesh::MeshPart;
use crate::mesh::balance::Balance;
use crate::mesh::quality::Quality;
use crate::obstacles::Obstacles;
use crate::phase::{Phase, VolumeReport, inflow::Inflow};
use crate::report::bodies::BodiesOutput;
use crate::report::energy::EnergyOutput;
use crate::report::gauges::Gauges;
use crate::report::output::{Output, Schedule, Snapshot};
use crate::report::progress::{Line, Progress};
use crate::report::stages::Stages;
use crate::report::summary::{Summary, Totals};
use crate::setup::{self, SetupError};
use energy::Ledger;
use partition::Communicator;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// A step is at most this much longer than the one before.
const GROWTH: f64 = 1.2;
/// In the first step a fluid at rest falls at most this fraction of the smallest cell; without gravity
/// the step is this fraction of the run.
const FIRST_FALL: f64 = 0.01;
/// The leapfrog of surface and velocity is stable up to about 1.1 √(h/g) for the shortest waves of the mesh.
const WAVE_LIMIT: f64 = 0.5;
/// Cells that a wall crosses in a step at most: nodes beyond it hold for it no longer.
const WALL_LIMIT: f64 = 0.25;

/// Bodies without a fluid take this many sub-steps a step.
const SUB_STEPS: f64 = 100.0;

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

/// How a run was asked for on the command line.
#[derive(Clone, Debug)]
pub struct Options {
    /// Folder for the results.
    pub out: PathBuf,
    /// Checkpoint to go on from, or a folder with checkpoints.
    pub restart: Option<PathBuf>,
    /// Stop after this many steps.
    pub steps: Option<u64>,
    /// Print nothing but errors.
    pub quiet: bool,
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
        let obstacles = Obstacles::new(&case, &part)?;
        let (bodies, tracked) = setup::bodies::bodies(&case, comm)?.unzip();
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
            let moved = stages
                .time("free surface", || {
                    phase.advance(part, &self.cut, dt_phase, velocity, fine_scale, inflow)
                })
                .map_err(failed("free surface"))?;
            report.phase_iterations = moved.iterations;
            clock.t_phase += dt_phase;
            report.volume = stages.time("volume", || phase.restore_volume(part, &self.cut));
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
            self.material.set_flux(phase.flux());
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

    /// From where it stands to the end of the case, with all output. Collective.
    ///
    /// # Errors
    /// A step that fails, a file that cannot be written.
    pub fn run(&mut self, options: &Options) -> Result<Summary, RunError> {
        let started = Instant::now();
        let first = self.part.comm.rank() == 0;
        let after = match &options.restart {
            Some(path) => {
                self.restore(path)?;
                Some(self.clock.t)
            }
            None => None,
        };
        self.open_folder(&options.out)?;
        let gauges = self.gauges.take().expect("a simulation is run once");
        let mut output = Output::open(&self.case, &self.part, gauges, &options.out, after)?;
        let mut body_files = match &self.bodies {
            Some(b) => BodiesOutput::open(&self.case, b, &self.tracked, &options.out, after)?,
            None => None,
        };
        let mut energy = match &self.energy {
            Some(_) => Some(EnergyOutput::open(&self.part, &options.out, after)?),
            None => None,
        };
        let mut checkpoints = self.case.output.checkpoint_every.map(|every| {
            let mut schedule = Schedule::new(every, after);
            schedule.take(self.clock.t);
            schedule
        });
        let end = self.case.time.end;
        let mut progress = Progress::new(first && !options.quiet, self.clock.t, end);
        for thin in self.thin_structures() {
            progress.tell(&thin);
        }
        let begun = self.clock.step;
        let mut flow_iterations = 0;
        let mut told = 0;
        if after.is_none() {
            output.write_if_due(&self.part, &self.snapshot())?;
            if let (Some(files), Some(bodies)) = (&mut body_files, &self.bodies) {
                files.write_if_due(self.clock.t, bodies)?;
            }
        }
        let mut line = Line { t: self.clock.t, ..Line::default() };
        let mut pockets = 0;
        let begin = self.part.comm.clock();
        while self.clock.t < end && options.steps.is_none_or(|n| self.clock.step - begun < n) {
            let rate = courant_rate(&self.part, self.velocity());
            let due = checkpoints.map(|schedule| schedule.next_time());
            let pictures = body_files.as_ref().map(|files| files.next_time());
            let due = output.next_time().into_iter().chain(due).chain(pictures);
            let dt = self.next_dt(rate, due);
            let report = self.step(dt)?;
            flow_iterations += u64::from(report.flow.iterations);
            let sealed = report.flow.squeezed;
            if sealed.pockets > pockets && sealed.volume > 0.0 {
                progress.tell(&format!(
                    "t {:.4} s: {} bodies of fluid have no open boundary; what moving walls squeeze out of them is \
                     compressed there (sealed_pockets and squeezed in history.csv)",
                    self.clock.t, sealed.pockets
                ));
            }
            pockets = sealed.pockets;
            let clock = self.part.comm.clock();
            line = self.line(&report, dt * rate);
            output.write_history(&self.part, self.history(&report, dt * rate))?;
            if let (Some(file), Some(ledger)) = (&mut energy, &self.energy) {
                file.write(&self.part, self.clock.t, &ledger.energy)?;
            }
            output.write_if_due(&self.part, &self.snapshot())?;
            if let Some(bodies) = &self.bodies {
                for left in &bodies.left[told..] {
                    progress.tell(&left.to_string());
                }
                told = bodies.left.len();
            }
            if let (Some(files), Some(bodies)) = (&mut body_files, &self.bodies) {
                files.write_if_due(self.clock.t, bodies)?;
            }
            if let Some(schedule) = &mut checkpoints
                && schedule.take(self.clock.t)
            {
                self.write_checkpoint(&options.out)?;
            }
            self.stages.add("output", clock.elapsed());
            progress.show(&line, false);
        }
        progress.show(&line, true);
        let totals = Totals {
            steps: self.clock.step - begun,
            t: self.clock.t,
            wall_seconds: started.elapsed().as_secs_f64(),
            flow_iterations,
            bodies_left: self.bodies.as_ref().map_or(0, |bodies| bodies.left.len() as u64),
            cost: begin.elapsed(),
        };
        let summary = Summary::new(&self.case, &self.part, &self.stages, totals);
        let written = if first { summary.write(&options.out) } else { Ok(()) };
        io::Error::agree(&self.part.comm, written)?;
        Ok(summary)
    }

    /// A sentence for each obstacle, and for each entry of bodies, that is too thin for the mesh somewhere. Collective.
    pub fn thin_structures(&self) -> Vec<String> {
        let thin = self.structures.thin(&self.part, self.bodies.as_ref(), self.clock.t);
        let name = |t: &Thin| self.structures.name(&self.case, self.bodies.as_ref(), t.structure);
        let sentence = |alike: &[Thin]| {
            let by_elements = |a: &&Thin, b: &&Thin| a.elements.total_cmp(&b.elements);
            let thinnest = alike.iter().min_by(by_elements).expect("a chunk is not empty");
            let Thin { place: [x, y, z], thickness, elements, share, .. } = thinnest;
            let others = match alike.len() {
                1 => String::new(),
                n => format!("; {} more of its parts are too thin", n - 1),
            };
            format!(
                "thin:    {} is {thickness:.3} m or {elements:.1} elements thick at ({x:.3}, {y:.3}, {z:.3}), and less \
                 than 2 on {:.0} % of its surface: the flow may not see it as it is{others}",
                name(thinnest),
                100.0 * share
            )
        };
        thin.chunk_by(|a, b| name(a) == name(b)).map(sentence).collect()
    }

    /// Makes the folder for the results and puts the case as used into it. Collective.
    fn open_folder(&self, folder: &Path) -> Result<(), io::Error> {
        let made = if self.part.comm.rank() == 0 {
            let case = folder.join("case.toml");
            std::fs::create_dir_all(folder).map_err(|e| io::Error::file(folder, e)).and_then(|()| {
                std::fs::write(&case, &self.case.effective).map_err(|e| io::Error::file(&case, e))
            })
        } else {
            Ok(())
        };
        io::Error::agree(&self.part.comm, made)
    }

    /// Cells that the fastest wall crosses a second.
    fn wall_rate(&self) -> f64 {
        // Before the first step, their speed at once.
        let (t, dt) = (self.clock.t, self.clock.dt.max(1e-9 * self.case.time.end));
        self.structures.crossing_rate(&self.part, &self.cut, t, dt)
    }

    /// u at local nodes [m/s], computed or given.
    pub fn velocity(&self) -> &[[f64; 3]] {
        self.flow.as_ref().map_or(&self.given, |flow| &flow.u)
    }

    fn snapshot(&self) -> Snapshot<'_> {
        Snapshot {
            t: self.clock.t,
            u: self.velocity(),
            p: self.flow.as_ref().map_or(&[], |flow| &flow.p),
            phi: self.phase.as_ref().map_or(&[], |phase| &phase.phi),
            distance: &self.cut.distance,
            dry: &self.cut.dry_nodes,
            loads: self.structures.by_name(
                self.bodies.as_ref(),
                &self.loads,
                &self.hidden,
                self.case.bodies.as_ref().map_or(0, |b| b.bodies.len()),
            ),
            riding: self.structures.ride(&self.riders, self.clock.t),
        }
    }

    fn line(&self, report: &StepReport, courant: f64) -> Line {
        let volume = &report.volume;
        Line {
            t: self.clock.t,
            step: self.clock.step,
            dt: report.dt,
            courant,
            iterations: report.flow.iterations,
            fluid: self.case.mesh != MeshSource::Nothing,
            volume_error: (volume.volume - volume.target) / volume.target.max(f64::MIN_POSITIVE),
        }
    }

    fn history(&self, report: &StepReport, courant: f64) -> [f64; 18] {
        let (flow, volume) = (&report.flow, &report.volume);
        [
            self.clock.step as f64,
            self.clock.t,
            report.dt,
            courant,
            report.passes.into(),
            flow.iterations.into(),
            flow.residual / flow.initial_residual.max(f64::MIN_POSITIVE),
            report.phase_iterations.into(),
            volume.volume,
            volume.error,
            volume.inflow,
            volume.correction,
            volume.corrected,
            volume.bodies.into(),
            flow.squeezed.pockets.into(),
            flow.squeezed.volume,
            flow.kinetic,
            flow.potential,
        ]
    }

    /// Length of the next step [s], for flow that crosses `rate` cells a second; it ends on the next of the
    /// times `due`, unless the case gives the step.
    fn next_dt(&self, rate: f64, due: impl Iterator<Item = f64>) -> f64 {
        let time = &self.case.time;
        let t = self.clock.t;
        let (wanted, stop) = match time.step {
            Some(step) => (step, time.end),
            None => {
                let g = crate::fem::norm(self.case.gravity);
                let growth = match time.first_step {
                    _ if self.clock.step > 0 => GROWTH * self.clock.dt,
                    Some(first) => first,
                    None if g > 0.0 => (FIRST_FALL * 2.0 * self.smallest / g).sqrt(),
                    None => FIRST_FALL * time.end,
                };
                let mut wanted = growth.min(time.max_step).min(time.max_cfl / rate);
                if let (Some(phase), true) = (&self.phase, self.flow.is_some()) {
                    wanted = wanted.min(WAVE_LIMIT * (phase.cell() / g).sqrt());
                }
                if self.flow.is_some() {
                    wanted = wanted.min(WALL_LIMIT / self.wall_rate());
                } else if let Some(bodies) = &self.bodies {
                    wanted = (SUB_STEPS * bodies.time_step()).min(time.max_step);
                }
                let next = due.filter(|&d| d > t * (1.0 + 1e-9)).fold(time.end, f64::min);
                (wanted, next)
            }
        };
        let left = stop - t;
        // The stop is met with equal steps, not with a last crumb.
        if left <= wanted * (1.0 + 1e-9) {
            left
        } else if left < 2.0 * wanted {
            0.5 * left
        } else {
            wanted
        }
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
