//! Structures that move as told: by displacement or velocity, gauges on them, fluid shut in between them, structures
//! too thin for the mesh.

#[path = "common/simulation.rs"]
mod common;

use common::simulation;
use std::path::PathBuf;
use std::process::Command;

/// Runs the program itself on a case and files beside it; the folder of its results.
fn run(name: &str, case: &str, files: &[(&str, &str)]) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("case.toml"), case).unwrap();
    files.iter().for_each(|(name, text)| std::fs::write(folder.join(name), text).unwrap());
    let mut command = Command::new(env!("CARGO_BIN_EXE_fcm-fsi"));
    command.arg(folder.join("case.toml")).arg("--quiet").arg("--out").arg(&folder);
    let done = command.output().expect("the program starts");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    folder
}

/// Columns of a table by the start of their names.
fn columns(path: PathBuf, names: &[&str]) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(&path).unwrap();
    let table = io::Table::parse(&path, &text).unwrap();
    let find = |name: &&str| {
        let name = |c: &String| c.split('[').next().is_some_and(|c| c.trim() == *name);
        let at = table.columns.iter().position(name).expect("a column of this name");
        table.rows.iter().map(|row| row[at]).collect()
    };
    names.iter().map(find).collect()
}

const TANK: &str = r#"
boundaries = { default = "slip", z_max = "open" }
initial.water = "z < 0.5"
air = {}
output.fields_every = "never"
[mesh]
box = { x = [0, 1], y = [0, 0.4], z = [0, 0.7], cells = [20, 8, 14] }
"#;

/// Told by its displacement, its velocity or a table of its velocity, a block goes the same way and bears the same.
#[test]
fn a_block_led_by_its_velocity_goes_where_its_displacement_says() {
    let rows: Vec<String> = (0..=100)
        .map(|i| {
            let t = 0.004 * f64::from(i);
            format!("{t}, {}", -0.6 * (6.0 * t).sin())
        })
        .collect();
    let table = format!("t [s], w [m/s]\n{}\n", rows.join("\n"));
    let forces = [
        ("displacement = [0, 0, \"-0.1*(1 - cos(6*t))\"]\nrotation = [0, \"30*t\", 0]", "told"),
        ("velocity = [0, 0, \"-0.6*sin(6*t)\"]\nspin = [0, \"pi/6\", 0]", "led"),
        ("velocity = [0, 0, { table = \"w.csv\", column = \"w\" }]\nspin = [0, \"pi/6\", 0]", "table"),
    ]
    .map(|(motion, name)| {
        let case = format!(
            "time = {{ end = 0.3, step = 0.01 }}\nsolver.tolerance = 1e-8\n{TANK}\n[[obstacle]]\nname = \"block\"\n\
             cuboid = [0.2, 0.2, 0.2]\nat = [0.5, 0.2, 0.45]\nwall = \"slip\"\n{motion}\n"
        );
        let folder = run(&format!("motion_{name}"), &case, &[("w.csv", &table)]);
        columns(folder.join("loads.csv"), &["block_force_z"]).remove(0)
    });
    let largest = forces[0].iter().fold(0.0f64, |m, f| m.max(f.abs()));
    let apart = |k: usize| {
        let pairs = forces[0].iter().zip(&forces[k]);
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / largest
    };
    assert!(apart(1) < 1e-6, "{}", apart(1));
    // Its rows are 4 ms apart.
    assert!(apart(2) < 1e-2, "{}", apart(2));
}

/// A ball let down slowly into still water: gauges at its foot and its side go with it, and tell the weight of the
/// water above them from the moment they are under it.
#[test]
fn gauges_ride_on_a_ball_and_feel_the_water_beside_it() {
    let case = format!(
        "time = {{ end = 1, max_step = 0.02 }}\n{TANK}\n[[obstacle]]\nname = \"ball\"\nsphere = 0.12\n\
         at = [0.5, 0.2, 0.42]\nwall = \"slip\"\nvelocity = [0, 0, \"-0.15*sin(pi*t)^2\"]\n\
         [[gauge]]\nname = \"foot\"\non = \"ball\"\npressure = [0.5, 0.2, 0.3]\n\
         [[gauge]]\nname = \"side\"\non = \"ball\"\npressure = [0.62, 0.2, 0.42]\n\
         [[gauge]]\nname = \"wind\"\non = \"ball\"\nvelocity = [0.5, 0.2, 0.54]\n"
    );
    let folder = run("riding", &case, &[]);
    let [t, foot, side, w] = columns(folder.join("gauges.csv"), &["t", "foot", "side", "wind_z"])
        .try_into()
        .expect("four columns");
    for (i, &t) in t.iter().enumerate().filter(|(_, t)| **t > 0.1) {
        let down = 0.15
            * (t / 2.0 - (2.0 * std::f64::consts::PI * t).sin() / (4.0 * std::f64::consts::PI));
        // The water rises a little; inertia adds some pascals.
        for (p, depth) in [(foot[i], 0.2 + down), (side[i], 0.08 + down)] {
            let off = p - 9810.0 * depth;
            assert!(off.abs() < 250.0, "t = {t}: {p} Pa at {depth} m");
        }
        assert!(w[i].abs() < 0.5, "{}", w[i]);
    }
}

