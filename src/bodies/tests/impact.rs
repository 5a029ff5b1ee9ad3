//! Bounces, slides, rolls.

use super::*;
use std::f64::consts::PI;

fn zeta(e: f64) -> f64 {
    let ln = e.ln();
    -ln / (PI * PI + ln * ln).sqrt()
}

/// Speed after over speed before, and duration of a contact that begins at speed `v` under gravity `g`:
/// x'' + 2ζω x' + ω²x = g, until x = 0 again.
fn exact(stiffness: f64, mass: f64, e: f64, v: f64, g: f64) -> (f64, f64) {
    let (zeta, omega) = (zeta(e), (stiffness / mass).sqrt());
    let damped = omega * (1.0 - zeta * zeta).sqrt();
    let rest = g / (omega * omega);
    let b = (v - zeta * omega * rest) / damped;
    let x = |t: f64| {
        rest + (-zeta * omega * t).exp() * (b * (damped * t).sin() - rest * (damped * t).cos())
    };
    let (mut from, mut to) = (0.5 * PI / damped, 1.5 * PI / damped);
    for _ in 0..60 {
        let middle = 0.5 * (from + to);
        *(if x(middle) > 0.0 { &mut from } else { &mut to }) = middle;
    }
    let d = 1e-4 * from;
    ((x(from - d) - x(from + d)) / (2.0 * d) / v, from)
}

/// A sphere of 0.2 m, 2600 kg/m³, falls 0.4 m. The formulas without gravity during contact give times of
/// 4.6392, 4.6663, 4.7481, 4.9654 ms and overlaps of 3.925, 3.502, 3.065, 2.604 mm.
#[test]
fn a_sphere_bounces_by_the_formula() {
    for (e, duration, overlap) in [
        (0.9, 4.6392e-3, 3.925e-3),
        (0.7, 4.6663e-3, 3.502e-3),
        (0.5, 4.7481e-3, 3.065e-3),
        (0.3, 4.9654e-3, 2.604e-3),
    ] {
        let mut scene = Scene::new(contact(5e6, e, 0.0), [0.0, 0.0, -9.81]).floor();
        let c = scene.add(&Scene::form(&Shape::sphere(0.1), 0.1), 2600.0, [0.0, 0.0, 0.5]);
        let mass = scene.world.clusters[c].mass;
        let (_, without) = exact(5e6, mass, e, 2.8, 0.0);
        assert!((without / duration - 1.0).abs() < 1e-4, "{without}");
        let h = without / 50.0;
        scene.settings.time_step = Some(h);
        let mut ball = scene.start();
        let (mut deepest, mut up) = (0.0f64, false);
        let mut heights = Vec::new();
        // When it came down to the floor and left it, first.
        let (mut times, mut above) = (Vec::new(), 0.4);
        while heights.len() < 3 && ball.t < 3.0 {
            advance(&mut ball, h);
            let height = ball.state.pose[c].position.z - 0.1;
            if (height > 0.0) != (above > 0.0) {
                times.push(ball.t - h * height / (height - above));
            }
            above = height;
            deepest = deepest.max(0.1 - ball.state.pose[c].position.z);
            let now = ball.state.velocity[c].z > 0.0;
            if up && !now && ball.state.pose[c].position.z > 0.1 {
                heights.push(ball.state.pose[c].position.z);
            }
            up = now;
        }
        let ((_, wanted), lasted) = (exact(5e6, mass, e, 2.8, 9.81), times[1] - times[0]);
        assert!((lasted / wanted - 1.0).abs() < 5e-3, "e {e}: {lasted} s, not {wanted}");
        let mut fall: f64 = 0.4;
        for found in heights {
            let (ratio, _) = exact(5e6, mass, e, (2.0 * 9.81 * fall).sqrt(), 9.81);
            fall *= ratio * ratio;
            let wanted = 0.1 + fall;
            assert!((found / wanted - 1.0).abs() < 5e-3, "e {e}: {found}, not {wanted}");
        }
        // The weight adds m g/K = 0.02 mm.
        let wanted = overlap + 9.81 * mass / 5e6;
        assert!((deepest / wanted - 1.0).abs() < 5e-3, "e {e}: {deepest}, not {wanted}");
    }
}

/// Speed after over speed before of a block dropped without gravity.
fn rebound(size: [f64; 3], e: f64, turn: UnitQuaternion<f64>) -> (f64, f64, f64) {
    let mut scene = Scene::new(contact(1e7, e, 0.0), [0.0; 3]).floor();
    let form = Scene::form(&Shape::cuboid(size), 0.05);
    let reach = form.bounds_at(&Pose { position: V3::zeros(), rotation: turn }).max.z;
    let c = scene.turned(&form, 2000.0, [0.0, 0.0, reach + 0.01], turn);
    scene.moving(c, [0.0, 0.0, -1.0], [0.0; 3]);
    scene.settings.fraction = 0.02;
    let mut block = scene.start();
    // The sphere that touches first, as a point of the block.
    let lowest = form.spheres.iter().map(|s| turn * s.centre).min_by(|a, b| a.z.total_cmp(&b.z));
    let arm = lowest.unwrap() - V3::new(0.0, 0.0, 0.05);
    let mut top: f64 = 0.0;
    for _ in 0..60 {
        advance(&mut block, 1e-3);
        let a = block.account();
        top = top.max(a.kinetic + a.contact);
    }
    let v = block.state.velocity[c] + block.spin(c).cross(&arm);
    (v.z, block.state.velocity[c].z, top / (0.5 * block.world.clusters[c].mass))
}

