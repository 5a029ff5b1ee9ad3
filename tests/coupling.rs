//! Bodies and water together, against exact solutions.

#[path = "common/simulation.rs"]
mod common;

use common::simulation;
use fcm_fsi::coupling::hidden::Hidden;
use fcm_fsi::report::energy::Energy;
use fcm_fsi::shape::Bounds;
use fcm_fsi::simulation::{Options, Simulation};
use nalgebra::Vector3;
use std::path::PathBuf;

/// Velocity along x of the first body [m/s].
fn speed(run: &Simulation) -> f64 {
    run.bodies.as_ref().unwrap().placed()[0].end.velocity.x
}

/// A block pushed along a channel that it fills, with water before it and no pressure at the far end:
/// `a = F / (m + ρ A L)`, exactly, heavy or light, from the first step on.
#[test]
fn a_piston_pushes_its_column() {
    let (force, dt, column) = (100.0, 1e-3, 1000.0 * 0.04 * 0.85);
    for mass in [34.0, 0.34] {
        let mut run = simulation(&format!(
            "gravity = [0, 0, 0]\n\
             [mesh]\nbox = {{ x = [0, 1], y = [0, 0.2], z = [0, 0.2], cells = [20, 4, 4] }}\n\
             [boundaries]\ndefault = \"slip\"\nx_max = \"open\"\n\
             [water]\nviscosity = 0\n\
             [time]\nend = 1\nstep = {dt}\n\
             [solver]\ntolerance = 1e-8\n\
             [bodies]\nsphere_radius = 0.05\nslip = true\n\
             [[body]]\nname = \"piston\"\ncuboid = [0.3, 0.6, 0.6]\nat = [0, 0.1, 0.1]\n\
             density = {}\nforce = [{force}, 0, 0]\n\
             locked = [\"y\", \"z\", \"rx\", \"ry\", \"rz\"]\n",
            mass / (0.3 * 0.36)
        ));
        let exact = force / (mass + column);
        let mut before = 0.0;
        for step in 1..=12 {
            let report = run.step(dt).unwrap();
            assert!(report.passes <= 6, "{} passes", report.passes);
            let acceleration = (speed(&run) - before) / dt;
            before = speed(&run);
            assert!(
                (acceleration / exact - 1.0).abs() < 0.01,
                "{mass} kg, step {step}: {acceleration}, not {exact}"
            );
        }
        // What the water does to the block: what is left of the force.
        let load = run.loads[0].reaction.force[0];
        assert!((load / (-column * exact) - 1.0).abs() < 0.02, "{mass} kg: {load}");
    }
}

/// A block that lies on the bottom of still water is as much lighter as the water that it displaces weighs; dry
/// underneath, it is pressed down by what stands above it. One that a plane of symmetry halves, half as much.
#[test]
fn a_block_on_the_bottom_has_buoyancy() {
    for (y, share) in [(0.45, 1.0), (0.0, 0.5)] {
        let mut run = simulation(&format!(
            "[mesh]\nbox = {{ x = [0, 1], y = [0, 1], z = [0, 1], cells = [10, 10, 10] }}\n\
             [boundaries]\ndefault = \"slip\"\nz_max = \"open\"\n\
             [time]\nend = 1\nstep = 0.01\n\
             [solver]\ntolerance = 1e-8\n\
             [bodies]\nsphere_radius = 0.05\nslip = true\nsettle = 0.05\n\
             [[wall]]\nname = \"floor\"\nplane = {{ point = [0, 0, 0], normal = [0, 0, 1] }}\n\
             [[body]]\nname = \"block\"\ncuboid = [0.4, 0.3, 0.2]\nat = [0.5, {y}, 0.1]\ndensity = 3000\n\
             locked = [\"y\", \"rx\", \"rz\"]\n"
        ));
        for _ in 0..3 {
            run.step(0.01).unwrap();
        }
        let bodies = run.bodies.as_ref().unwrap();
        let hidden = Hidden {
            clusters: &bodies.world.clusters,
            placed: &bodies.placed(),
            loose: &bodies.loose(),
            first: 0,
            mesh: &Bounds { min: Vector3::zeros(), max: Vector3::repeat(1.0) },
        };
        let flow = run.flow.as_ref().unwrap();
        let hidden = hidden.loads(&run.part, &run.cut, &run.material, flow)[0];
        let seen = run.loads[0].reaction;
        let buoyancy = share * 1000.0 * 9.81 * 0.4 * 0.3 * 0.2;
        assert!(seen.force[2] < -2.0 * buoyancy, "{seen:?}");
        let force = hidden.force + Vector3::from(seen.force);
        assert!((force.z / buoyancy - 1.0).abs() < 1e-3, "{force:?}");
        let torque = hidden.torque + Vector3::from(seen.torque);
        // What the plane of symmetry bears is in neither. Torques of what is seen are summed with one point a facet.
        let off =
            if share == 1.0 { force.xy().norm() + torque.norm() / 0.2 } else { torque.y / 0.2 };
        assert!(off.abs() < 1e-2 * buoyancy, "{force:?} {torque:?}");
    }
}

