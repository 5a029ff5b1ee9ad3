//! Boundaries of the mesh and obstacles as walls of bodies, against exact results.

#[path = "common/bodies.rs"]
mod common;

use common::advance;
use fcm_fsi::bodies::Bodies;
use fcm_fsi::bodies::walls::WallSurface;
use partition::Communicator;
use std::path::Path;

fn start(text: &str) -> Bodies {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    common::start(folder, text, &Communicator::single()).unwrap_or_else(|e| panic!("{e}")).0
}

/// A tank with a step, a pier that stands in it and a sphere in its own shell; balls fly at all of them.
const TANK: &str = "
gravity = [0, 0, 0]
[mesh]
box = { x = [0, 2], y = [0, 1], z = [0.1, 1.1], cells = [8, 4, 4] }
holes = [{ name = 'step', x = [0.5, 1], y = [0.25, 0.75], z = [0.1, 0.35] }]
[boundaries]
default = 'slip'
[time]
end = 1
[[obstacle]]
name = 'pier'
cuboid = [0.3, 0.3, 1]
turned = [0, 0, 45]
at = [1.5, 0.5, 0.5]
[[obstacle]]
name = 'shell'
sphere = 1
at = [0, 0, 9]
outside_in = true
[bodies]
sphere_radius = 0.02
stiffness = 1e5
restitution = 0.7
fraction = 0.02
walls = [WALL]
[[body]]
name = 'ball'
sphere = 0.05
density = 1000
";

/// Speed after over before, and the direction of flight, exact for each kind of wall.
#[test]
fn balls_bounce_off_boundaries_and_obstacles() {
    for (wall, at, velocity, is_plane) in [
        ("z_min", [0.2, 0.3, 0.2], [0.0, 0.0, -1.0], true),
        ("x_max", [1.9, 0.3, 0.5], [1.0, 0.0, 0.0], true),
        // The hole's top, its side, and an inner edge of its mesh on the top.
        ("step", [0.6, 0.4, 0.45], [0.0, 0.0, -1.0], false),
        ("step", [0.4, 0.4, 0.2], [1.0, 0.0, 0.0], false),
        ("step", [0.75, 0.5, 0.45], [0.0, 0.0, -1.0], false),
        // A face and an upright edge of the pier.
        ("pier", [1.3, 0.3, 0.5], [0.5f64.sqrt(), 0.5f64.sqrt(), 0.0], false),
        ("pier", [1.5 - 0.15 * 2f64.sqrt() - 0.1, 0.5, 0.5], [1.0, 0.0, 0.0], false),
        ("shell", [0.0, 0.0, 9.9], [0.0, 0.0, 1.0], false),
        ("shell", [-0.54, 0.0, 9.72], [-0.6, 0.0, 0.8], false),
    ] {
        let text = TANK.replace("WALL", &format!("'{wall}'"));
        let mut bodies = start(&format!("{text}at = {at:?}\nvelocity = {velocity:?}"));
        let plane = matches!(bodies.world.walls[0].surface, WallSurface::Plane { .. });
        assert_eq!(plane, is_plane, "{wall}");
        advance(&mut bodies, 0.15);
        let after = -bodies.state.velocity[0];
        let exact = 0.7 * nalgebra::Vector3::from(velocity);
        assert!((after - exact).norm() < 1e-3, "{wall} at {at:?}: {after} {exact}");
    }
}

