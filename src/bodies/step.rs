//! All clusters, and their sub-cycle to the end of a flow step.

use super::account::{Account, Momentum};
use super::cluster::{Inertia, Motion, State};
use super::cohesion::{Break, Joints};
use super::contact::{self, Twist, World};
use super::leaving::Left;
use super::motion::{self, Load};
use super::neighbours::{Neighbours, Touch};
use super::ownership::{Luggage, Ownership};
use super::time_step::longest_stable;
use nalgebra::Vector3;

/// How sub-steps are chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Length of a sub-step [s]; `None`: `fraction` of the longest stable one.
    pub time_step: Option<f64>,
    /// Of the longest stable sub-step.
    pub fraction: f64,
    /// Reach of neighbour lists over the smallest sphere's radius.
    pub skin: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { time_step: None, fraction: 0.1, skin: 0.4 }
    }
}

/// A sub-step that was given is too long.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{given:.3e} s is longer than the longest stable step, {limit:.3e} s")]
pub struct Unstable {
    /// [s]
    pub given: f64,
    /// [s]
    pub limit: f64,
}

/// Where a cluster stands and how it got there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// Now.
    pub pose: crate::shape::Pose,
    /// Mean over the last `advance`: contact noise within it is not there.
    pub twist: Twist,
    /// At its end.
    pub end: Twist,
}

/// Clusters, walls and joints in motion.
#[derive(Debug)]
pub struct Bodies {
    /// What does not change.
    pub world: World,
    /// Where clusters stand.
    pub state: State,
    /// Glued faces.
    pub joints: Joints,
    /// Joints that came off here, in time.
    pub breaks: Vec<Break>,
    /// Clusters that were taken out, in time, the same on every rank.
    pub left: Vec<Left>,
    /// Which clusters this rank moves.
    pub ranks: Ownership,
    /// Now [s].
    pub t: f64,
    /// Energy that went on this rank (what is there now: `account`).
    spent: Account,
    /// Longest sub-step wanted [s].
    time_step: f64,
    /// Longest stable one [s].
    limit: f64,
    pub(super) near: Neighbours,
    /// Of each cluster; it changes when one is let go.
    inertia: Vec<Inertia>,
    /// Sub-steps until the lists must be looked at.
    unchecked: u32,
    twists: Vec<Twist>,
    /// Poses when the last `advance` began.
    before: Vec<crate::shape::Pose>,
    /// Length of the last `advance` [s].
    last: f64,
    /// Whether clusters touched something in it while they were this rank's.
    touched: Vec<bool>,
    /// Joints with a cluster of this rank and an unbroken point.
    active: Vec<u32>,
    cracked: Vec<u32>,
    loads: Vec<Load>,
}

/// Everything later steps depend on.
#[derive(Clone, Debug)]
pub struct Saved {
    state: State,
    near: Neighbours,
    unchecked: u32,
    largest: Vec<f64>,
    alive: Vec<u32>,
    active: Vec<u32>,
    breaks: usize,
    ranks: Ownership,
    t: f64,
    spent: Account,
    before: Vec<crate::shape::Pose>,
    last: f64,
}

/// Between two looks at the lists a surface is taken to get at most this much faster.
const FASTER: f64 = 2.0;
/// Sub-steps between two times that velocities are reduced while all comes to rest.
const SETTLING: f64 = 20.0;
/// Sub-steps between two looks at the lists, at most.
const UNCHECKED: f64 = 50.0;

