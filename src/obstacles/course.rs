//! Where an obstacle stands at a time: as its displacement and rotation say, or as its velocity and spin lead it.
//!
//! `x(t) = at + ∫v dt` and `Ṙ = ω × R`, from t = 0, summed up once over panels that end where tables have rows:
//! three Gauss points a panel for the place, two and Magnus' fourth-order exponential for the attitude. Where it
//! stands is a function of time alone: a run that goes on from a checkpoint finds it where it was.

use crate::case::{Formula, Obstacle};
use crate::shape::Pose;
use nalgebra::{UnitQuaternion, Vector3};

/// Panels over the run.
const PANELS: usize = 4096;
/// Points and weights on [0, 1].
const THREE: [(f64, f64); 3] = [
    (0.112_701_665_379_258_3, 5.0 / 18.0),
    (0.5, 4.0 / 9.0),
    (0.887_298_334_620_741_7, 5.0 / 18.0),
];
const TWO: [f64; 2] = [0.211_324_865_405_187_1, 0.788_675_134_594_812_9];

type Three = [Formula; 3];

/// The course of one obstacle.
#[derive(Clone, Debug)]
pub struct Course {
    at: Vector3<f64>,
    turned: UnitQuaternion<f64>,
    displacement: Option<Three>,
    rotation: Option<Three>,
    velocity: Option<Three>,
    spin: Option<Three>,
    /// Ends of the panels [s]; empty without velocity and spin.
    times: Vec<f64>,
    /// Way and turn up to there.
    ways: Vec<(Vector3<f64>, UnitQuaternion<f64>)>,
}

fn value(formulas: &Three, t: f64) -> Vector3<f64> {
    Vector3::from_fn(|k, _| formulas[k].at([0.0; 3], t))
}

/// ∫v dt.
fn way(velocity: &Three, from: f64, to: f64) -> Vector3<f64> {
    let h = to - from;
    THREE.iter().map(|(s, w)| value(velocity, from + s * h) * (w * h)).sum()
}

/// The turn from `from` to `to`: exp(h/2 (ω₁ + ω₂) − √3/12 h² ω₁ × ω₂).
fn turn(spin: &Three, from: f64, to: f64) -> UnitQuaternion<f64> {
    let h = to - from;
    let [a, b] = TWO.map(|s| value(spin, from + s * h));
    let vector = 0.5 * h * (a + b) - 3f64.sqrt() / 12.0 * h * h * a.cross(&b);
    UnitQuaternion::from_scaled_axis(vector)
}

impl Course {
    /// Of an obstacle, in a run up to `end` [s].
    pub fn new(given: &Obstacle, end: f64) -> Self {
        let [x, y, z] = given.turned;
        let mut course = Self {
            at: given.at.into(),
            turned: UnitQuaternion::from_euler_angles(x, y, z),
            displacement: given.displacement.clone(),
            rotation: given.rotation.clone(),
            velocity: given.velocity.clone(),
            spin: given.spin.clone(),
            times: Vec::new(),
            ways: Vec::new(),
        };
        let led = || course.velocity.iter().chain(&course.spin).flatten();
        if led().next().is_none() {
            return course;
        }
        let rows = led().flat_map(|f| f.rows().iter().copied()).filter(|&t| t > 0.0 && t < end);
        let mut times: Vec<f64> =
            (0..=PANELS).map(|i| end * i as f64 / PANELS as f64).chain(rows).collect();
        times.sort_unstable_by(f64::total_cmp);
        times.dedup();
        let mut here = (Vector3::zeros(), UnitQuaternion::identity());
        let mut ways = vec![here];
        for t in times.windows(2) {
            here = course.onwards(here, t[0], t[1]);
            ways.push(here);
        }
        (course.times, course.ways) = (times, ways);
        course
    }

    /// Whether it moves.
    pub fn moves(&self) -> bool {
        let told = [&self.displacement, &self.rotation, &self.velocity, &self.spin];
        told.iter().any(|formulas| formulas.is_some())
    }

