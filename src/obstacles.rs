//! The case's obstacles: shapes, where they stand at a time, how they move over a step.

mod course;
mod terrain;

use crate::case::{self, Case, CaseError};
use crate::cut::level_set::Solid;
use crate::cut::{Motion, Surface, Wall};
use crate::mesh::MeshPart;
use crate::shape::{Pose, Shape};
use course::Course;
use nalgebra::Vector3;
use std::path::Path;
use terrain::ground;

/// All obstacles of a case.
#[derive(Clone, Debug)]
pub struct Obstacles {
    given: Vec<case::Obstacle>,
    shapes: Vec<Shape>,
    courses: Vec<Course>,
}

impl Obstacles {
    /// Reads their files. Collective.
    ///
    /// # Errors
    /// A file that cannot be read, a surface that is not closed: the key in the case file.
    pub fn new(case: &Case, part: &MeshPart) -> Result<Self, CaseError> {
        let mut shapes = Vec::new();
        for (i, obstacle) in case.obstacles.iter().enumerate() {
            let refused = |key: &str, message: String| {
                case.source.error(&format!("obstacle[{}].{key}", i + 1), message)
            };
            shapes.push(match &obstacle.solid {
                case::Solid::Cuboid(size) => Shape::cuboid(*size),
                case::Solid::Sphere(radius) => Shape::sphere(*radius),
                case::Solid::Cylinder([radius, height]) => Shape::cylinder(*radius, *height),
                case::Solid::Points(points) => {
                    Shape::hull(points).map_err(|e| refused("points", e.to_string()))?
                }
                case::Solid::Surface(path) => {
                    let bytes = read(part, path).map_err(|e| refused("surface", e))?;
                    surface(path, &bytes).map_err(|e| refused("surface", e))?
                }
                case::Solid::Terrain(path) => {
                    let bytes = read(part, path).map_err(|e| refused("terrain", e))?;
                    terrain(path, &bytes).map_err(|e| refused("terrain", e))?
                }
            });
        }
        let given = case.obstacles.clone();
        let courses = given.iter().map(|o| Course::new(o, case.time.end)).collect();
        Ok(Self { given, shapes, courses })
    }

    /// Names, in the order of their numbers.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.given.iter().map(|o| &*o.name)
    }

    /// Whether any of them moves.
    pub fn move_at_all(&self) -> bool {
        self.courses.iter().any(Course::moves)
    }

    /// Whether one of them moves.
    pub fn moves(&self, i: usize) -> bool {
        self.courses[i].moves()
    }

    /// Where one of them stands at time `t`.
    pub fn pose(&self, i: usize, t: f64) -> Pose {
        self.courses[i].pose(t)
    }

    /// Where they stand at time `t`.
    pub fn solids(&self, t: f64) -> Vec<Solid<'_>> {
        let solid = |(i, (given, shape)): (usize, (&case::Obstacle, _))| Solid {
            shape,
            pose: self.pose(i, t),
            outside_in: given.outside_in,
        };
        self.given.iter().zip(&self.shapes).enumerate().map(solid).collect()
    }

    /// Their walls, and the motion that brings each from where it is at `t` to where it is at `t + dt`.
    pub fn surfaces(&self, t: f64, dt: f64) -> Vec<Surface> {
        let surface = |(i, given): (usize, &case::Obstacle)| {
            let motion = motion(&self.pose(i, t), &self.pose(i, t + dt), dt);
            Surface { wall: if given.slip { Wall::Slip } else { Wall::NoSlip }, motion }
        };
        self.given.iter().enumerate().map(surface).collect()
    }
}

/// The steady motion that brings a body `from` one pose `to` another in a time `dt`, about where it ends.
fn motion(from: &Pose, to: &Pose, dt: f64) -> Motion {
    let per = |v: Vector3<f64>| if dt > 0.0 { v / dt } else { Vector3::zeros() };
    let spin = per((to.rotation * from.rotation.inverse()).scaled_axis());
    let way = to.position - from.position;
    // Its origin moves at the mean velocity where it is halfway.
    let velocity = per(way) + spin.cross(&(0.5 * way));
    Motion { centre: to.position.into(), velocity: velocity.into(), spin: spin.into() }
}

/// The bytes of a file, read once. Collective.
fn read(part: &MeshPart, path: &Path) -> Result<Vec<u8>, String> {
    let first = part.comm.rank() == 0;
    let bytes = if first { std::fs::read(path) } else { Ok(Vec::new()) };
    let bytes = part.comm.agree(bytes.map_err(|e| format!("{}: {e}", path.display())))?;
    Ok(part.comm.broadcast(0, bytes))
}

fn surface(path: &Path, bytes: &[u8]) -> Result<Shape, String> {
    let file = io::surface::parse(path, bytes).map_err(|e| e.to_string())?;
    let surface = crate::shape::Surface::new(&file.vertices, &file.triangles);
    Shape::drawn(surface).map_err(|e| format!("{}: {e}", path.display()))
}

fn terrain(path: &Path, bytes: &[u8]) -> Result<Shape, String> {
    let named = |e: String| format!("{}: {e}", path.display());
    let text = std::str::from_utf8(bytes).map_err(|e| named(e.to_string()))?;
    let ground = ground(text).map_err(named)?;
    Shape::mesh(ground).map_err(|e| named(e.to_string()))
}
