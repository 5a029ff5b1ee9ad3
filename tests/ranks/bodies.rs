//! Bodies move, break and cross borders alike on any number of ranks: the same bits.

use crate::common::{self, advance};
use fcm_fsi::bodies::Bodies;
use partition::Communicator;
use std::path::Path;

/// All ranks share the bodies, however few they are.
fn start(text: &str, comm: &Communicator) -> Bodies {
    let text = text.replace("[bodies]", "[bodies]\nranks = 16");
    common::start(Path::new("/"), &text, comm).unwrap().0
}

/// Advances both by `steps` steps of `n` sub-steps; `look` after each.
fn side_by_side(
    text: &str,
    comm: &Communicator,
    steps: usize,
    n: f64,
    mut look: impl FnMut(&Bodies, &Bodies),
) -> (Bodies, Bodies) {
    let mut alone = start(text, &Communicator::single());
    let mut shared = start(text, comm);
    let dt = n * alone.time_step();
    for _ in 0..steps {
        advance(&mut alone, dt);
        advance(&mut shared, dt);
        look(&alone, &shared);
    }
    (alone, shared)
}

fn assert_alike(alone: &Bodies, shared: &Bodies, comm: &Communicator) {
    let owned = shared.ranks.owned();
    assert_eq!(comm.sum_u64(owned.len() as u64), alone.state.len() as u64, "each is owned once");
    for &c in owned {
        let c = c as usize;
        let (a, b) = (&alone.state, &shared.state);
        assert_eq!(a.pose[c], b.pose[c], "pose of {c} at {}", alone.t);
        assert_eq!(a.velocity[c], b.velocity[c], "velocity of {c}");
        assert_eq!(a.angular_momentum[c], b.angular_momentum[c], "angular momentum of {c}");
    }
}

/// A wall of 240 blocks is hit; 1000 sub-steps around the impact, and more after it.
pub fn a_wall_breaks_alike(comm: &Communicator) {
    let text = "
        [time]
        end = 1
        [bodies]
        sphere_radius = 0.05
        stiffness = 1e8
        bond = { strength = 2e5, opening = 1e-3, points = 3 }
        [[wall]]
        name = 'ground'
        plane = { point = [0, 0, 0], normal = [0, 0, 1] }
        [[body]]
        name = 'wall'
        cuboid = [5, 0.2, 2.4]
        at = [0, 0, 1.2]
        grid = [20, 1, 12]
        density = 2000
        bonded = true
        [[body]]
        name = 'block'
        cuboid = [0.6, 0.6, 0.6]
        at = [0.5, -0.52, 1.2]
        turned = [20, 10, 30]
        density = 2500
        velocity = [0, 10, 0]";
    let (alone, shared) = side_by_side(text, comm, 30, 100.0, |a, s| assert_alike(a, s, comm));
    let mine: Vec<u64> = shared.breaks.iter().map(|b| b.joint.into()).collect();
    let mut broken = comm.all_gather(&mine).concat();
    broken.sort_unstable();
    let mut expected: Vec<u64> = alone.breaks.iter().map(|b| b.joint.into()).collect();
    expected.sort_unstable();
    assert_eq!(broken, expected);
    assert!(broken.len() >= 20, "{} faces broke", broken.len());
    let (a, s) = (alone.account(), shared.account());
    assert!((a.total() - s.total()).abs() < 1e-9 * a.total(), "{a:?} {s:?}");
    assert!((a.friction - s.friction).abs() < 1e-9 * a.friction);
}

/// Loose blocks and balls fly through each other across all borders: none forgets what it touches.
pub fn loose_bodies_cross_borders(comm: &Communicator) {
    let text = "
        gravity = [0, 0, -9.81]
        [time]
        end = 1
        [bodies]
        sphere_radius = 0.05
        stiffness = 1e7
        [[wall]]
        name = 'ground'
        plane = { point = [0, 0, 0], normal = [0, 0, 1] }
        [[body]]
        name = 'right'
        cuboid = [0.2, 0.2, 0.2]
        at = [-2, 0, 0.1001]
        turned = [0, 0, 10]
        density = 2000
        velocity = [8, 0, 0]
        spin = [0, 0, 2]
        copies = { count = [8, 3, 2], spacing = [0.3, 0.3, 0.21] }
        [[body]]
        name = 'left'
        cuboid = [0.2, 0.2, 0.2]
        at = [0.8, 0.1, 0.1001]
        density = 2000
        velocity = [-1, 0, 0]
        copies = { count = [8, 3, 2], spacing = [0.3, 0.3, 0.21] }
        [[body]]
        name = 'balls'
        sphere = 0.1
        at = [-1.9, -0.22, 0.1001]
        density = 2000
        velocity = [6, 0.5, 0]
        copies = { count = [10, 1, 2], spacing = [0.25, 0, 0.2002] }";
    let mut moved = 0;
    let mut before: Vec<bool> = Vec::new();
    let (alone, shared) = side_by_side(text, comm, 150, 50.0, |alone, shared| {
        assert_alike(alone, shared, comm);
        let now = shared.ranks.is_owned();
        moved += before.iter().zip(now).filter(|(b, n)| **n && !**b).count();
        before = now.to_vec();
    });
    if comm.size() > 1 {
        assert!(comm.sum_u64(moved as u64) > 20, "clusters change ranks");
    }
    // They have gone far from where they were shared out at first.
    let most = comm.max(shared.ranks.owned().len() as f64);
    assert!(most <= 1.6 * alone.state.len() as f64 / comm.size() as f64, "one rank has {most}");
}

/// Blocks and balls fall onto a step in a tank: its walls, spread over the ranks, are boundaries of the mesh.
pub fn bodies_fall_on_boundaries(comm: &Communicator) {
    let text = "
        [mesh]
        box = { x = [0, 2], y = [0, 1], z = [0, 1], cells = [8, 4, 4] }
        holes = [{ name = 'step', x = [0.5, 1], y = [0.25, 0.75], z = [0, 0.25] }]
        [boundaries]
        default = 'slip'
        [time]
        end = 1
        [[obstacle]]
        name = 'pier'
        cylinder = [0.2, 1]
        at = [1.5, 0.4, 0.5]
        [bodies]
        sphere_radius = 0.03
        stiffness = 1e6
        walls = ['z_min', 'x_min', 'x_max', 'y_min', 'y_max', 'step', 'pier']
        [[body]]
        name = 'blocks'
        cuboid = [0.2, 0.15, 0.12]
        at = [0.3, 0.3, 0.4]
        turned = [20, 30, 10]
        density = 2000
        copies = { count = [5, 2, 2], spacing = [0.31, 0.33, 0.24] }
        [[body]]
        name = 'balls'
        sphere = 0.05
        at = [0.2, 0.2, 0.8]
        velocity = [1, 0, 0]
        density = 2000
        copies = { count = [12, 5, 1], spacing = [0.12, 0.13, 0] }";
    let (alone, _) = side_by_side(text, comm, 40, 100.0, |a, s| assert_alike(a, s, comm));
    let (e, inside) = (alone.account(), |x: f64, end: f64| (-0.01..end + 0.01).contains(&x));
    assert!(e.friction > 0.0 && e.dashpots > 0.0, "{e:?}");
    for pose in &alone.state.pose {
        let x = pose.position;
        assert!(inside(x.x, 2.0) && inside(x.y, 1.0) && x.z > 0.0, "{x}");
        let in_step = inside(x.x - 0.5, 0.5) && inside(x.y - 0.25, 0.5) && x.z < 0.25;
        assert!(!in_step && (x.x - 1.5).hypot(x.y - 0.4) > 0.2, "{x}");
    }
}
