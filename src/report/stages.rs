//! Wall time by stage of a step.

use std::time::{Duration, Instant};

/// Time and calls of each named stage, in the order they first ran.
#[derive(Clone, Debug, Default)]
pub struct Stages {
    stages: Vec<(&'static str, Duration, u64)>,
}

impl Stages {
    /// Runs `work` and books its time to `name`.
    pub fn time<R>(&mut self, name: &'static str, work: impl FnOnce() -> R) -> R {
        let clock = Instant::now();
        let result = work();
        self.add(name, clock.elapsed());
        result
    }

    /// Books time measured elsewhere.
    pub fn add(&mut self, name: &'static str, elapsed: Duration) {
        match self.stages.iter_mut().find(|s| s.0 == name) {
            Some(stage) => {
                stage.1 += elapsed;
                stage.2 += 1;
            }
            None => self.stages.push((name, elapsed, 1)),
        }
    }

    /// Name, seconds and calls of each stage on this rank.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, f64, u64)> + '_ {
        self.stages.iter().map(|s| (s.0, s.1.as_secs_f64(), s.2))
    }
}