/// A piston pushed into a tank that has no opening: the air in it is squeezed, all of it a little, and nowhere does
/// it rush to the one node that holds the pressure.
#[test]
fn sealed_fluid_is_compressed_and_reported() {
    let mut run = simulation(&format!(
        "time = {{ end = 1, max_step = 0.02 }}\n{}\n[[obstacle]]\nname = \"piston\"\ncuboid = [0.4, 1, 0.4]\n\
         at = [0.1, 0.2, 0.68]\nwall = \"slip\"\nvelocity = [\"0.2*min(5*t, 1)\", 0, 0]\n",
        TANK.replace(", z_max = \"open\"", "")
    ));
    let mut squeezed = 0.0;
    for _ in 0..25 {
        let report = run.step(0.02).unwrap();
        assert_eq!(report.flow.squeezed.pockets, 1);
        squeezed += report.flow.squeezed.volume;
    }
    // 0.08 m of way, 0.4 m wide, 0.22 m of it in the tank.
    assert!((squeezed / (0.08 * 0.4 * 0.22) - 1.0).abs() < 0.1, "{squeezed}");
    let top = run.velocity().iter().map(|u| fcm_fsi::fem::norm(*u)).fold(0.0, f64::max);
    assert!(top < 1.0, "{top}");
}

#[test]
fn a_structure_that_is_too_thin_is_named() {
    let with = |thickness: f64| {
        let run = simulation(&format!(
            "time.end = 1\n{TANK}\n[[obstacle]]\nname = \"wall\"\ncuboid = [{thickness}, 1, 2]\nat = [0.512, 0.2, 0.3]\n\
             [[obstacle]]\nname = \"ball\"\nsphere = 0.1\nat = [0.8, 0.2, 0.3]\n"
        ));
        run.warnings()
    };
    assert!(with(0.1001).is_empty(), "two cells: {:?}", with(0.1001));
    let said = with(0.06);
    assert_eq!(said.len(), 1, "{said:?}");
    assert!(said[0].contains("obstacle \"wall\" is 0.060 m or 1.2 elements thick at"), "{said:?}");
    // So thin that no node is in it: the mesh does not see it at all.
    assert!(with(0.004)[0].contains("0.1 elements"));
}

#[test]
fn what_is_outside_the_mesh_and_a_tank_without_water_are_told() {
    let with = |at: f64, rest: &str| {
        let run = simulation(&format!(
            "time.end = 1\n{TANK}\n[bodies]\nwalls = [\"z_min\"]\nsphere_radius = 0.05\n[[obstacle]]\nname = \"pier\"\n\
             sphere = 0.1\nat = [{at}, 0.2, 0.3]\n{rest}\n[[body]]\nname = \"box\"\ncuboid = [0.2, 0.2, 0.2]\n\
             at = [{at}, 0.2, 0.55]\ndensity = 2000\n"
        ));
        run.warnings()
    };
    assert_eq!(with(0.5, ""), [""; 0]);
    let outside = |name: &str| format!("outside: {name} is nowhere in the mesh");
    assert_eq!(with(-0.2, ""), [outside("obstacle \"pier\""), outside("body \"box\"")]);
    // It comes in later.
    assert_eq!(with(-0.2, "velocity = [1, 0, 0]"), [outside("body \"box\"")]);
    let dry = TANK.replace("z < 0.5", "z < -0.5");
    assert_eq!(
        simulation(&format!("time.end = 1\n{dry}")).warnings(),
        ["water:   none at first (initial.water)"]
    );
}

/// Glued blocks of one cell each: the wall they make is what has to be thick.
#[test]
fn blocks_that_touch_are_as_thick_as_all_of_them() {
    let with = |blocks: u32| {
        let run = simulation(&format!(
            "time.end = 1\n{TANK}\n[bodies]\nwalls = [\"z_min\"]\nsphere_radius = 0.02\nbond = {{ strength = 1e6, opening = 0.001 }}\n\
             [[body]]\nname = \"wall\"\ncuboid = [{}, 0.2, 0.2]\nat = [0.5, 0.2, 0.3]\ngrid = [{blocks}, 4, 4]\n\
             density = 2000\nbonded = true\n",
            0.05 * f64::from(blocks)
        ));
        run.warnings()
    };
    assert!(with(2).is_empty(), "{:?}", with(2));
    assert!(with(1)[0].contains("body \"wall\" is 0.050 m or 1.0 elements"), "{:?}", with(1));
}

/// A ball of this density on a bed of water: what the water does to it is in loads.csv, by the entry's name.
#[test]
fn loads_on_bodies_are_written_by_name() {
    let case = format!(
        "time = {{ end = 0.02, step = 0.01 }}\n{TANK}\n[bodies]\nsphere_radius = 0.1\n[[body]]\nname = \"ball\"\nsphere = 0.1\n\
         at = [0.5, 0.2, 0.25]\ndensity = 1000\nlocked = [\"x\", \"y\", \"z\"]\n"
    );
    let folder = run("body_loads", &case, &[]);
    let [force, traction, area] =
        columns(folder.join("loads.csv"), &["ball_force_z", "ball_traction_z", "ball_area"])
            .try_into()
            .expect("three columns");
    // Four cells across: its discrete volume is up to a sixth too small.
    let weight = 9810.0 * 4.18879e-3;
    for f in [force[2], traction[2]] {
        assert!((f / weight - 1.0).abs() < 0.2, "{f} N, {weight} N displaced");
    }
    assert!((area[2] / 0.125_664 - 1.0).abs() < 0.1, "{}", area[2]);
}
