//! First-order tetrahedra: shape functions, quadrature, boundary conditions by name.
//!
//! May name `mesh` and `case`; knows nothing of ranks but what `MeshPart` offers.

pub mod constraints;
pub mod quadrature;
pub mod region;

pub use crate::mesh::{number, tetrahedron};
use number::{Number, Real};

/// a·b
#[inline]
pub fn dot<R: Number>(a: [R; 3], b: [R; 3]) -> R {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// |a|
#[inline]
pub fn norm<R: Real>(a: [R; 3]) -> R {
    dot(a, a).square_root()
}

/// Area times unit normal of a triangle (right-hand rule).
#[inline]
pub fn triangle_normal(x: [[f64; 3]; 3]) -> [f64; 3] {
    let a: [f64; 3] = std::array::from_fn(|k| x[1][k] - x[0][k]);
    let b: [f64; 3] = std::array::from_fn(|k| x[2][k] - x[0][k]);
    [
        0.5 * (a[1] * b[2] - a[2] * b[1]),
        0.5 * (a[2] * b[0] - a[0] * b[2]),
        0.5 * (a[0] * b[1] - a[1] * b[0]),
    ]
}

/// Largest `|u·∇N_i|` over the domain [1/s]: times Δt, the Courant number. It counts cells along the
/// flow, whatever their shape. Collective.
pub fn courant_rate(part: &crate::mesh::MeshPart, velocity: &[[f64; 3]]) -> f64 {
    let mut rate = 0.0f64;
    for (e, tet) in part.mesh.tets[..part.n_owned_elements].iter().enumerate() {
        let t = tetrahedron::Tetrahedron::of(&part.mesh, e);
        let mut u = [0.0; 3];
        for &n in tet {
            let v = velocity[n as usize];
            u = std::array::from_fn(|k| u[k] + 0.25 * v[k]);
        }
        for g in t.grad {
            rate = rate.max(dot(u, g).abs());
        }
    }
    part.max(rate)
}
