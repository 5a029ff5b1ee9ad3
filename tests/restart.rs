//! A run that is stopped and goes on from a checkpoint equals the uninterrupted one: bit for bit on as many
//! ranks, to solver tolerance on others.

use fcm_fsi::bodies::record::CLUSTER;
use io::checkpoint::{Checkpoint, find};
use partition::Communicator;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A column falls and hits the far wall; the time step follows the flow.
const CASE: &str = r#"
[mesh]
box = { x = [0, 1], y = [0, 0.3], z = [0, 0.5], cells = [20, 6, 10] }
jitter = 0.1

[boundaries]
default = "slip"
z_max = "open"

[initial]
water = "x < 0.35 && z < 0.31 + 0.1*y"

[air]

[time]
end = 0.2
max_cfl = 0.8

[solver]
tolerance = 1e-10
phase_tolerance = 1e-12

[output]
checkpoint_every = 0.1
"#;

/// A wall of glued blocks, light for the water that breaks it.
const BODIES: &str = include_str!("wall_in_a_wave.toml");

fn run(folder: &Path, ranks: usize, restart: Option<&Path>) {
    let mut command = Command::new("mpirun");
    command.args(["-n", &ranks.to_string(), env!("CARGO_BIN_EXE_fcm-fsi"), "--quiet"]);
    command.arg(folder.parent().unwrap().join("case.toml")).arg("--out").arg(folder);
    if let Some(path) = restart {
        command.arg("--restart").arg(path);
    }
    command.env("OMPI_ALLOW_RUN_AS_ROOT", "1").env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1");
    command.env("OMPI_MCA_rmaps_base_oversubscribe", "1").env("OMPI_MCA_mpi_yield_when_idle", "1");
    let done = command.output().expect("mpirun starts");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
}

/// Everything in the last checkpoint of a folder: name, values.
fn state(folder: &Path) -> Vec<(String, Vec<f64>)> {
    let path = find(folder).expect("a checkpoint");
    let saved = Checkpoint::open(&Communicator::single(), &path).unwrap();
    let mut state = vec![("time".to_string(), vec![saved.time(), saved.step() as f64])];
    state.extend(saved.scalars().iter().map(|(name, v)| (name.clone(), vec![*v])));
    let nodal = [("u", 3), ("u_old", 3), ("p", 1), ("phi", 1), ("phase_excess", 1)];
    let two_fluids = saved.read_f64("nodes", "phi", 1, &[0]).is_ok();
    let nodal = if two_fluids { &nodal[..] } else { &nodal[..3] };
    let groups = [
        ("nodes", nodal.to_vec()),
        ("elements", vec![("fine_scale", 3)]),
        ("bodies", vec![("state", CLUSTER)]),
        ("bonds", vec![("largest", 1)]),
    ];
    for (group, arrays) in groups {
        let ids: Vec<u64> = (0..saved.count(group).unwrap()).collect();
        for (name, components) in arrays {
            let values = saved.read_f64(group, name, components, &ids).unwrap();
            state.push((name.to_string(), values));
        }
    }
    state
}

/// The folder of a whole run of `case` on two ranks, and its checkpoint half-way.
fn whole_run(name: &str, case: &str) -> (PathBuf, PathBuf) {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("case.toml"), case).unwrap();
    let whole = folder.join("whole");
    run(&whole, 2, None);
    let first = std::fs::read_dir(&whole)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.file_name().unwrap().to_str().unwrap().starts_with("checkpoint-"))
        .min()
        .expect("a checkpoint half-way");
    (whole, first)
}

fn lines(folder: &Path, file: &str) -> Vec<String> {
    let text = std::fs::read_to_string(folder.join(file)).unwrap();
    text.lines().skip(1).map(str::to_string).collect()
}

fn last_line(folder: &Path) -> String {
    lines(folder, "history.csv").pop().unwrap()
}

/// A block led through the surface, with gauges on it: the step follows the wall.
const LED: &str = r#"
boundaries = { default = "slip", z_max = "open" }
initial.water = "z < 0.25"
air = {}
free_surface.volume_correction = "off"
time.end = 0.4
output.checkpoint_every = 0.2

[mesh]
box = { x = [0, 1], y = [0, 0.3], z = [0, 0.5], cells = [20, 6, 10] }
jitter = 0.1