/// What the bodies get is what the water loses: all momentum rows without the walls' terms add up to minus the loads,
/// around the two bodies of a box that is open on all sides.
#[test]
fn momentum_taken_from_the_water_is_given_to_bodies() {
    let mut run = simulation(
        "gravity = [0, 0, 0]\n\
         [mesh]\nbox = { x = [0, 1], y = [0, 1], z = [0, 1], cells = [10, 10, 10] }\njitter = 0.1\n\
         [boundaries]\ndefault = \"open\"\n\
         [water]\nviscosity = 1\n\
         [time]\nend = 1\nstep = 0.01\n\
         [solver]\ntolerance = 1e-10\nstart_tolerance = 1e-10\n\
         [bodies]\nsphere_radius = 0.05\n\
         [[body]]\nname = \"ball\"\nsphere = 0.16\nat = [0.33, 0.4, 0.45]\ndensity = 500\n\
         force = [30, 10, -20]\n\
         [[body]]\nname = \"box\"\ncuboid = [0.2, 0.24, 0.3]\nat = [0.7, 0.6, 0.52]\nturned = [20, 30, 40]\n\
         density = 2000\ntorque = [5, -4, 3]\n",
    );
    for _ in 0..5 {
        run.step(0.01).unwrap();
        let left = run.flow.as_ref().unwrap().momentum_left(&run.part, &run.cut, &run.material);
        let bodies = run.bodies.as_ref().unwrap();
        let (mut force, mut torque) = (Vector3::zeros(), Vector3::zeros());
        for (load, placed) in run.loads.iter().zip(bodies.placed_before()) {
            let f = Vector3::from(load.reaction.force);
            force += f;
            torque += Vector3::from(load.reaction.torque) + placed.pose.position.cross(&f);
        }
        let off = (force + Vector3::from(left.force)).norm() / force.norm();
        assert!(force.norm() > 1.0 && off < 1e-9, "{force:?}: off by {off:e}");
        let off = (torque + Vector3::from(left.torque)).norm() / torque.norm();
        assert!(torque.norm() > 0.1 && off < 1e-9, "{torque:?}: off by {off:e}");
    }
}

/// The energies of fluids and bodies and all that went, after some steps of a small coupled run.
fn ledger(text: &str, steps: u32, dt: f64) -> Vec<Energy> {
    let mut run = simulation(text);
    let energy = |run: &Simulation| run.energy.as_ref().expect("asked for").energy;
    let mut lines = vec![energy(&run)];
    for _ in 0..steps {
        run.step(dt).unwrap();
        lines.push(energy(&run));
    }
    lines
}

