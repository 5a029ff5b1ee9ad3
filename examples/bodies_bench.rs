//! Sphere-steps per second of one core: loose spheres settling in a box, and bonded clusters of 8 spheres.
//!
//!     cargo run --release --example bodies_bench [loose|bonded] [SUB_STEPS]

use fcm_fsi::bodies::{Bodies, Load};
use fcm_fsi::case::{Case, Sources};
use fcm_fsi::setup::bodies::bodies;
use partition::Communicator;
use std::collections::BTreeMap;
use std::time::Instant;

fn start(text: String) -> Bodies {
    let sources =
        Sources { file: "case.toml".into(), folder: "/".into(), text, tables: BTreeMap::new() };
    let case = Case::new(&sources).unwrap_or_else(|e| panic!("{e}"));
    let started = bodies(&case, &Communicator::single()).unwrap_or_else(|e| panic!("{e}"));
    started.expect("the case has bodies").0
}

const WALLS: &str = "
[[wall]]
name = 'z'
plane = { point = [0, 0, 0], normal = [0, 0, 1] }
[[wall]]
name = 'x0'
plane = { point = [0, 0, 0], normal = [1, 0, 0] }
[[wall]]
name = 'x1'
plane = { point = [0.5, 0, 0], normal = [-1, 0, 0] }
[[wall]]
name = 'y0'
plane = { point = [0, 0, 0], normal = [0, 1, 0] }
[[wall]]
name = 'y1'
plane = { point = [0, 0.5, 0], normal = [0, -1, 0] }
";

fn main() {
    let mut arguments = std::env::args().skip(1);
    let wanted = arguments.next();
    let n: u32 = arguments.next().and_then(|n| n.parse().ok()).unwrap_or(2000);
    let head =
        "[time]\nend = 1\n[bodies]\nsphere_radius = 0.01\nstiffness = 1e5\nrestitution = 0.5\n";
    let grid = "copies = { count = [20, 20, 25], spacing = [0.0245, 0.0245, 0.0215] }";
    let loose = format!(
        "{head}{WALLS}[[body]]\nname = 'spheres'\nsphere = 0.01\ndensity = 2500\n\
         at = [0.0125, 0.0125, 0.011]\nvelocity = [0.1, 0.05, 0]\n{grid}\n"
    );
    let bonded = format!(
        "{head}bond = {{ strength = 1e6, opening = 1e-3, points = 2 }}\n{WALLS}[[body]]\n\
         name = 'blocks'\nbox = [0.4, 0.4, 0.32]\ngrid = [10, 10, 8]\n\
         at = [0.25, 0.25, 0.17]\ndensity = 2500\nbonded = true\n"
    );
    for (name, text) in [("loose", loose), ("bonded", bonded)] {
        if wanted.as_deref().is_some_and(|w| w != name) {
            continue;
        }
        let mut bodies = start(text);
        let spheres: usize = bodies.world.clusters.iter().map(|c| c.form.spheres.len()).sum();
        let loads = vec![Load::default(); bodies.state.len()];
        let h = bodies.time_step();
        // Half of the time for the heap to settle.
        bodies.advance(f64::from(n) * h, &loads);
        let clock = Instant::now();
        bodies.advance(f64::from(n) * h, &loads);
        let rate = spheres as f64 * f64::from(n) / clock.elapsed().as_secs_f64();
        println!(
            "{name}: {} bodies, {spheres} spheres, {} joints, Δt {h:.2e} s: {rate:.3e} sphere-steps/s",
            bodies.state.len(),
            bodies.joints.joints.len()
        );
    }
}
