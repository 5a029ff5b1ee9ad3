//! A rigid cluster: what it is, and where it stands.

use super::packing::{self, Sphere, TooThin};
use crate::case::Formula;
use crate::shape::{Bounds, MassProperties, Pose, Shape};
use nalgebra::{Matrix6, Vector3};
use std::sync::Arc;

/// A shape in its principal frame (centroid at the origin) with its spheres; many clusters may share one.
#[derive(Clone, Debug)]
pub struct Form {
    /// Closed shape, for volume, distance and pictures.
    pub shape: Shape,
    /// For contact.
    pub spheres: Vec<Sphere>,
    /// At unit density.
    pub mass: MassProperties,
    /// Around the shape, in its own frame.
    pub bounds: Bounds,
    /// Of the sphere around the origin that holds the shape [m].
    pub radius: f64,
}

impl Form {
    /// From a shape anywhere in its frame; the pose takes the new frame to that of `shape`.
    ///
    /// # Errors
    /// Spheres of this radius do not fit.
    pub fn new(shape: &Shape, sphere: f64, spacing: f64) -> Result<(Self, Pose), TooThin> {
        let (shape, mass, back) = shape.centred();
        let spheres = packing::spheres(&shape, sphere, spacing)?;
        let (bounds, radius) = (shape.bounds(&Pose::identity()), shape.radius());
        Ok((Self { shape, spheres, mass, bounds, radius }, back))
    }

    /// Whether it is one sphere.
    pub fn is_ball(&self) -> bool {
        matches!(self.shape, Shape::Sphere(_))
    }

    /// The box around the form where it stands [m].
    pub fn bounds_at(&self, pose: &Pose) -> Bounds {
        let centre = pose.to_space(0.5 * (self.bounds.min + self.bounds.max));
        let axes = pose.rotation.to_rotation_matrix();
        let half = axes.matrix().abs() * (0.5 * (self.bounds.max - self.bounds.min));
        Bounds { min: centre - half, max: centre + half }
    }

    /// λ of `K` for springs of stiffness `k` [N/m] (normal and tangential alike) on all spheres that touch
    /// one plane, over all planes: the square of the highest frequency per mass [1/s² · kg at unit density].
    fn contact_frequency(&self, k: f64) -> f64 {
        let mut directions: Vec<Vector3<f64>> = Vec::new();
        if let Shape::Mesh(mesh) = &self.shape {
            directions.extend(
                mesh.surface()
                    .corners()
                    .filter_map(|[a, b, c]| (b - a).cross(&(c - a)).try_normalize(0.0)),
            );
        }
        for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
            directions.extend([axis, -axis]);
        }
        let highest = directions.iter().map(|d| {
            let reach = |s: &Sphere| s.centre.dot(d) + s.radius;
            let top = self.spheres.iter().map(reach).fold(f64::NEG_INFINITY, f64::max);
            let touching = self.spheres.iter().filter(|s| top - reach(s) < 0.1 * s.radius);
            let springs = touching.map(|s| (s.centre + s.radius * d, k));
            frequency(1.0 * self.mass.volume, self.mass.moments, springs)
        });
        highest.fold(0.0, f64::max)
    }
}

/// λ_max of M⁻¹K [1/s²] of a body held by springs, alike in all directions, at points of its principal
/// frame (place, stiffness [N/m]).
pub fn frequency(
    mass: f64,
    moments: Vector3<f64>,
    springs: impl Iterator<Item = (Vector3<f64>, f64)>,
) -> f64 {
    let scale = moments.map(|i| (mass / i).sqrt());
    let mut stiffness = Matrix6::<f64>::zeros();
    for (r, k) in springs {
        let mut jacobian = nalgebra::Matrix3x6::<f64>::zeros();
        jacobian.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        let turn = -r.cross_matrix() * nalgebra::Matrix3::from_diagonal(&scale);
        jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&turn);
        stiffness += jacobian.transpose() * jacobian * (k / mass);
    }
    stiffness.symmetric_eigenvalues().max()
}

/// Who decides how a cluster moves.
#[derive(Clone, Debug, PartialEq)]
pub enum Motion {
    /// Forces do; `locked`: along x, y, z, about x, y, z it stays as it is.
    Free {
        /// Six flags.
        locked: [bool; 6],
    },
    /// It stands still.
    Fixed,
    /// It has left, and nothing feels it any more.
    Gone,
    /// It is led: formulas of t.
    Prescribed {
        /// Of the centroid [m/s].
        velocity: Box<[Formula; 3]>,
        /// [rad/s]
        spin: Box<[Formula; 3]>,
    },
}

impl Motion {
    /// All six degrees of freedom.
    pub const FREE: Self = Self::Free { locked: [false; 6] };
}

