//! Clusters of one sphere around the centroid: flat lists of those that may touch, and their contact.
//!
//! The point of contact lies on the line through both centroids, `r × n = 0`: one contact stops
//! `1/m = 1/m_a + 1/m_b`, whatever the inertia, and the torque on either is `−r n × F`.

use super::account::Account;
use super::cluster::State;
use super::contact::{Twist, World};
use super::contact_law::{Point, push};
use super::neighbours::{Partner, Touch};
use nalgebra::Vector3;

/// Where a ball is.
#[derive(Clone, Copy, Debug, Default)]
struct Ball {
    /// [m]
    centre: Vector3<f64>,
    /// [m]
    radius: f64,
}

/// Balls and what they may touch: other balls, walls.
#[derive(Clone, Debug, Default)]
pub struct Balls {
    /// An entry for each cluster, set for the balls that lists name.
    balls: Vec<Ball>,
    /// Index of the material of each cluster.
    material: Vec<u32>,
    /// Balls that lists name, often more than once.
    listed: Vec<u32>,
    /// Pairs of balls, the lower number first, sorted.
    pairs: Vec<[u32; 2]>,
    /// Balls and walls, sorted.
    walls: Vec<[u32; 2]>,
    /// C of the pairs, then of those at walls [N s/m].
    dashpot: Vec<f64>,
    /// Their ξ [m], if touching.
    spring: Vec<Vector3<f64>>,
    /// Whether they touched last time.
    touching: Vec<bool>,
}

impl Balls {
    /// Number of candidates.
    pub(super) fn n_candidates(&self) -> usize {
        self.dashpot.len()
    }

    /// Forgets all lists.
    pub(super) fn clear(&mut self, world: &World) {
        self.balls.resize(world.clusters.len(), Ball::default());
        self.material.clear();
        self.material.extend(world.clusters.iter().map(|c| c.material));
        [&mut self.pairs, &mut self.walls].into_iter().for_each(Vec::clear);
        self.listed.clear();
        self.dashpot.clear();
    }

    /// Adds a pair, unless more than `skin` is between them. All pairs come before all walls, sorted.
    pub(super) fn add_pair(&mut self, state: &State, world: &World, pair: [u32; 2], skin: f64) {
        let [a, b] = pair.map(|c| &world.clusters[c as usize]);
        let [x, y] = pair.map(|c| state.pose[c as usize].position);
        let reach = a.form.radius + b.form.radius + skin;
        if (x - y).norm_squared() < reach * reach {
            self.pairs.push(pair);
            let inverse = a.inverse_mass() + b.inverse_mass();
            self.dashpot.push(world.materials.damping(a.material, b.material) / inverse.sqrt());
            self.list(world, pair[0]);
            self.list(world, pair[1]);
        }
    }

    /// Adds a free ball at a wall.
    pub(super) fn add_wall(&mut self, world: &World, cluster: u32, wall: u32) {
        self.walls.push([cluster, wall]);
        let ball = &world.clusters[cluster as usize];
        let damping = world.materials.damping(ball.material, world.walls[wall as usize].material);
        self.dashpot.push(damping * ball.mass.sqrt());
        self.list(world, cluster);
    }

    fn list(&mut self, world: &World, cluster: u32) {
        if self.listed.last() != Some(&cluster) {
            self.listed.push(cluster);
            self.balls[cluster as usize].radius = world.clusters[cluster as usize].form.radius;
        }
    }

    /// All are added: gives them what they are to remember, sorted.
    pub(super) fn recall(&mut self, touches: &[Touch]) {
        self.listed.sort_unstable();
        self.listed.dedup();
        let n = self.dashpot.len();
        self.spring.clear();
        self.spring.resize(n, Vector3::zeros());
        self.touching.clear();
        self.touching.resize(n, false);
        for list in [0..self.pairs.len(), self.pairs.len()..n] {
            let mut touches = touches.iter().peekable();
            for k in list {
                let key = self.key(k);
                while touches.next_if(|touch| touch.key < key).is_some() {}
                if let Some(touch) = touches.next_if(|touch| touch.key == key) {
                    (self.spring[k], self.touching[k]) = (touch.spring, touch.touching);
                }
            }
        }
    }

    fn key(&self, k: usize) -> (u32, Partner, [u32; 2]) {
        let (cluster, partner) = match self.pairs.get(k) {
            Some(&[a, b]) => (a, Partner::Cluster(b)),
            None => {
                let [a, w] = self.walls[k - self.pairs.len()];
                (a, Partner::Wall(w))
            }
        };
        (cluster, partner, [0, 0])
    }

    /// Those that touch.
    pub(super) fn touches(&self) -> impl Iterator<Item = Touch> {
        let touching = (0..self.touching.len()).filter(|&k| self.touching[k]);
        touching.map(|k| Touch {
            key: self.key(k),
            spring: self.spring[k],
            rest: 0.0,
            touching: true,
        })
    }

    /// Moves the balls to where their clusters are.
    pub(super) fn place(&mut self, state: &State) {
        for &c in &self.listed {
            self.balls[c as usize].centre = state.pose[c as usize].position;
        }
    }

