//! Faces with given pressure: traction `−p n`, and what keeps backflow stable.
//!
//! `∫_Γ w·(p n)` with the given `p` is what integrating `∇p` by parts leaves; where the fluid comes
//! in, `−∫_Γ ρ (a·n)₋ w·u_θ` takes out the kinetic energy that it would bring along.

use crate::fem::dot;

/// One face's known data.
#[derive(Clone, Copy, Debug)]
pub struct OpenFace {
    /// Unit normal out of the fluid.
    pub normal: [f64; 3],
    /// ∮N_iN_j of the corners [m²].
    pub mass: [[f64; 3]; 3],
    /// uⁿ at the corners [m/s].
    pub u: [[f64; 3]; 3],
    /// Advecting velocity at n+½ at the corners [m/s].
    pub a: [[f64; 3]; 3],
    /// Given pressure at the corners [Pa].
    pub p: [f64; 3],
    /// Density of the element behind [kg/m³].
    pub rho: f64,
    /// Weight of n+1.
    pub theta: f64,
}

impl OpenFace {
    /// Right-hand side of the three corners' momentum rows, and the coefficient `c` of the matrix:
    /// entry (i, j) is `c mass[i][j]` on each velocity component.
    pub fn system(&self) -> ([[f64; 3]; 3], f64) {
        let mean: [f64; 3] =
            std::array::from_fn(|k| (self.a[0][k] + self.a[1][k] + self.a[2][k]) / 3.0);
        let c = self.rho * (-dot(mean, self.normal)).max(0.0);
        let rhs = std::array::from_fn(|i| {
            let p = dot(self.mass[i], self.p);
            std::array::from_fn(|k| {
                let u = dot(self.mass[i], self.u.map(|u| u[k]));
                -self.normal[k] * p - (1.0 - self.theta) * c * u
            })
        });
        (rhs, self.theta * c)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn traction_of_uniform_pressure_and_backflow_only_inwards() {
        let mut face = OpenFace {
            normal: [0.0, 0.0, 1.0],
            // A triangle of area ½.
            mass: [0, 1, 2].map(|i| [0, 1, 2].map(|j| if i == j { 2.0 } else { 1.0 } / 24.0)),
            u: [[0.0, 0.0, -2.0]; 3],
            a: [[0.0, 0.0, 2.0]; 3],
            p: [6.0; 3],
            rho: 3.0,
            theta: 0.5,
        };
        let (rhs, c) = face.system();
        assert!((rhs.iter().map(|r| r[2]).sum::<f64>() + 3.0).abs() < 1e-14);
        assert_eq!(c, 0.0);
        face.a = [[0.0, 0.0, -2.0]; 3];
        let (rhs, c) = face.system();
        // ½ρ|a·n| ∫N_i u_θ of the old velocity: −½·3·2·½·(−2) = +3 in all, on top of the pressure.
        assert!((rhs.iter().map(|r| r[2]).sum::<f64>() - 0.0).abs() < 1e-14);
        assert!((c - 3.0).abs() < 1e-14);
    }
}
