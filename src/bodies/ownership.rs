//! Which clusters this rank moves, and which of other ranks it knows (METHOD.md, 6).
//!
//! Flow and bodies take turns, so each is spread over the ranks for itself: the mesh by its elements, bodies by
//! a recursive bisection of where they are, weighted by what they cost. A cluster belongs to the rank that its
//! centroid's place belongs to; the bisection is made anew when clusters have gathered on a few ranks. Where
//! there is little to do, fewer ranks do it: two ranks save half of a sub-step's work and send a message in each,
//! which takes microseconds, but milliseconds where ranks share processors with others. One rank alone sends
//! none.
//!
//! Whenever neighbour lists are made anew, clusters go to the ranks where they are now, with all that they
//! remember, and each rank learns of the clusters near its own. In between, one message goes to each neighbour in
//! a sub-step.

use super::cluster::State;
use super::cohesion::Joints;
use super::contact::{Twist, World};
use super::motion::Load;
use super::neighbours::{Partner, Touch};
use super::step::Placed;
use crate::shape::{Bounds, Pose};
use nalgebra::{Quaternion, Unit, Vector3};
use partition::{Communicator, Exchange, IndexMap};
use std::fmt;
use std::sync::Arc;

/// Time that a cluster and a bond's point take in a sub-step [s], roughly.
const CLUSTER: f64 = 5e-7;
const POINT: f64 = 2e-8;
/// The least that a rank is bothered for in a sub-step [s].
const SHARE: f64 = 5e-4;
/// Most over mean work at which it is shared anew.
const UNEVEN: f64 = 1.5;

/// A rank's own clusters and those near them.
#[derive(Clone)]
pub struct Ownership {
    comm: Communicator,
    /// Ranks that share the work.
    sharing: usize,
    regions: Arc<Regions>,
    /// Work of each cluster in a sub-step [s].
    weights: Arc<[f64]>,
    is_owned: Vec<bool>,
    /// In ascending order.
    owned: Vec<u32>,
    /// In ascending order, own ones among them.
    local: Vec<u32>,
    /// Own clusters, then those of other ranks.
    order: Vec<u32>,
    exchange: Option<Exchange>,
}

impl fmt::Debug for Ownership {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} clusters, {} known", self.owned.len(), self.local.len())
    }
}

/// Everything that moves with a cluster.
pub struct Luggage<'a> {
    /// Places and momenta.
    pub state: &'a mut State,
    /// Predicted velocities.
    pub twists: &'a mut [Twist],
    /// Loads of this step.
    pub loads: &'a mut [Load],
    /// Poses when the step began.
    pub before: &'a mut [Pose],
    /// Broken points.
    pub joints: &'a mut Joints,
}

/// A pose and a twist.
const NEAR: usize = 13;
/// All of a cluster's numbers.
const ALL: usize = NEAR + 12 + 6 + 7;

impl Ownership {
    /// One rank owns all.
    pub fn single(world: &World, state: &State, joints: &Joints) -> Self {
        Self::new(&Communicator::single(), world, state, joints, None)
    }

    /// By where the clusters are now, all of which every rank knows; shared by `ranks` ranks, if given.
    pub fn new(
        comm: &Communicator,
        world: &World,
        state: &State,
        joints: &Joints,
        ranks: Option<u32>,
    ) -> Self {
        let mut weights = vec![CLUSTER; world.clusters.len()];
        for joint in &joints.joints {
            let half = 0.5 * POINT * f64::from(joint.end - joint.first);
            [joint.a, joint.b].into_iter().for_each(|c| weights[c as usize] += half);
        }
        let enough = || (weights.iter().sum::<f64>() / SHARE) as usize;
        let sharing = ranks.map_or_else(enough, |n| n as usize).clamp(1, comm.size());
        let places = state.pose.iter().map(|pose| pose.position).zip(weights.iter().copied());
        let mut ownership = Self {
            comm: comm.clone(),
            sharing,
            regions: Arc::new(Regions::split(places.collect(), 0..sharing)),
            weights: weights.into(),
            is_owned: Vec::new(),
            owned: Vec::new(),
            local: Vec::new(),
            order: Vec::new(),
            exchange: None,
        };
        ownership.claim(state);
        ownership
    }

    /// Takes the clusters of this rank's region, while every rank knows all of them.
    pub(super) fn claim(&mut self, state: &State) {
        let me = self.comm.rank();
        let mine = |pose: &Pose| self.regions.rank_of(pose.position) == me;
        self.is_owned = state.pose.iter().map(mine).collect();
        self.owned = (0..state.len() as u32).filter(|&c| self.is_owned[c as usize]).collect();
        self.local.clone_from(&self.owned);
        self.order.clone_from(&self.owned);
        self.exchange = None;
    }