impl Bodies {
    /// From clusters and joints as they stand. Collective.
    ///
    /// # Errors
    /// A given sub-step is too long.
    pub fn new(
        world: World,
        state: State,
        mut joints: Joints,
        settings: Settings,
        ranks: Ownership,
    ) -> Result<Self, Unstable> {
        joints.sort();
        let limit = longest_stable(&world, &joints);
        let time_step = settings.time_step.unwrap_or(settings.fraction * limit);
        if time_step > limit {
            return Err(Unstable { given: time_step, limit });
        }
        let radii = world.clusters.iter().flat_map(|c| c.form.spheres.iter().map(|s| s.radius));
        let smallest = radii.fold(f64::INFINITY, f64::min);
        let n = state.len();
        let mut bodies = Self {
            near: Neighbours::new(settings.skin * smallest.min(f64::MAX)),
            inertia: Vec::new(),
            before: state.pose.clone(),
            twists: vec![Twist::default(); n],
            loads: vec![Load::default(); n],
            world,
            state,
            joints,
            breaks: Vec::new(),
            left: Vec::new(),
            ranks,
            t: 0.0,
            spent: Account::default(),
            time_step,
            limit,
            unchecked: 0,
            last: 0.0,
            touched: vec![false; n],
            active: Vec::new(),
            cracked: Vec::new(),
        };
        bodies.weigh();
        bodies.refresh();
        bodies.predict(0.0);
        bodies.ranks.update_ghosts(&mut bodies.state.pose, &mut bodies.twists);
        bodies.add_forces(0.0);
        Ok(bodies)
    }

    /// Longest stable sub-step [s].
    pub fn limit(&self) -> f64 {
        self.limit
    }

    /// Longest sub-step taken [s].
    pub fn time_step(&self) -> f64 {
        self.time_step
    }

    /// Length and number of sub-steps in a step of `dt` [s].
    pub fn sub_steps(&self, dt: f64) -> (f64, u64) {
        let n = (dt / self.time_step * (1.0 - 1e-9)).ceil().max(1.0);
        (dt / n, n as u64)
    }

    /// Moves all clusters on by `dt` under constant `loads` (one for each cluster, valid for this rank's).
    /// Collective.
    pub fn advance(&mut self, dt: f64, loads: &[Load]) {
        let (h, n) = self.sub_steps(dt);
        let begin = self.t;
        self.weigh();
        self.loads.copy_from_slice(loads);
        for &c in self.ranks.local() {
            let c = c as usize;
            if let Some(formulas) = &self.world.clusters[c].applied {
                let x = self.state.pose[c].position.into();
                let value = |k: usize| formulas[k].at(x, begin + 0.5 * dt);
                self.loads[c].force += Vector3::from_fn(|k, _| value(k));
                self.loads[c].torque += Vector3::from_fn(|k, _| value(3 + k));
            }
        }
        self.before.copy_from_slice(&self.state.pose);
        self.last = dt;
        self.touched.fill(false);
        for i in 1..=n {
            self.sub_step(h);
            self.t = begin + dt * (i as f64 / n as f64);
        }
    }

    fn sub_step(&mut self, h: f64) {
        let half = 0.5 * h;
        let gravity = self.world.gravity;
        for &c in self.ranks.owned() {
            let c = c as usize;
            let inertia = &self.inertia[c];
            if inertia.is_free() {
                let load = &self.loads[c];
                motion::kick(&mut self.state, c, inertia, gravity, load, half);
                motion::drift(&mut self.state, c, inertia, h);
                self.twists[c] = motion::predicted(&self.state, c, inertia, gravity, load, half);
                self.spent.work += h
                    * (load.force.dot(&self.state.velocity[c])
                        + load.torque.dot(&self.twists[c].spin));
            } else {
                let cluster = &self.world.clusters[c];
                self.twists[c] = motion::lead(&mut self.state, c, cluster, self.t, h);
            }
        }
        self.ranks.update_ghosts(&mut self.state.pose, &mut self.twists);
        if self.unchecked == 0 {
            self.look(h);
        } else {
            self.unchecked -= 1;
        }
        self.near.place(&self.state);
        self.add_forces(h);
        for &c in self.ranks.owned() {
            let c = c as usize;
            let inertia = &self.inertia[c];
            if inertia.is_free() {
                motion::kick(&mut self.state, c, inertia, gravity, &self.loads[c], half);
            } else if !self.world.clusters[c].stands() {
                let Twist { velocity, spin } = self.twists[c];
                self.spent.work -=
                    h * (self.state.force[c].dot(&velocity) + self.state.torque[c].dot(&spin));
            }
        }
    }

