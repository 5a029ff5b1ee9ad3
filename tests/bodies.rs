//! Whole structures from case files: bending, fragments, energy, restart of the state.

#[path = "common/bodies.rs"]
mod common;

use common::advance;
use fcm_fsi::bodies::cohesion_law::BROKEN;
use fcm_fsi::bodies::neighbours::Partner;
use fcm_fsi::bodies::{Bodies, Break};
use partition::Communicator;
use std::path::Path;

fn start_in(folder: &Path, text: &str) -> Result<Bodies, String> {
    Ok(common::start(folder, text, &Communicator::single())?.0)
}

fn start(text: &str) -> Bodies {
    start_in(Path::new("/"), text).unwrap_or_else(|e| panic!("{e}"))
}

/// Corners of a block are a block, wherever their origin is: the same mass and moments, at the same place.
#[test]
fn a_body_of_points_is_the_body_between_them() {
    let corners = "[[1, 0, 0], [1.4, 0, 0], [1, 0.2, 0], [1.4, 0.2, 0], [1, 0, 0.3], [1.4, 0, 0.3], [1, 0.2, 0.3], \
                   [1.4, 0.2, 0.3], [1.2, 0.1, 0.1]]";
    let with = |shape: &str| {
        start(&format!(
            "[time]
            end = 1
            [bodies]
            sphere_radius = 0.05
            [[body]]
            name = 'rock'
            {shape}
            density = 2000"
        ))
    };
    let block = with("cuboid = [0.4, 0.2, 0.3]\nat = [1.7, 0.1, 0.15]");
    let rock = with(&format!("points = {corners}\nat = [0.5, 0, 0]"));
    let [a, b] = [&block, &rock].map(|bodies| &bodies.world.clusters[0]);
    assert!((a.mass - 48.0).abs() < 1e-9 && (b.mass - 48.0).abs() < 1e-9, "{} {}", a.mass, b.mass);
    let mut moments = [a, b].map(|c| <[f64; 3]>::from(c.moments));
    moments.iter_mut().for_each(|m| m.sort_by(f64::total_cmp));
    (0..3).for_each(|k| assert!((moments[0][k] - moments[1][k]).abs() < 1e-9, "{moments:?}"));
    let places = [&block, &rock].map(|bodies| bodies.state.pose[0].position);
    assert!((places[0] - places[1]).norm() < 1e-9, "{places:?}");
    assert!(b.form.spheres.len() >= 8, "{}", b.form.spheres.len());
}

/// What stands on the floor is not said to overlap; what begins in it, or in another body, is, and how deep.
#[test]
fn a_body_that_begins_inside_something_is_told() {
    let overlap = |rest: &str| {
        let bodies = start(&format!(
            "[time]
            end = 1
            [bodies]
            sphere_radius = 0.05
            [[wall]]
            name = 'ground'
            plane = {{ point = [0, 0, 0], normal = [0, 0, 1] }}
            [[body]]
            name = 'block'
            cuboid = [0.4, 0.4, 0.4]
            density = 2000
            {rest}"
        ));
        bodies.deepest_overlap()
    };
    let standing = overlap("at = [0, 0, 0.2]");
    assert!(standing.is_none_or(|o| o.relative < 1e-9), "{standing:?}");
    let sunk = overlap("at = [0, 0, 0.17]").expect("3 cm deep");
    assert_eq!((sunk.cluster, sunk.partner), (0, Partner::Wall(0)));
    assert!((sunk.depth - 0.03).abs() < 1e-9 && (sunk.relative - 0.6).abs() < 1e-9, "{sunk:?}");
    // Side by side, in by 2 cm.
    let other = "at = [0, 0, 0.2]
        [[body]]
        name = 'other'
        cuboid = [0.4, 0.4, 0.4]
        density = 2000
        at = [0.38, 0, 0.2]";
    let two = overlap(other).expect("2 cm deep");
    assert_eq!((two.cluster, two.partner), (0, Partner::Cluster(1)));
    assert!((two.depth - 0.02).abs() < 1e-9, "{two:?}");
}

