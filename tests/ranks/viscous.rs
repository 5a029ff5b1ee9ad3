//! Flow where viscosity rules: the preconditioner's velocity multigrid over ranks.

use fcm_fsi::case::{Case, Sources};
use fcm_fsi::cut::CutMesh;
use fcm_fsi::mesh::{MeshPart, boxes::tensor_box};
use fcm_fsi::setup;
use partition::Communicator;

const CASE: &str = r#"
mesh.box = { x = [0, 1], y = [0, 1], z = [0, 1], cells = [1, 1, 1] }
boundaries = { default = "slip", x_min = "no_slip", z_max = "open" }
body_force = ["sin(3*y)", "cos(2*z)", "x*y"]
water = { density = 1, viscosity = 1 }
solver.tolerance = 1e-9
time = { end = 1, step = 1 }
"#;

/// Counts within two and a fifth of one rank's (restarts fall differently), and its velocities.
pub fn viscous_flow_on_ranks(comm: &Communicator) {
    let sources = Sources {
        file: "case.toml".into(),
        folder: "/".into(),
        text: CASE.into(),
        tables: Default::default(),
    };
    let case = Case::new(&sources).unwrap_or_else(|error| panic!("{error}"));
    let run = |comm: &Communicator| {
        let line: Vec<f64> = (0..=10).map(|i| 0.1 * f64::from(i)).collect();
        let mesh = (comm.rank() == 0).then(|| tensor_box([&line; 3]));
        let part = MeshPart::distribute(comm, mesh, 0).unwrap();
        let graph = setup::graph(&part);
        let mut flow = setup::flow(&case, &part, &CutMesh::whole(), &graph).expect("a flow");
        let material = setup::material(&case, &part, None);
        let counts: Vec<u32> = (0..4)
            .map(|i| {
                flow.advance(&part, &CutMesh::whole(), &[], &material, 0.5 * f64::from(i), 0.5)
                    .unwrap()
                    .iterations
            })
            .collect();
        (part, flow, counts)
    };
    let (part, flow, counts) = run(comm);
    let (whole, expected, whole_counts) = run(&Communicator::single());
    if comm.rank() == 0 {
        println!("  {counts:?}, one rank: {whole_counts:?}");
    }
    let mut by_global = vec![[0.0; 3]; whole.n_owned()];
    for (u, id) in expected.u.iter().zip(&whole.nodes.global) {
        by_global[*id as usize] = *u;
    }
    let largest = by_global.iter().flatten().fold(0.0f64, |a, u| a.max(u.abs()));
    for i in 0..part.n_owned() {
        let there = by_global[part.nodes.global[i] as usize];
        assert!((0..3).all(|k| (flow.u[i][k] - there[k]).abs() < 1e-6 * largest));
    }
    assert!(counts.iter().zip(&whole_counts).all(|(n, one)| 5 * n <= 6 * one + 10), "{counts:?}");
}