    fn weigh(&mut self) {
        self.inertia.clear();
        self.inertia.extend(self.world.clusters.iter().map(|c| c.inertia()));
    }

    /// Poses when the last `advance` began.
    pub(super) fn before(&self) -> &[crate::shape::Pose] {
        &self.before
    }

    /// Length of the last `advance` [s].
    pub(super) fn last(&self) -> f64 {
        self.last
    }

    /// What went on this rank.
    pub(super) fn spent(&self) -> &Account {
        &self.spent
    }

    /// Books energy [J] that a cluster takes with it.
    pub(super) fn give_away(&mut self, energy: f64) {
        self.spent.work -= energy;
    }

    /// What spheres remember here.
    pub(super) fn touches(&self) -> Vec<Touch> {
        self.near.touches()
    }

    /// Goes on with the state as it has just been set on every rank.
    pub(super) fn go_on(
        &mut self,
        t: f64,
        last: f64,
        before: Vec<crate::shape::Pose>,
        spent: Account,
        deepest: f64,
        touches: Vec<Touch>,
    ) {
        self.near.deepest = deepest;
        (self.t, self.last, self.before, self.spent) = (t, last, before, spent);
        self.ranks.claim(&self.state);
        self.breaks.clear();
        self.left.clear();
        self.unchecked = 0;
        self.refresh_with(touches);
    }

    /// Makes the lists anew if they may not hold until the next look, and says when that is. Collective.
    fn look(&mut self, h: f64) {
        let reach = 0.5 * self.near.skin;
        for remade in [false, true] {
            let wear = self.near.wear(&self.state, &self.world);
            let speed = self.ranks.owned().iter().map(|&c| {
                let Twist { velocity, spin } = self.twists[c as usize];
                velocity.norm() + spin.norm() * self.world.clusters[c as usize].form.radius
            });
            let speed = speed.fold(0.0, f64::max);
            let [wear, speed] = self.ranks.largest([wear, speed]);
            let steps = ((1.0 - wear) * reach / (FASTER * speed * h)).min(UNCHECKED);
            if steps >= 1.0 || remade {
                self.unchecked = (steps as u32).max(1) - 1;
                return;
            }
            self.refresh();
        }
    }

    /// Moves clusters to the ranks where they are now, finds neighbours, and makes the lists. Collective.
    pub(super) fn refresh(&mut self) {
        let touches = self.near.touches();
        self.refresh_with(touches);
    }

    fn refresh_with(&mut self, touches: Vec<Touch>) {
        let margin = self.near.skin + self.joints.widest_opening();
        let luggage = Luggage {
            state: &mut self.state,
            twists: &mut self.twists,
            loads: &mut self.loads,
            before: &mut self.before,
            joints: &mut self.joints,
        };
        let touches = self.ranks.migrate(&self.world, luggage, touches, margin);
        let (joints, ranks) = (&self.joints, &self.ranks);
        self.near.rebuild(
            &self.state,
            &self.world,
            ranks.local(),
            ranks.is_owned(),
            &touches,
            |a, b| joints.bond_alone(a, b),
        );
        self.active.clear();
        for (j, joint) in (0..).zip(&self.joints.joints) {
            let owned = |c: u32| ranks.is_owned()[c as usize];
            let moves = |c: u32| !self.world.clusters[c as usize].stands();
            if self.joints.alive[j as usize] > 0
                && (owned(joint.a) || owned(joint.b))
                && (moves(joint.a) || moves(joint.b))
            {
                self.active.push(j);
            }
        }
    }

    /// Velocities for the first forces.
    fn predict(&mut self, half: f64) {
        for &c in self.ranks.owned() {
            let c = c as usize;
            let cluster = &self.world.clusters[c];
            self.twists[c] = match &cluster.motion {
                Motion::Free { .. } => motion::predicted(
                    &self.state,
                    c,
                    &self.inertia[c],
                    self.world.gravity,
                    &self.loads[c],
                    half,
                ),
                _ => motion::lead(&mut self.state, c, cluster, self.t, 0.0),
            };
        }
    }

