//! The P1 tetrahedron: constant gradients, volume, size.

use super::number::Real;
use crate::mesh::Mesh;

/// Geometry of one tetrahedron.
#[derive(Clone, Copy, Debug)]
pub struct Tetrahedron<R = f64> {
    /// ∇N_i, constant [1/m].
    pub grad: [[R; 3]; 4],
    /// Volume [m³], negative if inverted.
    pub volume: R,
}

impl Tetrahedron {
    /// Element `e` of the mesh.
    #[inline(always)]
    pub fn of(mesh: &Mesh, e: usize) -> Self {
        Self::new(mesh.tets[e].map(|n| mesh.nodes[n as usize]))
    }
}

impl<R: Real> Tetrahedron<R> {
    /// From its corners.
    #[inline(always)]
    pub fn new(x: [[R; 3]; 4]) -> Self {
        let d = |i: usize| [x[i][0] - x[0][0], x[i][1] - x[0][1], x[i][2] - x[0][2]];
        let (a, b, c) = (d(1), d(2), d(3));
        let cross = |u: [R; 3], v: [R; 3]| {
            [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
        };
        let (bc, ca, ab) = (cross(b, c), cross(c, a), cross(a, b));
        let det = a[0] * bc[0] + a[1] * bc[1] + a[2] * bc[2];
        let inverse = R::of(1.0) / det;
        let mut grad = [[R::default(); 3]; 4];
        for k in 0..3 {
            grad[1][k] = bc[k] * inverse;
            grad[2][k] = ca[k] * inverse;
            grad[3][k] = ab[k] * inverse;
            grad[0][k] = -(grad[1][k] + grad[2][k] + grad[3][k]);
        }
        Self { grad, volume: det / R::of(6.0) }
    }

    /// h_e = (6√2 V)^(1/3): edge of the regular tetrahedron of the same volume [m].
    #[inline]
    pub fn size(&self) -> R {
        (R::of(6.0 * std::f64::consts::SQRT_2) * self.volume).cube_root()
    }

    /// Gradient of the P1 function with these nodal values.
    #[inline]
    pub fn gradient(&self, f: [R; 4]) -> [R; 3] {
        let g = &self.grad;
        std::array::from_fn(|k| f[0] * g[0][k] + f[1] * g[1][k] + f[2] * g[2][k] + f[3] * g[3][k])
    }
}

/// Volume of the tetrahedron with these corners [m³], to the last bit that of [`Tetrahedron`].
#[inline]
pub fn volume(x: &[[f64; 3]; 4]) -> f64 {
    let d = |i: usize| [x[i][0] - x[0][0], x[i][1] - x[0][1], x[i][2] - x[0][2]];
    let (a, b, c) = (d(1), d(2), d(3));
    let bc = [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]];
    (a[0] * bc[0] + a[1] * bc[1] + a[2] * bc[2]) / 6.0
}

/// ∛v to 1e-14, faster than `cbrt`: a third of the exponent, and two of Halley's steps.
#[inline]
pub(super) fn cube_root(v: f64) -> f64 {
    let size = v.abs();
    let mut y = f64::from_bits(size.to_bits() / 3 + 0x2a9f_7893_782d_a1ce);
    for _ in 0..2 {
        let cube = y * y * y;
        y *= (cube + 2.0 * size) / (2.0 * cube + size);
    }
    y.copysign(v)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cube_roots_are_those_of_the_standard_library() {
        for k in -300..300 {
            let v = 1.037f64.powi(k) * (-10f64).powi(k / 20);
            assert!((cube_root(v) / v.cbrt() - 1.0).abs() < 1e-14, "{v}");
        }
    }

    #[test]
    fn gradients_are_a_partition_of_unity_and_exact_for_linear_functions() {
        let x = [[0.1, 0.0, 0.2], [1.3, 0.1, 0.0], [0.2, 0.9, -0.1], [0.0, 0.3, 1.1]];
        let t = Tetrahedron::new(x);
        let f = x.map(|p| 3.0 * p[0] - 2.0 * p[1] + 0.5 * p[2] + 7.0);
        let g = t.gradient(f);
        for (a, b) in g.iter().zip([3.0, -2.0, 0.5]) {
            assert!((a - b).abs() < 1e-13);
        }
        let regular = Tetrahedron::new([[0., 0., 0.], [1., 1., 0.], [0., 1., 1.], [1., 0., 1.]]);
        assert_eq!(volume(&x), t.volume);
        assert!((regular.size() - 2f64.sqrt()).abs() < 1e-14 || regular.volume < 0.0);
    }
}
