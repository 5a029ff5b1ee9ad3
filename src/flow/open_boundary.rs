//! Faces with given pressure: traction `−p n`, and what keeps backflow stable.
//!
//! `∫_Γ w·(p n)` with the given `p` is what integrating `∇p` by parts leaves; where the fluid comes
//! in, `−∫_Γ ρ (a·n)₋ w·u_θ` takes out the kinetic energy that it would bring along.

use crate::fem::{dot, norm, triangle_normal};

/// One face's known data.
#[derive(Clone, Copy, Debug)]
pub struct OpenFace {
    /// Corners, normal out of the fluid.
    pub x: [[f64; 3]; 3],
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
    /// entry (i, j) is `c (1 + δ_ij)` on each velocity component.
    pub fn system(&self) -> ([[f64; 3]; 3], f64) {
        let normal = triangle_normal(self.x);
        let area = norm(normal);
        let mean: [f64; 3] =
            std::array::from_fn(|k| (self.a[0][k] + self.a[1][k] + self.a[2][k]) / 3.0);
        let inflow = (-dot(mean, normal) / area).max(0.0);
        let c = self.rho * inflow * area / 12.0;
        let sum_p: f64 = self.p.iter().sum();
        let rhs = std::array::from_fn(|i| {
            std::array::from_fn(|k| {
                let sum_u = self.u[0][k] + self.u[1][k] + self.u[2][k] + self.u[i][k];
                -normal[k] * (sum_p + self.p[i]) / 12.0 - (1.0 - self.theta) * c * sum_u
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
            x: [[0., 0., 1.], [1., 0., 1.], [0., 1., 1.]],
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
        assert!((12.0 * c - 1.5).abs() < 1e-14);
    }
}
