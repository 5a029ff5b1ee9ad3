//! Boundary values that change in time, by table and by formula: a wave maker, and what it lets in.

use fcm_fsi::case::{Case, Sources};
use fcm_fsi::simulation::Simulation;
use partition::Communicator;

/// Speeds that rise for 0.2 s and then stay.
const TABLE: &str = "t [s], u [m/s]\n0, 0\n0.2, 0.3\n1, 0.3\n";

/// A tank half full with this condition at its end; volume and inflow [m³] of each step, and the speed at the end.
fn filled(inlet: &str) -> (Vec<[f64; 2]>, Vec<[f64; 3]>) {
    let text = format!(
        r#"
        [mesh]
        box = {{ x = [0, 1], y = [0, 0.25], z = [0, 1], cells = [12, 3, 12] }}
        [boundaries]
        default = "slip"
        x_min = {inlet}
        z_max = "open"
        [initial]
        water = "z < 0.5"
        [air]
        [time]
        end = 0.4
        step = 0.02
        [solver]
        tolerance = 1e-10
        [free_surface]
        thickness_cells = 0.5
        "#
    );
    let tables = [("in.csv".into(), TABLE.into())].into();
    let sources = Sources { file: "case.toml".into(), folder: "/tank".into(), text, tables };
    let case = Case::new(&sources).unwrap_or_else(|error| panic!("{error}"));
    let mut run = Simulation::new(case, &Communicator::single()).unwrap();
    let volumes = (0..20)
        .map(|_| {
            let volume = run.step(0.02).unwrap().volume;
            [volume.volume, volume.inflow]
        })
        .collect();
    (volumes, run.velocity().to_vec())
}

#[test]
fn a_wave_maker_is_the_formula_of_its_table_and_lets_in_what_it_pushes() {
    let water = r#"water = "z < 0.5""#;
    let (volumes, u) = filled(&format!(
        r#"{{ wave_maker = "in.csv", column = "u", direction = [2, 0, 0], {water} }}"#
    ));
    let (by_formula, u_formula) =
        filled(&format!(r#"{{ velocity = ["0.3*min(t/0.2, 1)", 0, 0], {water} }}"#));
    for (a, b) in u.iter().zip(&u_formula) {
        assert!((0..3).all(|k| (a[k] - b[k]).abs() < 1e-9), "{a:?} {b:?}");
    }
    let last = volumes[19];
    assert!((last[0] - by_formula[19][0]).abs() < 1e-10);

    // φ stands half a step before the velocity: to t = 0.39, through 0.5 m × 0.25 m.
    let came: f64 = volumes.iter().map(|v| v[1]).sum();
    let pushed = 0.125 * 0.3 * (0.1 + 0.19);
    assert!((came / pushed - 1.0).abs() < 0.005, "{came} {pushed}");
    // And it is what is there more.
    let more = last[0] - (volumes[0][0] - volumes[0][1]);
    assert!((more / came - 1.0).abs() < 1e-5, "{more} {came}");
}
