//! Iterations and CPU time of the linear solvers on boxes of growing size.
//!
//! `[mpirun -n N] target/release/examples/linear_bench [largest number of nodes, default 120000]`
//!
//! CPU times are those of the slowest rank, per node of the whole mesh.

#![allow(non_snake_case)]

#[path = "../tests/linear/systems.rs"]
mod systems;

use fcm_fsi::linear::*;
use fcm_fsi::mesh::MeshPart;
use partition::Communicator;
use systems::*;

fn main() {
    let ranks = partition::start();
    let comm = ranks.world();
    let largest = std::env::args().nth(1).and_then(|n| n.parse().ok()).unwrap_or(120_000);
    diffusion(&comm, largest);
    let title = "Stabilised two-phase flow 1000:1, FGMRES + Schur; CPU in µs per node";
    say(&comm, &format!("\n{title}, {} ranks", comm.size()));
    say(
        &comm,
        "   nodes     CFL     top  its 1e-3  its 1e-6     setup     apply    matvec   to 1e-3   to 1e-6",
    );
    for n in [30, 60, 94] {
        if (n + 1) * (n + 1) * (n / 2 + 1) > largest {
            break;
        }
        for (courant, open) in [(1.0, true), (1.0, false), (10.0, true), (10.0, false)] {
            flow(&comm, n, courant, open);
        }
    }
}

fn say(comm: &Communicator, line: &str) {
    if comm.rank() == 0 {
        println!("{line}");
    }
}

fn distributed(comm: &Communicator, n: usize, h: f64) -> MeshPart {
    let mesh = (comm.rank() == 0).then(|| cells([n, n, n / 2], h, 0.2));
    MeshPart::distribute(comm, mesh, 0).expect("a good mesh")
}

fn diffusion(comm: &Communicator, largest: usize) {
    say(
        comm,
        "Diffusion on n x n x n/2 cells, nodes jittered 20 %, one side prescribed; µs per node",
    );
    say(comm, "   nodes    jump  its 1e-3  its 1e-6     setup     cycle  levels");
    for n in [30, 60, 94] {
        let nodes = (n + 1) * (n + 1) * (n / 2 + 1);
        if nodes > largest {
            break;
        }
        let part = distributed(comm, n, 1.0);
        for jump in [1.0, 1e3] {
            let half = 0.25 * n as f64 + 0.4;
            let L = scalar(
                &part,
                0.0,
                |x| if x[2] < half { 1.0 } else { jump },
                [0.0; 3],
                |x| x[0] < 0.1,
            );
            let halo = Halo::new(&part.comm, &part.nodes, &part.exchange, &L);
            let A = DistributedOperator::new(&L, &halo);
            let product = OwnedProduct::plain::<1>(&halo);
            let mut multigrid = Multigrid::new(&halo);
            multigrid.setup(&L);
            let setup = timed(comm, || multigrid.setup(&L));
            let mut b: Vec<f64> = part.nodes.global.iter().map(|&g| noise(g)).collect();
            let owned = b.iter_mut().take(part.n_owned()).enumerate();
            owned.for_each(|(i, b)| *b *= L.values[L.diagonal(i)][0][0]);
            let mut z = vec![0.0; part.n_local()];
            let cycle = timed(comm, || multigrid.apply(&b, &mut z));
            let mut work = Workspace::default();
            let its = [1e-3, 1e-6].map(|relative| {
                let settings = KrylovSettings { relative, ..KrylovSettings::default() };
                let mut x = vec![0.0; part.n_local()];
                match cg(&A, &mut multigrid, &product, &b, &mut x, &settings, &mut work) {
                    Ok(done) => done.iterations.to_string(),
                    Err(failed) => format!("{:?}", failed.reason),
                }
            });
            let per_node = 1e6 / nodes as f64;
            say(
                comm,
                &format!(
                    "{nodes:>8} {jump:>7} {:>9} {:>9} {:>9.3} {:>9.3}  {:?}",
                    its[0],
                    its[1],
                    setup * per_node,
                    cycle * per_node,
                    multigrid.sizes()
                ),
            );
        }
    }
}

/// Sloshing-like flow, 1000:1, at a given Courant number.
fn flow(comm: &Communicator, n: usize, courant: f64, open: bool) {
    let part = distributed(comm, n, 1.0 / n as f64);
    let nodes = (n + 1) * (n + 1) * (n / 2 + 1);
    let problem = Oseen::tank(n, courant, open);
    let (system, L) = problem.assemble(&part);
    let halo = Halo::new(&part.comm, &part.nodes, &part.exchange, &system);
    let A = DistributedOperator::new(&system, &halo);
    let mut weights = Vec::new();
    residual_weights(&system, &L, &mut weights);
    let product = OwnedProduct::weighted::<4>(&halo, &weights);
    let mut schur = SchurPreconditioner::new(&halo);
    schur.setup(&system, &L, None);
    let setup = timed(comm, || schur.setup(&system, &L, None));
    let b = problem.right_hand_side(&part);
    let mut z = vec![0.0; b.len()];
    let apply = timed(comm, || schur.apply(&b, &mut z));
    let mut y = vec![0.0; b.len()];
    let product_time = timed(comm, || A.apply(&mut z, &mut y));
    let mut work = Workspace::default();
    let mut cpu = [0.0; 2];
    let its = [1e-3, 1e-6].map(|relative| {
        let settings = KrylovSettings {
            relative,
            restart: std::env::var("RS").map_or(15, |s| s.parse().unwrap()),
            ..KrylovSettings::default()
        };
        let mut x = vec![0.0; b.len()];
        let start = self::cpu();
        let outcome = fgmres(&A, &mut schur, &product, &b, &mut x, &settings, &mut work);
        cpu[usize::from(relative < 1e-4)] = comm.max(self::cpu() - start);
        match outcome {
            Ok(done) => done.iterations.to_string(),
            Err(failed) => format!("{:?}", failed.reason),
        }
    });
    let per_node = 1e6 / nodes as f64;
    say(
        comm,
        &format!(
            "{nodes:>8} {courant:>7} {:>7} {:>9} {:>9} {:>9.3} {:>9.3} {:>9.3} {:>9.3} {:>9.3}",
            if open { "open" } else { "closed" },
            its[0],
            its[1],
            setup * per_node,
            apply * per_node,
            product_time * per_node,
            cpu[0] * per_node,
            cpu[1] * per_node,
        ),
    );
}

/// Mean CPU time of ten calls [s]: the clock has ticks of milliseconds.
fn timed(comm: &Communicator, mut f: impl FnMut()) -> f64 {
    let start = cpu();
    for _ in 0..10 {
        f();
    }
    comm.max(0.1 * (cpu() - start))
}

/// CPU time of this thread so far [s] (Linux).
fn cpu() -> f64 {
    let stat = std::fs::read_to_string("/proc/thread-self/schedstat").expect("Linux");
    let nanoseconds = stat.split(' ').next().expect("time on the CPU");
    nanoseconds.parse::<f64>().expect("a number") * 1e-9
}