/// Largest force of the stamp on a beam of nine cubes of 0.1 m, 0.6 m between supports.
fn bending(points: u32, compression: &str, radius: f64, stiffness: f64) -> f64 {
    let mut beam = start(&format!(
        "gravity = [0, 0, 0]
        [time]
        end = 1
        [bodies]
        sphere_radius = {radius}
        stiffness = {stiffness}
        fraction = 0.8
        friction_angle = 0
        bond = {{ strength = 1e5, opening = 1e-3, points = {points}, compression = '{compression}', damping = 0.2 }}
        [[body]]
        name = 'beam'
        cuboid = [0.9, 0.1, 0.1]
        grid = [9, 1, 1]
        density = 1000
        bonded = true
        locked = ['y', 'rx', 'rz']
        [[body]]
        name = 'supports'
        sphere = 0.05
        at = [-0.3, 0, -0.1]
        density = 1000
        fixed = true
        copies = {{ count = [2, 1, 1], spacing = [0.6, 0, 0] }}
        [[body]]
        name = 'stamp'
        sphere = 0.05
        at = [0, 0, 0.1]
        density = 1000
        led_velocity = [0, 0, -4e-3]"
    ));
    let stamp = beam.state.len() - 1;
    // Past the largest moment: the joint is torn open at its edge.
    let mut peak: f64 = 0.0;
    while beam.joints.largest.iter().all(|&delta| delta < BROKEN) {
        advance(&mut beam, 1e-3);
        peak = peak.max(beam.state.force[stamp].z);
        assert!(beam.t < 3.0, "it gives way: {peak} N");
    }
    peak
}

/// The two joints beside the middle cube carry M = P/2 (0.3 − 0.05); the larger P breaks one of them.
#[test]
fn a_beam_breaks_at_the_moment_of_its_joints() {
    let (strength, b, h, arm) = (1e5, 0.1, 0.1f64, 0.5 * (0.3 - 0.05));
    let linear = |p: f64| p * arm / (strength * b * h * h);
    let found: Vec<f64> = [2, 4, 8, 16].map(|n| linear(bending(n, "bond", 0.02, 1e6))).into();
    assert!((found[2] / 0.286 - 1.0).abs() < 0.03, "M/(σ_c b h²): {found:?}");
    assert!((found[3] / 0.286 - 1.0).abs() < 0.03, "M/(σ_c b h²): {found:?}");
    let error = |i: usize| (found[i] - 0.286).abs();
    assert!(error(2) < error(0), "{found:?}");
    // The hinge is at the centres of the outermost spheres.
    let deep = h - 0.0055556;
    let hinge = |n| bending(n, "contact", 0.0055556, 3e7) * arm / (strength * b * deep * deep);
    let found = [4, 8].map(hinge);
    assert!((found[1] / 0.4523 - 1.0).abs() < 0.03, "M/(σ_c b h²): {found:?}");
    assert!((found[1] - 0.4523).abs() < (found[0] - 0.4523).abs(), "{found:?}");
}

fn fragmented(at: f64) -> Bodies {
    start(&format!(
        "gravity = [0, 0, 0]
        [time]
        end = 1
        [bodies]
        sphere_radius = 0.008
        stiffness = 1e7
        bond = {{ strength = 1e5, opening = 5e-4, points = 3 }}
        [[body]]
        name = 'beam'
        cuboid = [1, 0.2, 0.2]
        density = 2000
        bonded = true
        fragments = {{ size = 0.12, seed = 5 }}
        [[body]]
        name = 'ball'
        sphere = 0.1
        at = [{at}, 0, 0.21]
        density = 4000
        velocity = [0, 0, -6]"
    ))
}