/// Water falls on two blocks that are glued to each other and pushes them along: what the fluids lose and
/// the bodies get is accounted for to 2 % of what was exchanged, with the solver's default tolerance.
#[test]
fn energy_is_accounted_for() {
    let text = "[mesh]\nbox = { x = [0, 1], y = [0, 0.3], z = [0, 0.5], cells = [20, 6, 10] }\n\
         [boundaries]\ndefault = \"slip\"\nz_max = \"open\"\n\
         [initial]\nwater = \"x < 0.35 && z < 0.3 || z < 0.06\"\n\
         [air]\n\
         [time]\nend = 1\n\
         [output]\nenergy = true\n\
         [bodies]\nsphere_radius = 0.02\nbond = { strength = 1e4, opening = 1e-3 }\n\
         [[wall]]\nname = \"floor\"\nplane = { point = [0, 0, 0], normal = [0, 0, 1] }\n\
         [[body]]\nname = \"boxes\"\ncuboid = [0.12, 0.24, 0.12]\nat = [0.5, 0.16, 0.065]\n\
         grid = [1, 2, 1]\ndensity = 400\nbonded = true\n";
    let lines = ledger(text, 60, 5e-3);
    let (begin, end) = (lines[0], lines[60]);
    let exchanged = begin.potential - lines.iter().fold(f64::INFINITY, |m, l| m.min(l.potential));
    for (i, line) in lines.iter().enumerate() {
        let off = (line.total() - begin.total()) / exchanged;
        assert!(off.abs() < 0.02, "step {i}: {off:e} of {exchanged} J: {line:?}");
        let off = (line.fluid_total() - begin.fluid_total()) / exchanged;
        assert!(off.abs() < 0.02, "step {i}: {off:e} of {exchanged} J in the fluids: {line:?}");
    }
    assert!(end.bodies > 0.0 && end.account.kinetic > 0.0 && end.viscous > 0.0, "{end:?}");
}

/// A vortex that viscosity alone slows down: what it loses is viscosity's line, and the numerical ones are small beside it.
#[test]
fn a_vortex_loses_its_energy_to_viscosity() {
    let text = "gravity = [0, 0, 0]\n\
         [mesh]\nbox = { x = [0, 1], y = [0, 1], z = [0, 0.1], cells = [32, 32, 1] }\n\
         [boundaries]\ndefault = \"slip\"\n\
         [initial]\nvelocity = [\"sin(pi*x)*cos(pi*y)\", \"-cos(pi*x)*sin(pi*y)\", 0]\n\
         [water]\ndensity = 1\nviscosity = 0.02\n\
         [time]\nend = 1\n[solver]\ntolerance = 1e-8\n[output]\nenergy = true\n";
    let lines = ledger(text, 20, 0.02);
    let (begin, end) = (lines[0], lines[20]);
    let lost = begin.kinetic - end.kinetic;
    let exact =
        begin.kinetic * (1.0 - (-4.0 * 0.02 * std::f64::consts::PI.powi(2) * 0.4_f64).exp());
    assert!((lost / exact - 1.0).abs() < 0.02, "{lost}, not {exact}");
    assert!((end.viscous / exact - 1.0).abs() < 0.02, "{}, not {exact}", end.viscous);
    assert!((end.fluid_total() / begin.fluid_total() - 1.0).abs() < 1e-7, "{end:?}");
}

/// A vortex in a tank that is cut out of the mesh, without viscosity: it would turn for ever. What it loses to the
/// ghost penalty is a matter of time, not of the number of steps.
#[test]
fn shorter_steps_lose_no_more_beside_cut_walls() {
    let text = "gravity = [0, 0, 0]\n\
         [mesh]\nbox = { x = [0, 1], y = [0, 1], z = [0, 0.05], cells = [20, 20, 1] }\n\
         [boundaries]\ndefault = \"slip\"\n\
         [initial]\nvelocity = [\"sin(pi*(x-0.09)/0.82)*cos(pi*(y-0.09)/0.82)\", \
         \"-cos(pi*(x-0.09)/0.82)*sin(pi*(y-0.09)/0.82)\", 0]\n\
         [water]\ndensity = 1\nviscosity = 0\n\
         [time]\nend = 1\n[output]\nenergy = true\n\
         [[obstacle]]\nname = \"tank\"\ncuboid = [0.82, 0.82, 1]\nat = [0.5, 0.5, 0]\n\
         outside_in = true\nwall = \"slip\"\n";
    let ghost = |steps: u32| {
        let lines = ledger(text, steps, 0.4 / f64::from(steps));
        let (begin, end) = (lines[0], lines[steps as usize]);
        end.ghost / begin.kinetic
    };
    let (few, many) = (ghost(10), ghost(80));
    assert!(0.0 < many && many < 1.2 * few, "{few} of its energy in 10 steps, {many} in 80");
}

