//! What clusters bump into and cannot move: planes, terrain, the walls of a tank.

use crate::shape::{Pose, Shape};
use nalgebra::Vector3;
use parry3d_f64::math::Vec3;
use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::TriMesh;
use std::sync::Arc;

/// A wall.
#[derive(Clone, Debug)]
pub struct Wall {
    /// As the case calls it.
    pub name: String,
    /// Index of its material.
    pub material: u32,
    /// Where it is.
    pub surface: WallSurface,
}

/// The surface of a wall.
#[derive(Clone, Debug)]
pub enum WallSurface {
    /// `normal · x = offset`; clusters are on the side the normal points to.
    Plane {
        /// Of length 1.
        normal: Vector3<f64>,
        /// [m]
        offset: f64,
    },
    /// Triangles, open or closed; clusters are on either side.
    Triangles(Arc<TriMesh>),
    /// A closed solid.
    Solid {
        /// In its own frame.
        shape: Shape,
        /// Where it stands.
        pose: Pose,
        /// Clusters are inside the shape.
        outside_in: bool,
    },
}

impl WallSurface {
    /// From triangles.
    ///
    /// # Errors
    /// There are none.
    pub fn triangles(vertices: &[[f64; 3]], triangles: &[[u32; 3]]) -> Result<Self, String> {
        let points = vertices.iter().map(|&v| Vec3::from_array(v)).collect();
        let mesh = TriMesh::new(points, triangles.to_vec()).map_err(|e| e.to_string())?;
        Ok(Self::Triangles(Arc::new(mesh)))
    }

    /// Distance of a point from the wall [m] and the direction away from it.
    #[inline]
    pub fn distance(&self, x: Vector3<f64>) -> (f64, Vector3<f64>) {
        match self {
            Self::Plane { normal, offset } => (normal.dot(&x) - offset, *normal),
            Self::Triangles(mesh) => {
                let near = mesh.project_local_point(Vec3::new(x.x, x.y, x.z), false).point;
                let away = x - Vector3::new(near.x, near.y, near.z);
                let distance = away.norm();
                let normal = if distance > 0.0 { away / distance } else { Vector3::z() };
                (distance, normal)
            }
            Self::Solid { shape, pose, outside_in } => {
                let local = pose.to_local(x);
                let (distance, near) = shape.nearest(local);
                let (side, away) = (if *outside_in { -1.0 } else { 1.0 }, local - near);
                let normal =
                    if distance == 0.0 { Vector3::z() } else { pose.rotation * away / distance };
                (side * distance, side * normal)
            }
        }
    }
}
