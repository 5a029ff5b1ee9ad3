//! The case's obstacles: where they stand at a time, how they move over a step.

mod course;

use crate::case::{self, Case};
use crate::cut::level_set::Solid;
use crate::cut::{Motion, Surface, Wall};
use crate::shape::{Pose, Shape};
use course::Course;
use nalgebra::Vector3;

/// All obstacles of a case.
#[derive(Clone, Debug)]
pub struct Obstacles {
    given: Vec<case::Obstacle>,
    shapes: Vec<Shape>,
    courses: Vec<Course>,
}

impl Obstacles {
    /// Those of the case, with their shapes.
    pub fn new(case: &Case, shapes: Vec<Shape>) -> Self {
        let given = case.obstacles.clone();
        let courses = given.iter().map(|o| Course::new(o, case.time.end)).collect();
        Self { given, shapes, courses }
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
