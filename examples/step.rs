//! One step on real states of a dam break, for any mesh and number of ranks: iterations and time.
//!
//!     step state FILE                              a coarse run to t = 0.7 s, kept in FILE
//!     mpirun -n R step solve FILE N CFL open|closed [STRETCH]
//!
//! The tank is 4 × 1 × 1 m. `solve` takes the coarse state over to a mesh of 4N × N × N cells (the distance
//! to the surface is interpolated, so that the surface is as sharp as on any mesh of its own), lets it
//! settle for four steps at Courant number 1 and one at CFL, and solves the next step to 1e-3 and, from
//! the same guess, to 1e-6. It prints one line of JSON, with what the stages of the step to 1e-3 cost, how its multigrid
//! was used, and the peak memory of all ranks. STRETCH: ratio of the tallest to the lowest cell.

use fcm_fsi::case::{Case, Sources};
use fcm_fsi::fem::courant_rate;
use fcm_fsi::flow::Flow;
use fcm_fsi::phase::inflow::Inflow;
use fcm_fsi::phase::{Phase, initial};
use fcm_fsi::report::stages::Stages;
use fcm_fsi::report::summary::{Stage, memory_peak_mb};
use fcm_fsi::setup;
use fcm_fsi::simulation::Simulation;
use partition::Communicator;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Cells over the height of the coarse run, and its end [s].
const COARSE: usize = 15;
const TIME: f64 = 0.7;

/// Nodal values of the coarse run, x fastest.
#[derive(Serialize, Deserialize)]
struct State {
    velocity: Vec<[f64; 3]>,
    /// Signed distance to the surface [m].
    distance: Vec<f64>,
}

fn case(cells: usize, stretch: f64, open: bool) -> Case {
    let top = if open { "z_max = \"open\"" } else { "" };
    let text = format!(
        "[mesh.box]\n\
         x = {{ edges = [0, 4], cells = [{}] }}\n\
         y = {{ edges = [0, 1], cells = [{cells}] }}\n\
         z = {{ edges = [0, 1], cells = [{cells}], ratio = [{stretch:?}] }}\n\
         [boundaries]\ndefault = \"slip\"\n{top}\n\
         [initial]\nwater = \"x < 1.2 && z < 0.7 - 0.3*y\"\n\
         [air]\n\
         [time]\nend = {TIME}\nmax_cfl = 1\n",
        4 * cells
    );
    let (file, tables) = ("step/case.toml".into(), BTreeMap::new());
    Case::new(&Sources { file, folder: PathBuf::from("/step"), text, tables }).unwrap()
}

/// Index of the node nearest to x in the coarse run.
fn place(x: [usize; 3]) -> usize {
    x[0] + (4 * COARSE + 1) * (x[1] + (COARSE + 1) * x[2])
}

fn make_state(comm: &Communicator, file: &str) {
    assert_eq!(comm.size(), 1, "the coarse run is of one rank");
    let mut run = Simulation::new(case(COARSE, 1.0, true), comm).unwrap();
    while run.clock.t < TIME {
        let rate = courant_rate(&run.part, run.velocity());
        let dt = (0.8 / rate).min(1.2 * run.clock.dt.max(2e-3)).min(TIME - run.clock.t);
        let report = run.step(dt).unwrap();
        println!(
            "step {}, t = {:.3} s, {} iterations",
            run.clock.step, run.clock.t, report.flow.iterations
        );
    }
    let n = run.part.n_local();
    let mut state = State { velocity: vec![[0.0; 3]; n], distance: vec![0.0; n] };
    let mut distance = vec![0.0; n];
    run.phase.as_ref().unwrap().psi(&mut distance);
    for (i, x) in run.part.mesh.nodes.iter().enumerate() {
        let at = place(x.map(|x| (x * COARSE as f64).round() as usize));
        state.velocity[at] = run.velocity()[i];
        state.distance[at] = distance[i];
    }
    std::fs::write(file, serde_json::to_vec(&state).unwrap()).unwrap();
}

impl State {
    /// Velocity and distance at x, trilinear.
    fn at(&self, x: [f64; 3]) -> ([f64; 3], f64) {
        let (mut u, mut d) = ([0.0; 3], 0.0);
        let cells = [4 * COARSE, COARSE, COARSE];
        let low: [usize; 3] =
            std::array::from_fn(|k| ((x[k] * COARSE as f64) as usize).min(cells[k] - 1));
        for corner in 0..8 {
            let mut weight = 1.0;
            let mut node = low;
            for k in 0..3 {
                let along = x[k] * COARSE as f64 - low[k] as f64;
                let upper = corner >> k & 1;
                weight *= if upper == 1 { along } else { 1.0 - along };
                node[k] += upper;
            }
            let at = place(node);
            (0..3).for_each(|k| u[k] += weight * self.velocity[at][k]);
            d += weight * self.distance[at];
        }
        (u, d)
    }
}

