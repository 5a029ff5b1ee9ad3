//! How long the next step is.

use super::Simulation;

/// A step is at most this much longer than the one before.
const GROWTH: f64 = 1.2;
/// In the first step a fluid at rest falls at most this fraction of the smallest cell; without gravity
/// the step is this fraction of the run.
const FIRST_FALL: f64 = 0.01;
/// The leapfrog of surface and velocity is stable up to about 1.1 √(h/g) for the shortest waves of the mesh.
const WAVE_LIMIT: f64 = 0.5;
/// Cells that a wall crosses in a step at most: nodes beyond it hold for it no longer.
const WALL_LIMIT: f64 = 0.5;

/// Bodies without a fluid take this many sub-steps a step.
const SUB_STEPS: f64 = 100.0;

impl Simulation {
    /// Length of the next step [s], for flow that crosses `rate` cells a second; it ends on the next of the
    /// times `due`, unless the case gives the step.
    pub(super) fn next_dt(&self, rate: f64, due: impl Iterator<Item = f64>) -> f64 {
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
        // The stop is met with equal steps, not with a last crumb: pressures feel a step that changes. Given steps stay
        // as they are up to the last two.
        let steps = (left / wanted * (1.0 - 1e-9)).ceil().max(1.0);
        if time.step.is_none() || steps <= 2.0 { left / steps } else { wanted }
    }

    /// Cells that the fastest wall crosses a second.
    fn wall_rate(&self) -> f64 {
        // Before the first step, their speed at once.
        let (t, dt) = (self.clock.t, self.clock.dt.max(1e-9 * self.case.time.end));
        self.structures.crossing_rate(&self.part, &self.cut, t, dt)
    }
}