    fn add_forces(&mut self, h: f64) {
        let Self { state, near, inertia, joints, twists, world, ranks, spent, cracked, .. } = self;
        for &c in ranks.local() {
            state.force[c as usize] = Vector3::zeros();
            state.torque[c as usize] = Vector3::zeros();
        }
        let owned = ranks.is_owned();
        contact::add_forces(state, near, inertia, twists, world, h, owned, spent);
        for &c in ranks.owned() {
            self.touched[c as usize] |= state.force[c as usize] != Vector3::zeros();
        }
        joints.add_forces(state, twists, &self.active, h, owned, spent, cracked);
        // Cracked faces feel contact from the next sub-step on.
        for j in cracked.drain(..) {
            let joint = joints.joints[j as usize];
            if joints.alive[j as usize] == 0 && owned[joint.a as usize] {
                let place = joints.middle(state, j);
                self.breaks.push(Break { t: self.t + h, joint: j, place });
            }
            near.add_pair(state, world, joint.a, joint.b);
        }
    }

    /// Energies of all ranks. Collective.
    pub fn account(&self) -> Account {
        let owned = self.ranks.is_owned();
        let mut account = self.spent;
        for &c in self.ranks.owned() {
            let c = c as usize;
            let cluster = &self.world.clusters[c];
            if cluster.is_free() {
                account.kinetic += motion::kinetic(&self.state, c, cluster);
                account.potential -=
                    cluster.mass * self.world.gravity.dot(&self.state.pose[c].position);
            }
        }
        account.contact = contact::elastic_energy(&self.state, &self.near, &self.world, owned);
        let (stored, spent) = self.joints.energy(&self.state, owned);
        account.bonds = stored;
        account.fracture += spent;
        Account::from_array(self.ranks.sum(account.to_array()))
    }

    /// Momentum of all free clusters. Collective.
    pub fn momentum(&self) -> Momentum {
        let mut sums = [0.0; 8];
        for &c in self.ranks.owned() {
            let c = c as usize;
            if self.world.clusters[c].is_free() {
                let p = self.world.clusters[c].mass * self.state.velocity[c];
                let l = self.state.pose[c].position.cross(&p) + self.state.angular_momentum[c];
                (0..3).for_each(|k| sums[k] += p[k]);
                (0..3).for_each(|k| sums[3 + k] += l[k]);
            }
        }
        let [px, py, pz, lx, ly, lz, ..] = self.ranks.sum(sums);
        Momentum { linear: [px, py, pz].into(), angular: [lx, ly, lz].into() }
    }

    /// Pairs of spheres, and spheres and walls, that this rank looks at in a sub-step.
    pub fn candidates(&self) -> usize {
        self.near.n_candidates()
    }

    /// Deepest overlap of two spheres so far on this rank, over the smaller radius.
    pub fn deepest(&self) -> f64 {
        self.near.deepest
    }

    /// ω of a cluster now [rad/s].
    pub fn spin(&self, c: usize) -> Vector3<f64> {
        let cluster = &self.world.clusters[c];
        if cluster.is_free() {
            return motion::spin(&self.state, c, &cluster.inertia());
        }
        let inverse = cluster.moments.map(|i| 1.0 / i);
        State::spin(&self.state.pose[c], &inverse, &self.state.angular_momentum[c])
    }

    /// Sets velocity [m/s] and spin [rad/s] of a cluster; before the first step.
    pub fn set_motion(&mut self, c: usize, velocity: Vector3<f64>, spin: Vector3<f64>) {
        self.state.set_motion(c, &self.world.clusters[c], velocity, spin);
    }

    /// Every cluster's place before the last `advance`, the same on every rank. Collective.
    pub fn placed_before(&self) -> Vec<Placed> {
        let owned = self.ranks.owned().iter().map(|&c| c as usize);
        let placed = |c: usize| Placed {
            pose: self.before[c],
            twist: Twist::default(),
            end: Twist::default(),
        };
        self.ranks.gather(&owned.map(placed).collect::<Vec<_>>())
    }