    /// Makes the regions anew if the work has become uneven. Collective.
    fn share_anew(&mut self, state: &State) {
        let mine = || self.owned.iter().map(|&c| c as usize);
        let work = mine().map(|c| self.weights[c]).sum();
        let (most, all) = (self.comm.max(work), self.comm.sum(work));
        if most * self.sharing as f64 > UNEVEN * all {
            let wire = mine().map(|c| {
                let [x, y, z] = state.pose[c].position.into();
                [x, y, z, self.weights[c]]
            });
            let all = self.comm.all_gather(&wire.collect::<Vec<[f64; 4]>>()).concat();
            let places = all.into_iter().map(|[x, y, z, weight]| (Vector3::new(x, y, z), weight));
            self.regions = Arc::new(Regions::split(places.collect(), 0..self.sharing));
        }
    }

    /// The ranks.
    pub fn comm(&self) -> &Communicator {
        &self.comm
    }

    /// Of each flag whether any rank sets it; all ranks give equally many. Collective.
    pub fn any(&self, flags: impl Iterator<Item = bool>) -> Vec<bool> {
        let mut count: Vec<f64> = flags.map(|flag| f64::from(u8::from(flag))).collect();
        self.comm().sum_all(&mut count);
        count.into_iter().map(|n| n > 0.0).collect()
    }

    /// For each cluster whether it is this rank's.
    pub fn is_owned(&self) -> &[bool] {
        &self.is_owned
    }

    /// This rank's clusters, ascending.
    pub fn owned(&self) -> &[u32] {
        &self.owned
    }

    /// This rank's clusters and those near them, ascending.
    pub fn local(&self) -> &[u32] {
        &self.local
    }

    /// Poses and velocities of the clusters near by become their owners'. Concerns neighbours alone.
    pub fn update_ghosts(&self, pose: &mut [Pose], twists: &mut [Twist]) {
        let Some(exchange) = &self.exchange else { return };
        let mut wire = vec![[0.0; NEAR]; self.order.len()];
        for (_, shared) in exchange.shared() {
            for &i in shared {
                let c = self.order[i as usize] as usize;
                wire[i as usize] = pack_near(&pose[c], &twists[c]);
            }
        }
        exchange.update_ghosts(&mut wire);
        for (&c, numbers) in self.order.iter().zip(&wire).skip(self.owned.len()) {
            (pose[c as usize], twists[c as usize]) = unpack_near(numbers);
        }
    }

    /// What each owner knows of its clusters (`mine`, in the order of `owned`), for all of them. Collective.
    pub fn gather(&self, mine: &[Placed]) -> Vec<Placed> {
        let pack = |placed: &Placed| {
            let mut numbers = [0.0; NEAR + 6];
            numbers[..NEAR].copy_from_slice(&pack_near(&placed.pose, &placed.twist));
            numbers[NEAR..NEAR + 3].copy_from_slice(placed.end.velocity.as_slice());
            numbers[NEAR + 3..].copy_from_slice(placed.end.spin.as_slice());
            numbers
        };
        let unpack = |numbers: &[f64; NEAR + 6]| {
            let (pose, twist) = unpack_near(numbers.first_chunk().expect("longer"));
            let v = |i: usize| Vector3::from_column_slice(&numbers[i..i + 3]);
            Placed { pose, twist, end: Twist { velocity: v(NEAR), spin: v(NEAR + 3) } }
        };
        let wire: Vec<[f64; NEAR + 6]> = mine.iter().map(pack).collect();
        let owned = self.comm.all_gather(&self.owned).into_iter().flatten();
        let wire = self.comm.all_gather(&wire).into_iter().flatten();
        let mut all: Vec<(u32, [f64; NEAR + 6])> = owned.zip(wire).collect();
        all.sort_unstable_by_key(|(c, _)| *c);
        all.iter().map(|(_, numbers)| unpack(numbers)).collect()
    }

    /// Largest over the ranks that share the work. Collective.
    pub fn largest(&self, values: [f64; 2]) -> [f64; 2] {
        if self.sharing == 1 {
            return values;
        }
        values.map(|x| self.comm.max(x))
    }

    /// Sums over ranks. Collective.
    pub fn sum(&self, mut values: [f64; 8]) -> [f64; 8] {
        self.comm.sum_all(&mut values);
        values
    }

