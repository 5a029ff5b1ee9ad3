//! The run: state, one step, output, restart.

use crate::case::Case;
use crate::flow::{Flow, FlowReport, Material};
use crate::linear::Diverged;
use crate::mesh::MeshPart;
use crate::phase::{Phase, VolumeReport, inflow::Inflow};
use crate::report::output::Fields;
use crate::report::stages::Stages;
use crate::setup::{self, SetupError};
use partition::Communicator;
use std::path::PathBuf;

/// A case in progress on this rank.
pub struct Simulation {
    /// What is computed.
    pub case: Case,
    /// This rank's part of the mesh.
    pub part: MeshPart,
    /// Velocity and pressure, unless the velocity is given.
    pub flow: Option<Flow>,
    /// The free surface, if there are two fluids.
    pub phase: Option<Phase>,
    /// Densities and gravity as the flow sees them.
    pub material: Material,
    /// Where time stands.
    pub clock: Clock,
    /// Wall time by stage.
    pub stages: Stages,
    inflow: Inflow,
    inflow_values: Vec<(u32, f64)>,
    /// The given velocity, and no fine-scale velocity, where there is no flow.
    given: Vec<[f64; 3]>,
    no_fine_scale: Vec<[f64; 3]>,
}

/// Why a run stops.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// It did not start.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// A file cannot be written.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// A linear solver failed.
    #[error(
        "step {step} (t = {t:.6e} s, Δt = {dt:.3e} s), {equation}: {source}; try a smaller {advice}"
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
        /// What to change.
        advice: &'static str,
        /// The solver's numbers.
        source: Diverged,
    },
}

/// What one step did.
#[derive(Clone, Copy, Debug, Default)]
pub struct StepReport {
    /// Length of the step [s].
    pub dt: f64,
    /// Courant number of the step.
    pub courant: f64,
    /// The flow's solve.
    pub flow: FlowReport,
    /// Iterations of the phase transport.
    pub phase_iterations: u32,
    /// The water's account.
    pub volume: VolumeReport,
}

/// How a run was asked for on the command line.
#[derive(Clone, Debug)]
pub struct Options {
    /// Folder for the results.
    pub out: PathBuf,
    /// Checkpoint to go on from.
    pub restart: Option<PathBuf>,
    /// Stop after this many steps.
    pub steps: Option<u64>,
    /// Print nothing but errors.
    pub quiet: bool,
}

/// Time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    /// Now [s].
    pub t: f64,
    /// Steps done.
    pub step: u64,
    /// Time the phase field stands at [s]: half a step behind the velocity that comes next.
    pub t_phase: f64,
    /// Last step [s].
    pub dt: f64,
}

impl Simulation {
    /// From a case. Collective.
    ///
    /// # Errors
    /// What is wrong with the case or its mesh.
    pub fn new(case: Case, comm: &Communicator) -> Result<Self, SetupError> {
        let (part, _quality) = setup::mesh(&case, comm)?;
        let inflow = Inflow::new(&case, &part);
        let phase = setup::phase(&case, &part, &inflow);
        let material = setup::material(&case, &part, phase.as_ref());
        let flow = setup::flow(&case, &part);
        let given = vec![[0.0; 3]; if flow.is_some() { 0 } else { part.n_local() }];
        let no_fine_scale = vec![[0.0; 3]; if flow.is_some() { 0 } else { part.mesh.tets.len() }];
        Ok(Self {
            case,
            part,
            flow,
            phase,
            material,
            clock: Clock { t: 0.0, step: 0, t_phase: 0.0, dt: 0.0 },
            stages: Stages::default(),
            inflow,
            inflow_values: Vec::new(),
            given,
            no_fine_scale,
        })
    }

    /// One step of the paper's algorithm: free surface, then velocity and pressure.
    ///
    /// The phase field stands at the middle of flow steps: it moves from tⁿ⁻½ to tⁿ⁺½ with uⁿ, and its
    /// densities are then those at the middle of the flow's step (a leapfrog: waves neither grow nor decay).
    ///
    /// # Errors
    /// A solver that does not converge.
    pub fn step(&mut self, dt: f64) -> Result<StepReport, RunError> {
        let Self { part, clock, .. } = self;
        let failed = |equation, advice| {
            let (step, t) = (clock.step + 1, clock.t);
            move |source| RunError::Solver { equation, step, t, dt, advice, source }
        };
        let mut report = StepReport { dt, ..StepReport::default() };

        if let Some(phase) = &mut self.phase {
            let middle = clock.t + 0.5 * dt;
            let (dt_phase, velocity, fine_scale) = match &self.flow {
                Some(flow) => (middle - clock.t_phase, &flow.u, &flow.fine_scale),
                None => {
                    prescribe(&self.case, part, middle, &mut self.given);
                    (dt, &self.given, &self.no_fine_scale)
                }
            };
            self.inflow.values(
                part,
                velocity,
                clock.t_phase,
                phase.delta(),
                &mut self.inflow_values,
            );
            let moved = self
                .stages
                .time("phase", || {
                    phase.advance(part, dt_phase, velocity, fine_scale, &self.inflow_values)
                })
                .map_err(failed("free surface", "time.max_cfl"))?;
            report.phase_iterations = moved.transport.iterations;
            report.volume = self.stages.time("volume", || phase.restore_volume(part));
            self.material.set_phase(&phase.phi);
            clock.t_phase += dt_phase;
        }
        if let Some(flow) = &mut self.flow {
            report.flow = flow
                .advance(part, &self.material, clock.t, dt)
                .map_err(failed("velocity and pressure", "time.max_cfl"))?;
            self.stages.add("flow: assembly", report.flow.assembly);
            self.stages.add("flow: solve", report.flow.solve);
        }
        clock.t += dt;
        clock.dt = dt;
        clock.step += 1;
        Ok(report)
    }