    fn onwards(
        &self,
        (x, q): (Vector3<f64>, UnitQuaternion<f64>),
        from: f64,
        to: f64,
    ) -> (Vector3<f64>, UnitQuaternion<f64>) {
        let x = x + self.velocity.as_ref().map_or(Vector3::zeros(), |v| way(v, from, to));
        (x, self.spin.as_ref().map_or(q, |spin| turn(spin, from, to) * q))
    }

    /// Where it stands at `t` [s].
    pub fn pose(&self, t: f64) -> Pose {
        let told = |f: &Option<Three>| f.as_ref().map_or(Vector3::zeros(), |f| value(f, t));
        let (mut way, mut turn) = (
            told(&self.displacement),
            UnitQuaternion::from_scaled_axis(told(&self.rotation).map(f64::to_radians)),
        );
        if !self.times.is_empty() {
            let panel = self.times.partition_point(|&s| s <= t).max(1) - 1;
            let led = self.onwards(self.ways[panel], self.times[panel], t);
            way += led.0;
            turn = led.1 * turn;
        }
        Pose { position: self.at + way, rotation: turn * self.turned }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::case::formula::TimeSeries;
    use crate::case::{ObstacleShape, Solid};
    use std::sync::Arc;

    fn obstacle() -> Obstacle {
        Obstacle {
            name: "a".into(),
            shape: ObstacleShape::Solid(Solid::Sphere(1.0)),
            at: [1.0, 2.0, 3.0],
            turned: [0.1, 0.2, 0.3],
            outside_in: false,
            slip: true,
            displacement: None,
            rotation: None,
            velocity: None,
            spin: None,
        }
    }

    fn three(texts: [&str; 3]) -> Option<Three> {
        Some(texts.map(|text| Formula::parse(text).unwrap()))
    }

    #[test]
    fn a_velocity_leads_where_its_integral_says() {
        let course =
            Course::new(&Obstacle { velocity: three(["sin(3*t)", "t^4", "2"]), ..obstacle() }, 2.0);
        for t in [0.0, 0.3, 1.234_567, 2.0, 2.001] {
            let x = course.pose(t).position - Vector3::new(1.0, 2.0, 3.0);
            let exact = Vector3::new((1.0 - (3.0 * t).cos()) / 3.0, t.powi(5) / 5.0, 2.0 * t);
            assert!((x - exact).norm() < 1e-13, "{t}: {x} {exact}");
        }
        // A table: linear between its rows, so its integral is a parabola between them, wherever they are.
        let series = TimeSeries { times: vec![0.0, 0.77, 1.0], values: vec![0.0, 1.0, -1.0] };
        let column = Formula::table(Arc::new(series), 1.0);
        let still = Formula::constant(0.0);
        let velocity = Some([column, still.clone(), still]);
        let course = Course::new(&Obstacle { velocity, ..obstacle() }, 1.0);
        let x = |t: f64| course.pose(t).position.x - 1.0;
        assert!((x(0.5) - 0.125 / 0.77).abs() < 1e-14);
        assert!((x(1.0) - 0.385).abs() < 1e-14);
    }

    #[test]
    fn a_spin_turns_about_its_axis_and_a_coning_one_as_it_must() {
        let course =
            Course::new(&Obstacle { spin: three(["0", "0", "cos(t)"]), ..obstacle() }, 3.0);
        let start = UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3);
        let exact = UnitQuaternion::from_scaled_axis(Vector3::z() * 2f64.sin()) * start;
        assert!(course.pose(2.0).rotation.angle_to(&exact) < 1e-12);
        // ω = a e_z + b (e_x cos at − e_z-turned …): in the frame that turns with a about z, ω is b e_x; so
        // R = exp(a t e_z) exp(b t e_x).
        let (a, b) = (2.0, 1.5);
        let coning = three(["1.5*cos(2*t)", "1.5*sin(2*t)", "2"]);
        let course = Course::new(&Obstacle { spin: coning, ..obstacle() }, 3.0);
        for t in [0.4f64, 1.7, 3.0] {
            let exact = UnitQuaternion::from_scaled_axis(Vector3::z() * (a * t))
                * UnitQuaternion::from_scaled_axis(Vector3::x() * (b * t))
                * start;
            let off = course.pose(t).rotation.angle_to(&exact);
            assert!(off < 1e-9, "{t}: {off}");
        }
    }
}
