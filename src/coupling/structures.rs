//! Obstacles and bodies as the flow sees them.

use super::{Failure, Report};
use crate::bodies::cohesion::Joint;
use crate::bodies::{Bodies, Load, Placed};
use crate::case::Case;
use crate::cut::level_set::{Bridge, LevelSet, Nodes, Solid, nearest};
use crate::cut::{CutElement, CutMesh, Motion, Surface, Wall};
use crate::fem::dot;
use crate::flow::{BodyLoad, Flow, Material};
use crate::mesh::MeshPart;
use crate::obstacles::Obstacles;
use crate::shape::{Bounds, Shape};
use nalgebra::Vector3;

/// All of them: obstacles first, then bodies.
#[derive(Clone, Debug)]
pub struct Structures {
    pub(super) obstacles: Obstacles,
    pub(super) nodes: Nodes,
    /// Distances to the obstacles that never move: found once.
    still: LevelSet,
    /// How bodies hold the fluid.
    wall: Wall,
    /// Around the mesh.
    pub mesh: Bounds,
    /// Where each body stands, and how its wall moves over the step.
    pub placed: Vec<Placed>,
}

impl Structures {
    /// At t = 0. Collective.
    pub fn new(
        case: &Case,
        part: &MeshPart,
        obstacles: Obstacles,
        bodies: Option<&Bodies>,
    ) -> Self {
        let slip = case.bodies.as_ref().is_some_and(|b| b.slip);
        let solids = obstacles.solids(0.0);
        let clusters = bodies.map_or(&[][..], |b| &b.world.clusters);
        let mut shapes =
            solids.iter().map(|s| s.shape).chain(clusters.iter().map(|c| &c.form.shape));
        let nodes = Nodes::new(part, shapes.any(Shape::is_round));
        let still = (0u32..).zip(&solids).filter(|(i, _)| !obstacles.moves(*i as usize));
        let still = LevelSet::nothing(part, &nodes).with(part, &nodes, still, &[]);
        Self {
            still,
            obstacles,
            nodes,
            mesh: bounds(part),
            wall: if slip { Wall::Slip } else { Wall::NoSlip },
            placed: bodies.map_or(Vec::new(), Bodies::placed),
        }
    }

    /// Whether there are any.
    pub fn is_empty(&self) -> bool {
        self.first_body() + self.placed.len() == 0
    }

    /// Whether any of them may move.
    pub fn move_at_all(&self) -> bool {
        self.obstacles.move_at_all() || !self.placed.is_empty()
    }

    /// Whether this is an obstacle that moves.
    pub fn obstacle_moves(&self, structure: usize) -> bool {
        structure < self.first_body() && self.obstacles.moves(structure)
    }

    /// The number of the first body.
    pub fn first_body(&self) -> usize {
        self.obstacles.names().count()
    }

    /// Names of the obstacles.
    pub fn obstacles(&self) -> impl Iterator<Item = &str> {
        self.obstacles.names()
    }

    /// What to call one of them in a sentence.
    pub fn name(&self, case: &Case, bodies: Option<&Bodies>, structure: usize) -> String {
        match (structure.checked_sub(self.first_body()), bodies, &case.bodies) {
            (Some(body), Some(bodies), Some(asked)) => {
                let group = bodies.world.clusters[body].group;
                format!("body \"{}\"", asked.bodies[group as usize].name)
            }
            _ => format!("obstacle \"{}\"", case.obstacles[structure].name),
        }
    }

    /// Loads on each obstacle, then on all bodies of each entry together, torques about their common centroid;
    /// `hidden` adds to the reaction. There are so many `entries`.
    pub fn by_name(
        &self,
        bodies: Option<&Bodies>,
        loads: &[BodyLoad],
        hidden: &[Load],
        entries: usize,
    ) -> Vec<BodyLoad> {
        let mut sums = loads[..self.first_body()].to_vec();
        let clusters = bodies.map_or(&[][..], |b| &b.world.clusters);
        let mut centres = vec![(0.0, Vector3::zeros()); entries];
        for (cluster, placed) in clusters.iter().zip(&self.placed) {
            let centre = &mut centres[cluster.group as usize];
            centre.0 += cluster.mass;
            centre.1 += cluster.mass * placed.pose.position;
        }
        sums.resize(self.first_body() + entries, BodyLoad::default());
        for (c, (cluster, placed)) in clusters.iter().zip(&self.placed).enumerate() {
            let (entry, seen) = (cluster.group as usize, &loads[self.first_body() + c]);
            let arm = placed.pose.position - centres[entry].1 / centres[entry].0;
            let under = hidden.get(c).copied().unwrap_or_default();
            let sum = &mut sums[self.first_body() + entry];
            for (sum, seen, under) in [
                (&mut sum.reaction, &seen.reaction, under),
                (&mut sum.traction, &seen.traction, Load::default()),
            ] {
                let force = Vector3::from(seen.force) + under.force;
                let torque = Vector3::from(seen.torque) + under.torque + arm.cross(&force);
                for k in 0..3 {
                    sum.force[k] += force[k];
                    sum.torque[k] += torque[k];
                }
            }
            sum.area += seen.area;
        }
        sums
    }

