//! The whole state as flat lists by global numbers, for checkpoints: from these a run goes on with any number
//! of ranks, to the same bits.

use super::account::Account;
use super::cluster::Motion;
use super::neighbours::{Partner, Touch};
use super::step::Bodies;
use crate::shape::Pose;
use nalgebra::{Quaternion, Unit, Vector3};

/// Numbers of a cluster: two poses, four vectors, whether it is gone.
pub const CLUSTER: usize = 27;
/// Numbers that all ranks share.
pub const SHARED: usize = 11;

/// What a rank owns, or, to go on from, all there is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Record {
    /// Numbers of clusters.
    pub clusters: Vec<u64>,
    /// `CLUSTER` each.
    pub states: Vec<f64>,
    /// Numbers of points of joints.
    pub points: Vec<u64>,
    /// Largest opening of each [m].
    pub largest: Vec<f64>,
    /// Which spheres remember something: cluster, kind and number of the partner, spheres.
    pub keys: Vec<[u64; 5]>,
    /// What they remember: ξ, rest, whether they touch.
    pub memories: Vec<[f64; 5]>,
    /// Time, length of the last step, energy account, deepest overlap: the same on all ranks.
    pub shared: [f64; SHARED],
}

impl Bodies {
    /// What this rank owns. Collective.
    pub fn record(&self) -> Record {
        let mut record = Record::default();
        let owned = self.ranks.is_owned();
        for &c in self.ranks.owned() {
            record.clusters.push(c.into());
            let c = c as usize;
            let state = &self.state;
            for pose in [&state.pose[c], &self.before()[c]] {
                record.states.extend(pose.position.as_slice());
                record.states.extend(pose.rotation.coords.as_slice());
            }
            let vectors =
                [state.velocity[c], state.angular_momentum[c], state.force[c], state.torque[c]];
            vectors.iter().for_each(|v| record.states.extend(v.as_slice()));
            let gone = self.world.clusters[c].motion == Motion::Gone;
            record.states.push(f64::from(u8::from(gone)));
        }
        for joint in self.joints.joints.iter().filter(|joint| owned[joint.a as usize]) {
            for p in joint.first..joint.end {
                record.points.push(p.into());
                record.largest.push(self.joints.largest[p as usize]);
            }
        }
        for touch in self.touches().iter().filter(|touch| owned[touch.key.0 as usize]) {
            let (a, partner, [i, j]) = touch.key;
            let (kind, b) = match partner {
                Partner::Cluster(b) => (0, b),
                Partner::Wall(w) => (1, w),
            };
            record.keys.push([a.into(), kind, b.into(), i.into(), j.into()]);
            let s = touch.spring;
            record.memories.push([s.x, s.y, s.z, touch.rest, f64::from(u8::from(touch.touching))]);
        }
        record.shared[..2].copy_from_slice(&[self.t, self.last()]);
        let spent = self.ranks.sum(self.spent().to_array());
        record.shared[2..10].copy_from_slice(&spent);
        record.shared[10] = self.ranks.comm().max(self.deepest());
        record
    }

    /// Goes on from a record of everything, the same on every rank. Collective.
    pub fn resume(&mut self, record: &Record) {
        let mut before = self.before().to_vec();
        for (&c, numbers) in record.clusters.iter().zip(record.states.as_chunks::<CLUSTER>().0) {
            let c = c as usize;
            let v = |i: usize| Vector3::from_column_slice(&numbers[i..i + 3]);
            let pose = |i: usize| {
                let q = &numbers[i + 3..i + 7];
                let rotation = Unit::new_unchecked(Quaternion::new(q[3], q[0], q[1], q[2]));
                Pose { position: v(i), rotation }
            };
            self.state.pose[c] = pose(0);
            before[c] = pose(7);
            [self.state.velocity[c], self.state.angular_momentum[c]] = [v(14), v(17)];
            [self.state.force[c], self.state.torque[c]] = [v(20), v(23)];
            if numbers[26] == 1.0 {
                self.world.clusters[c].motion = Motion::Gone;
            }
        }
        for (&p, &largest) in record.points.iter().zip(&record.largest) {
            self.joints.largest[p as usize] = largest;
        }
        (0..self.joints.joints.len() as u32).for_each(|j| self.joints.recount(j));
        let mut touches: Vec<Touch> = record
            .keys
            .iter()
            .zip(&record.memories)
            .map(|(&[a, kind, b, i, j], m)| {
                let b = b as u32;
                let partner = if kind == 0 { Partner::Cluster(b) } else { Partner::Wall(b) };
                Touch {
                    key: (a as u32, partner, [i as u32, j as u32]),
                    spring: Vector3::new(m[0], m[1], m[2]),
                    rest: m[3],
                    touching: m[4] == 1.0,
                }
            })
            .collect();
        touches.sort_by_key(|touch| touch.key);
        let first = self.ranks.comm().rank() == 0;
        let mut spent = [0.0; 8];
        if first {
            spent.copy_from_slice(&record.shared[2..10]);
        }
        let [t, last, .., deepest] = record.shared;
        self.go_on(t, last, before, Account::from_array(spent), deepest, touches);
    }
}
