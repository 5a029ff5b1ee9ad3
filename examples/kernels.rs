//! Speed of the kernels a step is made of, one line of JSON each: name, value, unit.
//!
//!     [mpirun -n R] kernels [N, default 94]
//!
//! The box has N × N × N/2 cells; values are medians of nine calls on the slowest rank. With N = 0 the triad alone.

#![allow(non_snake_case)]

#[path = "../tests/linear/systems.rs"]
mod systems;

use fcm_fsi::linear::*;
use fcm_fsi::mesh::MeshPart;
use partition::Communicator;
use std::hint::black_box;
use std::time::Instant;
use systems::*;

fn main() {
    let ranks = partition::start();
    let comm = ranks.world();
    let n = std::env::args().nth(1).map_or(94, |n| n.parse().expect("a number of cells"));
    let triad = triad(&comm);
    say(&comm, "triad", triad * 1e-9, "GB/s");
    if n == 0 {
        return;
    }

    let mesh = (comm.rank() == 0).then(|| cells([n, n, n / 2], 1.0 / n as f64, 0.2));
    let part = MeshPart::distribute(&comm, mesh, 0).expect("a good mesh");
    let problem = Oseen::tank(n, 1.0, true);
    let (system, L) = problem.assemble(&part);
    let halo = Halo::new(&part.comm, &part.nodes, &part.exchange, &system.pattern);
    let nodes = comm.sum(part.n_owned() as f64);

    // As the flow's step stores it: blocks in single precision, products in double.
    let system = SaddleCsr::from(&system);
    let A = DistributedOperator::new(&system, &halo);
    let mut x: Vec<f32> = problem.right_hand_side(&part).iter().map(|&x| x as f32).collect();
    let mut y = vec![0.0; x.len()];
    let mut z = x.clone();
    let matvec = timed(&comm, || A.apply(&mut x, &mut y));
    let blocks = comm.sum(system.pattern.columns.len() as f64);
    let bytes = blocks * (16.0 * 4.0 + 4.0) + nodes * (3.0 * 4.0 + 4.0 * 4.0 + 4.0 * 8.0);
    say(&comm, "matvec", 100.0 * bytes / matvec / triad, "% of triad");
    say(&comm, "the same", 1e6 * matvec / nodes, "µs per node");

    let mut schur = SchurPreconditioner::new(&halo);
    let setup = timed(&comm, || schur.setup(&system, &L, None));
    say(&comm, "preconditioner set-up", 1e6 * setup / nodes, "µs per node");
    let apply = timed(&comm, || schur.with(&system).apply(&x, &mut z));
    say(&comm, "preconditioner", 1e6 * apply / nodes, "µs per node");
    let mut multigrid = Multigrid::new(&halo);
    let setup = timed(&comm, || multigrid.setup(&L));
    say(&comm, "multigrid set-up", 1e6 * setup / nodes, "µs per node");
    let cycle = timed(&comm, || {
        multigrid.cycle();
    });
    say(&comm, "multigrid cycle", 1e6 * cycle / nodes, "µs per node");
}

/// a = b + s c on all ranks at once [bytes/s], counted without the read of a.
fn triad(comm: &Communicator) -> f64 {
    const LENGTH: usize = 8_000_000;
    let (mut a, b, c) = (vec![0.0; LENGTH], vec![1.0; LENGTH], vec![2.0; LENGTH]);
    let time = timed(comm, || {
        let s = black_box(3.0);
        for ((a, b), c) in a.iter_mut().zip(&b).zip(&c) {
            *a = b + s * c;
        }
        black_box(&mut a);
    });
    comm.size() as f64 * 24.0 * LENGTH as f64 / time
}

fn say(comm: &Communicator, name: &str, value: f64, unit: &str) {
    if comm.rank() == 0 {
        println!("{}", serde_json::json!({ "name": name, "value": value, "unit": unit }));
    }
}

/// Median of nine calls [s], the slowest rank's.
fn timed(comm: &Communicator, mut f: impl FnMut()) -> f64 {
    let mut times: Vec<f64> = (0..9)
        .map(|_| {
            comm.sum(0.0);
            let start = Instant::now();
            f();
            comm.max(start.elapsed().as_secs_f64())
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[4]
}
