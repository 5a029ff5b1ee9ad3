//! Whole steps on small boxes: what must hold to round-off.

use super::*;
use crate::fem::norm;
use crate::linear::{
    BlockCsr, DistributedOperator, KrylovSettings, NodeGraph, OwnedProduct, Workspace, cg,
    relaxation::Jacobi,
};
use crate::mesh::boxes::tensor_box;
use crate::mesh::tetrahedron::Tetrahedron;
use std::f64::consts::PI;

pub(super) const SETTINGS: FreeSurface = FreeSurface {
    thickness: None,
    thickness_cells: 1.0,
    conservative: true,
    regularisation: Regularisation::Psi,
    mobility: 1.0,
    profile_correction: true,
    volume_correction: VolumeCorrection::Off,
};

pub(super) fn solver(phase_tolerance: f64) -> case::Solver {
    case::Solver { tolerance: 1e-3, start_tolerance: 1e-11, phase_tolerance, max_iterations: 200 }
}

/// A unit cube of n³ cells (times `stretch` along z) with inner nodes moved by up to 15 % of a cell.
pub(super) fn cube(n: usize) -> MeshPart {
    let h = 1.0 / n as f64;
    let lines: Vec<f64> = (0..=n).map(|i| i as f64 * h).collect();
    let mut mesh = tensor_box([&lines, &lines, &lines]);
    let mut random = random();
    for x in &mut mesh.nodes {
        if x.iter().all(|&x| x > 1e-9 && x < 1.0 - 1e-9) {
            *x = x.map(|x| x + 0.15 * h * random());
        }
    }
    MeshPart::single(mesh)
}

