//! Faces that two clusters share: flat, opposite, with a common area. There they can be glued.
//!
//! A common area is cut by a grid of n × n cells along its edges; each piece gives an integration point at
//! its centroid with its area, so that the areas add up to the face whatever its outline.

use super::broad_phase::meeting;
use super::cluster::{Form, State};
use super::contact::World;
use crate::shape::{Pose, Shape};
use nalgebra::{Vector2, Vector3};

/// Faces are parallel if their normals differ by less than this [rad].
const PARALLEL: f64 = 1e-2;

/// A flat convex piece of a surface, in space.
#[derive(Clone, Debug, PartialEq)]
pub struct Face {
    /// Outwards.
    normal: Vector3<f64>,
    corners: Vec<Vector3<f64>>,
}

/// What two clusters have in common.
#[derive(Clone, Debug, PartialEq)]
pub struct Common {
    /// The clusters, the lower number first.
    pub clusters: [u32; 2],
    /// From the first to the second, in space.
    pub normal: Vector3<f64>,
    /// Corners of the common area's convex hull [m], anticlockwise seen from the tip of the normal.
    pub outline: Vec<Vector3<f64>>,
    /// Integration points [m] and their areas [m²].
    pub points: Vec<(Vector3<f64>, f64)>,
}

/// Flat faces of a form where it stands; round ones have none.
fn faces(form: &Form, pose: &Pose) -> Vec<Face> {
    let face = |corners: &[Vector3<f64>]| {
        let corners: Vec<_> = corners.iter().map(|&x| pose.to_space(x)).collect();
        let [a, b, c] = [corners[0], corners[1], corners[2]];
        Face { normal: (b - a).cross(&(c - a)).normalize(), corners }
    };
    match &form.shape {
        Shape::Cuboid(_) => {
            let surface = form.shape.surface(1.0);
            let pairs = surface.triangles.as_chunks::<2>().0;
            let quad = |[[a, b, c], [_, _, d]]: &[[u32; 3]; 2]| [*a, *b, *c, *d];
            pairs.iter().map(|t| face(&quad(t).map(|v| surface.vertices[v as usize]))).collect()
        }
        Shape::Mesh(mesh) => {
            let flat = |f: &Face| f.normal.iter().all(|n| n.is_finite());
            mesh.surface().corners().map(|t| face(&t)).filter(flat).collect()
        }
        Shape::Cylinder(c) => {
            // Polygons of the area of the caps.
            const SIDES: usize = 48;
            let sector = std::f64::consts::TAU / SIDES as f64;
            let r = c.radius * (sector / sector.sin()).sqrt();
            [-1.0, 1.0]
                .map(|side| {
                    let corner = |k: usize| {
                        let angle = side * sector * k as f64;
                        Vector3::new(r * angle.cos(), r * angle.sin(), side * c.half_height)
                    };
                    face(&(0..SIDES).map(corner).collect::<Vec<_>>())
                })
                .into()
        }
        Shape::Sphere(_) => Vec::new(),
    }
}

/// Pairs of the clusters `which` whose boxes come within `gap` [m] of each other, sorted.
pub fn close_pairs(state: &State, world: &World, which: &[u32], gap: f64) -> Vec<[u32; 2]> {
    let bounds = |&c: &u32| {
        let pose = &state.pose[c as usize];
        (c, world.clusters[c as usize].form.bounds_at(pose).inflated(0.5 * gap + 1e-12))
    };
    let boxes: Vec<_> = which.iter().map(bounds).collect();
    meeting(&boxes).into_iter().map(|(a, b)| [a, b]).collect()
}

/// Common faces of the pairs of clusters, `across` points along each side; gaps up to `gap` [m] count as
/// touching.
pub fn common_faces(
    state: &State,
    world: &World,
    pairs: &[[u32; 2]],
    across: u32,
    gap: f64,
) -> Vec<Common> {
    let mut known: Vec<Option<Vec<Face>>> = vec![None; world.clusters.len()];
    let mut found = Vec::new();
    for &[a, b] in pairs {
        for c in [a, b].map(|c| c as usize) {
            known[c].get_or_insert_with(|| faces(&world.clusters[c].form, &state.pose[c]));
        }
        let [of_a, of_b] = [a, b].map(|c| known[c as usize].as_ref().expect("just found"));
        // Pieces in one plane are one face.
        let mut planes: Vec<(Plane, Vec<Vec<Vector2<f64>>>)> = Vec::new();
        for f in of_a {
            for g in of_b.iter().filter(|g| (f.normal + g.normal).norm() < PARALLEL) {
                let off = (g.corners[0] - f.corners[0]).dot(&f.normal);
                if off.abs() > gap {
                    continue;
                }
                let at = planes.iter().position(|(plane, _)| plane.holds(f, gap));
                let at = at.unwrap_or_else(|| {
                    planes.push((Plane::of(f, 0.5 * off), Vec::new()));
                    planes.len() - 1
                });
                let (plane, pieces) = &mut planes[at];
                let piece = clip(&plane.flat(f), &plane.flat(g));
                if piece.len() > 2 {
                    pieces.push(piece);
                }
            }
        }
        for (plane, pieces) in planes {
            let points = plane.points(&pieces, across);
            if !points.is_empty() {
                let corners = hull(pieces.concat());
                let outline = corners.into_iter().map(|x| plane.to_space(x)).collect();
                found.push(Common { clusters: [a, b], normal: plane.normal, outline, points });
            }
        }
    }
    found
}

/// A plane with axes along the first edge of the face that it was made for.
struct Plane {
    origin: Vector3<f64>,
    normal: Vector3<f64>,
    axes: [Vector3<f64>; 2],
    /// Of that face [m].
    size: f64,
}