    /// Hands clusters to the ranks where they are now, with all that is theirs, and learns of those within
    /// `margin` [m] of this rank's. Returns what pairs of spheres remember here. Collective.
    pub fn migrate(
        &mut self,
        world: &World,
        mut luggage: Luggage,
        touches: Vec<Touch>,
        margin: f64,
    ) -> Vec<Touch> {
        if self.sharing == 1 {
            return touches;
        }
        self.share_anew(luggage.state);
        let touches = self.hand_over(&mut luggage, touches);
        let Luggage { state, twists, .. } = luggage;
        let bounds = |c: u32| {
            let form = &world.clusters[c as usize].form;
            form.bounds_at(&state.pose[c as usize])
        };
        let mine = self.owned.iter().map(|&c| bounds(c));
        let whole = Bounds::of(mine.flat_map(|b| [b.min, b.max]));
        let whole = [<[f64; 3]>::from(whole.min), whole.max.into()];
        let all = self.comm.all_gather(&[whole]);
        let mut leaving = vec![Vec::new(); self.comm.size()];
        for (rank, theirs) in all.iter().enumerate().filter(|(rank, _)| *rank != self.comm.rank()) {
            let [min, max] = theirs[0].map(Vector3::from);
            let theirs = Bounds { min, max };
            for &c in self.owned.iter().filter(|&&c| bounds(c).inflated(margin).meets(&theirs)) {
                let numbers = pack_near(&state.pose[c as usize], &twists[c as usize]);
                leaving[rank].push((c, numbers));
            }
        }
        let mut map = IndexMap {
            n_owned: self.owned.len(),
            global: self.owned.iter().map(|&c| c.into()).collect(),
            ghost_owner: Vec::new(),
        };
        for (rank, list) in self.comm.exchange_lists(leaving).into_iter().enumerate() {
            for (c, numbers) in list {
                (state.pose[c as usize], twists[c as usize]) = unpack_near(&numbers);
                map.global.push(c.into());
                map.ghost_owner.push(rank as u32);
            }
        }
        self.order = map.global.iter().map(|&c| c as u32).collect();
        self.local.clone_from(&self.order);
        self.local.sort_unstable();
        self.exchange = Some(Exchange::new(&self.comm, &map));
        touches
    }

    fn hand_over(&mut self, luggage: &mut Luggage, mut touches: Vec<Touch>) -> Vec<Touch> {
        let me = self.comm.rank();
        let Luggage { state, twists, loads, before, joints } = luggage;
        let mut clusters = vec![Vec::new(); self.comm.size()];
        let mut to = vec![me; state.len()];
        for &c in &self.owned {
            let c = c as usize;
            let rank = self.regions.rank_of(state.pose[c].position);
            to[c] = rank;
            if rank != me {
                let mut numbers = [0.0; ALL];
                numbers[..NEAR].copy_from_slice(&pack_near(&state.pose[c], &twists[c]));
                let vectors = [
                    state.velocity[c],
                    state.angular_momentum[c],
                    state.force[c],
                    state.torque[c],
                    loads[c].force,
                    loads[c].torque,
                    before[c].position,
                ];
                for (room, v) in numbers[NEAR..].chunks_exact_mut(3).zip(vectors) {
                    room.copy_from_slice(v.as_slice());
                }
                numbers[ALL - 4..].copy_from_slice(before[c].rotation.coords.as_slice());
                clusters[rank].push((c as u32, numbers));
            }
        }
        // What joints and touching spheres remember goes along with either cluster.
        let mut points = vec![Vec::new(); self.comm.size()];
        for (j, joint) in (0u32..).zip(&joints.joints) {
            let mut ranks = [to[joint.a as usize], to[joint.b as usize]];
            if ranks[0] == ranks[1] {
                ranks[1] = me;
            }
            for rank in ranks.into_iter().filter(|&rank| rank != me) {
                for p in joint.first..joint.end {
                    points[rank].push((j, p, joints.largest[p as usize]));
                }
            }
        }
        let mut memories = vec![Vec::new(); self.comm.size()];
        for touch in &touches {
            let (a, partner, numbers) = touch.key;
            let (code, b) = match partner {
                Partner::Cluster(b) => ([0, b], b),
                Partner::Wall(w) => ([1, w], a),
            };
            let mut ranks = [to[a as usize], to[b as usize]];
            if ranks[0] == ranks[1] {
                ranks[1] = me;
            }
            for rank in ranks.into_iter().filter(|&rank| rank != me) {
                let s = touch.spring;
                let kept = [s.x, s.y, s.z, touch.rest, f64::from(u8::from(touch.touching))];
                memories[rank].push(([a, code[0], code[1], numbers[0], numbers[1]], kept));
            }
        }
        for list in &clusters {
            list.iter().for_each(|(c, _)| self.is_owned[*c as usize] = false);
        }
        for (c, numbers) in self.comm.exchange_lists(clusters).concat() {
            let c = c as usize;
            self.is_owned[c] = true;
            let near: &[f64; NEAR] = numbers.first_chunk().expect("longer");
            (state.pose[c], twists[c]) = unpack_near(near);
            let v = |i: usize| Vector3::from_column_slice(&numbers[NEAR + 3 * i..][..3]);
            [state.velocity[c], state.angular_momentum[c]] = [v(0), v(1)];
            [state.force[c], state.torque[c]] = [v(2), v(3)];
            loads[c] = Load { force: v(4), torque: v(5) };
            before[c] = Pose { position: v(6), rotation: rotation(&numbers[ALL - 4..]) };
        }
        let mut changed = Vec::new();
        for (j, p, largest) in self.comm.exchange_lists(points).concat() {
            joints.largest[p as usize] = largest;
            changed.push(j);
        }
        changed.dedup();
        changed.into_iter().for_each(|j| joints.recount(j));
        for ([a, kind, b, i, j], kept) in self.comm.exchange_lists(memories).concat() {
            let partner = if kind == 0 { Partner::Cluster(b) } else { Partner::Wall(b) };
            touches.push(Touch {
                key: (a, partner, [i, j]),
                spring: Vector3::new(kept[0], kept[1], kept[2]),
                rest: kept[3],
                touching: kept[4] == 1.0,
            });
        }
        touches.sort_by_key(|touch| touch.key);
        // A rank that owned one of a pair already has the same memory of it.
        touches.dedup_by_key(|touch| touch.key);
        self.owned =
            (0..self.is_owned.len() as u32).filter(|&c| self.is_owned[c as usize]).collect();
        touches
    }
}