/// Where a beam of random fragments breaks depends on where it is hit; no mass is lost.
#[test]
fn fragments_break_where_they_are_hit() {
    let middle = |at: f64| {
        let mut bodies = fragmented(at);
        let n = bodies.state.len() - 1;
        let mass: f64 = bodies.world.clusters[..n].iter().map(|c| c.mass).sum();
        assert!((mass / 80.0 - 1.0).abs() < 1e-12, "{mass} kg");
        let glued: f64 = bodies.joints.area.iter().sum();
        assert!(n > 15 && bodies.joints.joints.len() > 2 * n && glued > 0.2);
        let e = bodies.account().total();
        advance(&mut bodies, 0.03);
        let now = bodies.account().total();
        assert!((now / e - 1.0).abs() < 0.01, "the account closes: {e}, {now}");
        let broken: Vec<u32> = bodies.breaks.iter().map(|b| b.joint).collect();
        assert!(broken.len() > 3 && broken.len() < bodies.joints.joints.len());
        let x = bodies.breaks.iter().map(|b| b.place.x).sum::<f64>() / broken.len() as f64;
        (broken, x)
    };
    let (left, x_left) = middle(-0.3);
    let (right, x_right) = middle(0.3);
    assert_ne!(left, right);
    assert!(x_left < -0.05 && x_right > 0.05, "{x_left}, {x_right}");
}

/// An L of an STL file in pieces: mass, glue, different paths for different blows, a message where it is open.
#[test]
fn a_solid_of_a_file_is_fragmented() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let outline = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
    let mut triangles: Vec<[[f64; 3]; 3]> = Vec::new();
    let at = |k: usize, z: f64| [outline[k % 6][0], outline[k % 6][1], z];
    for [a, b, c] in [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]] {
        triangles.push([at(a, 0.0), at(c, 0.0), at(b, 0.0)]);
        triangles.push([at(a, 0.75), at(b, 0.75), at(c, 0.75)]);
    }
    for k in 0..6 {
        triangles.push([at(k, 0.0), at(k + 1, 0.0), at(k + 1, 0.75)]);
        triangles.push([at(k, 0.0), at(k + 1, 0.75), at(k, 0.75)]);
    }
    let text_of = |triangles: &[[[f64; 3]; 3]]| {
        let mut text = "solid s\n".to_string();
        for t in triangles {
            text += "facet normal 0 0 0\nouter loop\n";
            t.iter().for_each(|[x, y, z]| text += &format!("vertex {x} {y} {z}\n"));
            text += "endloop\nendfacet\n";
        }
        text + "endsolid s\n"
    };
    std::fs::write(folder.join("angle.stl"), text_of(&triangles)).unwrap();
    std::fs::write(folder.join("open.stl"), text_of(&triangles[1..])).unwrap();
    let case = |file: &str| {
        format!(
            "[time]
            end = 1
            [bodies]
            sphere_radius = 0.04
            bond = {{ strength = 1e6, opening = 1e-3 }}
            [[wall]]
            name = 'ground'
            plane = {{ point = [0, 0, 0], normal = [0, 0, 1] }}
            [[body]]
            name = 'angle'
            surface = '{file}'
            density = 2000
            bonded = true
            fragments = {{ size = 0.5 }}"
        )
    };
    let mut bodies = start_in(folder, &case("angle.stl")).unwrap();
    let mass: f64 = bodies.world.clusters.iter().map(|c| c.mass).sum();
    assert!((mass / (2000.0 * 2.25) - 1.0).abs() < 1e-12, "{mass}");
    assert!(bodies.state.len() > 10 && bodies.joints.joints.len() > bodies.state.len());
    // It stands on the ground as one.
    advance(&mut bodies, 0.05);
    assert!(bodies.breaks.is_empty());

    // Hit on the side of one leg or of the other, it breaks there.
    let hit = |at: [f64; 3], velocity: [f64; 3]| {
        let ball = format!(
            "
            [[body]]
            name = 'ball'
            sphere = 0.2
            at = {at:?}
            velocity = {velocity:?}
            density = 8000"
        );
        let mut bodies = start_in(folder, &(case("angle.stl") + &ball)).unwrap();
        advance(&mut bodies, 0.03);
        let broken: Vec<u32> = bodies.breaks.iter().map(|b| b.joint).collect();
        assert!(broken.len() > 2 && broken.len() < bodies.joints.joints.len(), "{}", broken.len());
        let way = |b: &Break| b.place.x - b.place.y;
        (broken, bodies.breaks.iter().map(way).sum::<f64>())
    };
    let (along_x, x) = hit([1.7, -0.21, 0.375], [0.0, 15.0, 0.0]);
    let (along_y, y) = hit([-0.21, 1.7, 0.375], [15.0, 0.0, 0.0]);
    assert_ne!(along_x, along_y);
    assert!(x > 0.0 && y < 0.0, "{x}, {y}");

    let wrong = start_in(folder, &case("open.stl")).unwrap_err();
    assert!(wrong.starts_with("case.toml:") && wrong.contains("body[1].surface"), "{wrong}");
    assert!(wrong.contains("not closed: 3 edges"), "{wrong}");
}

