//! Sphere-steps per second of processor time: 10 000 loose spheres that have settled in a box, and bonded clusters of 8.
//!
//!     cargo run --release --example clusters loose|bonded
//!
//! The loose spheres are those of `scripts/peers/settle.in`: 5 mm, friction and history, 0.3 s to settle and then 3000
//! sub-steps that are timed. The bonded ones are 1248 blocks glued to one, on the ground.

use fcm_fsi::bodies::{Bodies, Load};
use fcm_fsi::case::{Case, Sources};
use fcm_fsi::mesh::MeshPart;
use fcm_fsi::setup::bodies::bodies;
use partition::Communicator;
use std::collections::BTreeMap;

fn start(text: String) -> Bodies {
    let sources =
        Sources { file: "case.toml".into(), folder: "/".into(), text, tables: BTreeMap::new() };
    let case = Case::new(&sources).unwrap_or_else(|e| panic!("{e}"));
    let started = bodies(&case, &MeshPart::nothing(&Communicator::single()), &[])
        .unwrap_or_else(|e| panic!("{e}"));
    started.expect("the case has bodies").0
}

const GROUND: &str = "
[[wall]]
name = 'ground'
plane = { point = [0, 0, 0], normal = [0, 0, 1] }
";

const LOOSE: &str = "
[time]
end = 1
[bodies]
sphere_radius = 0.005
stiffness = 3.1e3
restitution = 0.5
friction_angle = 16.7
time_step = 1e-5
[[wall]]
name = 'x0'
plane = { point = [0, 0, 0], normal = [1, 0, 0] }
[[wall]]
name = 'x1'
plane = { point = [0.22, 0, 0], normal = [-1, 0, 0] }
[[wall]]
name = 'y0'
plane = { point = [0, 0, 0], normal = [0, 1, 0] }
[[wall]]
name = 'y1'
plane = { point = [0, 0.22, 0], normal = [0, -1, 0] }
[[body]]
name = 'even'
sphere = 0.005
density = 2500
at = [0.0061, 0.0061, 0.006]
velocity = [0.05, 0.03, -0.5]
copies = { count = [17, 17, 18], spacing = [0.0123, 0.0123, 0.0232] }
[[body]]
name = 'odd'
sphere = 0.005
density = 2500
at = [0.0115, 0.0103, 0.0176]
velocity = [-0.03, -0.05, -0.5]
copies = { count = [17, 17, 17], spacing = [0.0123, 0.0123, 0.0232] }
";

const BONDED: &str = "
[time]
end = 1
[bodies]
sphere_radius = 0.01
stiffness = 1e5
bond = { strength = 1e6, opening = 1e-3, points = 2 }
[[body]]
name = 'blocks'
cuboid = [0.48, 0.52, 0.32]
grid = [12, 13, 8]
at = [0, 0, 0.161]
density = 2500
bonded = true
";

/// Time this process has had a processor [s]; other jobs do not count.
fn processor_time() -> f64 {
    let text = std::fs::read_to_string("/proc/self/schedstat").expect("Linux");
    let nanoseconds = text.split_whitespace().next().and_then(|n| n.parse::<f64>().ok());
    1e-9 * nanoseconds.expect("a number")
}

fn main() {
    let (text, settle, timed) = match std::env::args().nth(1).as_deref() {
        Some("loose") => (LOOSE, 30_000, 3000),
        Some("bonded") => (BONDED, 1000, 1000),
        _ => panic!("clusters loose|bonded"),
    };
    let mut bodies = start(format!("{text}{GROUND}"));
    let spheres: usize = bodies.world.clusters.iter().map(|c| c.form.spheres.len()).sum();
    let loads = vec![Load::default(); bodies.state.len()];
    let h = bodies.time_step();
    bodies.advance(f64::from(settle) * h, &loads);
    let begin = processor_time();
    bodies.advance(f64::from(timed) * h, &loads);
    let rate = spheres as f64 * f64::from(timed) / (processor_time() - begin);
    let line = serde_json::json!({
        "bodies": bodies.state.len(),
        "spheres": spheres,
        "joints": bodies.joints.joints.len(),
        "step": h,
        "kinetic": bodies.account().kinetic,
        "rate": rate,
    });
    println!("{line}");
}