    /// Cells that the fastest wall crosses a second: its speed across over the cell's size that way. Collective.
    pub fn crossing_rate(&self, part: &MeshPart, cut: &CutMesh, t: f64, dt: f64) -> f64 {
        let surfaces = self.surfaces(t, dt);
        let rate = |c: &CutElement| {
            let n = c.pieces.normal;
            let along = part.mesh.corners(c.element as usize).map(|x| dot(x, n));
            let size = along.iter().fold(f64::NEG_INFINITY, |m, &s| m.max(s))
                - along.iter().fold(f64::INFINITY, |m, &s| m.min(s));
            dot(surfaces[c.body as usize].motion.at(c.x), n).abs() / size
        };
        part.max(cut.owned(part).map(rate).fold(0.0, f64::max))
    }

    /// The mesh as they leave it: obstacles where they are at time `t`, bodies where they stand. Collective.
    pub fn cut(&self, part: &MeshPart, bodies: Option<&Bodies>, t: f64) -> CutMesh {
        if self.is_empty() {
            return CutMesh::whole();
        }
        let solids = self.solids(bodies, t);
        let bridges = bodies.map_or(Vec::new(), |bodies| self.bridges(bodies));
        let moves = |&(i, _): &(u32, &Solid<'_>)| {
            i as usize >= self.first_body() || self.obstacles.moves(i as usize)
        };
        let moving = (0u32..).zip(&solids).filter(moves);
        let levels = self.still.clone().with(part, &self.nodes, moving, &bridges);
        CutMesh::new(part, levels, |x, near| nearest(&solids, near, x))
    }

    /// Obstacles where they are at time `t`, bodies where they stand.
    pub fn solids<'a>(&'a self, bodies: Option<&'a Bodies>, t: f64) -> Vec<Solid<'a>> {
        let mut solids = self.obstacles.solids(t);
        if let Some(bodies) = bodies {
            let clusters = bodies.world.clusters.iter().zip(&self.placed);
            solids.extend(clusters.map(|(cluster, placed)| Solid {
                shape: &cluster.form.shape,
                pose: placed.pose,
                outside_in: false,
            }));
        }
        solids
    }

    /// Where joints hold. Collective.
    fn bridges(&self, bodies: &Bodies) -> Vec<Bridge> {
        let (joints, holding) = (&bodies.joints, bodies.holding());
        let bounds = |c: u32| {
            let c = c as usize;
            bodies.world.clusters[c].form.bounds_at(&self.placed[c].pose)
        };
        let bridge = |joint: &Joint, prism: &[(Vector3<f64>, f64)]| {
            let pose = &self.placed[joint.a as usize].pose;
            let sides = prism.iter().map(|&(n, offset)| {
                let n = pose.rotation * n;
                (n, offset + n.dot(&pose.position))
            });
            Bridge {
                sides: sides.collect(),
                bounds: bounds(joint.a).joined(&bounds(joint.b)),
                gap: joints.laws[joint.law as usize].opening,
            }
        };
        let all = joints.joints.iter().zip(&joints.prisms).zip(holding);
        all.filter(|(_, holds)| *holds).map(|((j, prism), _)| bridge(j, prism)).collect()
    }

    /// Their walls over the step from `t` to `t + dt`.
    fn surfaces(&self, t: f64, dt: f64) -> Vec<Surface> {
        let mut surfaces = self.obstacles.surfaces(t, dt);
        surfaces.extend(self.placed.iter().map(|placed| Surface {
            wall: self.wall,
            motion: Motion {
                centre: placed.pose.position.into(),
                velocity: placed.twist.velocity.into(),
                spin: placed.twist.spin.into(),
            },
        }));
        surfaces
    }

    /// One pass of the flow over the step, and what it did to the structures. Collective.
    pub(super) fn pass(
        &self,
        part: &MeshPart,
        cut: &CutMesh,
        material: &Material,
        flow: &mut Flow,
        [t, dt]: [f64; 2],
        report: &mut Report,
    ) -> Result<(), Failure> {
        let surfaces = self.surfaces(t, dt);
        let done = flow.advance(part, cut, &surfaces, material, t, dt).map_err(Failure::Flow)?;
        let before = report.flow;
        report.flow = done;
        report.flow.iterations += before.iterations;
        report.flow.assembly += before.assembly;
        report.flow.solve += before.solve;
        report.loads = flow.loads(part, cut, material, &surfaces);
        report.surfaces = surfaces;
        Ok(())
    }
}

/// Around the whole mesh. Collective.
fn bounds(part: &MeshPart) -> Bounds {
    let mine = Bounds::of(part.mesh.nodes.iter().map(|&x| x.into()));
    Bounds { min: mine.min.map(|x| -part.max(-x)), max: mine.max.map(|x| part.max(x)) }
}

/// The weak form's own reaction: what the water loses, the body gets.
pub(super) fn on_body(load: &BodyLoad) -> Load {
    Load { force: load.reaction.force.into(), torque: load.reaction.torque.into() }
}