/// A pile of boulders, dropped: at rest at last, without more energy than it had.
#[test]
fn a_pile_comes_to_rest() {
    let mut pile = start(
        "[time]
        end = 1
        [bodies]
        sphere_radius = 0.04
        stiffness = 1e6
        restitution = 0.3
        [[wall]]
        name = 'ground'
        plane = { point = [0, 0, 0], normal = [0, 0, 1] }
        [[body]]
        name = 'boulders'
        cuboid = [0.3, 0.25, 0.2]
        at = [0, 0, 0.12]
        turned = [4, 7, 12]
        density = 2500
        copies = { count = [1, 1, 4], spacing = [0.01, 0.01, 0.25] }",
    );
    let e = pile.account().total();
    advance(&mut pile, 3.0);
    let rest = pile.account();
    assert!((rest.total() / e - 1.0).abs() < 0.01, "{e}, {rest:?}");
    assert!(rest.kinetic + rest.potential + rest.contact < 0.9 * e);
    assert!(rest.kinetic < 1e-4 * e, "{rest:?}");
}

/// A force that grows with time and a constant torque on a free cube of 8 kg: ½ t² 16 N/s / m, t 0.8 N m / I.
#[test]
fn applied_forces_move_bodies() {
    let mut bodies = start(
        "gravity = [0, 0, 0]
        [time]
        end = 1
        [bodies]
        sphere_radius = 0.05
        [[body]]
        name = 'pushed'
        cuboid = [0.2, 0.2, 0.2]
        density = 1000
        force = ['16 * t', 0, 0]
        torque = [0, 0, 0.8]",
    );
    (0..100).for_each(|_| advance(&mut bodies, 0.01));
    assert!((bodies.state.velocity[0].x - 1.0).abs() < 1e-9, "{:?}", bodies.state.velocity);
    assert!((bodies.state.pose[0].position.x - 1.0 / 3.0).abs() < 1e-4);
    assert!((bodies.spin(0).z - 0.8 / (8.0 * 0.04 / 6.0)).abs() < 1e-9, "{:?}", bodies.spin(0));
    let account = bodies.account();
    assert!((account.kinetic - account.work).abs() < 1e-3 * account.work, "{account:?}");
}

