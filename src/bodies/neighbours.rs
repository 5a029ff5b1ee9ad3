//! Who may touch whom: first boxes around clusters, in a grid; then spheres of the clusters whose boxes meet.
//!
//! Lists reach `skin` beyond contact and serve until a surface has moved by half of it. Tangential
//! springs stay with their pair of spheres when lists are made anew.

use super::cluster::{Form, Motion, State};
use super::contact::{Hit, World};
use crate::shape::{Bounds, Pose};
use nalgebra::Vector3;

/// What a cluster may touch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Partner {
    /// A cluster with a higher number.
    Cluster(u32),
    /// A wall.
    Wall(u32),
}

/// A cluster and what it may touch, with their range of candidates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// The cluster.
    pub cluster: u32,
    /// The other.
    pub partner: Partner,
    /// First candidate.
    pub first: u32,
    /// Past the last one.
    pub end: u32,
}

/// A sphere that may touch something.
#[derive(Clone, Copy, Debug)]
pub struct PlacedSphere {
    /// Now [m].
    pub place: Vector3<f64>,
    /// [m]
    pub radius: f64,
    /// Its cluster.
    cluster: u32,
    /// Its number there.
    number: u32,
    /// In the cluster's frame [m].
    local: Vector3<f64>,
}

/// What contact asks of a cluster.
#[derive(Clone, Copy, Debug)]
pub struct Inertia {
    /// 1/m [1/kg]; 0 if forces do not move it.
    pub inverse_mass: f64,
    /// Diagonal of I⁻¹ [1/(kg m²)].
    pub inverse_moments: Vector3<f64>,
    /// Index of its material.
    pub material: u32,
}

/// What a pair of spheres remembers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    /// Cluster, partner, spheres of both (0 for a wall's).
    pub key: (u32, Partner, [u32; 2]),
    /// ξ [m].
    pub spring: Vector3<f64>,
    /// Overlap that is not felt [m].
    pub rest: f64,
    /// Whether they touched last time.
    pub touching: bool,
}

/// Lists of what is close.
#[derive(Clone, Debug, Default)]
pub struct Neighbours {
    /// Sorted by cluster, then partner: forces are summed in an order that ranks do not change.
    pub pairs: Vec<Pair>,
    /// Those that candidates name.
    pub spheres: Vec<PlacedSphere>,
    /// Pairs of spheres (indices into `spheres`; of a wall, the first one twice).
    pub candidates: Vec<[u32; 2]>,
    /// ξ of each candidate [m], if touching.
    pub spring: Vec<Vector3<f64>>,
    /// Overlap of each candidate when the bond between its clusters cracked [m]: only what comes on top is
    /// felt, until they part. (Felt at once, it would be energy out of nothing.)
    pub rest: Vec<f64>,
    /// Whether each candidate touched last time.
    pub touching: Vec<bool>,
    /// Scratch: the touching candidates of one pair.
    pub hits: Vec<Hit>,
    /// Deepest overlap so far over the smaller radius: beyond 0.5 contact is too soft for what it stops.
    pub deepest: f64,
    /// Reach beyond contact [m].
    pub skin: f64,
    /// Of each cluster.
    pub inertia: Vec<Inertia>,
    /// Where clusters stood when the lists were made.
    origin: Vec<(u32, Pose)>,
    slots: Slots,
    scratch: [Vec<(u32, Vector3<f64>, f64)>; 2],
}

impl Neighbours {
    /// Nothing yet; lists will reach `skin` beyond contact.
    pub fn new(skin: f64) -> Self {
        Self { skin, ..Self::default() }
    }

    /// Takes over how heavy clusters are, which changes when one is let go.
    pub fn weigh(&mut self, world: &World) {
        self.inertia.clear();
        self.inertia.extend(world.clusters.iter().map(|c| Inertia {
            inverse_mass: c.inverse_mass(),
            inverse_moments: c.inverse_moments(),
            material: c.material,
        }));
    }

    /// Moves the spheres to where their clusters are.
    pub fn place(&mut self, state: &State) {
        for s in &mut self.spheres {
            s.place = state.pose[s.cluster as usize].to_space(s.local);
        }
    }

