//! The ghost penalty on velocity, on faces of cut elements (`cut::ghost`):
//! `Σ_F γ_g ∫_F {(μh + ρ|a|h²) [∂ₙuⁿ⁺¹] + ρh³/Δt [∂ₙ(uⁿ⁺¹ − uⁿ)]}·[∂ₙw]`.
//!
//! What is over Δt extends the mass matrix to the nodes of slivers, and acts as that does, on the change of u. On
//! uⁿ⁺¹ it would take the same share of the jumps in every step, however short.
//!
//! The penalty couples the nodes opposite the face, which no element does. Those two entries a face are kept beside the
//! matrix: the operator has them, the preconditioner goes without.

use super::material::Material;
use crate::cut::ghost::GhostFace;
use crate::fem::constraints::Nodes;
use crate::fem::norm;
use crate::linear::{Operator, Value};

/// γ_g: with 0.01 to 0.1 iterations do not depend on how little fluid a cut element has; 1 is as bad as none.
const GAMMA: f64 = 0.05;

/// Coefficients of `g_i g_j` in the velocity rows: of uⁿ⁺¹, and of uⁿ⁺¹ − uⁿ.
pub fn coefficients(face: &GhostFace, material: &Material, a: &[[f64; 3]], dt: f64) -> [f64; 2] {
    let [i, j, k, ..] = face.nodes.map(|n| n as usize);
    let mean = |f: &dyn Fn(usize) -> f64| (f(i) + f(j) + f(k)) / 3.0;
    let (rho, mu) = (mean(&|n| material.density(n)), mean(&|n| material.viscosity(n)));
    let speed = mean(&|n| norm(a[n]));
    let h = face.h;
    let scale = GAMMA * face.area * h;
    [scale * (mu + rho * h * speed), scale * rho * h * h / dt]
}

/// A matrix entry, the same for each velocity component.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Owned node.
    pub row: u32,
    /// Local node.
    pub column: u32,
    /// Its value.
    pub value: f64,
}

/// The system's operator with the entries that are not in its matrix.
pub struct WithEntries<'a, A> {
    /// The matrix.
    pub matrix: A,
    /// The others.
    pub entries: &'a [Entry],
    /// Of all local nodes.
    pub constraints: &'a Nodes,
}

impl<A: Operator> Operator for WithEntries<'_, A> {
    fn apply<X: Value>(&self, x: &mut [X], y: &mut [f64]) {
        self.matrix.apply(x, y);
        for entry in self.entries {
            let (i, j) = (entry.row as usize, entry.column as usize);
            let x = [x[4 * j], x[4 * j + 1], x[4 * j + 2]].map(Into::into);
            let x = self.constraints[j].project(x);
            let add = self.constraints[i].project(x);
            for k in 0..3 {
                y[4 * i + k] += entry.value * add[k];
            }
        }
    }
}
