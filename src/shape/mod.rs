//! Closed rigid shapes and where they stand: distance, volume, inertia, surface. Pure geometry, for
//! bodies that move and for the level set that cuts the mesh.
//!
//! - [`Shape`]: cuboid, sphere, cylinder, or any closed triangle surface.
//! - [`Pose`]: place and attitude.
//! - [`surface`]: triangle surfaces, and whether they are closed.
//! - [`fragment`]: Voronoi cells of a solid, cut by `clip`.
//! - [`mass`]: volume, centroid, principal axes and moments.
//!
//! Distances are parry's. Names no other room.

mod clip;
mod crossing;
pub mod fragment;
pub mod mass;
pub mod surface;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use parry3d_f64::math::Vec3;
use parry3d_f64::query::{PointQuery, Ray, RayCast};
use parry3d_f64::shape as parry;
use parry3d_f64::transformation::try_convex_hull;
use std::sync::Arc;

pub use mass::MassProperties;
pub use surface::{OpenSurface, Surface};

/// Place and attitude: `x = position + rotation · local`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Of the shape's origin [m].
    pub position: Vector3<f64>,
    /// From the shape's axes to those of space.
    pub rotation: UnitQuaternion<f64>,
}

impl Pose {
    /// Unmoved, unturned.
    pub fn identity() -> Self {
        Self { position: Vector3::zeros(), rotation: UnitQuaternion::identity() }
    }

    /// From the shape's frame to space.
    #[inline]
    pub fn to_space(&self, local: Vector3<f64>) -> Vector3<f64> {
        self.position + self.rotation * local
    }

    /// From space to the shape's frame.
    #[inline]
    pub fn to_local(&self, x: Vector3<f64>) -> Vector3<f64> {
        self.rotation.inverse_transform_vector(&(x - self.position))
    }

    /// `inner` first, then `self`.
    pub fn after(&self, inner: &Pose) -> Pose {
        Pose { position: self.to_space(inner.position), rotation: self.rotation * inner.rotation }
    }
}

/// A box along the axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Least coordinates [m].
    pub min: Vector3<f64>,
    /// Greatest coordinates [m].
    pub max: Vector3<f64>,
}

impl Bounds {
    /// Around points; of none, an empty box that meets nothing.
    pub fn of(points: impl IntoIterator<Item = Vector3<f64>>) -> Self {
        let mut bounds =
            Self { min: Vector3::repeat(f64::INFINITY), max: Vector3::repeat(f64::NEG_INFINITY) };
        for x in points {
            bounds.min = bounds.min.inf(&x);
            bounds.max = bounds.max.sup(&x);
        }
        bounds
    }

    /// Around both.
    pub fn joined(&self, other: &Self) -> Self {
        Self { min: self.min.inf(&other.min), max: self.max.sup(&other.max) }
    }

    /// Moved outwards by `margin` [m].
    pub fn inflated(&self, margin: f64) -> Self {
        let m = Vector3::repeat(margin);
        Self { min: self.min - m, max: self.max + m }
    }

    /// Whether the boxes share a point.
    pub fn meets(&self, other: &Self) -> bool {
        (0..3).all(|k| self.min[k] <= other.max[k] && other.min[k] <= self.max[k])
    }

    /// Length of the diagonal [m].
    pub fn diagonal(&self) -> f64 {
        (self.max - self.min).norm()
    }
}

/// A closed solid in its own frame.
#[derive(Clone, Debug)]
pub enum Shape {
    /// Centred on the origin, edges along the axes.
    Cuboid(parry::Cuboid),
    /// Centred on the origin.
    Sphere(parry::Ball),
    /// Centred on the origin, its axis along z.
    Cylinder(parry::Cylinder),
    /// Inside a closed triangle surface.
    Mesh(Arc<Mesh>),
}

/// A closed triangle surface with what distances to it need.
#[derive(Clone, Debug)]
pub struct Mesh {
    surface: Surface,
    query: parry::TriMesh,
}