    /// The longest way a surface of the owned clusters has gone since the lists were made, over half the
    /// skin: above 1 they no longer hold.
    pub fn wear(&self, state: &State, world: &World) -> f64 {
        let mut longest: f64 = 0.0;
        for (cluster, origin) in &self.origin {
            let pose = &state.pose[*cluster as usize];
            let turned = (pose.rotation.as_ref().coords - origin.rotation.as_ref().coords).norm();
            // A chord of the unit quaternions is a quarter of the angle's; π/2 covers long arcs.
            let angle = turned * std::f64::consts::PI;
            let moved = (pose.position - origin.position).norm();
            let radius = world.clusters[*cluster as usize].form.radius;
            longest = longest.max(moved + radius * angle);
        }
        longest / (0.5 * self.skin)
    }

    /// Makes the lists. `local`: the clusters known here, of which `owned` are this rank's; `touches`: what
    /// touched before; `apart`: pairs that do not feel each other.
    pub fn rebuild(
        &mut self,
        state: &State,
        world: &World,
        local: &[u32],
        owned: &[bool],
        touches: &[Touch],
        apart: impl Fn(u32, u32) -> bool,
    ) {
        let mine = |c: u32| owned[c as usize];
        let skin = self.skin;
        let form = |c: u32| -> &Form { &world.clusters[c as usize].form };
        let bounds: Vec<(u32, Bounds)> = local
            .iter()
            .map(|&c| (c, form(c).bounds_at(&state.pose[c as usize]).inflated(0.5 * skin)))
            .collect();
        let mut close: Vec<(u32, Partner)> = meeting(&bounds)
            .into_iter()
            .filter(|&(a, b)| {
                let free = |c: u32| world.clusters[c as usize].is_free();
                let gone = |c: u32| world.clusters[c as usize].motion == Motion::Gone;
                !(gone(a) || gone(b))
                    && (mine(a) || mine(b))
                    && (free(a) || free(b))
                    && !apart(a, b)
            })
            .map(|(a, b)| (a, Partner::Cluster(b)))
            .collect();
        for &(c, _) in bounds.iter().filter(|(c, _)| mine(*c)) {
            let cluster = &world.clusters[c as usize];
            for w in 0..world.walls.len() as u32 {
                let centre = state.pose[c as usize].position;
                let reach = cluster.form.radius + skin;
                if cluster.is_free()
                    && !world.ignored.contains(&(cluster.group, w))
                    && world.walls[w as usize].surface.distance(centre).0 < reach
                {
                    close.push((c, Partner::Wall(w)));
                }
            }
        }
        close.sort_unstable();

        self.pairs.clear();
        self.candidates.clear();
        self.spheres.clear();
        self.slots.clear();
        for (cluster, partner) in close {
            let first = self.candidates.len() as u32;
            self.add_candidates(state, world, cluster, partner);
            let end = self.candidates.len() as u32;
            if end > first {
                self.pairs.push(Pair { cluster, partner, first, end });
            }
        }
        self.recall(touches);
        self.origin.clear();
        self.origin
            .extend(local.iter().filter(|&&c| mine(c)).map(|&c| (c, state.pose[c as usize])));
        self.place(state);
    }

    /// Adds a pair of clusters whose bond cracked.
    pub fn add_pair(&mut self, state: &State, world: &World, a: u32, b: u32) {
        let partner = Partner::Cluster(b);
        let at = self.pairs.partition_point(|p| (p.cluster, p.partner) < (a, partner));
        if self.pairs.get(at).is_some_and(|p| (p.cluster, p.partner) == (a, partner)) {
            return;
        }
        let first = self.candidates.len() as u32;
        self.add_candidates(state, world, a, partner);
        let end = self.candidates.len() as u32;
        self.spring.resize(end as usize, Vector3::zeros());
        self.touching.resize(end as usize, false);
        let pair = Pair { cluster: a, partner, first, end };
        for k in first..end {
            self.rest.push(self.overlap(state, world, &pair, k as usize).max(0.0));
        }
        if end > first {
            self.pairs.insert(at, pair);
        }
    }

