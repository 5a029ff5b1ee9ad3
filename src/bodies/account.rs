//! Where the energy is, and where it went; momentum.

use nalgebra::Vector3;

/// Energies [J]: what is there now, and what has been taken or given since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Account {
    /// ½mv² + ½ω·Iω.
    pub kinetic: f64,
    /// −m g·x.
    pub potential: f64,
    /// In the springs of contacts.
    pub contact: f64,
    /// In bonds, to be had back.
    pub bonds: f64,
    /// Spent on opening bonds.
    pub fracture: f64,
    /// Taken by the dashpots of contacts and bonds.
    pub dashpots: f64,
    /// Taken by friction.
    pub friction: f64,
    /// Given by loads, applied forces and led bodies.
    pub work: f64,
}

impl Account {
    /// All of it less what was given: constant, but for the error of time stepping [J].
    pub fn total(&self) -> f64 {
        self.kinetic
            + self.potential
            + self.contact
            + self.bonds
            + self.fracture
            + self.dashpots
            + self.friction
            - self.work
    }

    /// The entries in order.
    pub fn to_array(self) -> [f64; 8] {
        [
            self.kinetic,
            self.potential,
            self.contact,
            self.bonds,
            self.fracture,
            self.dashpots,
            self.friction,
            self.work,
        ]
    }

    /// From the entries in order.
    pub fn from_array(a: [f64; 8]) -> Self {
        let [kinetic, potential, contact, bonds, fracture, dashpots, friction, work] = a;
        Self { kinetic, potential, contact, bonds, fracture, dashpots, friction, work }
    }
}

/// Momentum of all free clusters.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Momentum {
    /// [kg m/s]
    pub linear: Vector3<f64>,
    /// About the origin of space [kg m²/s].
    pub angular: Vector3<f64>,
}
