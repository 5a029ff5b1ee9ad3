//! A dam break on all ranks against the same on one.

use fcm_fsi::case::{Case, Sources};
use fcm_fsi::simulation::Simulation;
use partition::Communicator;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// A column falls onto a floor with a block on it.
fn case(top: &str, solver: &str) -> Case {
    let text = format!(
        "[mesh]\n\
         box = {{ x = [0, 1], y = [0, 0.3], z = [0, 0.5], cells = [20, 6, 10] }}\n\
         jitter = 0.1\n\
         [[mesh.holes]]\nname = \"block\"\nx = [0.6, 0.7]\ny = [0.1, 0.2]\nz = [0, 0.1]\n\
         [boundaries]\ndefault = \"slip\"\nblock = \"no_slip\"\n{top}\n\
         [initial]\nwater = \"x < 0.35 && z < 0.31 + 0.1*y\"\n\
         [air]\n\
         [time]\nend = 1\nstep = 0.008\n\
         [solver]\n{solver}\n"
    );
    parse(text)
}

fn parse(text: String) -> Case {
    let (file, tables) = ("ranks/case.toml".into(), BTreeMap::new());
    Case::new(&Sources { file, folder: PathBuf::from("/ranks"), text, tables }).unwrap()
}

/// A case at t = 0.
pub fn start(text: &str, comm: &Communicator) -> Simulation {
    Simulation::new(parse(text.into()), comm).unwrap()
}

/// (u, v, w, p, φ) at owned nodes.
fn fields(run: &Simulation) -> Vec<[f64; 5]> {
    let (flow, phase) = (run.flow.as_ref().unwrap(), run.phase.as_ref().unwrap());
    let node = |i: usize| {
        let [u, v, w] = flow.u[i];
        [u, v, w, flow.p[i], phase.phi[i]]
    };
    (0..run.part.n_owned()).map(node).collect()
}

/// The state after so many steps, and the iterations of the flow in each.
fn run(case: Case, comm: &Communicator, steps: usize) -> (Simulation, Vec<u32>) {
    let mut run = Simulation::new(case, comm).unwrap();
    let dt = run.case.time.step.unwrap();
    let mut iterations = Vec::new();
    for _ in 0..steps {
        let report = run.step(dt).unwrap();
        iterations.push(report.flow.iterations);
    }
    (run, iterations)
}

/// Largest differences of u, p and φ between this run and the same on one rank, relative to the
/// largest value, and of the iterations of the flow in each step.
fn differences(comm: &Communicator, case: &Case, steps: usize) -> ([f64; 3], Vec<i64>) {
    let (mine, iterations) = run(case.clone(), comm, steps);
    // The first rank alone computes the whole, for all to compare with.
    let (mut whole, mut whole_iterations) = (Vec::new(), Vec::new());
    if comm.rank() == 0 {
        let (run, iterations) = run(case.clone(), &Communicator::single(), steps);
        whole = vec![[0.0; 5]; run.part.n_owned()];
        for (value, &global) in fields(&run).iter().zip(&run.part.nodes.global) {
            whole[global as usize] = *value;
        }
        whole_iterations = iterations;
    }
    let whole = comm.broadcast(0, whole.into_flattened());
    let whole_iterations = comm.broadcast(0, whole_iterations);
    let (whole, _) = whole.as_chunks::<5>();

    // Velocity components count together.
    let group = [0, 0, 0, 1, 2];
    let (mut difference, mut largest) = ([0.0f64; 3], [0.0f64; 3]);
    for (value, &global) in fields(&mine).iter().zip(&mine.part.nodes.global) {
        for a in 0..5 {
            let error = (value[a] - whole[global as usize][a]).abs();
            difference[group[a]] = difference[group[a]].max(error);
            largest[group[a]] = largest[group[a]].max(value[a].abs());
        }
    }
    let relative = std::array::from_fn(|a| comm.max(difference[a]) / comm.max(largest[a]));
    let apart: Vec<i64> = iterations
        .iter()
        .zip(&whole_iterations)
        .map(|(a, b)| i64::from(*a) - i64::from(*b))
        .collect();
    if comm.rank() == 0 {
        println!(
            "  u, p, φ apart by {relative:?}, iterations by {apart:?} of {whole_iterations:?}"
        );
    }
    (relative, apart)
}

/// With tight tolerances only rounding differs.
fn same_fields(comm: &Communicator, top: &str, steps: usize) {
    let tight = "tolerance = 1e-10\nphase_tolerance = 1e-12";
    let (relative, _) = differences(comm, &case(top, tight), steps);
    assert!(relative.iter().all(|&r| r < 1e-6), "u, p, φ on one and more ranks: {relative:?}");
}

/// A tank with an open top, until the water has hit the block.
pub fn same_fields_on_any_ranks(comm: &Communicator) {
    same_fields(comm, "z_max = \"open\"", 40);
}

/// A few steps of the same: few elements a rank, most of them on a border.
pub fn same_fields_on_many_ranks(comm: &Communicator) {
    same_fields(comm, "z_max = \"open\"", 5);
}

/// A closed tank, where one node holds the pressure.
pub fn same_fields_in_a_closed_tank(comm: &Communicator) {
    same_fields(comm, "", 10);
}

/// Three blocks, one across all ranks, one through the surface, and a tank that has no opening.
pub fn same_fields_around_led_blocks(comm: &Communicator) {
    for top in ["open", "slip"] {
        let text = format!(
            r#"
            boundaries = {{ default = "slip", z_max = "{top}" }}
            initial.water = "z < 0.25"
            air = {{}}
            time = {{ end = 1, step = 0.01 }}
            solver = {{ tolerance = 1e-10, phase_tolerance = 1e-12 }}
            [mesh]
            box = {{ x = [0, 1], y = [0, 0.3], z = [0, 0.5], cells = [20, 6, 10] }}
            jitter = 0.1
            [[obstacle]]
            name = "beam"
            cuboid = [0.9, 0.1, 0.1]
            at = [0.5, 0.15, 0.1]
            velocity = [0, 0, "0.3*sin(6*t)"]
            [[obstacle]]
            name = "block"
            points = [[0, 0, 0], [0.2, 0, 0], [0, 0.2, 0], [0.2, 0.2, 0], [0.1, 0.1, 0.2]]
            at = [0.2, 0.05, 0.28]
            wall = "slip"
            velocity = [0.2, 0, "-0.4*t"]
            spin = [0, 0, 1]
            [[obstacle]]
            name = "ball"
            sphere = 0.1
            at = [0.75, 0.15, 0.3]
            displacement = [0, 0, "0.05*sin(5*t)"]
            "#
        );
        let (relative, _) = differences(comm, &parse(text), 20);
        assert!(relative.iter().all(|&r| r < 1e-9), "u, p, φ on one and more ranks: {relative:?}");
    }
}

/// The ranks cost hardly any iterations, with the tolerances that runs have: 2 for three digits. The two
/// starting steps are solved to eleven.
pub fn same_iterations_on_any_ranks(comm: &Communicator) {
    for top in ["z_max = \"open\"", ""] {
        let (_, apart) = differences(comm, &case(top, ""), 30);
        let (start, run) = apart.split_at(2);
        assert!(start.iter().all(|&n| n <= 2 * 11 / 3) && run.iter().all(|&n| n <= 2), "{apart:?}");
    }
}