fn pack_near(pose: &Pose, twist: &Twist) -> [f64; NEAR] {
    let mut numbers = [0.0; NEAR];
    numbers[..3].copy_from_slice(pose.position.as_slice());
    numbers[3..7].copy_from_slice(pose.rotation.coords.as_slice());
    numbers[7..10].copy_from_slice(twist.velocity.as_slice());
    numbers[10..].copy_from_slice(twist.spin.as_slice());
    numbers
}

fn unpack_near(numbers: &[f64; NEAR]) -> (Pose, Twist) {
    let v = |i: usize| Vector3::from_column_slice(&numbers[i..i + 3]);
    (
        Pose { position: v(0), rotation: rotation(&numbers[3..7]) },
        Twist { velocity: v(7), spin: v(10) },
    )
}

/// The same bits: it is not made a unit again.
fn rotation(coords: &[f64]) -> nalgebra::UnitQuaternion<f64> {
    Unit::new_unchecked(Quaternion::new(coords[3], coords[0], coords[1], coords[2]))
}

/// Places cut in two by planes, again and again.
#[derive(Debug)]
enum Regions {
    Rank(usize),
    Cut { axis: usize, at: f64, below: Box<Regions>, above: Box<Regions> },
}

impl Regions {
    /// Cuts across the longest side, so that the weights on both sides are as their numbers of ranks.
    fn split(mut places: Vec<(Vector3<f64>, f64)>, ranks: std::ops::Range<usize>) -> Self {
        if ranks.len() == 1 || places.is_empty() {
            return Self::Rank(ranks.start);
        }
        let bounds = Bounds::of(places.iter().map(|p| p.0));
        let axis = (bounds.max - bounds.min).imax();
        places.sort_by(|a, b| a.0[axis].total_cmp(&b.0[axis]));
        let half = ranks.len() / 2;
        let total: f64 = places.iter().map(|p| p.1).sum();
        let wanted = total * half as f64 / ranks.len() as f64;
        let mut sum = 0.0;
        let n = places.iter().take_while(|p| {
            sum += p.1;
            sum <= wanted * (1.0 + 1e-12)
        });
        let n = n.count().clamp(1, places.len().max(2) - 1).min(places.len());
        let last = places[n - 1].0[axis];
        let at = places.get(n).map_or(last, |next| 0.5 * (last + next.0[axis]));
        let above = places.split_off(n);
        let middle = ranks.start + half;
        Self::Cut {
            axis,
            at,
            below: Box::new(Self::split(places, ranks.start..middle)),
            above: Box::new(Self::split(above, middle..ranks.end)),
        }
    }

    fn rank_of(&self, x: Vector3<f64>) -> usize {
        match self {
            Self::Rank(rank) => *rank,
            Self::Cut { axis, at, below, above } => {
                if x[*axis] <= *at {
                    below.rank_of(x)
                } else {
                    above.rank_of(x)
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_share_the_weight() {
        let places: Vec<(Vector3<f64>, f64)> = (0..300)
            .map(|i| {
                let i = f64::from(i);
                let x =
                    Vector3::new((i * 0.618).fract() * 5.0, (i * 0.337).fract() * 2.0, i * 1e-3);
                (x, 1.0 + (i * 0.77).fract())
            })
            .collect();
        let total: f64 = places.iter().map(|p| p.1).sum();
        for n in 1..=5 {
            let tree = Regions::split(places.clone(), 0..n);
            let mut sums = vec![0.0; n];
            places.iter().for_each(|p| sums[tree.rank_of(p.0)] += p.1);
            assert!(sums.iter().all(|s| (s * n as f64 / total - 1.0).abs() < 0.05), "{sums:?}");
        }
    }
}
