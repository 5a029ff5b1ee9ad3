//! Bodies and water together, against exact solutions.

use fcm_fsi::case::{Case, Sources};
use fcm_fsi::coupling::hidden::Hidden;
use fcm_fsi::shape::Bounds;
use fcm_fsi::simulation::Simulation;
use nalgebra::Vector3;
use partition::Communicator;
use std::collections::BTreeMap;
use std::path::PathBuf;

fn start(text: String) -> Simulation {
    let (file, tables) = ("case.toml".into(), BTreeMap::new());
    let case = Case::new(&Sources { file, folder: PathBuf::from("/"), text, tables }).unwrap();
    Simulation::new(case, &Communicator::single()).unwrap()
}

/// Velocity along x of the first body over the last step [m/s].
fn speed(run: &Simulation) -> f64 {
    run.bodies.as_ref().unwrap().placed()[0].twist.velocity.x
}

/// A block pushed along a channel that it fills, with water before it and no pressure at the far end:
/// `a = F / (m + ρ A L)`, exactly, heavy or light.
#[test]
fn a_piston_pushes_its_column() {
    let (force, dt, column) = (100.0, 1e-3, 1000.0 * 0.04 * 0.85);
    for mass in [34.0, 0.34] {
        let mut run = start(format!(
            "gravity = [0, 0, 0]\n\
             [mesh]\nbox = {{ x = [0, 1], y = [0, 0.2], z = [0, 0.2], cells = [20, 4, 4] }}\n\
             [boundaries]\ndefault = \"slip\"\nx_max = \"open\"\n\
             [water]\nviscosity = 0\n\
             [time]\nend = 1\nstep = {dt}\n\
             [solver]\ntolerance = 1e-8\n\
             [bodies]\nsphere_radius = 0.05\nslip = true\n\
             [[body]]\nname = \"piston\"\nbox = [0.3, 0.6, 0.6]\nat = [0, 0.1, 0.1]\n\
             density = {}\nforce = [{force}, 0, 0]\n\
             locked = [\"y\", \"z\", \"rx\", \"ry\", \"rz\"]\n",
            mass / (0.3 * 0.36)
        ));
        let mut speeds = Vec::new();
        for _ in 0..12 {
            let report = run.step(dt).unwrap();
            assert!(report.passes <= 6, "{} passes", report.passes);
            speeds.push(speed(&run));
        }
        let acceleration = (speeds[11] - speeds[3]) / (8.0 * dt);
        let exact = force / (mass + column);
        assert!(
            (acceleration / exact - 1.0).abs() < 0.01,
            "{mass} kg: {acceleration}, not {exact}"
        );
        // What the water does to the block: what is left of the force.
        let load = run.loads[0].reaction.force[0];
        assert!((load / (-column * exact) - 1.0).abs() < 0.02, "{mass} kg: {load}");
    }
}

/// A block that lies on the bottom of still water is as much lighter as the water that it displaces weighs; dry
/// underneath, it is pressed down by what stands above it.
#[test]
fn a_block_on_the_bottom_has_buoyancy() {
    let mut run = start(
        "[mesh]\nbox = { x = [0, 1], y = [0, 1], z = [0, 1], cells = [10, 10, 10] }\n\
         [boundaries]\ndefault = \"slip\"\nz_max = \"open\"\n\
         [time]\nend = 1\nstep = 0.01\n\
         [solver]\ntolerance = 1e-8\n\
         [bodies]\nsphere_radius = 0.05\nslip = true\nsettle = 0.05\n\
         [[wall]]\nname = \"floor\"\nplane = { point = [0, 0, 0], normal = [0, 0, 1] }\n\
         [[body]]\nname = \"block\"\nbox = [0.4, 0.3, 0.2]\nat = [0.5, 0.45, 0.1]\ndensity = 3000\n"
            .into(),
    );
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
    let hidden = hidden.loads(&run.part, &run.cut, &run.material, run.flow.as_ref().unwrap())[0];
    let seen = run.loads[0].reaction;
    let buoyancy = 1000.0 * 9.81 * 0.4 * 0.3 * 0.2;
    assert!(seen.force[2] < -3.0 * buoyancy, "{seen:?}");
    let force = hidden.force + Vector3::from(seen.force);
    assert!((force - Vector3::new(0.0, 0.0, buoyancy)).norm() < 1e-3 * buoyancy, "{force:?}");
    let torque = hidden.torque + Vector3::from(seen.torque);
    // Torques of what is seen are summed with one point a facet.
    assert!(torque.norm() < 1e-2 * buoyancy * 0.2, "{torque:?}");
}

/// What the bodies get is what the water loses: all momentum rows without the walls' terms add up to minus the loads,
/// around the two bodies of a box that is open on all sides.
#[test]
fn momentum_taken_from_the_water_is_given_to_bodies() {
    let mut run = start(
        "gravity = [0, 0, 0]\n\
         [mesh]\nbox = { x = [0, 1], y = [0, 1], z = [0, 1], cells = [10, 10, 10] }\njitter = 0.1\n\
         [boundaries]\ndefault = \"open\"\n\
         [water]\nviscosity = 1\n\
         [time]\nend = 1\nstep = 0.01\n\
         [solver]\ntolerance = 1e-10\nstart_tolerance = 1e-10\n\
         [bodies]\nsphere_radius = 0.05\n\
         [[body]]\nname = \"ball\"\nsphere = 0.16\nat = [0.33, 0.4, 0.45]\ndensity = 500\n\
         force = [30, 10, -20]\n\
         [[body]]\nname = \"box\"\nbox = [0.2, 0.24, 0.3]\nat = [0.7, 0.6, 0.52]\nrotate = [20, 30, 40]\n\
         density = 2000\ntorque = [5, -4, 3]\n"
            .into(),
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