/// A simulation that begins in this state.
fn begin(case: Case, comm: &Communicator, state: &State) -> Simulation {
    let mut run = Simulation::new(case, comm).unwrap();
    let (case, part) = (&run.case, &run.part);
    let (velocity, distance): (Vec<[f64; 3]>, Vec<f64>) =
        part.mesh.nodes.iter().map(|&x| state.at(x)).unzip();
    let cell = initial::cell_size(part, &distance);
    let phi = initial::profile(&distance, fcm_fsi::phase::delta(&case.free_surface, cell));
    run.material.set_phase(&phi);
    let faces = Inflow::new(case, part).faces;
    let graph = setup::graph(part);
    run.phase = Some(Phase::new(
        part,
        &run.cut,
        &graph,
        &case.free_surface,
        &case.solver,
        cell,
        phi,
        faces,
    ));
    run.flow = Some(Flow::new(case, part, &run.cut, &graph, velocity));
    run
}

fn solve(comm: &Communicator, arguments: &[String]) {
    let [file, cells, courant, top, rest @ ..] = arguments else {
        panic!("FILE N CFL open|closed")
    };
    let state: State = serde_json::from_slice(&std::fs::read(file).unwrap()).unwrap();
    let (cells, courant): (usize, f64) = (cells.parse().unwrap(), courant.parse().unwrap());
    let stretch: f64 = rest.first().map_or(1.0, |ratio| ratio.parse().unwrap());
    let mut run = begin(case(cells, stretch, top == "open"), comm, &state);
    for courant in [1.0, 1.0, 1.0, 1.0, courant] {
        let dt = courant / courant_rate(&run.part, run.velocity());
        run.step(dt).unwrap();
    }

    let dt = courant / courant_rate(&run.part, run.velocity());
    let flow = run.flow.as_ref().unwrap();
    let before = (flow.u.clone(), flow.u_old.clone(), flow.p.clone(), flow.dt_old, flow.steps);
    let t = run.clock.t;
    run.stages = Stages::default();
    comm.sum(0.0);
    let clock = comm.clock();
    let rough = run.step(dt).unwrap().flow;
    let cost = clock.elapsed();
    let [seconds, memory] = [comm.max(cost.seconds), comm.sum(memory_peak_mb())];
    let stages = run.stages.iter().chain([("step", cost, 1)]);
    let stages: Vec<Stage> =
        stages.map(|(name, cost, calls)| Stage::new(&run.part, name, cost, calls)).collect();
    let multigrid = run.flow.as_ref().unwrap().preconditioner().multigrid();
    let levels: Vec<_> = (multigrid.visits())
        .map(|(nodes, visits, traffic)| {
            let [exchanges, messages, bytes] = traffic.map(|n| comm.sum_u64(n));
            json!({ "nodes": nodes, "visits": visits, "exchanges": exchanges / comm.size() as u64,
                    "messages": messages, "bytes": bytes })
        })
        .collect();
    let flow = run.flow.as_mut().unwrap();
    (flow.u, flow.u_old, flow.p, flow.dt_old, flow.steps) = before;
    flow.tolerance = 1e-6;
    let fine = flow.advance(&run.part, &run.cut, &[], &run.material, t, dt).unwrap();
    let nodes = comm.sum_u64(run.part.n_owned() as u64);
    let tets = comm.sum_u64(run.part.n_owned_elements as u64);
    let line = json!({
        "nodes": nodes,
        "ranks": comm.size(),
        "courant": courant,
        "top": top,
        "stretch": stretch,
        "iterations": [rough.iterations, fine.iterations],
        "reached": [rough.residual / rough.initial_residual, fine.residual / fine.initial_residual],
        "tets": tets,
        "step": seconds,
        "stages": stages,
        "levels": levels,
        "memory_mb": memory,
        "solve": [comm.sum(rough.solve.work), comm.sum(fine.solve.work)],
    });
    if comm.rank() == 0 {
        println!("{line}");
    }
}

fn main() {
    let ranks = partition::start();
    let comm = ranks.world();
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.first().map(String::as_str) {
        Some("state") => make_state(&comm, &arguments[1]),
        Some("solve") => solve(&comm, &arguments[1..]),
        _ => panic!("step state FILE, or step solve FILE N CFL open|closed [STRETCH]"),
    }
}
