//! Water and air at rest, 1000 : 1 and without viscosity, stay at rest on a mesh that does not know the surface.

use fcm_fsi::case::{Case, Sources};
use fcm_fsi::fem::norm;
use fcm_fsi::simulation::Simulation;
use partition::Communicator;
use std::path::Path;

/// Gravity, and so the surface, slants by 20°: the profile's tail reaches the lid. Without the floor of τ_c currents
/// grow in it.
#[test]
fn still_air_under_a_slanting_surface_stays_still() {
    let (sin, cos) = 20f64.to_radians().sin_cos();
    let (h, g) = (0.507, 9.81);
    let text = format!(
        r#"
        gravity = [{}, 0, {}]
        mesh.file = "tank.msh"
        boundaries.default = "slip"
        initial.water = "{sin}*(x - 0.5) + {cos}*(z - {h}) < 0"
        water.viscosity = 0
        air = {{ density = 1, viscosity = 0 }}
        time = {{ end = 7, step = 0.02 }}
        "#,
        -g * sin,
        -g * cos
    );
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("cases/still_water");
    let sources = Sources { file: "case.toml".into(), folder, text, tables: Default::default() };
    let case = Case::new(&sources).unwrap_or_else(|error| panic!("{error}"));
    let mut run = Simulation::new(case, &Communicator::single()).unwrap();
    // To t √(g/h) = 30.
    for _ in 0..341 {
        run.step(0.02).unwrap();
    }
    let top = run.velocity().iter().map(|u| norm(*u)).fold(0.0, f64::max) / (g * h).sqrt();
    assert!(top < 1e-8, "{top:.1e}");
}
