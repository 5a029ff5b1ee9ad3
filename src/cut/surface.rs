//! What the flow must know of a structure: how its wall holds the fluid, and how it moves.

/// How a wall holds the fluid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wall {
    /// The fluid sticks.
    NoSlip,
    /// The fluid slides freely along.
    Slip,
}

/// Rigid motion at one time: `ū(x) = velocity + spin × (x − centre)`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// A point of the body [m]; torques are about it.
    pub centre: [f64; 3],
    /// Of that point [m/s].
    pub velocity: [f64; 3],
    /// Angular velocity [rad/s].
    pub spin: [f64; 3],
}

impl Motion {
    /// ū(x) [m/s].
    #[inline]
    pub fn at(&self, x: [f64; 3]) -> [f64; 3] {
        let r = cross(self.spin, std::array::from_fn(|k| x[k] - self.centre[k]));
        std::array::from_fn(|k| self.velocity[k] + r[k])
    }
}

/// a × b
#[inline]
pub fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// A structure's surface, by its number in the level set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// How it holds the fluid.
    pub wall: Wall,
    /// How it moves over the step.
    pub motion: Motion,
}