    /// Every cluster's place now, the twist of its pose over the last `advance` and that at its end, the same on
    /// every rank. Collective.
    pub fn placed(&self) -> Vec<Placed> {
        let placed = |&c: &u32| {
            let c = c as usize;
            let (then, pose) = (&self.before[c], self.state.pose[c]);
            let end = Twist { velocity: self.state.velocity[c], spin: self.spin(c) };
            let mean = || Twist {
                velocity: (pose.position - then.position) / self.last,
                spin: (pose.rotation * then.rotation.inverse()).scaled_axis() / self.last,
            };
            Placed { pose, twist: if self.last == 0.0 { end } else { mean() }, end }
        };
        self.ranks.gather(&self.ranks.owned().iter().map(placed).collect::<Vec<_>>())
    }

    /// Of each cluster whether it touched something in the last `advance`, the same on every rank. Collective.
    pub fn touched(&self) -> Vec<bool> {
        self.ranks.any(self.touched.iter().copied())
    }

    /// Lets everything that is at rest settle under gravity for `duration` [s], while what moves at first
    /// waits in its place; time and account then begin anew. Collective.
    pub fn settle(&mut self, duration: f64) {
        let n = self.state.len();
        let waits = |bodies: &Self, c: usize| {
            bodies.world.clusters[c].is_free()
                && (bodies.state.velocity[c] != Vector3::zeros()
                    || bodies.state.angular_momentum[c] != Vector3::zeros())
        };
        let waiting: Vec<usize> = (0..n).filter(|&c| waits(self, c)).collect();
        let begin = self.state.clone();
        let motions: Vec<Motion> = waiting
            .iter()
            .map(|&c| std::mem::replace(&mut self.world.clusters[c].motion, Motion::Fixed))
            .collect();
        let loads = vec![Load::default(); n];
        let chunk = SETTLING * self.time_step;
        for i in 0..(duration / chunk).ceil() as u64 {
            self.advance(chunk, &loads);
            let share = if (i as f64 + 1.0) * chunk < duration { 0.9 } else { 0.0 };
            for c in (0..n).filter(|&c| self.world.clusters[c].is_free()) {
                self.state.velocity[c] *= share;
                self.state.angular_momentum[c] *= share;
            }
        }
        for (c, motion) in waiting.into_iter().zip(motions) {
            self.world.clusters[c].motion = motion;
            self.state.velocity[c] = begin.velocity[c];
            self.state.angular_momentum[c] = begin.angular_momentum[c];
        }
        self.t = 0.0;
        self.last = 0.0;
        self.spent = Account::default();
        self.near.deepest = 0.0;
        // Pairs of what waited were left out.
        self.refresh();
        self.unchecked = 0;
    }

    /// Everything later steps depend on, to go back to.
    pub fn save(&self) -> Saved {
        Saved {
            state: self.state.clone(),
            near: self.near.clone(),
            unchecked: self.unchecked,
            largest: self.joints.largest.clone(),
            alive: self.joints.alive.clone(),
            active: self.active.clone(),
            breaks: self.breaks.len(),
            ranks: self.ranks.clone(),
            t: self.t,
            spent: self.spent,
            before: self.before.clone(),
            last: self.last,
        }
    }

    /// Back to what was saved.
    pub fn restore(&mut self, saved: &Saved) {
        self.state.clone_from(&saved.state);
        self.near.clone_from(&saved.near);
        self.unchecked = saved.unchecked;
        self.joints.largest.clone_from(&saved.largest);
        self.joints.alive.clone_from(&saved.alive);
        self.active.clone_from(&saved.active);
        self.breaks.truncate(saved.breaks);
        self.ranks.clone_from(&saved.ranks);
        self.t = saved.t;
        self.spent = saved.spent;
        self.before.clone_from(&saved.before);
        self.last = saved.last;
    }
}
