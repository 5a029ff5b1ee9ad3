//! Water with a free surface around obstacles that are cut out of the mesh.

#[path = "common/simulation.rs"]
mod common;

use common::simulation;
use fcm_fsi::phase::initial;
use fcm_fsi::simulation::Simulation;

/// Largest speed at nodes with fluid [m/s].
fn top_speed(run: &Simulation) -> f64 {
    let cut = &run.cut;
    let speeds = run.velocity().iter().enumerate().filter(|(i, _)| cut.is_in_fluid(*i));
    speeds.map(|(_, u)| fcm_fsi::fem::norm(*u)).fold(0.0, f64::max)
}

/// A ball and a cube at the waterline at ten places each, upright and turned, on a jittered mesh: nothing moves,
/// and they bear the weight of the water they displace.
#[test]
fn still_water_around_half_submerged_bodies() {
    for k in 0..10 {
        // The first stay for 40 steps: what grows would be seen.
        still_water_around_bodies(k, if k == 0 { 40 } else { 8 });
    }
}

fn still_water_around_bodies(k: usize, steps: usize) {
    let at = [0.8191725, 0.6710436, 0.5497005].map(|a: f64| 0.05 * (a * k as f64).fract());
    let angle = [17, 45, 0][k % 3];
    let mut run = simulation(&format!(
        r#"
        mesh = {{ box = {{ x = [0, 1], y = [0, 0.6], z = [0, 0.6], cells = [20, 12, 12] }}, jitter = 0.15 }}
        boundaries.default = "slip"
        initial.water = "z < 0.3012"
        air = {{}}
        time = {{ end = 1, max_step = 0.01 }}
        [[obstacle]]
        name = "ball"
        sphere = 0.13
        at = [{}, {}, {}]
        [[obstacle]]
        name = "cube"
        cuboid = [0.2, 0.2, 0.2]
        at = [{}, {}, {}]
        turned = [{angle}, {}, {}]
        "#,
        0.28 + at[0],
        0.29 + at[1],
        0.29 + at[2],
        0.72 - at[1],
        0.31 - at[2],
        0.31 - at[0],
        2 * angle,
        angle / 2
    ));
    for _ in 0..steps {
        run.step(0.01).unwrap();
    }
    let top = top_speed(&run);
    assert!(top < 1e-7, "{k}: {top}");
    // Archimedes, with the density of the diffuse surface in the discrete bodies.
    let mut weight = [0.0; 2];
    let cut = &run.cut;
    let depth: Vec<f64> = run.part.mesh.nodes.iter().map(|x| 0.3012 - x[2]).collect();
    let mut water = run.material.clone();
    water.set_phase(&initial::profile(&depth, run.phase.as_ref().unwrap().delta()));
    for (e, tet) in run.part.mesh.tets.iter().enumerate() {
        let x = run.part.mesh.corners(e);
        let t = fcm_fsi::mesh::tetrahedron::Tetrahedron::new(x);
        let dry = t.volume - cut.fluid_volume(&run.part.mesh, e);
        let m = water.element(tet, &x);
        let left = x.iter().map(|x| x[0]).sum::<f64>() < 2.0;
        weight[usize::from(!left)] += 9.81 * m.rho * dry;
    }
    for (load, weight) in run.loads.iter().zip(weight) {
        let f = load.reaction.force;
        assert!((f[2] / weight - 1.0).abs() < 0.01, "{f:?} {weight}");
        assert!(f[0].hypot(f[1]) < 1e-3 * weight, "{f:?}");
        assert!((load.traction.force[2] / f[2] - 1.0).abs() < 1e-6);
    }
}

