//! Bodies in water: the same on any number of ranks.

use super::simulation::start;
use fcm_fsi::bodies::Placed;
use fcm_fsi::simulation::Simulation;
use partition::Communicator;

/// A column of water falls onto two glued boxes, light for it, that stand across the ranks' borders.
const CASE: &str = include_str!("../boxes_in_a_wave.toml");

/// Places and energies after some steps, against those of the same run on one rank.
pub fn boxes_in_a_wave(comm: &Communicator) {
    let case = CASE.to_string() + "\n[output]\nenergy = true\n";
    let (mut shared, mut alone) = (start(&case, comm), start(&case, &Communicator::single()));
    for step in 0..12 {
        let dt = 0.004;
        let (a, b) = (shared.step(dt).unwrap(), alone.step(dt).unwrap());
        assert!(a.passes > 1 && a.passes == b.passes, "step {step}: {} {}", a.passes, b.passes);
    }
    compare(&shared, &alone);
    let energies = |run: &Simulation| run.energy.as_ref().unwrap().energy.line();
    let (a, b) = (energies(&shared), energies(&alone));
    for (k, (a, b)) in a.iter().zip(&b).enumerate() {
        assert!(
            (a - b).abs() < 1e-7 * alone.energy.as_ref().unwrap().energy.total(),
            "{k}: {a} {b}"
        );
    }
    let moved = |b: &Placed| b.twist.velocity.norm() > 1e-3;
    assert!(alone.bodies.unwrap().placed().iter().all(moved), "they have not moved");
}

/// Bodies stand and move alike.
fn compare(shared: &Simulation, alone: &Simulation) {
    let placed = |run: &Simulation| run.bodies.as_ref().unwrap().placed();
    for (a, b) in placed(shared).iter().zip(placed(alone)) {
        let apart = (a.pose.position - b.pose.position).norm();
        let speeds = (a.twist.velocity - b.twist.velocity).norm();
        assert!(apart < 1e-9 && speeds < 1e-6, "{apart:e} m, {speeds:e} m/s apart");
    }
}

/// Half a column falls onto a wall of glued blocks that are light for it.
const WALL: &str = include_str!("../wall_in_a_wave.toml");

/// When faces came off, and which, in time. Collective.
fn breaks(run: &Simulation) -> Vec<(f64, u32)> {
    let bodies = run.bodies.as_ref().unwrap();
    let mine: Vec<[f64; 2]> = bodies.breaks.iter().map(|b| [b.t, b.joint.into()]).collect();
    let mut all = run.part.comm.all_gather(&mine).concat();
    all.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    all.into_iter().map(|[t, joint]| (t, joint as u32)).collect()
}

/// The same motion until the first face comes off; then the same ten faces in the same order, but for those that
/// do within two sub-steps of each other.
pub fn a_wall_in_a_wave_breaks_alike(comm: &Communicator) {
    let (mut shared, mut alone) = (start(WALL, comm), start(WALL, &Communicator::single()));
    let dt = 0.008;
    let [mut a, mut b] = [Vec::new(), Vec::new()];
    while a.len().min(b.len()) < 10 {
        assert!(alone.clock.t < 0.6, "{} faces have come off", b.len());
        shared.step(dt).unwrap();
        alone.step(dt).unwrap();
        (a, b) = (breaks(&shared), breaks(&alone));
        if b.is_empty() {
            compare(&shared, &alone);
        }
    }
    let tie = 2.0 * alone.bodies.as_ref().unwrap().sub_steps(dt).0;
    let at = |joint: u32| a[..10].iter().position(|other| other.1 == joint);
    for (i, first) in b[..10].iter().enumerate() {
        assert!(at(first.1).is_some(), "{first:?} is not among {a:?}");
        for then in b[i + 1..10].iter().filter(|then| then.0 - first.0 > tie) {
            assert!(at(first.1) < at(then.1), "{a:?} instead of {b:?}");
        }
    }
}

/// Two balls leave through the open end of a channel, one after the other, and one stays.
const DEBRIS: &str = include_str!("../debris.toml");

/// Bodies that leave are taken out on every rank, at the same time, with the energy that they take along.
pub fn debris_leaves(comm: &Communicator) {
    let (mut shared, mut alone) = (start(DEBRIS, comm), start(DEBRIS, &Communicator::single()));
    let left = |run: &Simulation| run.bodies.as_ref().unwrap().left.clone();
    let begin = alone.bodies.as_ref().unwrap().account().total();
    for _ in 0..40 {
        shared.step(0.01).unwrap();
        alone.step(0.01).unwrap();
        let (a, b) = (left(&shared), left(&alone));
        assert_eq!(a.len(), b.len(), "at {} s", alone.clock.t);
        for (a, b) in a.iter().zip(&b) {
            assert_eq!(a.cluster, b.cluster);
            assert!((a.place - b.place).norm() < 1e-9, "{a:?} {b:?}");
        }
    }
    compare(&shared, &alone);
    let gone = left(&alone);
    assert_eq!(gone.iter().map(|left| left.cluster).collect::<Vec<_>>(), [0, 1]);
    // Outside by its radius: 1 + 2 × 0.12 m, from 0.8 m and 0.4 m at 3 m/s, found at the end of a step.
    for (left, start) in gone.iter().zip([0.8, 0.4]) {
        let reached = (1.24 - start) / 3.0;
        assert!(left.t > reached - 0.01 && left.t < reached + 0.03, "{left:?}, not {reached}");
    }
    let bodies = alone.bodies.as_ref().unwrap();
    let account = bodies.account();
    let taken: f64 = (0..2).map(|c| 0.5 * bodies.world.clusters[c].mass * 9.0).sum();
    assert!((account.total() - begin).abs() < 1e-9 * taken, "{account:?}");
    assert!((account.work / -taken - 1.0).abs() < 0.05 && account.kinetic < 0.01 * taken);
    let still = bodies.placed()[2].twist.velocity.norm();
    assert!(still < 0.3, "the ball that stays: {still} m/s");
}
