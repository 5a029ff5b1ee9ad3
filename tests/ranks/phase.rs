//! The free surface on several ranks against the same on one.

use fcm_fsi::case::{BoxMesh, FreeSurface, Regularisation, Solver, VolumeCorrection};
use fcm_fsi::cut::CutMesh;
use fcm_fsi::mesh::boxes::box_mesh;
use fcm_fsi::mesh::{Mesh, MeshPart};
use fcm_fsi::phase::{Phase, VolumeReport, delta, initial};
use partition::Communicator;

/// 1 × 0.5 × 0.5 of 20 × 10 × 10 cells, inner nodes moved.
fn tank() -> Mesh {
    let lines = [20, 10, 10].map(|n| (0..=n).map(|i| f64::from(i) * 0.05).collect::<Vec<f64>>());
    box_mesh(&BoxMesh { lines, holes: Vec::new(), jitter: Some((0.2, 3)) }).expect("a tank")
}

/// Water on the floor and two drops that the flow carries about.
fn distance(x: [f64; 3]) -> f64 {
    let drop = |c: [f64; 3], r: f64| {
        r - x.iter().zip(c).map(|(x, c)| (x - c) * (x - c)).sum::<f64>().sqrt()
    };
    (0.12 - x[2]).max(drop([0.3, 0.25, 0.37], 0.1)).max(drop([0.75, 0.3, 0.36], 0.11))
}

/// u·n = 0 on the walls.
fn velocity(x: [f64; 3]) -> [f64; 3] {
    let s = |v: f64| (std::f64::consts::PI * v).sin();
    let c = |v: f64| (std::f64::consts::PI * v).cos();
    [0.5 * s(x[0]) * c(2.0 * x[2]), 0.1 * s(2.0 * x[1]), -0.5 * c(x[0]) * s(2.0 * x[2])]
}

fn run(part: &MeshPart, settings: &FreeSurface) -> (Phase, Vec<VolumeReport>) {
    let from: Vec<f64> = part.mesh.nodes.iter().map(|x| distance(*x)).collect();
    let h = initial::cell_size(part, &from);
    let phi = initial::profile(&from, delta(settings, h));
    let (tolerance, start_tolerance) = (1e-3, 1e-3);
    let solver = Solver { tolerance, start_tolerance, phase_tolerance: 1e-13, max_iterations: 200 };
    let mut phase = Phase::new(part, &CutMesh::whole(), settings, &solver, h, phi, Vec::new());
    let u: Vec<[f64; 3]> = part.mesh.nodes.iter().map(|x| velocity(*x)).collect();
    let fine = vec![[0.0; 3]; part.mesh.tets.len()];
    let mut reports = Vec::new();
    for _ in 0..6 {
        phase
            .advance(part, &CutMesh::whole(), 0.04, &u, &fine, &[])
            .expect("a mass-dominated solve");
        reports.push(phase.restore_volume(part, &CutMesh::whole()));
    }
    (phase, reports)
}

/// φ, body names, targets and iterations of the volume correction do not depend on the ranks.
pub fn free_surface_on_ranks(comm: &Communicator) {
    let part = MeshPart::distribute(comm, (comm.rank() == 0).then(tank), 0).unwrap();
    let whole = MeshPart::single(tank());
    for (regularisation, volume_correction) in [
        (Regularisation::Psi, VolumeCorrection::PerBody),
        (Regularisation::Plain, VolumeCorrection::Global),
    ] {
        let settings = FreeSurface {
            thickness: None,
            thickness_cells: 0.6,
            conservative: true,
            regularisation,
            mobility: 1.0,
            profile_correction: true,
            volume_correction,
        };
        let (here, reports) = run(&part, &settings);
        let (there, expected) = run(&whole, &settings);
        for (local, &global) in part.nodes.global.iter().enumerate() {
            let (a, b) = (here.phi[local], there.phi[global as usize]);
            assert!((a - b).abs() < 1e-9, "{regularisation:?}: φ of node {global}: {a} {b}");
        }
        let (a, b) = (here.ledger(), there.ledger());
        assert!(a.bodies.iter().map(|b| b.name).eq(b.bodies.iter().map(|b| b.name)));
        for (a, b) in a.bodies.iter().zip(&b.bodies) {
            assert!((a.target / b.target - 1.0).abs() < 1e-9, "{a:?} {b:?}");
        }
        for (a, b) in reports.iter().zip(&expected) {
            assert_eq!(a.bodies, b.bodies);
            assert!((a.volume / b.volume - 1.0).abs() < 1e-12);
            assert!((a.correction - b.correction).abs() < 1e-9 * b.volume);
        }
        if volume_correction == VolumeCorrection::PerBody {
            assert_eq!(reports[0].bodies, 3);
        }
    }
}