/// A point of a led body goes round with it, whichever body of the entry it belongs to.
#[test]
fn recorded_points_move_with_their_bodies() {
    let text = "
        [time]
        end = 1
        [bodies]
        sphere_radius = 0.05
        [[body]]
        name = 'post'
        cuboid = [0.2, 0.2, 0.2]
        at = [1, 0, 0]
        density = 1000
        led_velocity = ['2 * t', 0, 1]
        led_spin = [0, 0, 0.5]
        copies = { count = [2, 1, 1], spacing = [1, 0, 0] }
        track = [[2.1, 0.1, 0], [1, -0.1, 0.05]]";
    let (mut bodies, tracked) =
        common::start(Path::new("/"), text, &Communicator::single()).unwrap();
    (0..100).for_each(|_| advance(&mut bodies, 0.01));
    let named: Vec<_> = tracked.iter().map(|p| (&*p.name, p.cluster)).collect();
    assert_eq!(named, [("post_1", 1), ("post_2", 0)]);
    let (s, c) = 0.5f64.sin_cos();
    for (point, centre, arm) in
        [(&tracked[0], 2.0, [0.1, 0.1, 0.0]), (&tracked[1], 1.0, [0.0, -0.1, 0.05])]
    {
        let x = bodies.state.pose[point.cluster as usize].to_space(point.local);
        let exact = [centre + 1.0 + c * arm[0] - s * arm[1], s * arm[0] + c * arm[1], 1.0 + arm[2]];
        assert!((x - nalgebra::Vector3::from(exact)).norm() < 1e-6, "{}: {x}", point.name);
    }
}

/// A wall that one body feels and another does not; a glued block comes to rest as one.
#[test]
fn blocks_come_to_rest_on_the_walls_they_feel() {
    let mut bodies = start(
        "[time]
        end = 1
        [bodies]
        sphere_radius = 0.05
        stiffness = 1e6
        restitution = 0.2
        bond = { strength = 1e6, opening = 1e-3, points = 2 }
        [[wall]]
        name = 'shelf'
        plane = { point = [0, 0, 0], normal = [0, 0, 1] }
        [[wall]]
        name = 'ground'
        plane = { point = [0, 0, -1], normal = [0, 0, 1] }
        [[body]]
        name = 'felt'
        cuboid = [0.4, 0.4, 0.4]
        at = [0, 0, 0.21]
        grid = [2, 2, 2]
        bonded = true
        density = 1000
        [[body]]
        name = 'unfelt'
        cuboid = [0.2, 0.2, 0.2]
        at = [2, 0, 0.11]
        density = 1000
        ignores = ['shelf']",
    );
    let begin = bodies.account();
    advance(&mut bodies, 2.0);
    let (end, z) = (bodies.account(), |c: usize| bodies.state.pose[c].position.z);
    assert!((0..8).all(|c| (z(c) - if c < 4 { 0.1 } else { 0.3 }).abs() < 1e-3), "{}", z(0));
    assert!((z(8) + 0.9).abs() < 1e-3, "{}", z(8));
    assert!(end.kinetic < 1e-6 && bodies.breaks.is_empty(), "{end:?}");
    assert!((end.total() / begin.total() - 1.0).abs() < 0.01, "{begin:?} {end:?}");
}

