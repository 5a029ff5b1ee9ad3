//! Step after step to the end, with all that is written and said on the way.

use super::{RunError, Simulation, StepReport};
use crate::case::MeshSource;
use crate::fem::courant_rate;
use crate::report::bodies::{BodiesOutput, sub_step};
use crate::report::energy::EnergyOutput;
use crate::report::output::{Output, Schedule, Snapshot};
use crate::report::progress::{Line, Progress};
use crate::report::summary::{Summary, Totals};
use std::path::{Path, PathBuf};
use std::time::Instant;

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

impl Simulation {
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
        let replaced = self.open_folder(&options.out)?;
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
        if let Some(bodies) = &self.bodies {
            progress.tell(&sub_step(bodies));
        }
        if after.is_none() {
            if replaced {
                let folder = options.out.display();
                progress
                    .tell(&format!("results: those of an earlier run in {folder} are replaced"));
            }
            self.warnings().iter().for_each(|warning| progress.tell(warning));
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

    /// Makes the folder for the results and puts the case as used into it; whether one was there already, on the first
    /// rank. Collective.
    fn open_folder(&self, folder: &Path) -> Result<bool, io::Error> {
        let open = || {
            let case = folder.join("case.toml");
            let used = case.exists();
            if folder.is_file() {
                return Err(io::Error::file(folder, "a file, not a folder for results"));
            }
            std::fs::create_dir_all(folder).map_err(|e| io::Error::file(folder, e))?;
            std::fs::write(&case, &self.case.effective).map_err(|e| io::Error::file(&case, e))?;
            Ok(used)
        };
        let opened = if self.part.comm.rank() == 0 { open() } else { Ok(false) };
        io::Error::agree(&self.part.comm, opened)
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
}
