//! Bodies in water: the same on any number of ranks.

use super::simulation::start;
use partition::Communicator;

/// A column of water falls onto two glued boxes, light for it, that stand across the ranks' borders.
const CASE: &str = include_str!("../boxes_in_a_wave.toml");

/// Places after some steps, against those of the same run on one rank.
pub fn boxes_in_a_wave(comm: &Communicator) {
    let (mut shared, mut alone) = (start(CASE, comm), start(CASE, &Communicator::single()));
    for step in 0..12 {
        let dt = 0.004;
        let (a, b) = (shared.step(dt).unwrap(), alone.step(dt).unwrap());
        assert!(a.passes > 1 && a.passes == b.passes, "step {step}: {} {}", a.passes, b.passes);
    }
    let placed = |run: &fcm_fsi::simulation::Simulation| run.bodies.as_ref().unwrap().placed();
    for (a, b) in placed(&shared).iter().zip(placed(&alone)) {
        let apart = (a.pose.position - b.pose.position).norm();
        let speeds = (a.twist.velocity - b.twist.velocity).norm();
        assert!(b.twist.velocity.norm() > 1e-3, "they have not moved");
        assert!(apart < 1e-9 && speeds < 1e-6, "{apart:e} m, {speeds:e} m/s apart");
    }
}
