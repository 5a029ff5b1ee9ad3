//! Motion of rigid clusters [21-26]: kick, drift, kick.
//!
//! ```text
//!     v ← v + ½Δt F/m,  L ← L + ½Δt T;   x ← x + Δt v,  q ← free rotation of L over Δt;   forces;   kick
//! ```
//! The free rotation is that of Dullweber, Leimkuhler and McLachlan (1997): exact turns about the
//! principal axes in the order 1 2 3 2 1. It is symplectic, and |L| and the quaternion's length stay.
//! Without torque L in space is constant, gyroscopic terms included. ([27] moves with the old velocity:
//! energy then grows.)

use super::cluster::{Cluster, Inertia, Motion, State};
use super::contact::Twist;
use crate::shape::Pose;
use nalgebra::{Matrix3, Quaternion, Unit, UnitQuaternion, Vector3};

/// Loads from outside on one cluster, besides gravity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    /// [N]
    pub force: Vector3<f64>,
    /// About the centroid [N m].
    pub torque: Vector3<f64>,
}

/// v ← v + Δt a, for a free cluster `c`.
#[inline]
pub fn kick(
    state: &mut State,
    c: usize,
    inertia: &Inertia,
    gravity: Vector3<f64>,
    load: &Load,
    dt: f64,
) {
    let mut dv = (state.force[c] + load.force) * (dt * inertia.inverse_mass) + gravity * dt;
    let mut dl = (state.torque[c] + load.torque) * dt;
    if inertia.locked != FREE {
        for k in 0..3 {
            if inertia.locked[k] {
                dv[k] = 0.0;
            }
            if inertia.locked[3 + k] {
                dl[k] = 0.0;
            }
        }
    }
    state.velocity[c] += dv;
    state.angular_momentum[c] += dl;
}

const FREE: [bool; 6] = [false; 6];

/// ω of a free cluster along the axes of space [rad/s].
#[inline]
pub fn spin(state: &State, c: usize, inertia: &Inertia) -> Vector3<f64> {
    let locked = &inertia.locked;
    if !locked[3..].contains(&true) {
        let momentum = &state.angular_momentum[c];
        return State::spin(&state.pose[c], &inertia.inverse_moments, momentum);
    }
    // Reactions keep the locked components of ω at zero: solve for the others.
    let axes = state.pose[c].rotation.to_rotation_matrix();
    let moments = Matrix3::from_diagonal(&inertia.inverse_moments.map(|i| 1.0 / i));
    let mut matrix = axes.matrix() * moments * axes.matrix().transpose();
    let mut right = state.angular_momentum[c];
    for k in (0..3).filter(|k| locked[3 + k]) {
        for j in 0..3 {
            matrix[(k, j)] = 0.0;
            matrix[(j, k)] = 0.0;
        }
        matrix[(k, k)] = 1.0;
        right[k] = 0.0;
    }
    matrix.cholesky().map_or(Vector3::zeros(), |m| m.solve(&right))
}

/// Place and attitude of a free cluster after `dt` with constant momentum.
#[inline]
pub fn drift(state: &mut State, c: usize, inertia: &Inertia, dt: f64) {
    let i = inertia.inverse_moments;
    let turned = if inertia.locked[3..].contains(&true) {
        turn(spin(state, c, inertia) * dt) * state.pose[c].rotation
    } else if i.x == i.y && i.y == i.z {
        turn(state.angular_momentum[c] * (dt * i.x)) * state.pose[c].rotation
    } else {
        rotate_free(&state.pose[c], i, state.angular_momentum[c], dt)
    };
    let pose = &mut state.pose[c];
    pose.position += state.velocity[c] * dt;
    pose.rotation = turned;
    // Rounding alone makes it longer.
    pose.rotation.renormalize_fast();
}

/// exp of a rotation vector.
#[inline]
pub fn turn(angle: Vector3<f64>) -> UnitQuaternion<f64> {
    let square = 0.25 * angle.norm_squared();
    // sin(a)/a and cos(a) of the half angle a.
    let (ratio, cosine) = if square < 1e-4 {
        (
            1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0)),
            1.0 - square / 2.0
                * (1.0 - square / 12.0 * (1.0 - square / 30.0 * (1.0 - square / 56.0))),
        )
    } else {
        let a = square.sqrt();
        (a.sin() / a, a.cos())
    };
    Unit::new_unchecked(Quaternion::from_parts(cosine, 0.5 * ratio * angle))
}

/// Attitude after `dt` of a body with inverse principal moments `inverse` and angular momentum `l` in space.
fn rotate_free(
    pose: &Pose,
    inverse: Vector3<f64>,
    l: Vector3<f64>,
    dt: f64,
) -> UnitQuaternion<f64> {
    let mut q = pose.rotation;
    // Angular momentum in the body's frame, which turns the other way.
    let mut body = q.inverse_transform_vector(&l);
    for (axis, part) in [(0, 0.5), (1, 0.5), (2, 1.0), (1, 0.5), (0, 0.5)] {
        let mut angle = Vector3::zeros();
        angle[axis] = part * dt * body[axis] * inverse[axis];
        let step = turn(angle);
        q *= step;
        body = step.inverse_transform_vector(&body);
    }
    q
}

/// Velocity and spin of a free cluster when its second half kick is added with the forces of before.
#[inline]
pub fn predicted(
    state: &State,
    c: usize,
    inertia: &Inertia,
    gravity: Vector3<f64>,
    load: &Load,
    half: f64,
) -> Twist {
    if inertia.locked != FREE {
        return Twist { velocity: state.velocity[c], spin: spin(state, c, inertia) };
    }
    let velocity = state.velocity[c]
        + (state.force[c] + load.force) * (half * inertia.inverse_mass)
        + gravity * half;
    let momentum = state.angular_momentum[c] + (state.torque[c] + load.torque) * half;
    Twist { velocity, spin: State::spin(&state.pose[c], &inertia.inverse_moments, &momentum) }
}

/// Moves a cluster that is led, by its velocities at the middle of the step.
pub fn lead(state: &mut State, c: usize, cluster: &Cluster, t: f64, dt: f64) -> Twist {
    let Motion::Prescribed { velocity, spin } = &cluster.motion else { return Twist::default() };
    let at = state.pose[c].position.into();
    let of = |formulas: &[crate::case::Formula; 3], t: f64| {
        Vector3::from_fn(|k, _| formulas[k].at(at, t))
    };
    let pose = &mut state.pose[c];
    pose.position += of(velocity, t + 0.5 * dt) * dt;
    pose.rotation = turn(of(spin, t + 0.5 * dt) * dt) * pose.rotation;
    pose.rotation.renormalize_fast();
    state.velocity[c] = of(velocity, t + dt);
    let omega = of(spin, t + dt);
    let body = state.pose[c].rotation.inverse_transform_vector(&omega);
    state.angular_momentum[c] = state.pose[c].rotation * body.component_mul(&cluster.moments);
    Twist { velocity: state.velocity[c], spin: omega }
}

/// ½mv² + ½ω·L of a free cluster [J].
pub fn kinetic(state: &State, c: usize, cluster: &Cluster) -> f64 {
    let omega = spin(state, c, &cluster.inertia());
    0.5 * cluster.mass * state.velocity[c].norm_squared()
        + 0.5 * omega.dot(&state.angular_momentum[c])
}