/// A ball lies on a slope of 20° and rolls: `5/7 g sin α`, and slides where friction is too small:
/// `g (sin α − μ cos α)`; on a plane, on the same plane as terrain, as a boundary of the mesh, as an obstacle.
#[test]
fn a_ball_rolls_down_terrain_as_down_a_plane() {
    // z = −x tan 20° at the cells' centres 0, 0.5, … 3.
    let slope = 20f64.to_radians();
    let row: String =
        (0..7).map(|i| format!(" {:.17}", -0.5 * f64::from(i) * slope.tan())).collect();
    let header = "ncols 7\nnrows 3\nxllcorner -0.25\nyllcorner -0.75\ncellsize 0.5\n";
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    std::fs::write(folder.join("slope.asc"), format!("{header}{row}\n{row}\n{row}\n")).unwrap();
    let common = |friction: f64, walls: &str, rest: &str| {
        let r = 0.1 - 1e-6;
        format!(
            "[time]
            end = 1
            [bodies]
            sphere_radius = 0.02
            stiffness = 4e6
            friction_angle = {friction}
            {walls}
            {rest}
            [[body]]
            name = 'ball'
            sphere = 0.1
            density = 1000
            at = [{}, 0.01, {}]",
            0.4 + r * slope.sin(),
            -0.4 * slope.tan() + r * slope.cos()
        )
    };
    let plane = format!(
        "[[wall]]\nname = 'ground'\nplane = {{ point = [0, 0, 0], normal = [{}, 0, {}] }}",
        slope.sin(),
        slope.cos()
    );
    let terrain = "[[obstacle]]\nname = 'hill'\nterrain = 'slope.asc'";
    let cuboid = format!(
        "[[obstacle]]\nname = 'block'\ncuboid = [8, 2, 2]\nturned = [0, 20, 0]\nat = [{}, 0, {}]",
        -slope.sin(),
        -slope.cos()
    );
    let g = 9.81;
    let mu = 2f64.to_radians().tan();
    for (friction, exact) in
        [(30.0, 5.0 / 7.0 * g * slope.sin()), (2.0, g * (slope.sin() - mu * slope.cos()))]
    {
        let roll = |walls: &str, rest: &str| {
            let mut ball = start(&common(friction, walls, rest));
            advance(&mut ball, 0.1);
            let first = ball.state.velocity[0];
            advance(&mut ball, 0.5);
            let way = ball.state.velocity[0] - first;
            assert!(ball.state.velocity[0].y.abs() < 1e-9);
            (way.norm() / 0.5, ball.state.pose[0].position)
        };
        let (a, x) = roll("", &plane);
        assert!((a / exact - 1.0).abs() < 2e-3, "{friction}°: {a} {exact}");
        for (walls, rest) in [("walls = ['hill']", terrain), ("walls = ['block']", &*cuboid)] {
            let (b, y) = roll(walls, rest);
            assert!((b / a - 1.0).abs() < 1e-6, "{rest}: {b}, on a plane {a}");
            assert!((y - x).norm() < 1e-6, "{rest}: {y} {x}");
        }
    }
}

/// Two materials have a restitution of their own, on walls with a table and without, among bodies too.
#[test]
fn pairs_of_materials_have_their_own_contact() {
    let text = "
        gravity = [0, 0, 0]
        [time]
        end = 1
        [[obstacle]]
        name = 'block'
        cuboid = [20, 2, 2]
        at = [0, 0, -1]
        [bodies]
        sphere_radius = 0.02
        stiffness = 1e5
        restitution = 0.7
        fraction = 0.02
        walls = ['block']
        [[wall]]
        name = 'anvil'
        plane = { point = [0, 2, 0], normal = [0, -1, 0] }
        material = 'iron'
        [[contact]]
        between = ['iron', 'rubber']
        restitution = 0.9
        [[contact]]
        between = ['rubber', 'rubber']
        restitution = 0.4
        [[contact]]
        between = ['plain', 'rubber']
        restitution = 0.5
        ";
    let ball = |name: &str, material: &str, at: [f64; 3], velocity: [f64; 3]| {
        format!(
            "[[body]]\nname = '{name}'\nsphere = 0.05\ndensity = 1000\nmaterial = '{material}'\n\
             at = {at:?}\nvelocity = {velocity:?}\n"
        )
    };
    let mut bodies = start(
        &[
            text.to_string(),
            // At the anvil, at the block, at each other.
            ball("a", "rubber", [0.0, 1.9, 1.0], [0.0, 1.0, 0.0]),
            ball("b", "stone", [1.0, 1.9, 1.0], [0.0, 1.0, 0.0]),
            ball("c", "rubber", [2.0, 0.0, 0.1], [0.0, 0.0, -1.0]),
            ball("d", "iron", [3.0, 0.0, 0.1], [0.0, 0.0, -1.0]),
            ball("e", "rubber", [4.0, 0.0, 0.9], [0.5, 0.0, 0.0]),
            ball("f", "rubber", [4.2, 0.0, 0.9], [-0.5, 0.0, 0.0]),
        ]
        .concat(),
    );
    advance(&mut bodies, 0.2);
    let v = &bodies.state.velocity;
    let found = [-v[0].y, -v[1].y, v[2].z, v[3].z, v[5].x - v[4].x];
    for (found, e) in found.into_iter().zip([0.9, 0.7, 0.5, 0.7, 0.4]) {
        assert!((found - e).abs() < 1e-3, "{found}, not {e}");
    }
}
