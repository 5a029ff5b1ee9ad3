//! Bodies in water: the same on any number of ranks.

use super::simulation::start;
use partition::Communicator;

/// A column of water falls onto two glued boxes, light for it, that stand across the ranks' borders.
const CASE: &str = r#"
[mesh]
box = { x = [0, 1], y = [0, 0.3], z = [0, 0.5], cells = [20, 6, 10] }

[boundaries]
default = "slip"
z_max = "open"

[initial]
water = "x < 0.35 && z < 0.3 || z < 0.06"

[air]

[time]
end = 1

[solver]
tolerance = 1e-10
phase_tolerance = 1e-12

[bodies]
sphere_radius = 0.02
slip = true
bond = { strength = 1e4, opening = 1e-3 }

[[wall]]
name = "floor"
plane = { point = [0, 0, 0], normal = [0, 0, 1] }

[[body]]
name = "boxes"
box = [0.12, 0.24, 0.12]
at = [0.5, 0.16, 0.065]
grid = [1, 2, 1]
density = 400
bonded = true
"#;

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
