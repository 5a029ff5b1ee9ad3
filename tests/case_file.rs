//! Case files: defaults, presets, graded boxes, tables, and the file written beside the results.

use fcm_fsi::case::{
    Boundary, BoxMesh, Case, CaseFile, Formula, GaugeKind, Gravity, MeshSource, Regularisation,
    Sources, VolumeCorrection,
};
use std::collections::BTreeMap;
use std::path::PathBuf;

const DAM_BREAK: &str = r#"
title = "Dam break"
[mesh]
box = { x = [0, 3.22], y = [0, 1], z = [0, 1], cells = [64, 20, 20] }
[boundaries]
default = "slip"
z_max = "open"
[initial]
water = "x > 1.992 && z < 0.55"
[air]
[time]
end = 2
[[gauge]]
name = "H1"
water_level = [[1, 0.5, 0], [1, 0.5, 1]]
"#;

fn sources(text: &str, tables: &[(&str, &str)]) -> Sources {
    Sources {
        file: "tank/case.toml".into(),
        folder: PathBuf::from("/data/tank"),
        text: text.into(),
        tables: tables.iter().map(|(n, t)| (n.to_string(), t.to_string())).collect(),
    }
}

fn case(text: &str) -> Case {
    Case::new(&sources(text, &[])).unwrap_or_else(|error| panic!("{error}"))
}

fn boxed(case: &Case) -> &BoxMesh {
    match &case.mesh {
        MeshSource::Box(mesh) => mesh,
        other => panic!("not a box: {other:?}"),
    }
}

#[test]
fn a_short_case_gets_the_defaults() {
    let case = case(DAM_BREAK);
    let mesh = boxed(&case);
    assert_eq!(mesh.lines.each_ref().map(Vec::len), [65, 21, 21]);
    assert_eq!((mesh.lines[0][64], mesh.jitter, case.refine), (3.22, None, 0));
    assert_eq!(case.default_boundary, Boundary::Slip);
    let open = Boundary::Pressure { pressure: Formula::constant(0.0), water: None };
    assert_eq!(case.boundaries, [("z_max".to_string(), open)]);
    let gas = case.gas.expect("there is air");
    assert_eq!((case.liquid.density, case.liquid.viscosity), (1000.0, 1e-3));
    assert_eq!((gas.density, gas.viscosity), (1.2, 1.8e-5));
    assert_eq!(case.gravity, [0.0, 0.0, -9.81]);
    let water = case.initial.water.as_ref().expect("water is given");
    assert!((water.at([2.0, 0.0, 0.3], 0.0) - 0.008).abs() < 1e-15);
    let time = (case.time.end, case.time.step, case.time.max_cfl, case.time.max_step);
    assert_eq!(time, (2.0, None, 1.0, 2.0));
    let surface = &case.free_surface;
    assert_eq!(surface.regularisation, Regularisation::Psi);
    assert_eq!(surface.volume_correction, VolumeCorrection::PerBody);
    assert!(surface.conservative && surface.profile_correction);
    assert_eq!((surface.thickness, surface.thickness_cells, surface.mobility), (None, 1.0, 1.0));
    assert_eq!((case.flow.gravity, case.flow.iterations), (Gravity::Edge, 1));
    let solver = (case.solver.tolerance, case.solver.phase_tolerance, case.solver.max_iterations);
    assert_eq!(solver, (1e-3, 1e-8, 200));
    assert_eq!(case.output.fields_every, Some(0.04));
    assert_eq!((case.output.gauges_every, case.output.checkpoint_every), (None, None));
    assert_eq!(case.gauges[0].name, "H1");
    let line = [[1.0, 0.5, 0.0], [1.0, 0.5, 1.0]];
    assert_eq!(case.gauges[0].kind, GaugeKind::WaterLevel { line });
    assert_eq!(case.path, PathBuf::from("/data/tank/case.toml"));
}