[[obstacle]]
name = "block"
cuboid = [0.2, 0.15, 0.12]
at = [0.4, 0.15, 0.3]
turned = [0, 20, 0]
velocity = ["0.6*sin(5*t)", 0, "-0.5*t"]
spin = [0, "2*t", 1]

[[gauge]]
name = "foot"
on = "block"
pressure = [0.4, 0.15, 0.24]
"#;

#[test]
fn a_block_led_through_water_goes_on_bit_for_bit() {
    let (whole, first) = whole_run("restart_led", LED);
    let again = whole.with_file_name("again");
    run(&again, 2, Some(&first));
    for file in ["history.csv", "loads.csv", "gauges.csv"] {
        let (all, after) = (lines(&whole, file), lines(&again, file));
        assert!(after.len() > 3 && after.len() < all.len(), "{file}: {}", after.len());
        assert_eq!(all[all.len() - after.len()..], after, "{file}");
    }
    for ((name, a), (_, b)) in state(&again).iter().zip(&state(&whole)) {
        assert!(a == b, "{name}");
    }
}

#[test]
fn bodies_that_break_in_water_go_on_bit_for_bit() {
    let output = "[output]\nbodies_every = 0.1\ncheckpoint_every = 0.2\n";
    let case = BODIES.replace("end = 1\n", "end = 0.4\n") + output;
    let (whole, first) = whole_run("restart_bodies", &case);
    let again = whole.with_file_name("again");
    run(&again, 2, Some(&first));
    assert_eq!(last_line(&again), last_line(&whole));
    let (all, after) = (lines(&whole, "bonds.csv"), lines(&again, "bonds.csv"));
    assert!(!after.is_empty() && after.len() < all.len(), "{all:?}");
    assert_eq!(all[all.len() - after.len()..], after);
    for ((name, a), (_, b)) in state(&again).iter().zip(&state(&whole)) {
        // Energies are summed over ranks when a checkpoint is written: their last digits may differ.
        let account = name.starts_with("bodies.");
        let alike = |(a, b): (&f64, &f64)| a == b || account && (a - b).abs() < 1e-12;
        assert!(a.iter().zip(b).all(alike), "{name}: {a:?} {b:?}");
    }
}

/// What has left stays away, and the account of energy goes on.
#[test]
fn debris_that_has_left_stays_away() {
    let (whole, first) = whole_run("restart_debris", include_str!("debris.toml"));
    let again = whole.with_file_name("again");
    run(&again, 2, Some(&first));
    assert_eq!(last_line(&again), last_line(&whole));
    let (all, after) = (lines(&whole, "left.csv"), lines(&again, "left.csv"));
    assert_eq!((all.len(), &all[1..]), (2, &after[..]));
    let energies = |folder: &Path| -> Vec<f64> {
        let last = lines(folder, "energy.csv").pop().unwrap();
        last.split(',').map(|x| x.parse().unwrap()).collect()
    };
    for (a, b) in energies(&again).iter().zip(energies(&whole)) {
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }
    for ((name, a), (_, b)) in state(&again).iter().zip(&state(&whole)) {
        let account = name.starts_with("bodies.") || name.starts_with("energy.");
        let alike = |(a, b): (&f64, &f64)| a == b || account && (a - b).abs() < 1e-9;
        assert!(a.iter().zip(b).all(alike), "{name}: {a:?} {b:?}");
    }
}

#[test]
fn a_restarted_run_equals_the_uninterrupted_one() {
    let (whole, first) = whole_run("restart", CASE);
    let expected = state(&whole);
    for ranks in [2, 1, 3, 4] {
        let again = whole.with_file_name(format!("on_{ranks}"));
        run(&again, ranks, Some(&first));
        let got = state(&again);
        assert_eq!(got.len(), expected.len());
        if ranks == 2 {
            assert_eq!(last_line(&again), last_line(&whole));
        }
        for ((name, a), (_, b)) in got.iter().zip(&expected) {
            let largest = b.iter().fold(0.0f64, |m, v| m.max(v.abs()));
            let apart = a.iter().zip(b).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
            if ranks == 2 {
                assert!(a == b, "{name} on {ranks} ranks: apart by {apart:e} of {largest:e}");
            } else {
                println!("{name} on {ranks} ranks: apart by {apart:e} of {largest:e}");
                assert!(
                    apart <= 1e-6 * largest,
                    "{name} on {ranks} ranks: {apart:e} of {largest:e}"
                );
            }
        }
    }
}
