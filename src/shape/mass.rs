//! Volume, centroid and inertia of a solid of unit density.
//!
//! Of a closed surface they are sums over its triangles: each makes a tetrahedron with a point near by,
//! and `∫ x xᵀ dV = V/20 (Σ_i x_i x_iᵀ + s sᵀ)` there, with s the sum of the corners.

use super::Surface;
use nalgebra::{Matrix3, Rotation3, SymmetricEigen, UnitQuaternion, Vector3};
use std::f64::consts::PI;

/// Of a solid of unit density.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassProperties {
    /// [m³]
    pub volume: f64,
    /// [m]
    pub centroid: Vector3<f64>,
    /// From the principal axes to the frame's.
    pub axes: UnitQuaternion<f64>,
    /// Moments of inertia about the principal axes through the centroid [m⁵].
    pub moments: Vector3<f64>,
}

impl MassProperties {
    fn aligned(volume: f64, moments: [f64; 3]) -> Self {
        Self {
            volume,
            centroid: Vector3::zeros(),
            axes: UnitQuaternion::identity(),
            moments: moments.into(),
        }
    }

    /// Of a cuboid with these edges.
    pub fn cuboid([a, b, c]: [f64; 3]) -> Self {
        let v = a * b * c;
        let of = |p: f64, q: f64| v * (p * p + q * q) / 12.0;
        Self::aligned(v, [of(b, c), of(a, c), of(a, b)])
    }

    /// Of a sphere.
    pub fn sphere(radius: f64) -> Self {
        let v = 4.0 / 3.0 * PI * radius.powi(3);
        Self::aligned(v, [0.4 * v * radius * radius; 3])
    }

    /// Of a cylinder along z.
    pub fn cylinder(radius: f64, height: f64) -> Self {
        let v = PI * radius * radius * height;
        let across = v * (3.0 * radius * radius + height * height) / 12.0;
        Self::aligned(v, [across, across, 0.5 * v * radius * radius])
    }

    /// Of what a closed surface encloses.
    pub fn of(surface: &Surface) -> Self {
        let near = surface.vertices[0];
        let (mut volume, mut first, mut second) = (0.0, Vector3::zeros(), Matrix3::zeros());
        for corners in surface.corners() {
            let x = corners.map(|v| v - near);
            let v = x[0].dot(&x[1].cross(&x[2])) / 6.0;
            let s = x[0] + x[1] + x[2];
            volume += v;
            first += 0.25 * v * s;
            let squares = x.map(|x| x * x.transpose()).iter().sum::<Matrix3<f64>>();
            second += v / 20.0 * (squares + s * s.transpose());
        }
        let c = first / volume;
        let about = second - volume * c * c.transpose();
        let inertia = Matrix3::identity() * about.trace() - about;
        let eigen = SymmetricEigen::new(inertia);
        let mut axes = eigen.eigenvectors;
        if axes.determinant() < 0.0 {
            axes.column_mut(2).neg_mut();
        }
        Self {
            volume,
            centroid: near + c,
            axes: UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes)),
            moments: eigen.eigenvalues,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_surface_gives_what_the_formula_gives() {
        let exact = MassProperties::cuboid([2.0, 1.0, 3.0]);
        let mut surface = Surface::cuboid([2.0, 1.0, 3.0]);
        let shift = Vector3::new(40.0, -30.0, 20.0);
        surface.vertices.iter_mut().for_each(|v| *v += shift);
        let found = MassProperties::of(&surface);
        assert!((found.volume - exact.volume).abs() < 1e-12);
        assert!((found.centroid - shift).norm() < 1e-12);
        let full = |m: &MassProperties| {
            let r = m.axes.to_rotation_matrix();
            r.matrix() * Matrix3::from_diagonal(&m.moments) * r.matrix().transpose()
        };
        assert!((full(&found) - full(&exact)).norm() < 1e-11);
    }
}
