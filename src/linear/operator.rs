//! What a Krylov method needs to know: `y = A x`, `z ≈ A⁻¹ r`, `(a, b)`.
//!
//! Vectors are flat and of local length: owned entries first, then ghosts. A method written over
//! these three traits is the same on one rank and on many.

use super::block_csr::Value;

/// A linear operator.
pub trait Operator {
    /// y = A x. Ghosts of `x` are updated inside; owned rows of `y` are set, its ghosts are zero.
    fn apply<X: Value>(&self, x: &mut [X], y: &mut [f64]);
}

/// An approximate inverse, which may differ from call to call.
pub trait Preconditioner {
    /// z ≈ A⁻¹ r, in single precision: an approximation loses nothing by it. Reads owned entries of `r`, which is
    /// of length about one; sets owned entries of `z`, whose ghosts are stale.
    fn apply(&mut self, r: &[f32], z: &mut [f32]);
}

/// An inner product over owned entries of all ranks.
pub trait InnerProduct {
    /// `out[j] = (v_j, w)` for vectors `v_j` of `w`'s length packed one after another: one reduction.
    fn dots(&self, packed: &[f64], w: &[f64], out: &mut [f64]);

    /// (a, b).
    fn dot(&self, a: &[f64], b: &[f64]) -> f64 {
        let mut out = [0.0];
        self.dots(a, b, &mut out);
        out[0]
    }
}

/// No preconditioner: z = r.
#[derive(Clone, Copy, Debug)]
pub struct Identity;

impl Preconditioner for Identity {
    fn apply(&mut self, r: &[f32], z: &mut [f32]) {
        z.copy_from_slice(r);
    }
}