/// Water held back by a wall of twice the mesh size, wherever it stands: none of it passes.
#[test]
fn a_wall_holds_water_back() {
    for offset in [0.0, 0.013, 0.025, 0.049] {
        let text = format!(
            r#"
            mesh.box = {{ x = [0, 1], y = [0, 0.1], z = [0, 0.5], cells = [20, 2, 10] }}
            boundaries.default = "slip"
            initial.water = "z < 0.3 - 9*(x > {0})"
            air = {{}}
            free_surface.volume_correction = "off"
            time = {{ end = 1, max_step = 0.01 }}
            [[obstacle]]
            name = "wall"
            cuboid = [0.1, 1, 2]
            at = [{0}, 0.05, 0.25]
            wall = "slip"
            "#,
            0.5 + offset
        );
        let mut run = simulation(&text);
        // Water to the left of the wall.
        let held = |run: &Simulation| -> f64 {
            let phi = &run.phase.as_ref().unwrap().phi;
            let mut sum = 0.0;
            for (e, tet) in run.part.mesh.tets.iter().enumerate() {
                let x = run.part.mesh.corners(e);
                if x.iter().map(|x| x[0]).sum::<f64>() < 2.0 + 4.0 * offset {
                    let mean = tet.iter().map(|&n| phi[n as usize]).sum::<f64>() / 4.0;
                    sum += mean * run.cut.fluid_volume(&run.part.mesh, e);
                }
            }
            sum
        };
        let before = held(&run);
        for _ in 0..100 {
            run.step(0.01).unwrap();
        }
        let lost = 1.0 - held(&run) / before;
        assert!(top_speed(&run) < 1e-8, "{offset}: {}", top_speed(&run));
        assert!(lost.abs() < 1e-6, "{offset}: {lost}");
        // ½ρgh² a metre, and π²/6 ρgδ² more for a surface of thickness δ = h.
        let force = run.loads[0].reaction.force[0];
        let exact = 0.1 * 9810.0 * (0.5 * 0.09 + std::f64::consts::PI.powi(2) / 6.0 * 0.0025);
        assert!((force / exact - 1.0).abs() < 0.02, "{force} {exact}");
    }
}

/// A plunger lowered into the water and raised, nothing corrected, with steps that grow and shrink: the water is
/// still there. Where nodes lost more than they had left, it was not (4e-4).
#[test]
fn a_plunger_neither_makes_nor_destroys_water() {
    let mut run = simulation(
        r#"
        mesh = { box = { x = [0, 1], y = [0, 0.5], z = [0, 0.8], cells = [16, 8, 14] }, jitter = 0.1 }
        boundaries = { default = "slip", z_max = "open" }
        initial.water = "z < 0.4"
        air = {}
        free_surface.volume_correction = "off"
        time = { end = 1, max_step = 0.02 }
        [[obstacle]]
        name = "plunger"
        cuboid = [0.3, 0.25, 0.3]
        at = [0.5, 0.25, 0.6]
        wall = "slip"
        displacement = [0, 0, "-0.1*(1-cos(2*pi*t))"]
        "#,
    );
    let mut worst = 0.0f64;
    while run.clock.t < 1.0 {
        let dt = 0.015 + 0.005 * (2.0 * std::f64::consts::PI * run.clock.t).cos();
        let volume = run.step(dt).unwrap().volume;
        worst = worst.max((volume.volume / volume.target - 1.0).abs());
    }
    println!("volume changes by up to {worst:.1e}");
    assert!(worst < 2e-4, "{worst}");
}

/// A wave breaks over a box and closes a pocket of air: no energy comes from nowhere. It did, as long as the
/// momentum equation did not know what the regularisation moves.
#[test]
fn a_splash_makes_no_energy() {
    let mut run = simulation(
        r#"
        initial.water = "x > 1.992 && z < 0.55"
        air = {}
        boundaries = { default = "slip", z_max = "open" }
        free_surface.thickness = 0.02
        time = { end = 0.65, step = 0.005 }
        [mesh.box]
        x = { edges = [0, 0.8, 3.22], sizes = [0.06, 0.03, 0.05] }
        y = { edges = [0, 0.03], cells = [1] }
        z = { edges = [0, 0.2, 1], sizes = [0.02, 0.03, 0.08] }
        [[obstacle]]
        name = "box"
        cuboid = [0.161, 1, 0.322]
        at = [0.744, 0.015, 0]
        wall = "slip"
        "#,
    );
    let (mut last, mut made, mut all) = (f64::INFINITY, 0.0, 0.0);
    for step in 0..130 {
        let flow = run.step(0.005).unwrap().flow;
        let energy = flow.kinetic + flow.potential;
        // At the start the one is half a step behind the other.
        if step >= 40 {
            made += (energy - last).max(0.0);
        } else {
            all = energy;
        }
        last = energy;
    }
    assert!(made < 0.01 * all, "{made} of {all} J");
}