impl Mesh {
    /// The surface.
    pub fn surface(&self) -> &Surface {
        &self.surface
    }
}

impl Shape {
    /// A cuboid with these edges [m].
    pub fn cuboid(size: [f64; 3]) -> Self {
        Self::Cuboid(parry::Cuboid::new(0.5 * Vec3::from_array(size)))
    }

    /// A sphere [m].
    pub fn sphere(radius: f64) -> Self {
        Self::Sphere(parry::Ball::new(radius))
    }

    /// A cylinder along z [m].
    pub fn cylinder(radius: f64, height: f64) -> Self {
        Self::Cylinder(parry::Cylinder::new(0.5 * height, radius))
    }

    /// The inside of a closed surface; one that is inside out is turned.
    ///
    /// # Errors
    /// Where the surface is open.
    pub fn mesh(surface: Surface) -> Result<Self, OpenSurface> {
        let surface = surface.closed()?;
        let points = surface.vertices.iter().map(|v| Vec3::new(v.x, v.y, v.z)).collect();
        // Without pseudo-normals inside has no sign.
        let flags = parry::TriMeshFlags::ORIENTED;
        let query = parry::TriMesh::with_flags(points, surface.triangles.clone(), flags)
            .expect("a closed surface has triangles");
        Ok(Self::Mesh(Arc::new(Mesh { surface, query })))
    }

    /// The inside of a surface that somebody drew: closed, and nowhere running through itself.
    ///
    /// # Errors
    /// Where the surface is open or crosses itself.
    pub fn drawn(surface: Surface) -> Result<Self, OpenSurface> {
        let shape = Self::mesh(surface)?;
        let Self::Mesh(mesh) = &shape else { unreachable!("made of triangles") };
        match crossing::crossing(&mesh.surface) {
            Some(place) => Err(OpenSurface::Crossing { place: place.into() }),
            None => Ok(shape),
        }
    }

    /// The convex polyhedron around these points [m].
    ///
    /// # Errors
    /// Points that lie in a plane, or closer to one than rounding tells.
    pub fn hull(points: &[[f64; 3]]) -> Result<Self, OpenSurface> {
        let points: Vec<Vec3> = points.iter().map(|&x| Vec3::from_array(x)).collect();
        let Ok((vertices, triangles)) = try_convex_hull(&points) else {
            return Err(OpenSurface::Flat);
        };
        let vertices: Vec<[f64; 3]> = vertices.iter().map(|v| v.to_array()).collect();
        Self::mesh(Surface::new(&vertices, &triangles))
    }

    /// Signed distance to the surface from a point of the shape's frame [m]: positive outside.
    pub fn distance(&self, local: Vector3<f64>) -> f64 {
        self.nearest(local).0
    }

    /// Signed distance (positive outside) and the surface's nearest point, in the shape's frame [m].
    pub fn nearest(&self, local: Vector3<f64>) -> (f64, Vector3<f64>) {
        let [x, y, z] = local.into();
        let point = Vec3::new(x, y, z);
        let found = match self {
            Self::Cuboid(shape) => shape.project_local_point(point, false),
            Self::Sphere(shape) => shape.project_local_point(point, false),
            Self::Mesh(mesh) => mesh.query.project_local_point(point, false),
            Self::Cylinder(shape) => {
                // parry's axis is y.
                let mut found = shape.project_local_point(Vec3::new(y, z, x), false);
                let p = found.point;
                found.point = Vec3::new(p.z, p.x, p.y);
                found
            }
        };
        let distance = found.point.distance(point);
        let signed = if found.is_inside { -distance } else { distance };
        (signed, Vector3::new(found.point.x, found.point.y, found.point.z))
    }

    /// Whether some of its surface is curved.
    pub fn is_round(&self) -> bool {
        matches!(self, Self::Sphere(_) | Self::Cylinder(_))
    }