/// What is wrong with bodies is said with line, key and the nearest name.
#[test]
fn wrong_bodies_are_refused() {
    let good = "[time]
end = 1
[bodies]
sphere_radius = 0.02
bond = { strength = 1e5, opening = 1e-3 }
[[wall]]
name = 'ground'
plane = { point = [0, 0, 0], normal = [0, 0, 1] }
[[body]]
name = 'a'
cuboid = [0.1, 0.1, 0.1]
density = 2000
material = 'stone'
ignores = ['ground']
[[contact]]
between = ['stone', 'stone']
friction_angle = 20";
    assert!(start_in(Path::new("/"), good).is_ok());
    for (from, to, said) in [
        (
            "cuboid = [0.1, 0.1, 0.1]",
            "",
            "9: body[1]: needs one of cuboid, sphere, cylinder, points, surface",
        ),
        ("cuboid =", "cubiod =", "11: body[1].cubiod: unknown key; did you mean \"cuboid\"?"),
        ("density = 2000", "", "9: body[1]: the key \"density\" is missing"),
        ("density = 2000", "density = 0", "12: body[1].density: must be greater than 0, is 0"),
        (
            "['ground']",
            "['grund']",
            "14: body[1].ignores[1]: there is no wall \"grund\"; did you mean \"ground\"?",
        ),
        (
            "['stone', 'stone']",
            "['stone', 'stine']",
            "16: contact[1].between[2]: nothing is made of \"stine\"; did you mean \"stone\"?",
        ),
        (
            "friction_angle = 20",
            "friction_angle = 90",
            "17: contact[1].friction_angle: must be below 90 degrees, is 90",
        ),
        (
            "[bodies]\nsphere_radius = 0.02",
            "[bodies]\nsphere_radius = 0.06",
            "3: body[1].sphere_radius: spheres of radius 0.06 do not fit",
        ),
        (
            "sphere_radius = 0.02",
            "sphere_radius = 0.02\ntime_step = 1",
            "5: bodies.time_step: 1.000e0 s is longer than the longest stable step",
        ),
        (
            "sphere_radius = 0.02",
            "sphere_radius = 0.02\nranks = 0",
            "5: bodies.ranks: must be at least 1, is 0",
        ),
        (
            "normal = [0, 0, 1]",
            "normal = [0, 0, 0]",
            "8: wall[1].plane.normal: needs a direction, is 0",
        ),
        (
            "density = 2000",
            "density = 2000\ngrid = [2, 0, 1]",
            "13: body[1].grid[2]: must be at least 1, is 0",
        ),
        (
            "density = 2000",
            "density = 2000\nhollow = true",
            "13: body[1].hollow: leaves blocks out of a grid",
        ),
        (
            "sphere_radius = 0.02",
            "sphere_radius = 0.02\nwalls = ['ground']",
            "5: bodies.walls[1]: another wall is called \"ground\" too",
        ),
        (
            "sphere_radius = 0.02",
            "sphere_radius = 0.02\nwalls = ['z_min']",
            "5: bodies.walls[1]: no boundary or obstacle is called \"z_min\": there is no mesh",
        ),
        ("[[wall]]", "[air]\n[[wall]]", "6: air: has no effect without a mesh"),
    ] {
        let said_now = start_in(Path::new("/"), &good.replace(from, to)).unwrap_err();
        // The file's own table of the key is the next best line.
        assert!(said_now.starts_with("case.toml:"), "{said_now}");
        let expected = said.split_once(' ').map(|(_, rest)| rest).expect("a line and a text");
        assert!(said_now.contains(expected), "{said_now}\nnot {said}");
    }
}

/// A heap of balls against blocks, in a box.
fn heap() -> Bodies {
    start(
        "[time]
        end = 1
        [bodies]
        sphere_radius = 0.02
        stiffness = 1e5
        [[wall]]
        name = 'ground'
        plane = { point = [0, 0, 0], normal = [0, 0, 1] }
        [[wall]]
        name = 'side'
        plane = { point = [-0.06, 0, 0], normal = [1, 0, 0] }
        [[body]]
        name = 'balls'
        sphere = 0.05
        density = 2000
        at = [0, 0, 0.06]
        velocity = [-0.3, 0.1, -1]
        copies = { count = [4, 4, 4], spacing = [0.11, 0.1001, 0.103] }
        [[body]]
        name = 'blocks'
        cuboid = [0.1, 0.08, 0.12]
        density = 2000
        at = [0, 0, 0.6]
        turned = [20, 30, 40]
        velocity = [0.2, 0, -2]
        copies = { count = [2, 2, 1], spacing = [0.2, 0.2, 0] }",
    )
}

/// A record of all ranks' state is enough to go on from, to the same bits.
#[test]
fn a_record_is_enough_to_go_on() {
    for (start, first) in [((|| fragmented(0.1)) as fn() -> Bodies, 0.015), (heap, 0.2)] {
        let mut bodies = start();
        advance(&mut bodies, first);
        let record = bodies.record();
        assert!(!record.keys.is_empty());
        assert!(record.points.is_empty() || record.largest.contains(&BROKEN));
        let mut other = start();
        other.resume(&record);
        advance(&mut bodies, 0.01);
        advance(&mut other, 0.01);
        assert_eq!(bodies.state, other.state);
        assert_eq!(bodies.record(), other.record());
    }
}
