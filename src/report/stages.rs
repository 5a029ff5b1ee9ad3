//! What each stage of a step costs this rank: time, waiting, messages.

use partition::{Clock, Cost};

/// Cost and calls of each named stage, in the order they first ran.
#[derive(Clone, Debug, Default)]
pub struct Stages {
    stages: Vec<(&'static str, Cost, u64)>,
}

impl Stages {
    /// Runs `work` and books its cost to `name`.
    pub fn time<R>(&mut self, name: &'static str, work: impl FnOnce() -> R) -> R {
        let clock = Clock::start();
        let result = work();
        self.add(name, clock.elapsed());
        result
    }

    /// Books what was measured elsewhere.
    pub fn add(&mut self, name: &'static str, cost: Cost) {
        match self.stages.iter_mut().find(|s| s.0 == name) {
            Some(stage) => {
                stage.1 += cost;
                stage.2 += 1;
            }
            None => self.stages.push((name, cost, 1)),
        }
    }

    /// Name, cost and calls of each stage on this rank.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, Cost, u64)> + '_ {
        self.stages.iter().copied()
    }
}
