//! One test body for any number of ranks: this program starts itself under `mpirun` with 1, 2, 3
//! and 4 ranks, and each rank runs every body; and with 16 and 32, where each runs a few. `cargo test --test ranks NAME` runs those bodies whose
//! name contains NAME.
//!
//! A new body is a function `fn(&Communicator)` that panics on failure, and a line in `BODIES`. Last, a
//! panic on one rank must end all of them.

mod bodies;
#[path = "../common/bodies.rs"]
mod common;
mod communication;
mod coupling;
mod gauges;
mod linear;
mod parts;
mod phase;
mod simulation;
mod viscous;

use partition::Communicator;
use std::io::Read;
use std::process::{Command, ExitCode, Stdio};
use std::time::{Duration, Instant};

/// What every rank runs.
type Body = fn(&Communicator);

/// Every body, by name.
const BODIES: &[(&str, Body)] = &[
    ("collectives", communication::collectives),
    ("lists_between_ranks", communication::lists_between_ranks),
    ("agreement_on_errors", communication::agreement_on_errors),
    ("halo_of_a_ring", communication::halo_of_a_ring),
    ("debris_leaves", coupling::debris_leaves),
    ("everything_is_owned_once", parts::everything_is_owned_once),
    ("halos_are_complete", parts::halos_are_complete),
    ("owners_have_most_elements", parts::owners_have_most_elements),
    ("halo_of_a_mesh", parts::halo_of_a_mesh),
    ("integrals_and_rows", parts::integrals_and_rows),
    ("shares_are_even", parts::shares_are_even),
    ("points_have_one_answer", gauges::points_have_one_answer),
    ("lines_are_covered_once", gauges::lines_are_covered_once),
    ("few_elements_and_reruns", parts::few_elements_and_reruns),
    ("operator_and_product", linear::operator_and_product),
    ("multigrid_on_ranks", linear::multigrid_on_ranks),
    ("flow_system_on_ranks", linear::flow_system_on_ranks),
    ("stiff_elements_on_ranks", linear::stiff_elements_on_ranks),
    ("viscous_flow_on_ranks", viscous::viscous_flow_on_ranks),
    ("failed_solves_on_ranks", linear::failed_solves_on_ranks),
    ("free_surface_on_ranks", phase::free_surface_on_ranks),
    ("same_fields_on_any_ranks", simulation::same_fields_on_any_ranks),
    ("same_fields_on_many_ranks", simulation::same_fields_on_many_ranks),
    ("same_fields_in_a_closed_tank", simulation::same_fields_in_a_closed_tank),
    ("same_fields_around_led_blocks", simulation::same_fields_around_led_blocks),
    ("same_iterations_on_any_ranks", simulation::same_iterations_on_any_ranks),
    ("a_wall_breaks_alike", bodies::a_wall_breaks_alike),
    ("loose_bodies_cross_borders", bodies::loose_bodies_cross_borders),
    ("bodies_fall_on_boundaries", bodies::bodies_fall_on_boundaries),
    ("boxes_in_a_wave", coupling::boxes_in_a_wave),
    ("a_wall_in_a_wave_breaks_alike", coupling::a_wall_in_a_wave_breaks_alike),
    ("loose_nodes_are_refused", parts::loose_nodes_are_refused),
];

/// More ranks than there are cores, to see that nothing depends on their number, and the bodies that run on them.
const MANY_RANKS: [usize; 2] = [16, 32];
const ON_MANY_RANKS: &[&str] = &[
    "collectives",
    "lists_between_ranks",
    "agreement_on_errors",
    "halo_of_a_ring",
    "everything_is_owned_once",
    "halos_are_complete",
    "halo_of_a_mesh",
    "same_fields_on_many_ranks",
];

/// A run longer than this hangs.
const LIMIT: Duration = Duration::from_secs(300);

/// Set in the processes that `mpirun` starts.
const INSIDE: &str = "FCM_FSI_TEST_RANKS";

