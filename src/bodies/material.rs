//! Contact properties of pairs of materials [19, 20].

use std::f64::consts::PI;

/// What two materials are to each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// K [N/m], normal and tangential.
    pub stiffness: f64,
    /// e: speed after over speed before.
    pub restitution: f64,
    /// Tangent of the friction angle.
    pub friction: f64,
}

impl Contact {
    /// ζ: fraction of critical damping that gives the restitution.
    pub fn damping_ratio(&self) -> f64 {
        let ln = self.restitution.max(f64::MIN_POSITIVE).ln();
        (ln * ln / (ln * ln + PI * PI)).sqrt()
    }

    fn damping(&self) -> f64 {
        2.0 * self.stiffness.sqrt() * self.damping_ratio()
    }
}

/// All pairs of materials.
#[derive(Clone, Debug, PartialEq)]
pub struct Materials {
    n: usize,
    pairs: Vec<Contact>,
    /// 2√K ζ of each pair: times √m, its dashpot.
    dampings: Vec<f64>,
    /// Whether the dashpot's pull at the end of a contact is left out; restitution is then higher.
    pub no_tension: bool,
}

impl Materials {
    /// `n` materials, all pairs alike.
    pub fn uniform(n: usize, contact: Contact) -> Self {
        Self {
            n,
            pairs: vec![contact; n * n],
            dampings: vec![contact.damping(); n * n],
            no_tension: false,
        }
    }

    /// Another contact between two materials.
    pub fn set(&mut self, a: u32, b: u32, contact: Contact) {
        let (a, b) = (a as usize, b as usize);
        for at in [a * self.n + b, b * self.n + a] {
            self.pairs[at] = contact;
            self.dampings[at] = contact.damping();
        }
    }

    /// What two materials are to each other.
    #[inline]
    pub fn pair(&self, a: u32, b: u32) -> &Contact {
        &self.pairs[a as usize * self.n + b as usize]
    }

    /// Dashpot of a pair of materials over the root of the mass it stops [√N/m].
    #[inline]
    pub fn damping(&self, a: u32, b: u32) -> f64 {
        self.dampings[a as usize * self.n + b as usize]
    }

    /// Stiffest and most damped contact of a material.
    pub fn stiffest(&self, a: u32) -> (f64, f64) {
        let row = &self.pairs[a as usize * self.n..][..self.n];
        let stiffness = row.iter().map(|c| c.stiffness).fold(0.0, f64::max);
        (stiffness, row.iter().map(|c| c.damping_ratio()).fold(0.0, f64::max))
    }
}