    /// Second derivatives of the distance at the surface next to a point of the shape's frame [1/m]; none where
    /// it is flat, or has an edge.
    pub fn curvature(&self, local: Vector3<f64>) -> Option<Matrix3<f64>> {
        let round = |out: Vector3<f64>, flat: Matrix3<f64>, radius: f64| {
            let n = out.try_normalize(0.0).unwrap_or_else(Vector3::x);
            (flat - n * n.transpose()) / radius
        };
        match self {
            Self::Cuboid(_) | Self::Mesh(_) => None,
            Self::Sphere(shape) => Some(round(local, Matrix3::identity(), shape.radius)),
            Self::Cylinder(shape) => {
                let out = Vector3::new(local.x, local.y, 0.0);
                let (side, end) = (out.norm() - shape.radius, local.z.abs() - shape.half_height);
                let across = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 0.0));
                (end <= side.min(0.0)).then(|| round(out, across, shape.radius))
            }
        }
    }

    /// How far it is from a point inside, along a unit vector, to where the shape ends [m]; both in its frame.
    pub fn exit(&self, from: Vector3<f64>, way: Vector3<f64>) -> Option<f64> {
        let ray = |p: Vector3<f64>, w: Vector3<f64>| {
            Ray::new(Vec3::new(p.x, p.y, p.z), Vec3::new(w.x, w.y, w.z))
        };
        let (plain, far) = (ray(from, way), f64::MAX);
        match self {
            Self::Cuboid(shape) => shape.cast_local_ray(&plain, far, false),
            Self::Sphere(shape) => shape.cast_local_ray(&plain, far, false),
            Self::Mesh(mesh) => mesh.query.cast_local_ray(&plain, far, false),
            // parry's axis is y.
            Self::Cylinder(shape) => {
                let turn = |v: Vector3<f64>| Vector3::new(v.y, v.z, v.x);
                shape.cast_local_ray(&ray(turn(from), turn(way)), far, false)
            }
        }
    }

    /// Radius of the sphere around the origin that holds the shape [m].
    pub fn radius(&self) -> f64 {
        match self {
            Self::Cuboid(shape) => shape.half_extents.length(),
            Self::Sphere(shape) => shape.radius,
            Self::Cylinder(shape) => shape.radius.hypot(shape.half_height),
            Self::Mesh(mesh) => mesh.surface.vertices.iter().map(|v| v.norm()).fold(0.0, f64::max),
        }
    }

    /// The box around the shape where it stands.
    pub fn bounds(&self, pose: &Pose) -> Bounds {
        let around =
            |half: Vector3<f64>| Bounds { min: pose.position - half, max: pose.position + half };
        let axes = pose.rotation.to_rotation_matrix();
        match self {
            Self::Cuboid(shape) => {
                let h = shape.half_extents;
                around(axes.matrix().abs() * Vector3::new(h.x, h.y, h.z))
            }
            Self::Sphere(shape) => around(Vector3::repeat(shape.radius)),
            Self::Cylinder(shape) => {
                let axis: Vector3<f64> = axes.matrix().column(2).into();
                around(axis.map(|a| {
                    a.abs() * shape.half_height + shape.radius * (1.0 - a * a).max(0.0).sqrt()
                }))
            }
            Self::Mesh(mesh) => Bounds::of(mesh.surface.vertices.iter().map(|&v| pose.to_space(v))),
        }
    }

    /// Volume, centroid, principal axes.
    pub fn mass_properties(&self) -> MassProperties {
        match self {
            Self::Cuboid(shape) => {
                let h = shape.half_extents;
                MassProperties::cuboid([2.0 * h.x, 2.0 * h.y, 2.0 * h.z])
            }
            Self::Sphere(shape) => MassProperties::sphere(shape.radius),
            Self::Cylinder(shape) => {
                MassProperties::cylinder(shape.radius, 2.0 * shape.half_height)
            }
            Self::Mesh(mesh) => MassProperties::of(&mesh.surface),
        }
    }

    /// The same solid with its centroid at the origin and its principal axes along the frame's, its
    /// mass properties there, and the pose that puts it back.
    pub fn centred(&self) -> (Self, MassProperties, Pose) {
        let mass = self.mass_properties();
        let back = Pose { position: mass.centroid, rotation: mass.axes };
        let centred =
            MassProperties { centroid: Vector3::zeros(), axes: UnitQuaternion::identity(), ..mass };
        let shape = match self {
            Self::Mesh(mesh) => {
                let mut surface = mesh.surface.clone();
                surface.vertices.iter_mut().for_each(|v| *v = back.to_local(*v));
                Self::mesh(surface).expect("a closed surface stays closed when it is turned")
            }
            other => other.clone(),
        };
        (shape, centred, back)
    }

    /// Triangles of the surface, in the shape's frame; round ones with facets no longer than `facet` [m].
    pub fn surface(&self, facet: f64) -> Surface {
        match self {
            Self::Cuboid(shape) => {
                let h = shape.half_extents;
                Surface::cuboid([2.0 * h.x, 2.0 * h.y, 2.0 * h.z])
            }
            Self::Sphere(shape) => Surface::sphere(shape.radius, facet),
            Self::Cylinder(shape) => {
                Surface::cylinder(shape.radius, 2.0 * shape.half_height, facet)
            }
            Self::Mesh(mesh) => mesh.surface.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn turned() -> Pose {
        Pose {
            position: Vector3::new(0.3, -0.2, 0.7),
            rotation: UnitQuaternion::from_euler_angles(0.4, 1.1, -0.6),
        }
    }

    #[test]
    fn distances_have_the_sign_and_length_of_the_exact_ones() {
        let cuboid = Shape::cuboid([2.0, 1.0, 3.0]);
        let mesh = Shape::mesh(Surface::cuboid([2.0, 1.0, 3.0])).unwrap();
        for (x, d) in [
            ([0.0, 0.0, 0.0], -0.5),
            ([0.9, 0.0, 1.2], -0.1),
            ([4.0, 4.5, 1.0], 5.0),
            ([1.5, 0.0, 0.0], 0.5),
            ([2.0, 1.5, 2.5], 3f64.sqrt()),
        ] {
            for shape in [&cuboid, &mesh] {
                let (found, nearest) = shape.nearest(x.into());
                assert!((found - d).abs() < 1e-12, "{x:?}: {found}, not {d}");
                assert!(((nearest - Vector3::from(x)).norm() - d.abs()).abs() < 1e-12);
            }
        }
        let cylinder = Shape::cylinder(0.5, 2.0);
        for (x, d) in [
            ([0.0, 0.0, 0.2], -0.5),
            ([0.0, 3.5, 0.0], 3.0),
            ([0.3, 0.0, 0.9], -0.1),
            ([3.5, 0.0, 5.0], 5.0),
        ] {
            assert!((cylinder.distance(x.into()) - d).abs() < 1e-12, "{x:?}");
        }
        assert!((Shape::sphere(2.0).distance(Vector3::new(0.0, 0.0, 1.5)) + 0.5).abs() < 1e-15);
    }

    /// Against differences of distances.
    #[test]
    fn curvatures_are_second_derivatives_of_the_distance() {
        let cylinder = Shape::cylinder(0.5, 2.0);
        for (shape, x) in [
            (Shape::sphere(0.5), [0.3, -0.4, 0.01]),
            (cylinder.clone(), [0.3, 0.4, 0.7]),
            (cylinder.clone(), [0.1, 0.2, 1.0]),
            (Shape::cuboid([1.0; 3]), [0.5, 0.1, 0.2]),
        ] {
            let x = Vector3::from(x);
            let exact = shape.curvature(x).unwrap_or_default();
            let unit = |k: usize| Vector3::from_fn(|i, _| if i == k { 1e-4 } else { 0.0 });
            for (i, j) in [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)] {
                let at = |a: f64, b: f64| shape.distance(x + unit(i) * a + unit(j) * b);
                let found = (at(1.0, 1.0) - at(1.0, -1.0) - at(-1.0, 1.0) + at(-1.0, -1.0)) / 4e-8;
                let sharp = exact == Matrix3::zeros() && x.z == 1.0;
                assert!(sharp || (found - exact[(i, j)]).abs() < 0.05, "{exact} {found}");
            }
        }
        // Beyond the rim, and where the end is nearer.
        assert!(cylinder.curvature(Vector3::new(0.5, 0.1, 1.1)).is_none());
        assert!(cylinder.curvature(Vector3::new(0.3, 0.0, 0.9)).is_none());
    }

    #[test]
    fn bounds_hold_the_surface_and_touch_it() {
        let pose = turned();
        for shape in [Shape::cuboid([2.0, 1.0, 3.0]), Shape::cylinder(0.5, 2.0), Shape::sphere(0.7)]
        {
            let bounds = shape.bounds(&pose);
            let surface = shape.surface(0.01);
            let seen = Bounds::of(surface.vertices.iter().map(|&v| pose.to_space(v)));
            assert!((seen.min - bounds.min).norm() < 1e-4 && (seen.max - bounds.max).norm() < 1e-4);
            assert!((0..3).all(|k| seen.min[k] >= bounds.min[k] - 1e-12));
        }
    }

    #[test]
    fn a_turned_mesh_is_brought_to_its_principal_axes() {
        let pose = turned();
        let mut surface = Surface::cuboid([2.0, 1.0, 3.0]);
        surface.vertices.iter_mut().for_each(|v| *v = pose.to_space(*v));
        let shape = Shape::mesh(surface).unwrap();
        let (centred, mass, back) = shape.centred();
        assert!((mass.volume - 6.0).abs() < 1e-12);
        assert!((back.position - pose.position).norm() < 1e-12);
        let again = centred.mass_properties();
        assert!(again.centroid.norm() < 1e-12);
        assert!((again.moments - mass.moments).norm() < 1e-10);
        // The same solid: equal distances at points of space.
        for x in [[0.1, 0.2, 0.3], [2.0, -1.0, 0.5], [0.35, -0.2, 0.9]].map(Vector3::from) {
            let (a, b) = (shape.distance(x), centred.distance(back.to_local(x)));
            assert!((a - b).abs() < 1e-12);
        }
    }

    #[test]
    fn a_hull_is_the_polyhedron_around_its_points() {
        // An octahedron |x| + |y| + |z| ≤ 1 and points inside it.
        let mut points = vec![[0.1, 0.2, -0.3], [0.0; 3]];
        for k in 0..3 {
            for s in [-1.0, 1.0] {
                let mut x = [0.0; 3];
                x[k] = s;
                points.push(x);
            }
        }
        let octahedron = Shape::hull(&points).unwrap();
        assert!((octahedron.mass_properties().volume - 4.0 / 3.0).abs() < 1e-12);
        for x in [[0.5, 0.5, 0.5], [0.1, 0.1, 0.2], [0.3, -0.4, 0.3]] {
            let exact = (x.iter().map(|x: &f64| x.abs()).sum::<f64>() - 1.0) / 3f64.sqrt();
            assert!((octahedron.distance(x.into()) - exact).abs() < 1e-12, "{x:?}");
        }
        let plane = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
        assert!(Shape::hull(&plane).is_err());
        assert!(Shape::hull(&plane[..2]).is_err());
    }

    #[test]
    fn surfaces_of_round_shapes_enclose_their_volume() {
        for shape in [Shape::sphere(0.5), Shape::cylinder(0.5, 2.0)] {
            let faceted = Shape::mesh(shape.surface(0.02)).unwrap();
            let (a, b) = (shape.mass_properties(), faceted.mass_properties());
            assert!((a.volume - b.volume).abs() < 2e-3 * a.volume);
            let middle = |m: Vector3<f64>| m.sum() - m.max() - m.min();
            assert!((a.moments.max() - b.moments.max()).abs() < 4e-3 * a.moments.max());
            assert!((middle(a.moments) - middle(b.moments)).abs() < 4e-3 * a.moments.max());
        }
        assert!((Shape::sphere(0.5).mass_properties().volume - PI / 6.0).abs() < 1e-15);
    }
}