#[test]
fn the_paper_preset_yields_to_explicit_keys() {
    let paper = case(&format!("preset = \"paper\"{DAM_BREAK}"));
    assert_eq!(paper.free_surface.regularisation, Regularisation::Plain);
    assert_eq!(paper.free_surface.volume_correction, VolumeCorrection::Global);
    assert!(!paper.free_surface.profile_correction);
    assert_eq!(paper.flow.gravity, Gravity::Quadrature);
    let text = format!("preset = \"paper\"{DAM_BREAK}[free_surface]\nvolume_correction = \"off\"");
    let own = case(&text);
    assert_eq!(own.free_surface.volume_correction, VolumeCorrection::Off);
    assert_eq!(own.free_surface.regularisation, Regularisation::Plain);
}

#[test]
fn one_fluid_needs_neither_air_nor_water() {
    let cavity = case(
        "gravity = [0, 0, 0]
        [mesh.box]
        x = { edges = [0, 0.2, 1], cells = [10, 30], ratio = [1, 4] }
        y = { edges = [0, 0.01], cells = [1] }
        z = { edges = [0, 0.5, 1], sizes = [0.01, 0.05, 0.01] }
        [boundaries]
        default = \"slip\"
        z_max = { velocity = [1, 0, 0] }
        [water]
        density = 1
        viscosity = 0
        [time]
        end = 10
        step = 0.01",
    );
    assert!(cavity.gas.is_none() && cavity.initial.water.is_none());
    assert_eq!((cavity.time.step, cavity.time.max_step), (Some(0.01), 0.01));
    let [x, y, z] = &boxed(&cavity).lines;
    assert_eq!((x.len(), x[10], y.len()), (41, 0.2, 2));
    assert!(((x[40] - x[39]) / (x[11] - x[10]) - 4.0).abs() < 1e-12);
    let middle = z.iter().position(|z| *z == 0.5).expect("edges are lines");
    assert!((z[1] - 0.01).abs() < 1e-3 && (z[middle] - z[middle - 1] - 0.05).abs() < 5e-3);
}

/// Everything a case file can say, once.
const EVERYTHING: &str = r#"
title = "Everything"
gravity = [0, 1, -9.81]
body_force = ["sin(t)", 0.5, "x*y"]
[mesh]
box = { x = [0, 1], y = [0, 1], z = [0, 1], cells = [10, 10, 10] }
holes = [{ name = "pier", x = [0.4, 0.6], y = [0.4, 0.6], z = [0, 1] }]
jitter = 0.2
jitter_seed = 7
refine = 1
[boundaries]
default = "no_slip"
pier = "slip"
x_min = { velocity = [{ table = "in.csv", column = "u" }, 0, "-t"], water = "z < 0.5 + 0.1*t" }
x_max = { pressure = "9810*max(0.5 - z, 0)", water = "z < 0.5" }
y_min = { wave_maker = "in.csv", column = "w", direction = [0, 3, 4], water = true }
z_max = "open"
[initial]
water = "z < 0.5"
velocity = ["z", 0, 0]
noise = 1e-3
noise_seed = 3
[water]
density = 998.2
[air]
viscosity = 0
[free_surface]
thickness = 0.02
conservative = false
regularisation = "plain"
mobility = 0.5
profile_correction = false
volume_correction = "off"
[flow]
gravity = "quadrature"
iterations = 3
[time]
end = 4
max_cfl = 0.5
max_step = 0.02
first_step = 1e-4
[solver]
tolerance = 1e-6
phase_tolerance = 1e-10
max_iterations = 99
[output]
fields_every = "never"
gauges_every = 0.01
checkpoint_every = 1.5
[[gauge]]
name = "P1"
pressure = [0.1, 0.5, 0.2]
[[gauge]]
name = "U"
velocity = [0.1, 0.5, 0.2]
"#;
const IN_CSV: &str = "# measured\nt, u, w\n0, 0, 1\n2, 4, 2\n5, 4, 3\n";