/// Uniform in −1..1.
fn random() -> impl FnMut() -> f64 {
    let mut state = 88_172_645_463_325_252u64;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

pub(super) fn of_distance(
    part: &MeshPart,
    settings: &FreeSurface,
    tolerance: f64,
    distance: impl Fn([f64; 3]) -> f64,
) -> Phase {
    let distance: Vec<f64> = part.mesh.nodes.iter().map(|x| distance(*x)).collect();
    let h = initial::cell_size(part, &distance);
    let phi = initial::profile(&distance, delta(settings, h));
    Phase::new(
        part,
        &CutMesh::whole(),
        &graph(part),
        settings,
        &solver(tolerance),
        h,
        phi,
        Vec::new(),
    )
}

fn sphere(x: [f64; 3]) -> f64 {
    0.25 - norm([x[0] - 0.4, x[1] - 0.5, x[2] - 0.55])
}

pub(super) fn graph(part: &MeshPart) -> NodeGraph {
    NodeGraph::new(&part.comm, &part.nodes, &part.exchange, &part.mesh.tets)
}

/// A velocity of no particular divergence with u·n = 0 on the cube's walls, and the constant u' per element
/// that makes `∫ (u_h − u')·∇q = 0` for every P1 q: what a PSPG flow hands over.
fn flow(part: &MeshPart) -> (Vec<[f64; 3]>, Vec<[f64; 3]>) {
    let mesh = &part.mesh;
    let u: Vec<[f64; 3]> = (mesh.nodes.iter())
        .map(|&[x, y, z]| {
            let s = |v: f64| (PI * v).sin();
            [s(x) * (1.0 + y), s(y) * (PI * z).cos(), -0.5 * s(z) * (1.0 + x * y)]
        })
        .collect();
    let graph = graph(part);
    let mut laplacian = BlockCsr::<1>::zero(&graph.pattern);
    let mut b = vec![0.0; part.n_local()];
    for (e, tet) in mesh.tets.iter().enumerate() {
        let t = Tetrahedron::of(mesh, e);
        let mean: [f64; 3] =
            std::array::from_fn(|c| tet.iter().map(|&n| 0.25 * u[n as usize][c]).sum());
        for i in 0..4 {
            b[tet[i] as usize] += t.volume * dot(mean, t.grad[i]);
            let at = graph.entries(e, tet, i);
            for j in 0..4 {
                laplacian.values[at[j]][0][0] += t.volume * dot(t.grad[i], t.grad[j]);
            }
        }
    }
    let (mut p, mut jacobi) = (vec![0.0; part.n_local()], Jacobi::default());
    jacobi.setup(&laplacian);
    cg(
        &DistributedOperator::new(&laplacian, &graph.halo),
        &mut jacobi,
        &OwnedProduct::plain::<1>(&graph.halo),
        &b,
        &mut p,
        &KrylovSettings { relative: 1e-14, absolute: 1e-17, max_iterations: 500, restart: 30 },
        &mut Workspace::default(),
    )
    .expect("the Laplacian of a small cube");
    let fine = (0..mesh.tets.len())
        .map(|e| Tetrahedron::of(mesh, e).gradient(mesh.tets[e].map(|n| p[n as usize])))
        .collect();
    (u, fine)
}

/// `Σ_i (∫N_i φ_h + excess_i)`: what a step must keep.
fn owed(phase: &Phase) -> f64 {
    (phase.phi.iter().zip(&phase.lumped).zip(&phase.excess)).map(|((f, m), e)| f * m + e).sum()
}

#[test]
fn what_is_owed_is_kept_to_round_off_whatever_the_tolerance() {
    let part = cube(8);
    let (u, fine) = flow(&part);
    let none = vec![[0.0; 3]; fine.len()];
    for (profile, regularisation) in [
        (true, Regularisation::Psi),
        (false, Regularisation::Psi),
        (true, Regularisation::Plain),
        (false, Regularisation::Plain),
    ] {
        let settings = FreeSurface { profile_correction: profile, regularisation, ..SETTINGS };
        let mut drift = [0.0; 2];
        for (drift, fine) in drift.iter_mut().zip([&fine, &none]) {
            let mut phase = of_distance(&part, &settings, 1e-2, sphere);
            let before = owed(&phase);
            assert!((phase.volume(&part, &CutMesh::whole()) - before).abs() < 1e-15);
            for _ in 0..10 {
                phase.advance(&part, &CutMesh::whole(), 0.03, &u, fine, &[]).unwrap();
            }
            *drift = (owed(&phase) / before - 1.0).abs();
            // The integral itself follows one step behind.
            let lag = (phase.volume(&part, &CutMesh::whole()) / owed(&phase) - 1.0).abs();
            assert!(lag < 5e-3, "{profile} {regularisation:?}: {lag}");
        }
        assert!(drift[0] < 1e-13, "{profile} {regularisation:?}: {drift:?}");
        assert!(drift[1] > 1e-4, "u_h alone is not divergence-free enough: {drift:?}");
    }
}

#[test]
fn constants_are_kept_whatever_the_velocity() {
    let part = cube(5);
    let (u, _) = flow(&part);
    let fine: Vec<[f64; 3]> =
        (0..part.mesh.tets.len()).map(|e| [0.1, e as f64 * 1e-3, 0.0]).collect();
    for value in [1.0, 0.3] {
        let phi = vec![value; part.n_local()];
        let mut phase = Phase::new(
            &part,
            &CutMesh::whole(),
            &graph(&part),
            &SETTINGS,
            &solver(1e-6),
            0.2,
            phi,
            Vec::new(),
        );
        for _ in 0..3 {
            phase.advance(&part, &CutMesh::whole(), 0.1, &u, &fine, &[]).unwrap();
        }
        assert!(phase.phi.iter().all(|p| (p - value).abs() < 1e-14));
    }
}

#[test]
fn flat_water_at_rest_stays_to_the_last_bit() {
    let part = cube(7);
    let at_rest = vec![[0.0; 3]; part.n_local()];
    let fine = vec![[0.0; 3]; part.mesh.tets.len()];
    for slope in [0.0, 0.4, 2.7] {
        let size = f64::hypot(1.0, slope);
        let mut phase =
            of_distance(&part, &SETTINGS, 1e-8, |x| (0.52 - x[2] + slope * (x[0] - 0.5)) / size);
        let before = phase.phi.clone();
        for _ in 0..3 {
            let report =
                phase.advance(&part, &CutMesh::whole(), 0.1, &at_rest, &fine, &[]).unwrap();
            assert_eq!((report.iterations, report.sub_steps), (0, 0));
            regularise::sub_steps(&mut phase, &part, &CutMesh::whole(), 0.1, 1.0);
            phase.restore_volume(&part, &CutMesh::whole());
        }
        let moved = phase.phi.iter().zip(&before).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(moved < 1e-15, "slope {slope}: {moved}");
    }
}

#[test]
fn noise_is_carried_without_blowing_up_or_losing_water() {
    let part = cube(8);
    let (u, fine) = flow(&part);
    let mut random = random();
    let phi: Vec<f64> = part.mesh.nodes.iter().map(|_| 0.5 + 0.5 * random()).collect();
    let mut phase = Phase::new(
        &part,
        &CutMesh::whole(),
        &graph(&part),
        &SETTINGS,
        &solver(1e-3),
        0.125,
        phi,
        Vec::new(),
    );
    let before = owed(&phase);
    for _ in 0..30 {
        phase.advance(&part, &CutMesh::whole(), 0.1, &u, &fine, &[]).unwrap();
    }
    assert!((owed(&phase) / before - 1.0).abs() < 1e-13);
    assert!(phase.phi.iter().all(|p| (-0.2..1.2).contains(p)));
}

#[test]
fn what_comes_in_is_what_is_booked() {
    // A profile carried in through x_min and on towards x_max.
    let part = cube(10);
    let (u, dt) = (0.7, 0.02);
    let velocity = vec![[u, 0.0, 0.0]; part.n_local()];
    let fine = vec![[0.0; 3]; part.mesh.tets.len()];
    let at = |x: f64, t: f64| profile::sigmoid(10.0 * (0.45 + u * t - x));
    let inlet: Vec<u32> =
        (0..part.n_local() as u32).filter(|&i| part.mesh.nodes[i as usize][0] == 0.0).collect();
    let open: Vec<u32> = (0..part.mesh.boundary.len() as u32)
        .filter(|&f| part.mesh.boundary[f as usize].name < 2)
        .collect();
    let phi: Vec<f64> = part.mesh.nodes.iter().map(|x| at(x[0], 0.0)).collect();
    let settings = FreeSurface { volume_correction: VolumeCorrection::Global, ..SETTINGS };
    let mut phase = Phase::new(
        &part,
        &CutMesh::whole(),
        &graph(&part),
        &settings,
        &solver(1e-8),
        0.1,
        phi,
        open,
    );
    let mut booked = 0.0;
    for step in 1..=10 {
        let t = f64::from(step) * dt;
        let inflow: Vec<(u32, f64)> = inlet.iter().map(|&i| (i, at(0.0, t))).collect();
        phase.advance(&part, &CutMesh::whole(), dt, &velocity, &fine, &inflow).unwrap();
        let report = phase.restore_volume(&part, &CutMesh::whole());
        booked += report.inflow;
        assert!((report.volume - report.target).abs() < 1e-12);
        assert!(report.error.abs() < 1e-3 * u * dt, "{report:?}");
    }
    // ∫ at(x, t) dx = [softplus(10 (0.45 + u t))  − softplus(10 (0.45 + u t − 1))]/10
    let integral = |t: f64| {
        let softplus = |s: f64| s.exp().ln_1p() / 10.0;
        softplus(10.0 * (0.45 + u * t)) - softplus(10.0 * (0.45 + u * t - 1.0))
    };
    let exact = integral(10.0 * dt) - integral(0.0);
    assert!((booked / exact - 1.0).abs() < 2e-3, "{booked} {exact}");
}

#[test]
fn a_run_continues_from_its_state_bit_for_bit() {
    let part = cube(6);
    let (u, fine) = flow(&part);
    let settings = FreeSurface { volume_correction: VolumeCorrection::PerBody, ..SETTINGS };
    let mut phase = of_distance(&part, &settings, 1e-3, sphere);
    let step = |phase: &mut Phase| {
        phase.advance(&part, &CutMesh::whole(), 0.05, &u, &fine, &[]).unwrap();
        phase.restore_volume(&part, &CutMesh::whole());
    };
    (0..3).for_each(|_| step(&mut phase));
    let state = phase.state();
    (0..3).for_each(|_| step(&mut phase));
    let mut other = of_distance(&part, &settings, 1e-3, |x| 0.5 - x[2]);
    other.restore(&part, &state);
    assert_eq!(other.state(), state);
    (0..3).for_each(|_| step(&mut other));
    assert_eq!(other.state(), phase.state());
}

#[test]
fn without_conservation_a_disc_shrinks_by_curvature() {
    // dR²/dt = −2 γδ for a cylinder.
    let n = 40;
    let h = 1.0 / n as f64;
    let lines: Vec<f64> = (0..=n).map(|i| i as f64 * h).collect();
    let part = MeshPart::single(tensor_box([&lines, &lines, &[0.0, h]]));
    let settings = FreeSurface { conservative: false, profile_correction: false, ..SETTINGS };
    let mut phase =
        of_distance(&part, &settings, 1e-6, |x| 0.3 - f64::hypot(x[0] - 0.5, x[1] - 0.5));
    // The speed γ is that of the flow; here it is handed over without one.
    let u = vec![[0.0; 3]; part.n_local()];
    let fine = vec![[0.0; 3]; part.mesh.tets.len()];
    let before = phase.volume(&part, &CutMesh::whole());
    let (steps, dt, gamma) = (50, 0.02, 1.0);
    for _ in 0..steps {
        let given = Given { dt, velocity: &u, fine_scale: &fine, inflow: &[], speed: gamma };
        transport::step(&mut phase, &part, &CutMesh::whole(), &given).unwrap();
    }
    let lost = (before - phase.volume(&part, &CutMesh::whole())) / h;
    let theory = 2.0 * PI * gamma * phase.delta() * dt * steps as f64;
    assert!((lost / theory - 1.0).abs() < 0.05, "{lost} {theory}");
}

/// What nodes gain is what φ* ũ and `flux` bring: whoever moves momentum with these moves it with the mass.
#[test]
fn flux_is_what_moves_beyond_the_velocity() {
    let part = cube(8);
    let settings = FreeSurface { mobility: 0.0, ..SETTINGS };
    let mut phase = of_distance(&part, &settings, 1e-12, sphere);
    let (u, dt) = ([0.9, -0.4, 0.7], 0.1);
    let velocity = vec![u; part.n_local()];
    let fine = vec![[0.0; 3]; part.mesh.tets.len()];
    let old = phase.phi.clone();
    phase.advance(&part, &CutMesh::whole(), dt, &velocity, &fine, &[]).unwrap();

    // ∫N_i φ* of both levels, and what came; ∫φ* of each element.
    let (mut mass, mut came) = ([0, 1].map(|_| vec![0.0; old.len()]), vec![0.0; old.len()]);
    let profiles = [&old, &phase.phi].map(|phi| {
        let mut profile = Profile::default();
        profile.set(phi, true);
        profile
    });
    for (e, tet) in part.mesh.tets.iter().enumerate() {
        let t = Tetrahedron::of(&part.mesh, e);
        let mut mean = 0.0;
        for (profile, mass) in profiles.iter().zip(&mut mass) {
            let nodes = tet.map(|n| &profile.nodes[n as usize]);
            let w = f64::from(phase.solver.weight[e]);
            let excess = if w > 0.0 { profile::moments(nodes, w).excess } else { [0.0; 4] };
            let sum: f64 = nodes.iter().map(|n| n.phi).sum();
            for i in 0..4 {
                let share = t.volume * (0.05 * (sum + nodes[i].phi) + excess[i]);
                mass[tet[i] as usize] += share;
                mean += 0.5 * share;
            }
        }
        for i in 0..4 {
            let carried: f64 = dot(u, t.grad[i]) * mean;
            came[tet[i] as usize] += carried - t.volume * dot(phase.flux[e], t.grad[i]);
        }
    }
    let inside = |i: usize| part.mesh.nodes[i].iter().all(|&x| x > 1e-9 && x < 1.0 - 1e-9);
    let nodes: Vec<usize> = (0..old.len()).filter(|&i| inside(i)).collect();
    let most = |f: &dyn Fn(usize) -> f64| nodes.iter().map(|&i| f(i).abs()).fold(0.0, f64::max);
    let moved = most(&|i| mass[1][i] - mass[0][i]);
    let wrong = most(&|i| mass[1][i] - mass[0][i] - dt * came[i]);
    let streamline = most(&|i| dt * came[i]) > 0.0 && phase.flux.iter().any(|f| norm(*f) > 1e-3);
    assert!(streamline && wrong < 1e-10 * moved, "{wrong} of {moved}");
}