/// A slab sinks onto another and presses the water between them out: it does not blow up, none is lost, and they
/// come to rest on each other.
#[test]
fn water_between_bodies_that_meet_is_pressed_out() {
    let mut run = simulation(
        "[mesh]\nbox = { x = [0, 1], y = [0, 1], z = [0, 0.9], cells = [10, 10, 12] }\n\
         [boundaries]\ndefault = \"slip\"\nz_max = \"open\"\n\
         [initial]\nwater = \"z < 0.7\"\n[air]\n\
         [time]\nend = 2\nmax_step = 0.02\n\
         [bodies]\nsphere_radius = 0.05\nsettle = 0.05\nstiffness = 1e6\n\
         [[wall]]\nname = \"floor\"\nplane = { point = [0, 0, 0], normal = [0, 0, 1] }\n\
         [[body]]\nname = \"lower\"\ncuboid = [0.5, 0.5, 0.2]\nat = [0.5, 0.5, 0.1]\ndensity = 2500\n\
         [[body]]\nname = \"upper\"\ncuboid = [0.5, 0.5, 0.2]\nat = [0.52, 0.49, 0.42]\ndensity = 2500\n",
    );
    let (mut fastest, mut quickest) = (0.0_f64, 0.0_f64);
    let mut volumes = Vec::new();
    for _ in 0..120 {
        volumes.push(run.step(0.01).unwrap().volume);
        let flow = run.flow.as_ref().unwrap();
        let wet = (0..run.part.n_owned()).filter(|&i| run.material.phase(i) > 0.5);
        fastest = wet.map(|i| Vector3::from(flow.u[i]).norm()).fold(fastest, f64::max);
        let placed = run.bodies.as_ref().unwrap().placed();
        quickest = quickest.max(placed[1].twist.velocity.norm());
    }
    let (begin, end) = (volumes[0], volumes[volumes.len() - 1]);
    // The water under a slab 0.5 m wide is pressed out through a gap that is never narrower than a cell, 0.075 m: at
    // most 1.7 times as fast on all four sides, but not evenly. Here 1.27.
    assert!(quickest > 0.1 && fastest < 3.0 * quickest, "water {fastest}, slab {quickest} m/s");
    let inflow: f64 = volumes[1..].iter().map(|v| v.inflow).sum();
    let lost = end.volume - begin.volume - inflow;
    assert!(lost.abs() < 1e-4 * begin.volume, "{lost} {begin:?} {end:?}");
    // What the mesh does not see any more, a layer of a cell at most, is put back elsewhere.
    assert!(end.corrected.abs() < 0.5 * 0.5 * 0.075, "{end:?}");
    let placed = run.bodies.as_ref().unwrap().placed();
    assert!((placed[1].pose.position.z - 0.3).abs() < 0.01, "{:?}", placed[1]);
    assert!(placed.iter().all(|b| b.twist.velocity.norm() < 0.02), "{placed:?}");
}

/// Ball in a tank, of this density, coupled as asked for.
fn ball(density: f64, coupling: &str) -> Simulation {
    simulation(&format!(
        "[mesh]\nbox = {{ x = [0, 1], y = [0, 1], z = [0, 1], cells = [8, 8, 8] }}\n\
         [boundaries]\ndefault = \"slip\"\n\
         [time]\nend = 1\n\
         [bodies]\nsphere_radius = 0.1\ncoupling = \"{coupling}\"\n\
         [[body]]\nname = \"ball\"\nsphere = 0.2\nat = [0.5, 0.5, 0.5]\ndensity = {density}\n"
    ))
}

