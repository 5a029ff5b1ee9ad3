//! Formulas of x, y, z, t in case files.

/// A formula of x, y, z, t.
#[derive(Clone, Debug)]
pub struct Formula {}

impl Formula {
    /// Value at (x, t).
    pub fn at(&self, _x: [f64; 3], _t: f64) -> f64 {
        0.0
    }
}