/// What a cluster is: it does not change.
#[derive(Clone, Debug)]
pub struct Cluster {
    /// Shape and spheres.
    pub form: Arc<Form>,
    /// Index of the entry of the case it comes from.
    pub group: u32,
    /// [kg]
    pub mass: f64,
    /// About the principal axes [kg m²].
    pub moments: Vector3<f64>,
    /// Index of its material.
    pub material: u32,
    /// Who decides.
    pub motion: Motion,
    /// Force [N] and torque [N m] on it besides gravity, formulas of t.
    pub applied: Option<Arc<[Formula; 6]>>,
}

impl Cluster {
    /// A free cluster of this density [kg/m³].
    pub fn new(form: Arc<Form>, density: f64, material: u32) -> Self {
        let (mass, moments) = (density * form.mass.volume, density * form.mass.moments);
        Self { form, group: 0, mass, moments, material, motion: Motion::FREE, applied: None }
    }

    /// Whether forces move it.
    pub fn is_free(&self) -> bool {
        matches!(self.motion, Motion::Free { .. })
    }

    /// Whether it stays where it is, there or gone.
    pub fn stands(&self) -> bool {
        matches!(self.motion, Motion::Fixed | Motion::Gone)
    }

    /// 1/m [1/kg]; 0 if forces do not move it.
    pub fn inverse_mass(&self) -> f64 {
        if self.is_free() { 1.0 / self.mass } else { 0.0 }
    }

    /// How it answers to forces.
    pub fn inertia(&self) -> Inertia {
        let (inverse_moments, locked) = match self.motion {
            Motion::Free { locked } => (self.moments.map(|i| 1.0 / i), locked),
            _ => (Vector3::zeros(), [false; 6]),
        };
        Inertia {
            inverse_mass: self.inverse_mass(),
            inverse_moments,
            material: self.material,
            locked,
        }
    }

    /// λ_max of M⁻¹K [1/s²] when all spheres of a side touch with stiffness `k` [N/m].
    pub fn contact_frequency(&self, k: f64) -> f64 {
        self.form.contact_frequency(k) * self.form.mass.volume / self.mass
    }
}

/// How a cluster answers to forces, in one place.
#[derive(Clone, Copy, Debug)]
pub struct Inertia {
    /// 1/m [1/kg]; 0 if forces do not move it.
    pub inverse_mass: f64,
    /// Diagonal of I⁻¹ [1/(kg m²)]; 0 if forces do not move it.
    pub inverse_moments: Vector3<f64>,
    /// Index of its material.
    pub material: u32,
    /// Along x, y, z, about x, y, z it stays as it is.
    pub locked: [bool; 6],
}

impl Inertia {
    /// Whether forces move it.
    #[inline]
    pub fn is_free(&self) -> bool {
        self.inverse_mass > 0.0
    }
}

/// A point that is recorded: its entry's name and number there, its cluster and its place in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Tracked {
    /// `NAME_1`, `NAME_2`, …
    pub name: String,
    /// The cluster that carries it.
    pub cluster: u32,
    /// In the cluster's frame [m].
    pub local: Vector3<f64>,
}

/// Where clusters stand and how they move: an entry for each cluster, valid for those of this rank and
/// their neighbours.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// Of the centroid and the principal axes.
    pub pose: Vec<Pose>,
    /// Of the centroid [m/s].
    pub velocity: Vec<Vector3<f64>>,
    /// About the centroid, along the axes of space [kg m²/s].
    pub angular_momentum: Vec<Vector3<f64>>,
    /// From contact and bonds, now [N].
    pub force: Vec<Vector3<f64>>,
    /// The same about the centroid [N m].
    pub torque: Vec<Vector3<f64>>,
}

impl State {
    /// Number of clusters.
    pub fn len(&self) -> usize {
        self.pose.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.pose.is_empty()
    }

    /// Adds a cluster at rest.
    pub fn push(&mut self, pose: Pose) {
        self.pose.push(pose);
        let lists =
            [&mut self.velocity, &mut self.angular_momentum, &mut self.force, &mut self.torque];
        lists.into_iter().for_each(|list| list.push(Vector3::zeros()));
    }

    /// Sets velocity [m/s] and spin [rad/s] of a cluster.
    pub fn set_motion(
        &mut self,
        c: usize,
        cluster: &Cluster,
        velocity: Vector3<f64>,
        spin: Vector3<f64>,
    ) {
        let rotation = self.pose[c].rotation;
        self.velocity[c] = velocity;
        self.angular_momentum[c] =
            rotation * rotation.inverse_transform_vector(&spin).component_mul(&cluster.moments);
    }

    /// ω along the axes of space [rad/s] that belongs to an angular momentum.
    #[inline]
    pub fn spin(pose: &Pose, inverse: &Vector3<f64>, momentum: &Vector3<f64>) -> Vector3<f64> {
        if inverse.x == inverse.y && inverse.y == inverse.z {
            return momentum * inverse.x;
        }
        pose.rotation * pose.rotation.inverse_transform_vector(momentum).component_mul(inverse)
    }
}