/// Light bodies are solved together with the water, heavy ones after it, unless the case says otherwise.
#[test]
fn coupling_is_chosen_by_weight_or_given() {
    let passes = |density: f64, coupling: &str| {
        let mut run = ball(density, coupling);
        (0..3).map(|_| run.step(2e-3).unwrap().passes).collect::<Vec<_>>()
    };
    assert_eq!(passes(2500.0, "auto"), [1, 1, 1]);
    assert!(passes(200.0, "auto").iter().all(|&n| n > 1));
    assert!(passes(2500.0, "strong").iter().all(|&n| n > 1));
    assert_eq!(passes(800.0, "loose"), [1, 1, 1]);
}

/// Steps that are not given follow the flow, the walls and the stiffest contact.
#[test]
fn steps_follow_flow_walls_and_contacts() {
    let text = "gravity = [0, 0, 0]\n\
         [mesh]\nbox = { x = [0, 1], y = [0, 0.5], z = [0, 0.5], cells = [20, 5, 5] }\n\
         [boundaries]\ndefault = \"slip\"\n\
         [time]\nend = 0.05\nfirst_step = 1e-3\n\
         [output]\nfields_every = \"never\"\nbodies_every = \"never\"\n\
         [bodies]\nsphere_radius = 0.05\n\
         [[body]]\nname = \"led\"\ncuboid = [0.15, 0.22, 0.22]\nat = [0.3, 0.25, 0.25]\ndensity = 2500\n\
         led_velocity = [2, 0, 0]\n\
         [[body]]\nname = \"free\"\nsphere = 0.11\nat = [0.8, 0.25, 0.25]\ndensity = 2500\n";
    let mut run = simulation(text);
    let out = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("steps");
    let options = Options { out: out.clone(), restart: None, steps: None, quiet: true };
    run.run(&options).unwrap();
    let history = std::fs::read_to_string(out.join("history.csv")).unwrap();
    let dt = |line: &str| line.split(',').nth(2).unwrap().parse::<f64>().unwrap();
    let steps: Vec<f64> = history.lines().skip(1).map(dt).collect();
    // The led wall crosses half a cell of 0.05 m a step, at 2 m/s.
    let longest = steps.iter().copied().fold(0.0, f64::max);
    assert!(longest <= 0.5 * 0.05 / 2.0 * 1.0001, "{longest} s");
    assert!(steps.len() > 7 && steps.len() < 60, "{} steps", steps.len());
    let bodies = run.bodies.as_ref().unwrap();
    let (sub_step, n) = bodies.sub_steps(longest);
    assert!(sub_step <= 0.1 * bodies.limit() * 1.0001 && n > 1, "{n} sub-steps of {sub_step} s");
    assert!((sub_step * n as f64 / longest - 1.0).abs() < 1e-12);
}

/// A post glued onto a foot that stands, kicked in water at rest without viscosity, trembles faster than the steps: what it
/// was given is all the energy there is, and the water takes it.
#[test]
fn a_glued_post_gains_nothing_from_water_at_rest() {
    let mut run = simulation(
        "[mesh]\nbox = { x = [0, 1], y = [0, 0.4], z = [0, 0.6], cells = [20, 8, 12] }\n\
         [boundaries]\ndefault = \"slip\"\nz_max = \"open\"\n\
         [water]\nviscosity = 0\n\
         [time]\nend = 1\nstep = 0.01\n\
         [bodies]\nsphere_radius = 0.02\n\
         bond = { strength = 1e5, opening = 1e-3 }\n\
         [[body]]\nname = \"post\"\ncuboid = [0.1, 0.2, 0.4]\nat = [0.5, 0.2, 0.2]\n\
         grid = [1, 1, 2]\ndensity = 2400\nbonded = true\nfixed = \"z < 0.2\"\n\
         velocity = [0.1, 0, 0]\n",
    );
    let energy = |run: &Simulation| {
        let account = run.bodies.as_ref().unwrap().account();
        account.kinetic + account.bonds
    };
    let given = energy(&run);
    for step in 1..=20 {
        run.step(0.01).unwrap();
        assert!(energy(&run) < given, "step {step}: {} of {given} J", energy(&run));
    }
    assert!(energy(&run) < 0.1 * given, "{} of {given} J", energy(&run));
}