#[test]
fn everything_can_be_said() {
    let case = Case::new(&sources(EVERYTHING, &[("in.csv", IN_CSV)])).unwrap();
    assert_eq!(case.refine, 1);
    assert_eq!(boxed(&case).jitter, Some((0.2, 7)));
    assert_eq!(boxed(&case).holes[0].range, [[0.4, 0.6], [0.4, 0.6], [0.0, 1.0]]);
    let o = [0.0; 3];
    let Boundary::Velocity { velocity, water } = case.boundary("x_min") else { panic!() };
    assert_eq!(velocity.each_ref().map(|f| f.at(o, 1.0)), [2.0, 0.0, -1.0]);
    assert!((water.as_ref().unwrap().at([0.0, 0.0, 0.4], 1.0) - 0.2).abs() < 1e-15);
    let Boundary::Velocity { velocity, water } = case.boundary("y_min") else { panic!() };
    let u = velocity.each_ref().map(|f| f.at(o, 2.0));
    assert!(u[0] == 0.0 && (u[1] - 1.2).abs() < 1e-15 && (u[2] - 1.6).abs() < 1e-15);
    assert!(water.as_ref().unwrap().at(o, 0.0) > 1e3);
    let Boundary::Pressure { pressure, .. } = case.boundary("x_max") else { panic!() };
    assert_eq!(pressure.at([1.0, 0.0, 0.25], 0.0), 9810.0 * 0.25);
    assert_eq!(case.boundary("y_max"), &Boundary::NoSlip);
    assert_eq!(case.boundary("pier"), &Boundary::Slip);
    assert_eq!(case.initial.noise, Some((1e-3, 3)));
    let output = &case.output;
    let every = (output.fields_every, output.gauges_every, output.checkpoint_every);
    assert_eq!(every, (None, Some(0.01), Some(1.5)));
    assert_eq!(case.body_force.as_ref().unwrap()[2].at([2.0, 3.0, 0.0], 0.0), 6.0);
}

/// Where the velocity is given no energy goes anywhere.
#[test]
fn the_account_of_energy_wants_a_flow() {
    let given = "prescribed_velocity = [1, 0, 0]\noutput.energy = true\n[mesh]";
    let text = DAM_BREAK.replace("[mesh]", given);
    let error = Case::new(&sources(&text, &[])).unwrap_err().to_string();
    assert!(error.contains("output.energy: is the account of a flow"), "{error}");
}

/// The case file written beside the results gives the same case, from any folder.
#[test]
fn the_case_as_used_is_the_same_case() {
    let paper = format!("preset = \"paper\"{DAM_BREAK}");
    let turning =
        DAM_BREAK.replace("[mesh]", "prescribed_velocity = [\"-(y-0.5)\", \"x-0.5\", 0]\n[mesh]");
    let gmsh = DAM_BREAK.replace(
        "box = { x = [0, 3.22], y = [0, 1], z = [0, 1], cells = [64, 20, 20] }",
        "file = \"tank.msh\"",
    );
    for text in [DAM_BREAK, EVERYTHING, &paper, &turning, &gmsh] {
        let first = Case::new(&sources(text, &[("in.csv", IN_CSV)])).unwrap();
        let elsewhere = Sources {
            file: "case.toml".into(),
            folder: PathBuf::from("/results"),
            text: first.effective.clone(),
            tables: BTreeMap::from([("/data/tank/in.csv".into(), IN_CSV.into())]),
        };
        let mut again = Case::new(&elsewhere).unwrap_or_else(|e| panic!("{e}\n{text}"));
        again.path = first.path.clone();
        again.source = first.source.clone();
        assert_eq!(first, again);
    }
}

#[test]
fn the_schema_describes_every_table() {
    let schema: serde_json::Value = serde_json::from_str(&CaseFile::schema()).unwrap();
    let properties = schema["properties"].as_object().unwrap();
    for table in ["mesh", "boundaries", "initial", "water", "air", "time", "gauge", "output"] {
        let described = properties[table]["description"].as_str();
        assert!(described.is_some_and(|d| !d.is_empty()), "{table}");
    }
}

/// The cases that come with the program are cases, and its first one is short.
#[test]
fn every_case_in_the_repository_reads() {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("cases");
    let mut read = 0;
    for entry in std::fs::read_dir(&folder).expect("the cases are there") {
        let path = entry.unwrap().path();
        let sources = Sources::read(&path).unwrap_or_else(|error| panic!("{error}"));
        Case::new(&sources).unwrap_or_else(|error| panic!("{error}"));
        assert!(path.join("README.md").is_file(), "{} has no README.md", path.display());
        read += 1;
    }
    assert!(read >= 10, "{read} cases found");
    let dam_break = std::fs::read_to_string(folder.join("dam_break/case.toml")).unwrap();
    assert!(dam_break.lines().count() <= 40);
}