    /// Appends the spheres of a pair that are within reach.
    fn add_candidates(&mut self, state: &State, world: &World, a: u32, partner: Partner) {
        let Self { spheres, candidates, slots, scratch: [of_a, of_b], skin, .. } = self;
        let form = |c: u32| -> &Form { &world.clusters[c as usize].form };
        let pose = |c: u32| &state.pose[c as usize];
        match partner {
            Partner::Cluster(b) => {
                reaching(form(a), pose(a), form(b), pose(b), *skin, of_a);
                reaching(form(b), pose(b), form(a), pose(a), *skin, of_b);
                for &(i, x, r) in &*of_a {
                    for &(j, y, s) in &*of_b {
                        let reach = r + s + *skin;
                        if (x - y).norm_squared() < reach * reach {
                            let slot = |(c, n)| slots.of(spheres, form(c), c, n);
                            candidates.push([(a, i), (b, j)].map(slot));
                        }
                    }
                }
            }
            Partner::Wall(w) => {
                let surface = &world.walls[w as usize].surface;
                for (i, s) in (0..).zip(&form(a).spheres) {
                    if surface.distance(pose(a).to_space(s.centre)).0 < s.radius + *skin {
                        let slot = slots.of(spheres, form(a), a, i);
                        candidates.push([slot, slot]);
                    }
                }
            }
        }
    }

    /// Pairs of spheres with something to remember, sorted.
    pub fn touches(&self) -> Vec<Touch> {
        let mut touches = Vec::new();
        for pair in &self.pairs {
            for k in pair.first as usize..pair.end as usize {
                let (touching, rest) = (self.touching[k], self.rest[k]);
                if touching || rest > 0.0 {
                    let key = (pair.cluster, pair.partner, self.numbers(pair, k));
                    touches.push(Touch { key, spring: self.spring[k], rest, touching });
                }
            }
        }
        touches
    }

    /// Gives candidates what they are to remember, sorted.
    pub fn recall(&mut self, touches: &[Touch]) {
        let n = self.candidates.len();
        self.spring.clear();
        self.spring.resize(n, Vector3::zeros());
        self.touching.clear();
        self.touching.resize(n, false);
        self.rest.clear();
        self.rest.resize(n, 0.0);
        for pair in &self.pairs {
            let from =
                touches.partition_point(|t| (t.key.0, t.key.1) < (pair.cluster, pair.partner));
            let same = touches[from..]
                .iter()
                .take_while(|t| (t.key.0, t.key.1) == (pair.cluster, pair.partner));
            for touch in same {
                let found = (pair.first as usize..pair.end as usize)
                    .find(|&k| self.numbers(pair, k) == touch.key.2);
                if let Some(k) = found {
                    self.spring[k] = touch.spring;
                    self.rest[k] = touch.rest;
                    self.touching[k] = touch.touching;
                }
            }
        }
    }

    /// Numbers of a candidate's spheres in their clusters.
    fn numbers(&self, pair: &Pair, k: usize) -> [u32; 2] {
        let [i, j] = self.candidates[k].map(|s| self.spheres[s as usize].number);
        match pair.partner {
            Partner::Cluster(_) => [i, j],
            Partner::Wall(_) => [i, 0],
        }
    }

    /// How far a candidate's spheres overlap now [m]; negative if they are apart.
    pub fn overlap(&self, state: &State, world: &World, pair: &Pair, k: usize) -> f64 {
        let place = |s: u32| {
            let s = &self.spheres[s as usize];
            (state.pose[s.cluster as usize].to_space(s.local), s.radius)
        };
        let [i, j] = self.candidates[k];
        let (x, r) = place(i);
        match pair.partner {
            Partner::Cluster(_) => {
                let (y, s) = place(j);
                r + s - (x - y).norm()
            }
            Partner::Wall(w) => r - world.walls[w as usize].surface.distance(x).0,
        }
    }
}

/// Where the spheres named so far stand in the list.
#[derive(Clone, Debug, Default)]
struct Slots {
    /// Cluster → first entry of `slot`.
    start: std::collections::HashMap<u32, u32>,
    slot: Vec<u32>,
}

impl Slots {
    fn clear(&mut self) {
        self.start.clear();
        self.slot.clear();
    }

    fn of(
        &mut self,
        spheres: &mut Vec<PlacedSphere>,
        form: &Form,
        cluster: u32,
        number: u32,
    ) -> u32 {
        let start = *self.start.entry(cluster).or_insert_with(|| {
            let start = self.slot.len();
            self.slot.resize(start + form.spheres.len(), u32::MAX);
            start as u32
        });
        let slot = &mut self.slot[(start + number) as usize];
        if *slot == u32::MAX {
            *slot = spheres.len() as u32;
            let s = &form.spheres[number as usize];
            let (local, radius) = (s.centre, s.radius);
            spheres.push(PlacedSphere { place: local, radius, cluster, number, local });
        }
        *slot
    }
}