fn main() -> ExitCode {
    let wanted: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let bodies: Vec<_> = (BODIES.iter())
        .filter(|body| wanted.is_empty() || wanted.iter().any(|name| body.0.contains(name)))
        .collect();
    match std::env::var(INSIDE).as_deref() {
        Ok("bodies") => run_bodies(&bodies),
        Ok(_) => panic_on_the_last_rank(),
        Err(_) => start_all(&bodies, &wanted),
    }
}

/// What each rank does.
fn run_bodies(bodies: &[&(&str, Body)]) -> ExitCode {
    let ranks = partition::start();
    let comm = ranks.world();
    for (name, body) in bodies {
        let start = Instant::now();
        body(&comm);
        let time = comm.max(start.elapsed().as_secs_f64());
        if comm.rank() == 0 {
            println!("test {name} on {} ranks ... ok ({time:.2} s)", comm.size());
        }
    }
    ExitCode::SUCCESS
}

/// One rank panics while the others wait for it.
fn panic_on_the_last_rank() -> ExitCode {
    let ranks = partition::start();
    let comm = ranks.world();
    assert!(comm.rank() + 1 < comm.size(), "panic on purpose");
    comm.sum(1.0);
    ExitCode::SUCCESS
}

/// Starts the ranks, group by group.
fn start_all(bodies: &[&(&str, Body)], wanted: &[String]) -> ExitCode {
    let mut failed = Vec::new();
    for n in 1..=4 {
        if let Err(reason) = run_on(n, "bodies", wanted, Stdio::inherit()) {
            println!("FAILED on {n} ranks: {reason}");
            failed.push(n);
        }
    }
    let many: Vec<String> = (bodies.iter())
        .filter(|body| ON_MANY_RANKS.contains(&body.0))
        .map(|body| body.0.to_string())
        .collect();
    for n in MANY_RANKS.into_iter().filter(|_| !many.is_empty()) {
        if let Err(reason) = run_on(n, "bodies", &many, Stdio::inherit()) {
            println!("FAILED on {n} ranks: {reason}");
            failed.push(n);
        }
    }
    match run_on(3, "panic", &[], Stdio::piped()) {
        Err(said) if said.contains("rank 2 of 3 panicked") && said.contains("on purpose") => {
            println!("test a panic on one rank ends all ... ok");
        }
        other => {
            println!("FAILED: a panic on one of three ranks gave {other:?}");
            failed.push(3);
        }
    }
    if failed.is_empty() {
        println!(
            "ranks: {} bodies passed on 1, 2, 3 and 4 ranks, {} on 16 and 32",
            bodies.len(),
            many.len()
        );
        ExitCode::SUCCESS
    } else {
        println!("ranks: failed on {failed:?} ranks");
        ExitCode::FAILURE
    }
}

/// Runs this program on `n` ranks: what it ended with, and what it said to `stderr` if that is piped.
fn run_on(n: usize, job: &str, wanted: &[String], stderr: Stdio) -> Result<(), String> {
    let this = std::env::current_exe().map_err(|e| e.to_string())?;
    let mut child = Command::new("mpirun")
        .args(["-n", &n.to_string()])
        .arg(this)
        .args(wanted)
        .env(INSIDE, job)
        .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
        .env("OMPI_MCA_rmaps_base_oversubscribe", "1")
        .env("OMPI_MCA_mpi_yield_when_idle", "1")
        .stdin(Stdio::null())
        .stderr(stderr)
        .spawn()
        .map_err(|e| format!("mpirun does not start: {e}"))?;
    let start = Instant::now();
    loop {
        if let Some(status) = child.try_wait().map_err(|e| e.to_string())? {
            let mut said = format!("{status}\n");
            if let Some(mut stderr) = child.stderr.take() {
                stderr.read_to_string(&mut said).map_err(|e| e.to_string())?;
            }
            return if status.success() { Ok(()) } else { Err(said) };
        }
        if start.elapsed() > LIMIT {
            // mpirun ends its ranks when it is asked to end.
            let _ = Command::new("kill").arg(child.id().to_string()).status();
            std::thread::sleep(Duration::from_secs(2));
            let _ = child.kill();
            return Err(format!("no end after {} s", LIMIT.as_secs()));
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}
