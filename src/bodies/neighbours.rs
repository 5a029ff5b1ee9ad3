//! Who may touch whom: clusters whose boxes meet (`broad_phase`), then their spheres. Pairs of single spheres have
//! lists of their own (`balls`).
//!
//! Lists reach `skin` beyond contact and serve until a surface has moved by half of it. Tangential
//! springs stay with their pair of spheres when lists are made anew.

use super::balls::Balls;
use super::broad_phase::meeting;
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
    /// Clusters of one sphere and what they may touch of each other and of walls.
    pub balls: Balls,
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

    /// Number of candidates, balls' among them.
    pub fn n_candidates(&self) -> usize {
        self.candidates.len() + self.balls.n_candidates()
    }

    /// Moves the spheres to where their clusters are.
    pub fn place(&mut self, state: &State) {
        self.balls.place(state);
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
        let there = |c: &&u32| world.clusters[**c as usize].motion != Motion::Gone;
        let bounds: Vec<(u32, Bounds)> = local
            .iter()
            .filter(there)
            .map(|&c| (c, form(c).bounds_at(&state.pose[c as usize]).inflated(0.5 * skin)))
            .collect();
        self.pairs.clear();
        self.candidates.clear();
        self.spheres.clear();
        self.slots.clear();
        self.balls.clear(world);
        let mut close: Vec<(u32, Partner)> = Vec::new();
        let free = |c: u32| world.clusters[c as usize].is_free();
        for (a, b) in meeting(&bounds) {
            if (mine(a) || mine(b)) && (free(a) || free(b)) && !apart(a, b) {
                if form(a).is_ball() && form(b).is_ball() {
                    self.balls.add_pair(state, world, [a, b], skin);
                } else {
                    close.push((a, Partner::Cluster(b)));
                }
            }
        }
        for &(c, _) in bounds.iter().filter(|(c, _)| mine(*c) && free(*c)) {
            let (cluster, centre) = (&world.clusters[c as usize], state.pose[c as usize].position);
            let reach = cluster.form.radius + skin;
            for (w, wall) in (0..).zip(&world.walls) {
                if wall.surface.distance(centre).0 >= reach
                    || world.ignored.contains(&(cluster.group, w))
                {
                    continue;
                }
                if cluster.form.is_ball() {
                    self.balls.add_wall(world, c, w);
                } else {
                    close.push((c, Partner::Wall(w)));
                }
            }
        }
        // Two sorted lists, one after the other.
        close.sort();
        for (cluster, partner) in close {
            let first = self.candidates.len() as u32;
            self.add_candidates(state, world, cluster, partner);
            let end = self.candidates.len() as u32;
            if end > first {
                self.pairs.push(Pair { cluster, partner, first, end });
            }
        }
        self.balls.recall(touches);
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
        let mut touches: Vec<Touch> = self.balls.touches().collect();
        for pair in &self.pairs {
            for k in pair.first as usize..pair.end as usize {
                let (touching, rest) = (self.touching[k], self.rest[k]);
                if touching || rest > 0.0 {
                    let key = (pair.cluster, pair.partner, self.numbers(pair, k));
                    touches.push(Touch { key, spring: self.spring[k], rest, touching });
                }
            }
        }
        touches.sort_by_key(|touch| touch.key);
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