/// Spheres of `a` (number, place, radius) that come within `skin` of the box of `b`.
fn reaching(
    a: &Form,
    at: &Pose,
    b: &Form,
    b_at: &Pose,
    skin: f64,
    out: &mut Vec<(u32, Vector3<f64>, f64)>,
) {
    out.clear();
    for (i, s) in (0..).zip(&a.spheres) {
        let x = at.to_space(s.centre);
        let y = b_at.to_local(x);
        let reach = s.radius + skin;
        if (0..3).all(|k| y[k] > b.bounds.min[k] - reach && y[k] < b.bounds.max[k] + reach) {
            out.push((i, x, s.radius));
        }
    }
}

/// The cell of a place that is not negative.
#[inline]
fn place(x: Vector3<f64>, cell: f64) -> Vector3<i64> {
    x.map(|x| (x / cell) as i64)
}

/// All pairs of boxes that meet, the lower number first. Cost linear for boxes of like size.
pub(super) fn meeting(boxes: &[(u32, Bounds)]) -> Vec<(u32, u32)> {
    let mut pairs = Vec::new();
    if boxes.len() < 2 {
        return pairs;
    }
    let low = boxes.iter().fold(Vector3::repeat(f64::INFINITY), |low, b| low.inf(&b.1.min));
    let mut sizes: Vec<f64> = boxes.iter().map(|b| (b.1.max - b.1.min).max()).collect();
    sizes.sort_unstable_by(f64::total_cmp);
    let mut cell = 1.2 * sizes[sizes.len() / 2];
    let range = |b: &Bounds, cell: f64| (place(b.min - low, cell), place(b.max - low, cell));
    let count = |cell: f64| -> i64 {
        boxes.iter().map(|b| range(&b.1, cell)).map(|(a, b)| (b - a).add_scalar(1).product()).sum()
    };
    // A few large ones among small ones must not fill the grid.
    while count(cell) > 27 * boxes.len() as i64 {
        cell *= 1.5;
    }
    // Cells in one number, and boxes.
    let [_, wide, high] = <[i64; 3]>::from(boxes.iter().fold(Vector3::zeros(), |most, b| {
        let (_, to) = range(&b.1, cell);
        most.sup(&to.add_scalar(1))
    }));
    let number = |[i, j, k]: [i64; 3]| (i * wide + j) * high + k;
    let mut entries: Vec<(i64, u32)> = Vec::new();
    for (n, (_, bounds)) in (0..).zip(boxes) {
        let (from, to) = range(bounds, cell);
        for i in from.x..=to.x {
            for j in from.y..=to.y {
                for k in from.z..=to.z {
                    entries.push((number([i, j, k]), n));
                }
            }
        }
    }
    entries.sort_unstable();
    for cellmates in entries.chunk_by(|a, b| a.0 == b.0) {
        for (m, &(here, a)) in cellmates.iter().enumerate() {
            for &(_, b) in &cellmates[m + 1..] {
                let ((p, p_box), (q, q_box)) = (&boxes[a as usize], &boxes[b as usize]);
                // A pair is found once: in the cell of its boxes' common lower corner.
                let corner = p_box.min.sup(&q_box.min);
                if p_box.meets(q_box) && number(place(corner - low, cell).into()) == here {
                    pairs.push((*p.min(q), *p.max(q)));
                }
            }
        }
    }
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_that_meet_are_found_once() {
        let mut seed = 1u64;
        let mut random = || {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (seed >> 11) as f64 / (1u64 << 53) as f64
        };
        let boxes: Vec<(u32, Bounds)> = (0..300)
            .map(|i| {
                let min = Vector3::new(random(), random(), random());
                let size = if i % 50 == 0 { 0.7 } else { 0.08 };
                (i, Bounds { min, max: min + Vector3::repeat(size * (0.5 + random())) })
            })
            .collect();
        let mut found = meeting(&boxes);
        found.sort_unstable();
        let mut all = Vec::new();
        for (i, a) in &boxes {
            all.extend(boxes.iter().filter(|(j, b)| j > i && a.meets(b)).map(|(j, _)| (*i, *j)));
        }
        assert_eq!(found, all);
    }
}