    /// To the end of the case. Collective.
    ///
    /// # Errors
    /// A step that fails, a file that cannot be written.
    pub fn run(&mut self, options: &Options) -> Result<(), RunError> {
        std::fs::create_dir_all(&options.out).ok();
        let mut fields = Fields::open(
            &self.case,
            &self.part,
            &options.out,
            self.flow.is_some(),
            self.phase.is_some(),
            None,
        )?;
        if let Some(fields) = &mut fields {
            fields.write_if_due(0.0, self.flow.as_ref(), self.phase.as_ref(), &self.material)?;
        }
        while self.clock.t < self.case.time.end * (1.0 - 1e-12) {
            if options.steps.is_some_and(|n| self.clock.step >= n) {
                break;
            }
            let dt = self.next_dt();
            let r = self.step(dt)?;
            let ke =
                self.flow.as_ref().map_or(0.0, |f| f.kinetic_energy(&self.part, &self.material));
            let umax = self.part.max(
                self.flow
                    .as_ref()
                    .map_or(0.0, |f| f.u.iter().flatten().fold(0.0f64, |a, b| a.max(b.abs()))),
            );
            let (lo, hi) = self.phase.as_ref().map_or((0.0, 0.0), |p| {
                p.phi.iter().fold((0.0f64, 0.0f64), |a, &b| (a.0.min(b), a.1.max(b - 1.0)))
            });
            if self.part.comm.rank() == 0 {
                println!(
                    "{} t {:.5} dt {:.3e} it {} ({:.2e} -> {:.2e}) phase it {} vol err {:.3e} corr {:.3e} ke {:.6e} umax {:.3e} phi {:.1e} {:.1e}",
                    self.clock.step,
                    self.clock.t,
                    dt,
                    r.flow.iterations,
                    r.flow.initial_residual,
                    r.flow.residual,
                    r.phase_iterations,
                    r.volume.error,
                    r.volume.corrected,
                    ke,
                    umax,
                    lo,
                    hi
                );
            }
            if let Some(fields) = &mut fields {
                fields.write_if_due(
                    self.clock.t,
                    self.flow.as_ref(),
                    self.phase.as_ref(),
                    &self.material,
                )?;
            }
        }
        if self.part.comm.rank() == 0 {
            for s in self.stages.iter() {
                println!("{s:?}");
            }
        }
        Ok(())
    }

    /// Largest `Σ|u·∇N|`-type rate of this state [1/s]: Courant number per second. Collective.
    pub fn courant_rate(&self) -> f64 {
        let velocity = self.flow.as_ref().map_or(&self.given, |f| &f.u);
        crate::fem::courant_rate(&self.part, velocity)
    }

    /// Length of the next step [s]. Collective.
    pub fn next_dt(&self) -> f64 {
        let time = &self.case.time;
        let remaining = time.end - self.clock.t;
        let wanted = match time.step {
            Some(step) => step,
            None => {
                let courant = time.max_cfl / self.courant_rate();
                let growth =
                    if self.clock.step == 0 { time.first_step } else { 1.2 * self.clock.dt };
                courant.min(growth).min(time.max_step)
            }
        };
        // The end is met with equal steps, not with a last crumb.
        if remaining <= wanted * (1.0 + 1e-9) {
            remaining
        } else if remaining < 2.0 * wanted {
            0.5 * remaining
        } else {
            wanted
        }
    }
}

fn prescribe(case: &Case, part: &MeshPart, t: f64, velocity: &mut [[f64; 3]]) {
    if let Some(formula) = &case.prescribed_velocity {
        for (u, &x) in velocity.iter_mut().zip(&part.mesh.nodes) {
            *u = std::array::from_fn(|k| formula[k].at(x, t));
        }
    }
}
