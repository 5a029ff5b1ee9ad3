//! Which clusters hold together. All of it is the same on every rank, and collective.

use super::Bodies;

impl Bodies {
    /// Of each joint whether a point of it is unbroken.
    pub fn holding(&self) -> Vec<bool> {
        let owned = self.ranks.is_owned();
        let joints = self.joints.joints.iter().zip(&self.joints.alive);
        self.ranks.any(joints.map(|(j, &n)| owned[j.a as usize] && n > 0))
    }

    /// Of each cluster whether it is free and unglued.
    pub fn loose(&self) -> Vec<bool> {
        let mut loose: Vec<bool> = self.world.clusters.iter().map(|c| c.is_free()).collect();
        for c in self.glued().into_iter().flatten() {
            loose[c] = false;
        }
        loose
    }

    /// Of each cluster whether it is glued, through others too, to one that forces do not move.
    pub fn held(&self) -> Vec<bool> {
        let mut held: Vec<bool> = self.world.clusters.iter().map(|c| !c.is_free()).collect();
        let pairs = self.glued();
        let mut spreads = true;
        while spreads {
            spreads = false;
            for &[a, b] in &pairs {
                if held[a] != held[b] {
                    (held[a], held[b], spreads) = (true, true, true);
                }
            }
        }
        held
    }

    /// The clusters of each joint that holds.
    fn glued(&self) -> Vec<[usize; 2]> {
        let joints = self.joints.joints.iter().zip(self.holding());
        joints.filter(|(_, holds)| *holds).map(|(j, _)| [j.a as usize, j.b as usize]).collect()
    }
}