    /// As `contact::add_forces`.
    pub(super) fn add_forces(
        &mut self,
        state: &mut State,
        twists: &[Twist],
        world: &World,
        dt: f64,
        counted: &[bool],
        account: &mut Account,
        deepest: &mut f64,
    ) {
        let no_tension = world.materials.no_tension;
        let n = self.pairs.len();
        let (touching, touching_walls) = self.touching.split_at_mut(n);
        let mut hits = [0; BLOCK];
        for block in (0..n).step_by(BLOCK) {
            for &k in find_hits(&self.balls, &self.pairs, touching, block, &mut hits) {
                let k = k as usize;
                let [a, b] = self.pairs[k].map(|c| c as usize);
                let (p, q) = (&self.balls[a], &self.balls[b]);
                let (distance, n) = apart(p.centre - q.centre);
                let overlap = p.radius + q.radius - distance;
                let least = p.radius.min(q.radius);
                if overlap > *deepest * least {
                    *deepest = overlap / least;
                }
                let arms = [p.radius - 0.5 * overlap, q.radius - 0.5 * overlap];
                let (s, t) = (&twists[a], &twists[b]);
                let velocity =
                    s.velocity - t.velocity + n.cross(&(arms[0] * s.spin + arms[1] * t.spin));
                let spin = 0.5 * (s.spin + t.spin).dot(&n);
                let point = Point { normal: n, overlap, velocity, spin, dashpot: self.dashpot[k] };
                let law = world.materials.pair(self.material[a], self.material[b]);
                let push = push(law, no_tension, &point, &mut self.spring[k], touching[k], dt);
                touching[k] = true;
                if counted[a] {
                    account.friction += push.friction;
                    account.dashpots += push.dashpots;
                }
                let turn = n.cross(&push.force);
                state.force[a] += push.force;
                state.torque[a] -= arms[0] * turn;
                state.force[b] -= push.force;
                state.torque[b] -= arms[1] * turn;
            }
        }
        let memory = self.spring[n..].iter_mut().zip(touching_walls).zip(&self.dashpot[n..]);
        for (&[a, w], ((spring, touching), &dashpot)) in self.walls.iter().zip(memory) {
            let (a, wall) = (a as usize, &world.walls[w as usize]);
            let ball = &self.balls[a];
            let (distance, n) = wall.surface.distance(ball.centre);
            let overlap = ball.radius - distance;
            if overlap <= 0.0 {
                *touching = false;
                continue;
            }
            *deepest = deepest.max(overlap / ball.radius);
            let arm = ball.radius - 0.5 * overlap;
            let Twist { velocity, spin } = twists[a];
            let velocity = velocity + n.cross(&(arm * spin));
            let spin = 0.5 * spin.dot(&n);
            let point = Point { normal: n, overlap, velocity, spin, dashpot };
            let law = world.materials.pair(self.material[a], wall.material);
            let push = push(law, no_tension, &point, spring, *touching, dt);
            *touching = true;
            if counted[a] {
                account.friction += push.friction;
                account.dashpots += push.dashpots;
            }
            state.force[a] += push.force;
            state.torque[a] -= arm * n.cross(&push.force);
        }
    }

    /// Energy in the springs [J] of those whose first cluster is counted.
    pub(super) fn elastic_energy(&self, state: &State, world: &World, counted: &[bool]) -> f64 {
        let mut sum = 0.0;
        for touch in self.touches().filter(|touch| counted[touch.key.0 as usize]) {
            let a = touch.key.0 as usize;
            let (x, r) = (state.pose[a].position, self.balls[a].radius);
            let (overlap, material) = match touch.key.1 {
                Partner::Cluster(b) => {
                    let (b, other) = (b as usize, &self.balls[b as usize]);
                    let distance = (x - state.pose[b].position).norm();
                    (r + other.radius - distance, world.clusters[b].material)
                }
                Partner::Wall(w) => {
                    let wall = &world.walls[w as usize];
                    (r - wall.surface.distance(x).0, wall.material)
                }
            };
            let law = world.materials.pair(world.clusters[a].material, material);
            sum += 0.5 * law.stiffness * (overlap * overlap + touch.spring.norm_squared());
        }
        sum
    }
}

/// Pairs that are looked at together.
const BLOCK: usize = 256;

/// Which pairs of a block touch now, without a branch; what does not, will not have touched next time.
fn find_hits<'a>(
    balls: &[Ball],
    pairs: &[[u32; 2]],
    touching: &mut [bool],
    block: usize,
    hits: &'a mut [u32; BLOCK],
) -> &'a [u32] {
    let mut n = 0;
    let touching = touching[block..].iter_mut();
    for (k, (pair, touching)) in
        (block as u32..).zip(pairs[block..].iter().zip(touching).take(BLOCK))
    {
        let [p, q] = pair.map(|c| &balls[c as usize]);
        let reach = p.radius + q.radius;
        let hit = (p.centre - q.centre).norm_squared() < reach * reach;
        *touching &= hit;
        hits[n] = k;
        n += usize::from(hit);
    }
    &hits[..n]
}

/// Length and direction of a vector; some direction if it is 0.
#[inline(always)]
fn apart(x: Vector3<f64>) -> (f64, Vector3<f64>) {
    let length = x.norm();
    (length, if length > 0.0 { x * (1.0 / length) } else { Vector3::z() })
}
