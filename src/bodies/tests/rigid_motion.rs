//! Tops, momentum, energy.

use super::*;

fn free() -> Scene {
    Scene::new(contact(1e3, 1.0, 0.0), [0.0; 3])
}

/// I = (1, 1, 2): seen from the body, ω turns about the axis at (I3 − I1)/I1 ω3 = 1 rad/s.
#[test]
fn a_symmetric_top_precesses_at_the_exact_rate() {
    let mut scene = free();
    let form = Scene::form(&Shape::cuboid([1.0, 1.0, 1.0]), 0.2);
    let c = scene.add(&form, 1.0, [0.0; 3]);
    scene.world.clusters[c].moments = V3::new(1.0, 1.0, 2.0);
    scene.moving(c, [0.0; 3], [0.1, 0.0, 1.0]);
    scene.settings.time_step = Some(2e-4);
    let mut top = scene.start();
    let (l, e) = (top.state.angular_momentum[c], top.account().kinetic);
    let turns = 100.0;
    let t_end = turns * std::f64::consts::TAU;
    advance(&mut top, t_end);
    assert!((top.state.angular_momentum[c] - l).norm() < 1e-12, "L in space is constant");
    assert!((top.account().kinetic / e - 1.0).abs() < 1e-6);
    assert!((top.state.pose[c].rotation.norm() - 1.0).abs() < 1e-10);
    let omega = top.state.pose[c].rotation.inverse_transform_vector(&top.spin(c));
    // After whole turns the transverse ω is where it was.
    let angle = omega.y.atan2(omega.x);
    assert!(angle.abs() < 1e-3, "off by {angle} rad after {turns} turns");
    assert!((omega.xy().norm() - 0.1).abs() < 1e-6);
}

/// Three different moments: no closed form here, but energy and |L| stay over 100 turns.
#[test]
fn a_tumbling_body_keeps_its_energy() {
    let mut scene = free();
    let form = Scene::form(&Shape::cuboid([1.0, 2.0, 3.0]), 0.2);
    let c = scene.add(&form, 1.0, [0.0; 3]);
    scene.moving(c, [0.3, 0.0, 0.0], [0.02, 1.0, 0.01]);
    scene.settings.time_step = Some(2e-3);
    let mut body = scene.start();
    let e = body.account().kinetic;
    let mut worst: f64 = 0.0;
    for _ in 0..628 {
        advance(&mut body, 1.0);
        worst = worst.max((body.account().kinetic / e - 1.0).abs());
    }
    assert!(worst < 1e-6, "{worst}");
}

/// To 1e-12 of `scale` [kg m/s].
fn assert_same(then: &Momentum, now: &Momentum, scale: f64) {
    let off = [now.linear - then.linear, now.angular - then.angular].map(|d| d.norm() / scale);
    assert!(off.iter().all(|&d| d < 1e-12), "{off:?}");
}

/// Eight glued blocks that turn, one of another four hits them: some faces break.
#[test]
fn glued_groups_keep_their_momentum() {
    let mut scene = Scene::new(contact(1e7, 0.5, 30.0), [0.0; 3]);
    let form = Scene::form(&Shape::cuboid([0.1, 0.1, 0.1]), 0.025);
    let turn = |x: V3| V3::new(0.3, -0.2, 0.5).cross(&x);
    for i in 0..8 {
        let x = [i & 1, i >> 1 & 1, i >> 2].map(|k| 0.1 * f64::from(k));
        let c = scene.add(&form, 1000.0, x);
        scene.moving(c, turn(x.into()).into(), [0.3, -0.2, 0.5]);
    }
    let (unloading, compression) = (crate::case::Unloading::Damage, crate::case::Compression::Bond);
    let law = Law { strength: 3e4, opening: 1e-3, unloading, compression, damping: 0.05 };
    scene.glue(law, 3);
    for k in 0..4 {
        let c = scene.add(&form, 1000.0, [0.23 + 0.15 * f64::from(k), 0.03, 0.12]);
        scene.moving(c, [-3.0, 0.1, 0.0], [0.0, 1.0, 0.0]);
    }
    let mut group = scene.start();
    let (begin, e) = (group.momentum(), group.account());
    advance(&mut group, 0.5);
    let broken = group.breaks.len();
    assert!(broken > 0 && broken < 12, "{broken} of 12 faces");
    assert_same(&begin, &group.momentum(), begin.linear.norm());
    let lost = (group.account().total() - e.total()).abs() / e.kinetic;
    assert!(lost < 1e-2, "the account closes: {lost} {:?}", group.account());
}

#[test]
fn isolated_groups_keep_their_momentum() {
    let mut scene = Scene::new(contact(1e8, 0.5, 30.0), [0.0; 3]);
    let form = Scene::form(&Shape::cuboid([0.4, 0.4, 0.4]), 0.1);
    let mut seed = 7u64;
    let mut random = || {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    for i in 0..27 {
        let x = [i % 3, i / 3 % 3, i / 9].map(|k| f64::from(k) * 0.7 - 0.7);
        let turn = UnitQuaternion::from_euler_angles(random(), random(), random());
        let c = scene.turned(&form, 1000.0, x.map(|x| x + 1.0), turn);
        let towards = x.map(|x| -3.0 * x);
        scene.moving(c, towards, [random(), random(), random()]);
    }
    let mut group = scene.start();
    let begin = group.momentum();
    let e = group.account();
    advance(&mut group, 0.5);
    let now = group.account();
    assert!(
        now.dashpots > 0.05 * e.kinetic && now.friction > 0.01 * e.kinetic,
        "they hit: {now:?}"
    );
    let scale: f64 = group.world.clusters[0].mass * 27.0;
    assert_same(&begin, &group.momentum(), scale);
    let lost = (now.total() - e.total()).abs() / e.kinetic;
    assert!(lost < 1e-2, "the account closes: {lost} {now:?}");
}

#[test]
fn what_was_saved_comes_back() {
    let mut scene = Scene::new(contact(1e5, 0.5, 30.0), [0.0, 0.0, -9.81]).floor();
    let form = Scene::form(&Shape::cuboid([0.4, 0.4, 0.4]), 0.1);
    for k in 0..3 {
        scene.turned(
            &form,
            1000.0,
            [0.03 * f64::from(k), 0.0, 0.25 + 0.45 * f64::from(k)],
            UnitQuaternion::from_euler_angles(0.1, 0.2, 0.0),
        );
    }
    let mut bodies = scene.start();
    advance(&mut bodies, 0.2);
    let saved = bodies.save();
    advance(&mut bodies, 0.1);
    let once = bodies.state.clone();
    bodies.restore(&saved);
    advance(&mut bodies, 0.1);
    assert_eq!(bodies.state, once);
}

#[test]
fn locked_degrees_of_freedom_stay() {
    let mut scene = Scene::new(contact(1e5, 0.5, 30.0), [1.0, -2.0, -9.81]).floor();
    let form = Scene::form(&Shape::cuboid([0.4, 0.2, 0.6]), 0.1);
    let turn = UnitQuaternion::from_euler_angles(0.0, 0.3, 0.0);
    let c = scene.turned(&form, 1000.0, [0.0, 0.0, 0.5], turn);
    scene.world.clusters[c].motion =
        Motion::Free { locked: [false, true, false, true, false, true] };
    let mut bodies = scene.start();
    advance(&mut bodies, 1.0);
    let pose = &bodies.state.pose[c];
    assert_eq!(pose.position.y, 0.0);
    assert!(pose.position.x.abs() > 0.01, "the others move");
    let axis = pose.rotation * V3::y();
    assert!((axis - V3::y()).norm() < 1e-12);
}
