//! Bodies that have left the mesh: they are taken out of motion, contact and the account of energy.

use super::cluster::Motion;
use super::motion;
use super::step::{Bodies, Placed};
use crate::shape::Bounds;
use nalgebra::Vector3;

/// A body that was taken out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Left {
    /// When [s].
    pub t: f64,
    /// Its number.
    pub cluster: u32,
    /// Where its centroid was [m].
    pub place: Vector3<f64>,
    /// How fast it was [m/s].
    pub velocity: Vector3<f64>,
}

impl std::fmt::Display for Left {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Left { t, cluster, place: x, .. } = self;
        let at = format!("({:.3}, {:.3}, {:.3})", x.x, x.y, x.z);
        write!(f, "t {t:.4} s: body {cluster} has left the mesh, at {at}, and is taken out")
    }
}

impl Bodies {
    /// Takes out free bodies that have left `mesh` by more than their radius and go on, but not upwards, from where
    /// they fall back; of glued ones all together. `placed`: where all stand, the same on every rank. Collective.
    pub fn take_out(&mut self, mesh: &Bounds, placed: &[Placed]) {
        let gravity = self.world.gravity;
        let outside = |(cluster, placed): (&super::Cluster, &Placed)| {
            let bounds = cluster.form.bounds_at(&placed.pose);
            let (radius, v) = (cluster.form.radius, placed.twist.velocity);
            let left = |k: usize| {
                let below = bounds.max[k] < mesh.min[k] - radius && v[k] < 0.0 && gravity[k] <= 0.0;
                let above = bounds.min[k] > mesh.max[k] + radius && v[k] > 0.0 && gravity[k] >= 0.0;
                below || above
            };
            cluster.is_free() && (0..3).any(left)
        };
        let mut leaves: Vec<bool> = self.world.clusters.iter().zip(placed).map(outside).collect();
        if !leaves.contains(&true) {
            return;
        }
        let holding = self.holding();
        let held = || self.joints.joints.iter().zip(&holding).filter(|(_, holds)| **holds);
        let mut changed = true;
        while changed {
            changed = false;
            for (joint, _) in held() {
                let ends = [joint.a, joint.b].map(|c| c as usize);
                if leaves[ends[0]] != leaves[ends[1]] {
                    ends.into_iter().for_each(|c| leaves[c] = false);
                    changed = true;
                }
            }
        }
        for c in (0..leaves.len()).filter(|&c| leaves[c]) {
            let Placed { pose, twist, .. } = &placed[c];
            self.left.push(Left {
                t: self.t,
                cluster: c as u32,
                place: pose.position,
                velocity: twist.velocity,
            });
            if self.ranks.is_owned()[c] {
                let cluster = &self.world.clusters[c];
                let energy = motion::kinetic(&self.state, c, cluster)
                    - cluster.mass * gravity.dot(&self.state.pose[c].position);
                self.give_away(energy);
                self.set_motion(c, Vector3::zeros(), Vector3::zeros());
            }
            self.world.clusters[c].motion = Motion::Gone;
        }
        if leaves.contains(&true) {
            self.refresh();
        }
    }
}
