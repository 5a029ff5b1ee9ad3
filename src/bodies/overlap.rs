//! Bodies that stand inside each other or inside a wall: contact throws them apart.

use super::Bodies;
use super::neighbours::Partner;

/// Two that overlap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overlap {
    /// A cluster.
    pub cluster: u32,
    /// What it overlaps.
    pub partner: Partner,
    /// How deep its contact spheres are in the other's, or in the wall [m].
    pub depth: f64,
    /// The same over the smaller radius.
    pub relative: f64,
}

impl Bodies {
    /// The worst, over the radius, as they stand; clusters of one sphere are left out. The same on every rank. Collective.
    pub fn deepest_overlap(&self) -> Option<Overlap> {
        let near = &self.near;
        let mut worst: Option<Overlap> = None;
        for pair in &near.pairs {
            for &[i, j] in &near.candidates[pair.first as usize..pair.end as usize] {
                let (s, t) = (&near.spheres[i as usize], &near.spheres[j as usize]);
                let (depth, radius) = match pair.partner {
                    Partner::Cluster(_) => {
                        let reach = s.radius + t.radius;
                        (reach - (s.place - t.place).norm(), s.radius.min(t.radius))
                    }
                    Partner::Wall(w) => {
                        let surface = &self.world.walls[w as usize].surface;
                        (s.radius - surface.distance(s.place).0, s.radius)
                    }
                };
                let relative = depth / radius;
                if relative > worst.map_or(0.0, |w| w.relative) {
                    let (cluster, partner) = (pair.cluster, pair.partner);
                    worst = Some(Overlap { cluster, partner, depth, relative });
                }
            }
        }
        let comm = self.ranks.comm();
        let relative = comm.max(worst.map_or(0.0, |w| w.relative));
        // Of ranks that see as deep a one, the first cluster's.
        let mine = worst.filter(|w| w.relative == relative);
        let of = |value: Option<f64>| comm.min(value.unwrap_or(f64::INFINITY));
        let cluster = of(mine.map(|w| w.cluster.into()));
        let mine = mine.filter(|w| f64::from(w.cluster) == cluster);
        let (wall, partner) = mine
            .map(|w| match w.partner {
                Partner::Cluster(b) => (0.0, f64::from(b)),
                Partner::Wall(w) => (1.0, f64::from(w)),
            })
            .unzip();
        let [wall, partner, depth] = [of(wall), of(partner), of(mine.map(|w| w.depth))];
        (relative > 0.0).then_some(Overlap {
            cluster: cluster as u32,
            partner: if wall == 0.0 {
                Partner::Cluster(partner as u32)
            } else {
                Partner::Wall(partner as u32)
            },
            depth,
            relative,
        })
    }
}
