//! Contact at one point [19, 20]: a spring and a dashpot along the normal and across it, and Coulomb's slider.
//!
//! ```text
//!     F_n = K u + C u̇,   F_t = −K ξ − C v_t,  |F_t| ≤ tan(angle) max(F_n, 0)
//!     C   = 2√(mK) √((ln e)²/((ln e)²+π²))
//! ```

use super::material::Contact;
use nalgebra::Vector3;

/// One touching pair of spheres, or a sphere and a wall.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// From the second to the first.
    pub normal: Vector3<f64>,
    /// u [m]
    pub overlap: f64,
    /// Of the first relative to the second at the point [m/s].
    pub velocity: Vector3<f64>,
    /// Mean spin of the two about the normal [rad/s].
    pub spin: f64,
    /// C [N s/m].
    pub dashpot: f64,
}

/// What a point does in a step.
#[derive(Clone, Copy, Debug)]
pub struct Push {
    /// On the first [N].
    pub force: Vector3<f64>,
    /// Taken by the slider [J].
    pub friction: f64,
    /// Taken by the dashpots [J].
    pub dashpots: f64,
}

/// The push of a point; its spring ξ, which counts if they `touched` a step ago, moves on by `dt`.
#[inline(always)]
pub fn push(
    law: &Contact,
    no_tension: bool,
    point: &Point,
    spring: &mut Vector3<f64>,
    touched: bool,
    dt: f64,
) -> Push {
    let Point { normal: n, overlap, velocity: v, spin, .. } = *point;
    let k = law.stiffness;
    let v_n = v.dot(&n);
    let c = point.dashpot * share(overlap, v_n * dt, touched);
    let v_t = v - v_n * n;
    let mut normal_force = k * overlap - c * v_n;
    if no_tension {
        normal_force = normal_force.max(0.0);
    }
    // The spring turns with the contact: into its plane, and about its normal.
    let mut xi = if touched { *spring } else { Vector3::zeros() };
    let before = xi.norm_squared();
    if before > 0.0 {
        let (out, angle) = (xi.dot(&n), spin * dt);
        let now = (before - out * out) * (1.0 + angle * angle);
        xi += angle * n.cross(&xi) - out * n;
        if now > 0.0 {
            xi *= (before / now).sqrt();
        }
    }
    xi += v_t * dt;
    let mut tangential = -k * xi - c * v_t;
    let limit = law.friction * normal_force.max(0.0);
    let wanted = tangential.norm_squared();
    let mut friction = 0.0;
    if wanted > limit * limit {
        tangential *= limit / wanted.sqrt();
        // What the dashpot leaves of the limit is the spring's.
        let left = (tangential + c * v_t) * (-1.0 / k);
        let kept = if left.dot(&tangential) < 0.0 { left } else { Vector3::zeros() };
        friction = tangential.dot(&(kept - xi));
        xi = kept;
    }
    *spring = xi;
    let stored = 0.5 * k * (xi.norm_squared() - before);
    let given = ((normal_force - k * overlap) * v_n + tangential.dot(&v_t)) * dt;
    Push { force: normal_force * n + tangential, friction, dashpots: -(given + stored + friction) }
}

/// The part of the time between the middles of the two steps around now that a contact lasts which begins or
/// ends there: its dashpot jumps, and counting whole steps would make restitution a matter of luck.
/// `way`: growth of the gap in a step [m].
#[inline(always)]
fn share(overlap: f64, way: f64, touched: bool) -> f64 {
    if !touched && way < 0.0 {
        0.5 + (overlap / -way).min(1.0)
    } else if way > overlap {
        0.5 + overlap / way
    } else {
        1.0
    }
}
