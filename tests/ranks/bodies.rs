//! Bodies move, break and cross borders alike on any number of ranks: the same bits.

use fcm_fsi::bodies::{Bodies, Load};
use fcm_fsi::case::{Case, Sources};
use fcm_fsi::setup::bodies::bodies;
use partition::Communicator;
use std::collections::BTreeMap;

/// All ranks share the bodies, however few they are.
fn start(text: &str, comm: &Communicator) -> Bodies {
    let text = text.replace("[bodies]", "[bodies]\nranks = 16");
    let sources =
        Sources { file: "case.toml".into(), folder: "/".into(), text, tables: BTreeMap::new() };
    let case = Case::new(&sources).unwrap();
    bodies(&case, comm).unwrap().expect("the case has bodies").0
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
    let loads = vec![Load::default(); alone.state.len()];
    let dt = n * alone.time_step();
    for _ in 0..steps {
        alone.advance(dt, &loads);
        shared.advance(dt, &loads);
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
        box = [5, 0.2, 2.4]
        at = [0, 0, 1.2]
        grid = [20, 1, 12]
        density = 2000
        bonded = true
        [[body]]
        name = 'block'
        box = [0.6, 0.6, 0.6]
        at = [0.5, -0.52, 1.2]
        rotate = [20, 10, 30]
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
        box = [0.2, 0.2, 0.2]
        at = [-2, 0, 0.1001]
        rotate = [0, 0, 10]
        density = 2000
        velocity = [8, 0, 0]
        spin = [0, 0, 2]
        copies = { count = [8, 3, 2], spacing = [0.3, 0.3, 0.21] }
        [[body]]
        name = 'left'
        box = [0.2, 0.2, 0.2]
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
