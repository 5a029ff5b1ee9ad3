//! Joints that are pulled, sheared, bent, shaken.

use super::*;
use crate::case::{Compression, Unloading};
use cohesion_law::BROKEN;
use std::f64::consts::TAU;

fn law(strength: f64, opening: f64, damping: f64) -> Law {
    let (unloading, compression) = (Unloading::Curve, Compression::Bond);
    Law { strength, opening, unloading, compression, damping }
}

/// Two cubes of 0.1 m, one on the other, the lower one fixed, the upper one led.
fn pulled(direction: V3, law: Law) -> (f64, f64, Bodies) {
    let mut scene = Scene::new(contact(1e7, 0.5, 0.0), [0.0; 3]);
    let form = Scene::form(&Shape::cuboid([0.1, 0.1, 0.1]), 0.02);
    let a = scene.add(&form, 1000.0, [0.0; 3]);
    let b = scene.add(&form, 1000.0, [0.0, 0.0, 0.1]);
    scene.glue(law, 4);
    assert_eq!(scene.joints.joints.len(), 1);
    let area: f64 = scene.joints.area.iter().sum();
    assert!((area - 0.01).abs() < 1e-15, "tributary areas add up to the face: {area}");
    scene.world.clusters[a].motion = Motion::Fixed;
    let constant = |x: f64| crate::case::Formula::constant(x);
    let speed = direction.normalize() * (1.2 * law.opening);
    scene.world.clusters[b].motion = Motion::Prescribed {
        velocity: Box::new([0, 1, 2].map(|k| constant(speed[k]))),
        spin: Box::new([0.0; 3].map(constant)),
    };
    scene.settings.time_step = Some(2e-5);
    let mut bodies = scene.start();
    let steps = 2000;
    let (mut peak, mut work) = (0.0f64, 0.0);
    for _ in 0..steps {
        advance(&mut bodies, 1.0 / f64::from(steps));
        let pull = -bodies.state.force[b].dot(&direction.normalize());
        peak = peak.max(pull);
        work += pull * speed.norm() / f64::from(steps);
    }
    (peak, work, bodies)
}

#[test]
fn a_joint_carries_its_strength_and_takes_its_energy() {
    for direction in [V3::z(), V3::x(), V3::new(0.3, -0.2, 0.6)] {
        let (peak, work, bodies) = pulled(direction, law(1e4, 1e-3, 0.0));
        assert!((peak / 100.0 - 1.0).abs() < 5e-3, "{direction:?}: peak {peak}");
        assert!((work / (0.5625 * 1e4 * 1e-3 * 0.01) - 1.0).abs() < 5e-3, "{direction:?}: {work}");
        assert!(bodies.joints.largest.iter().all(|&d| d == BROKEN));
        assert_eq!(bodies.breaks.len(), 1);
        let account = bodies.account();
        assert!((account.fracture / (0.5625 * 1e4 * 1e-3 * 0.01) - 1.0).abs() < 1e-12);
    }
}

/// f = √(27 σ_c A/(4 δ_f m))/2π for σ_c = 1e4, δ_f = 1e-3, A = 1e-2, m = 1: 130.76 Hz.
#[test]
fn a_mass_on_a_bond_rings_at_its_frequency() {
    let mut scene = Scene::new(contact(1e7, 0.5, 0.0), [0.0; 3]);
    let form = Scene::form(&Shape::cuboid([0.1, 0.1, 0.1]), 0.02);
    let a = scene.add(&form, 1000.0, [0.0; 3]);
    let b = scene.add(&form, 1000.0, [0.0, 0.0, 0.1]);
    scene.glue(law(1e4, 1e-3, 0.0), 4);
    scene.world.clusters[a].motion = Motion::Fixed;
    assert!((scene.world.clusters[b].mass - 1.0).abs() < 1e-12);
    let frequency = (27.0 * 1e4 * 1e-2 / (4.0 * 1e-3f64)).sqrt() / TAU;
    assert!((frequency - 130.76).abs() < 0.01);
    let amplitude = 0.005e-3;
    scene.moving(b, [0.0, 0.0, amplitude * TAU * frequency], [0.0; 3]);
    let mut bodies = scene.start();
    let (mut crossings, mut last) = (Vec::new(), -1.0);
    let h = 1e-5;
    while crossings.len() < 21 {
        advance(&mut bodies, h);
        let x = bodies.state.pose[b].position.z - 0.1;
        if last < 0.0 && x >= 0.0 && bodies.t > 1e-3 {
            crossings.push(bodies.t - h * x / (x - last));
        }
        last = x;
    }
    let found = 20.0 / (crossings[20] - crossings[0]);
    assert!((found / frequency - 1.0).abs() < 0.01, "{found} Hz");
}

#[test]
fn a_bonded_block_at_rest_stays_at_rest() {
    let mut scene = Scene::new(contact(1e7, 0.5, 30.0), [0.0; 3]);
    let form = Scene::form(&Shape::cuboid([0.1, 0.1, 0.1]), 0.05);
    for i in 0..8 {
        scene.add(&form, 1000.0, [i & 1, i >> 1 & 1, i >> 2].map(|k| 0.1 * f64::from(k)));
    }
    scene.glue(law(1e5, 1e-3, 0.05), 3);
    assert_eq!(scene.joints.joints.len(), 12);
    let before = scene.state.pose.clone();
    let mut bodies = scene.start();
    let h = bodies.time_step();
    advance(&mut bodies, 1e5 * h);
    for (now, then) in bodies.state.pose.iter().zip(&before) {
        assert!((now.position - then.position).norm() < 1e-15);
        assert!(now.rotation.angle_to(&then.rotation) < 1e-14);
    }
}

/// After the bonds broke, the spheres feel each other and nothing else is left.
#[test]
fn broken_clusters_are_loose() {
    let (_, _, mut bodies) = pulled(V3::z(), law(1e4, 1e-3, 0.0));
    let gap = bodies.state.pose[1].position.z - 0.1;
    bodies.world.clusters[1].motion = Motion::FREE;
    bodies.set_motion(1, V3::new(0.0, 0.0, -1.0), V3::zeros());
    advance(&mut bodies, 0.5 * gap);
    assert_eq!(bodies.state.force[1], V3::zeros());
    advance(&mut bodies, 0.01);
    assert!(
        (bodies.state.velocity[1].z / 0.5 - 1.0).abs() < 0.02,
        "{:?}",
        bodies.state.velocity[1]
    );
}
