//! Structures too thin for the mesh: a level set on the nodes does not see walls of less than about two elements.
//!
//! Rays go in from points all over a structure's surface, through whatever touches it behind, and come out on the
//! other side of it all: that is how thick it is there, in elements of the size of the one at the point.

use super::Structures;
use crate::bodies::Bodies;
use crate::cut::level_set::Solid;
use crate::fem::dot;
use crate::mesh::MeshPart;
use crate::mesh::locate::Locator;
use nalgebra::Vector3;

/// Elements of thickness that a structure wants: two, but for what grading and placing take off.
const WANTED: f64 = 1.95;
/// Points along a triangle's edge, at most.
const FINEST: usize = 12;
/// Structures that a ray goes through, at most.
const THROUGH: usize = 8;

/// A structure that is too thin somewhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thin {
    /// Its number: obstacles first, then bodies.
    pub structure: usize,
    /// Where it is thinnest, measured in elements [m].
    pub place: [f64; 3],
    /// How thick it is there [m].
    pub thickness: f64,
    /// The same in elements.
    pub elements: f64,
    /// Share of its surface in the mesh where it is too thin.
    pub share: f64,
}

impl Structures {
    /// Those that are too thin, where they stand at `t`, the same on every rank. Collective.
    pub fn thin(&self, part: &MeshPart, bodies: Option<&Bodies>, t: f64) -> Vec<Thin> {
        if self.is_empty() {
            return Vec::new();
        }
        let locator = Locator::owned(part);
        let solids = self.solids(bodies, t);
        // Area that is in the mesh, that is too thin; the thinnest place.
        let mut areas = vec![[0.0; 2]; solids.len()];
        let mut thinnest = vec![[f64::INFINITY; 5]; solids.len()];
        for (s, solid) in solids.iter().enumerate().filter(|(_, solid)| !solid.outside_in) {
            let near = solid.shape.bounds(&solid.pose).inflated(self.nodes.band);
            if !near.meets(&self.mesh) {
                continue;
            }
            let meets = |other: &&Solid<'_>| {
                !std::ptr::eq(*other, solid) && other.shape.bounds(&other.pose).meets(&near)
            };
            let others: Vec<&Solid<'_>> = solids.iter().filter(meets).collect();
            let surface = solid.shape.surface(self.nodes.band);
            for corners in surface.corners() {
                for (x, n, area) in points(corners.map(|x| solid.pose.to_space(x)), self.nodes.band)
                {
                    let Some(place) = locator.find(&part.mesh, x.into()) else { continue };
                    let c = part.mesh.corners(place.element as usize);
                    let along = c.map(|c| dot(c, n.into()));
                    let size = along.iter().fold(f64::NEG_INFINITY, |m, &s| m.max(s))
                        - along.iter().fold(f64::INFINITY, |m, &s| m.min(s));
                    let skin = 1e-3 * size;
                    // What another structure covers is not a surface.
                    if others.iter().any(|o| o.distance((x + n * skin).into()) < skin) {
                        continue;
                    }
                    let thick = through(solid, &others, x, -n, skin, (WANTED + 1.0) * size);
                    areas[s][0] += area;
                    if thick < WANTED * size {
                        areas[s][1] += area;
                        if thick / size < thinnest[s][0] {
                            thinnest[s] = [thick / size, thick, x.x, x.y, x.z];
                        }
                    }
                }
            }
        }
        part.comm.sum_all(areas.as_flattened_mut());
        let all = part.comm.all_gather(thinnest.as_flattened());
        let found = |s: usize| {
            let mine = all.iter().map(|list| &list[5 * s..5 * s + 5]);
            // Equally thin everywhere: the first place.
            let least = mine.min_by(|a, b| a.iter().partial_cmp(b.iter()).expect("numbers"))?;
            let [elements, thickness, x, y, z] = *least else { unreachable!("five of each") };
            (elements < WANTED).then_some(Thin {
                structure: s,
                place: [x, y, z],
                thickness,
                elements,
                share: areas[s][1] / areas[s][0],
            })
        };
        (0..solids.len()).filter_map(found).collect()
    }
}

/// Points of a triangle no further apart than `spacing`, its normal, the area that each stands for.
fn points(
    [a, b, c]: [Vector3<f64>; 3],
    spacing: f64,
) -> impl Iterator<Item = (Vector3<f64>, Vector3<f64>, f64)> {
    let longest = (b - a).norm().max((c - b).norm()).max((a - c).norm());
    let n = ((longest / spacing).ceil() as usize).clamp(1, FINEST);
    let normal = (b - a).cross(&(c - a));
    let area = 0.5 * normal.norm() / (n * n) as f64;
    let step = 1.0 / n as f64;
    let at = move |i: f64, j: f64| a + (b - a) * (i * step) + (c - a) * (j * step);
    let normal = normal.normalize();
    let each = (0..n).flat_map(move |i| {
        (0..n - i).flat_map(move |j| {
            let (u, v) = (i as f64, j as f64);
            let up = Some(at(u + 1.0 / 3.0, v + 1.0 / 3.0));
            let down = (i + j + 1 < n).then(|| at(u + 2.0 / 3.0, v + 2.0 / 3.0));
            up.into_iter().chain(down)
        })
    });
    each.map(move |x| (x, normal, area))
}

/// How far it is from the surface point `x` along `way` to the open, `far` at most [m].
fn through(
    solid: &Solid<'_>,
    others: &[&Solid<'_>],
    x: Vector3<f64>,
    way: Vector3<f64>,
    skin: f64,
    far: f64,
) -> f64 {
    let exit = |solid: &Solid<'_>, from: f64| {
        let (p, w) = (solid.pose.to_local(x + way * from), solid.pose.rotation.inverse() * way);
        solid.shape.exit(p, w).map_or(far, |d| from + d)
    };
    let mut gone = exit(solid, skin);
    for _ in 0..THROUGH {
        let ahead = (x + way * (gone + skin)).into();
        match others.iter().find(|o| o.distance(ahead) < 0.0) {
            Some(next) if gone < far => gone = exit(next, gone + skin),
            _ => break,
        }
    }
    gone.min(far)
}