#[test]
fn a_block_that_lands_flat_on_many_spheres_rebounds_with_e() {
    for e in [0.3, 0.7, 0.9] {
        for size in [[0.2, 0.2, 0.2], [0.4, 0.2, 0.2], [0.6, 0.6, 0.3]] {
            let (_, v, top) = rebound(size, e, UnitQuaternion::identity());
            assert!((v / e - 1.0).abs() < 0.02, "{size:?}, e {e}: {v}");
            assert!(top < 1.0 + 1e-4, "energy never grows: {top}");
        }
    }
}

#[test]
fn a_tilted_block_rebounds_with_e_at_the_point_of_contact() {
    for e in [0.3, 0.7, 0.9] {
        for turn in [(0.5, 0.3, 0.0), (0.3, 0.0, 0.0), (0.2, 0.9, 0.4)] {
            let turn = UnitQuaternion::from_euler_angles(turn.0, turn.1, turn.2);
            let (v, _, top) = rebound([0.4, 0.2, 0.3], e, turn);
            assert!((v / e - 1.0).abs() < 0.05, "e {e}: {v}");
            assert!(top < 1.0 + 1e-4, "energy never grows: {top}");
        }
    }
}

/// Two spheres, oblique: the change of momentum obeys e along the normal and Coulomb's limit across it.
#[test]
fn oblique_impacts_obey_restitution_and_friction() {
    for (angle, e) in [(10.0f64, 0.6), (7.0, 0.9)] {
        let mut scene = Scene::new(contact(1e10, e, angle), [0.0; 3]);
        let form = Scene::form(&Shape::sphere(0.1), 0.1);
        let a = scene.add(&form, 2600.0, [0.0; 3]);
        let b = scene.add(&form, 1300.0, [0.21, 0.0, 0.0]);
        scene.moving(a, [2.0, 3.0, 0.0], [0.0; 3]);
        let mut pair = scene.start();
        // They meet after 1 cm, and the line between them is then almost along x.
        let mut before = 0.0;
        let mut normal = V3::x();
        for _ in 0..2000 {
            advance(&mut pair, 5e-6);
            let x = pair.state.pose[a].position - pair.state.pose[b].position;
            if x.norm() > 0.2 && before == 0.0 {
                normal = -x.normalize();
            } else {
                before = 1.0;
            }
        }
        let relative = pair.state.velocity[a] - pair.state.velocity[b];
        let approach = V3::new(2.0, 3.0, 0.0).dot(&normal);
        assert!((relative.dot(&normal) / approach + e).abs() < 0.02, "{}", relative.dot(&normal));
        let impulse = pair.world.clusters[b].mass * pair.state.velocity[b];
        let (n, t) = (impulse.dot(&normal), (impulse - impulse.dot(&normal) * normal).norm());
        // Fast sliding throughout: the full friction impulse.
        assert!((t / n / angle.to_radians().tan() - 1.0).abs() < 0.03, "{}", t / n);
    }
}

fn on_incline(form: &Arc<Form>, slope: f64, mu: f64, t: f64) -> (f64, f64) {
    let (s, c) = slope.to_radians().sin_cos();
    let law = Contact { stiffness: 1e7, restitution: 0.2, friction: mu };
    let mut scene = Scene::new(law, [9.81 * s, 0.0, -9.81 * c]).floor();
    let height = form.bounds_at(&Pose::identity()).max.z;
    let b = scene.add(form, 2000.0, [0.0, 0.0, height]);
    let mut bodies = scene.start();
    advance(&mut bodies, 0.25);
    let (x, v) = (bodies.state.pose[b].position.x, bodies.state.velocity[b].x);
    advance(&mut bodies, t);
    let way = bodies.state.pose[b].position.x - x;
    // Acceleration after the first settling, and the way.
    (2.0 * (way - v * t) / (t * t), way)
}

#[test]
fn a_block_slides_or_stays_by_coulombs_law() {
    let block = Scene::form(&Shape::cuboid([0.4, 0.4, 0.2]), 0.05);
    let (a, _) = on_incline(&block, 30.0, 0.45, 0.5);
    assert!((a / 1.08193 - 1.0).abs() < 0.01, "{a}");
    let (a, _) = on_incline(&block, 20.0, 0.2, 0.5);
    assert!((a / 1.51154 - 1.0).abs() < 0.01, "{a}");
    let (_, way) = on_incline(&block, 30.0, 0.6, 1.0);
    assert!(way.abs() < 1e-4, "creeps {way} m in a second");
}

#[test]
fn a_sphere_rolls_at_five_sevenths() {
    let ball = Scene::form(&Shape::sphere(0.1), 0.1);
    let (a, _) = on_incline(&ball, 30.0, 0.3, 0.5);
    assert!((a / 3.50357 - 1.0).abs() < 0.01, "{a}");
}