impl Plane {
    fn of(face: &Face, off: f64) -> Self {
        let along = (face.corners[1] - face.corners[0]).normalize();
        Self {
            origin: face.corners[0] + off * face.normal,
            normal: face.normal,
            axes: [along, face.normal.cross(&along)],
            size: face.corners.iter().map(|x| (x - face.corners[0]).norm()).fold(0.0, f64::max),
        }
    }

    fn holds(&self, face: &Face, gap: f64) -> bool {
        (self.normal - face.normal).norm() < PARALLEL
            && (face.corners[0] - self.origin).dot(&self.normal).abs() <= gap
    }

    /// Corners in the plane, anticlockwise seen from the tip of its normal.
    fn flat(&self, face: &Face) -> Vec<Vector2<f64>> {
        let place = |x: &Vector3<f64>| {
            let y = x - self.origin;
            Vector2::new(y.dot(&self.axes[0]), y.dot(&self.axes[1]))
        };
        let mut corners: Vec<_> = face.corners.iter().map(place).collect();
        if face.normal.dot(&self.normal) < 0.0 {
            corners.reverse();
        }
        corners
    }

    fn to_space(&self, x: Vector2<f64>) -> Vector3<f64> {
        self.origin + self.axes[0] * x.x + self.axes[1] * x.y
    }

    fn points(&self, pieces: &[Vec<Vector2<f64>>], across: u32) -> Vec<(Vector3<f64>, f64)> {
        let all = || pieces.iter().flatten();
        let low = all().fold(Vector2::repeat(f64::INFINITY), |l, x| l.inf(x));
        let high = all().fold(Vector2::repeat(f64::NEG_INFINITY), |h, x| h.sup(x));
        let total: f64 = pieces.iter().map(|p| area_and_centre(p).0).sum();
        let least = 1e-9 * total;
        // Edges and corners that touch have no area but by rounding.
        if pieces.is_empty() || (high - low).min() < 1e-6 * self.size {
            return Vec::new();
        }
        let cell = (high - low) / f64::from(across);
        let mut points = Vec::new();
        for j in 0..across {
            for i in 0..across {
                let from = low + cell.component_mul(&Vector2::new(i.into(), j.into()));
                let to = from + cell;
                let window = [from, Vector2::new(to.x, from.y), to, Vector2::new(from.x, to.y)];
                let (mut area, mut moment) = (0.0, Vector2::zeros());
                for piece in pieces {
                    let (a, c) = area_and_centre(&clip(piece, &window));
                    area += a;
                    moment += a * c;
                }
                if area > least {
                    let c: Vector2<f64> = moment / area;
                    points.push((self.to_space(c), area));
                }
            }
        }
        points
    }
}

/// What two convex polygons, both anticlockwise, have in common (Sutherland and Hodgman).
fn clip(subject: &[Vector2<f64>], window: &[Vector2<f64>]) -> Vec<Vector2<f64>> {
    let mut kept = subject.to_vec();
    for (i, &from) in window.iter().enumerate() {
        let edge = window[(i + 1) % window.len()] - from;
        let side = |x: Vector2<f64>| edge.perp(&(x - from));
        let before = std::mem::take(&mut kept);
        for (k, &x) in before.iter().enumerate() {
            let y = before[(k + 1) % before.len()];
            let (s, t) = (side(x), side(y));
            if s >= 0.0 {
                kept.push(x);
            }
            if s * t < 0.0 {
                kept.push(x + (y - x) * (s / (s - t)));
            }
        }
    }
    kept
}

/// Corners of the convex hull, anticlockwise (Andrew's monotone chain).
fn hull(mut points: Vec<Vector2<f64>>) -> Vec<Vector2<f64>> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let mut corners: Vec<Vector2<f64>> = Vec::new();
    let back = points.iter().rev().copied().collect();
    for chain in [points, back] {
        let first = corners.len();
        for x in chain {
            while let [.., a, b] = corners[first..]
                && (b - a).perp(&(x - b)) <= 1e-9 * (b - a).norm() * (x - a).norm()
            {
                corners.pop();
            }
            corners.push(x);
        }
        // The next chain begins with this one's end.
        corners.pop();
    }
    corners
}

fn area_and_centre(polygon: &[Vector2<f64>]) -> (f64, Vector2<f64>) {
    let Some(&o) = polygon.first() else { return (0.0, Vector2::zeros()) };
    let (mut area, mut moment) = (0.0, Vector2::zeros());
    for k in 1..polygon.len().max(2) - 1 {
        let [a, b] = [polygon[k] - o, polygon[k + 1] - o];
        let twice = a.perp(&b);
        area += 0.5 * twice;
        moment += (a + b) * (twice / 6.0);
    }
    if area > 0.0 { (area, o + moment / area) } else { (0.0, o) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polygons_are_cut_exactly() {
        let square = |x: f64, y: f64, s: f64| {
            [[x, y], [x + s, y], [x + s, y + s], [x, y + s]]
                .map(|p| Vector2::new(p[0], p[1]))
                .to_vec()
        };
        let (area, centre) = area_and_centre(&clip(&square(0.0, 0.0, 2.0), &square(1.0, 0.5, 4.0)));
        assert!((area - 1.5).abs() < 1e-15);
        assert!((centre - Vector2::new(1.5, 1.25)).norm() < 1e-15);
        assert_eq!(area_and_centre(&clip(&square(0.0, 0.0, 1.0), &square(1.0, 0.0, 1.0))).0, 0.0);
        let both = [square(0.0, 0.0, 1.0), square(1.0, 0.0, 1.0)].concat();
        let (area, centre) = area_and_centre(&hull(both));
        assert!((area - 2.0).abs() < 1e-15 && (centre - Vector2::new(1.0, 0.5)).norm() < 1e-15);
    }
}
