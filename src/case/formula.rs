//! Formulas of x, y, z, t in case files: `"0.1*sin(2*pi*t)"`, `"z < 0.55 && x > 1.992"`, a number, or
//! a column of a table.
//!
//! A condition has two readings. As a *value* it is 1 or 0. As a *distance* it is the signed distance
//! to the surface where it starts to hold, positive where it holds: `a < b` is f = b − a divided by
//! |∇f|, `&&` the smaller, `||` the larger, `!` the negative. The division is exact for planes and
//! right to first order near any smooth surface.

mod program;
mod syntax;

use program::Program;
use std::sync::Arc;
pub use syntax::FormulaError;

/// Distance [m] given where a condition holds, or fails, independent of x, y, z.
pub const FAR: f64 = 1e6;

/// A formula of x, y, z, t; cheap to clone.
#[derive(Clone, Debug, PartialEq)]
pub struct Formula(Kind);

#[derive(Clone, Debug, PartialEq)]
enum Kind {
    Constant(f64),
    Value(Arc<Program>),
    Distance(Arc<Program>),
    Table { series: Arc<TimeSeries>, factor: f64 },
}

/// A column of a table, linear in time between its rows and constant beyond them.
#[derive(Clone, Debug, PartialEq)]
pub struct TimeSeries {
    /// Strictly increasing [s].
    pub times: Vec<f64>,
    /// One per time.
    pub values: Vec<f64>,
}

impl Formula {
    /// The same everywhere, always.
    pub fn constant(value: f64) -> Self {
        Self(Kind::Constant(value))
    }

    /// A number in x, y, z, t; conditions in it count 1 or 0.
    ///
    /// # Errors
    /// Where and why the text is no formula.
    pub fn parse(text: &str) -> Result<Self, FormulaError> {
        let program = Program::value(&syntax::parse(text)?)?;
        Ok(program
            .as_constant()
            .map_or_else(|| Self(Kind::Value(Arc::new(program))), Self::constant))
    }

    /// A condition, read as a signed distance [m].
    ///
    /// # Errors
    /// Where and why the text is no condition.
    pub fn parse_distance(text: &str) -> Result<Self, FormulaError> {
        let program = Program::distance(&syntax::parse(text)?)?;
        Ok(Self(Kind::Distance(Arc::new(program))))
    }

    /// Holds everywhere (`true`) or nowhere, as a distance.
    pub fn everywhere(holds: bool) -> Self {
        Self::constant(if holds { FAR } else { -FAR })
    }

    /// `factor` times a table's column.
    pub fn table(series: Arc<TimeSeries>, factor: f64) -> Self {
        Self(Kind::Table { series, factor })
    }

    /// Value at (x, t). Never allocates.
    pub fn at(&self, x: [f64; 3], t: f64) -> f64 {
        match &self.0 {
            Kind::Constant(value) => *value,
            Kind::Value(program) => program.value_at(x, t),
            Kind::Distance(program) => program.distance_at(x, t),
            Kind::Table { series, factor } => factor * series.at(t),
        }
    }

    /// The times of a table's rows [s], where its slope changes; none of a formula.
    pub fn rows(&self) -> &[f64] {
        match &self.0 {
            Kind::Table { series, .. } => &series.times,
            _ => &[],
        }
    }

    /// The number it always is, if it is one.
    pub fn as_constant(&self) -> Option<f64> {
        match self.0 {
            Kind::Constant(value) => Some(value),
            _ => None,
        }
    }
}

impl TimeSeries {
    /// Value at `t`.
    pub fn at(&self, t: f64) -> f64 {
        let after = self.times.partition_point(|&s| s <= t);
        if after == 0 {
            return self.values[0];
        }
        if after == self.times.len() {
            return self.values[after - 1];
        }
        let (t0, t1) = (self.times[after - 1], self.times[after]);
        let s = (t - t0) / (t1 - t0);
        (1.0 - s) * self.values[after - 1] + s * self.values[after]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(text: &str, x: [f64; 3], t: f64) -> f64 {
        Formula::parse(text).unwrap().at(x, t)
    }

    #[test]
    fn arithmetic_follows_the_usual_rules() {
        let o = [0.0; 3];
        for (text, expected) in [
            ("1 + 2*3", 7.0),
            ("-2^2", -4.0),
            ("2^3^2", 512.0),
            ("2**-1", 0.5),
            ("12/2/3", 2.0),
            ("1-2-3", -4.0),
            ("1e-3*2E3", 2.0),
            (".5 + 1.", 1.5),
            ("min(2, max(1, 3))", 2.0),
            ("max(min(1,2),min(3,4))", 3.0),
            ("-max(1, 2)^2", -4.0),
            ("2*-3", -6.0),
            ("(1 < 2)*5 + (2 <= 1)", 5.0),
            ("1 < 2 < 3 && !(3 != 3)", 1.0),
            ("1 == 2 || 3 >= 3", 1.0),
            ("true && false", 0.0),
            ("floor(-1.5) + abs(-2) + sqrt(9)", 3.0),
        ] {
            assert_eq!(value(text, o, 0.0), expected, "{text}");
        }
        let p = [0.3, -0.7, 1.9];
        let by_hand = (0.3f64 * 0.7).sin() - (-(1.9f64 * 1.9)).exp() * 0.5f64.tanh()
            + (0.3f64.atan() + 0.3f64.asin() + 0.3f64.acos() + 0.3f64.tan())
            + (1.9f64.ln() + 0.3f64.sinh() + 0.3f64.cosh() + std::f64::consts::E.powf(0.3))
            - std::f64::consts::PI;
        let text = "sin(-x*y) - exp(-z^2)*tanh(t) + (atan(x) + asin(x) + acos(x) + tan(x))
                    + (log(z) + sinh(x) + cosh(x) + e^x) - pi";
        assert!((value(text, p, 0.5) - by_hand).abs() < 1e-14);
    }

    #[test]
    fn conditions_read_as_distances() {
        let water = Formula::parse_distance("z < 0.55 && x > 1.992").unwrap();
        assert!((water.at([2.0, 0.0, 0.5], 0.0) - 0.008).abs() < 1e-15);
        assert!((water.at([3.0, 0.0, 0.5], 0.0) - 0.05).abs() < 1e-15);
        assert!((water.at([1.0, 0.0, 0.1], 0.0) + 0.992).abs() < 1e-15);
        // Scale does not matter, nor does a slope.
        let plane = Formula::parse_distance("300*x + 400*z <= 50").unwrap();
        assert!((plane.at([0.0, 9.0, 0.0], 0.0) - 0.1).abs() < 1e-15);
        let not = Formula::parse_distance("!(z < 1 || z > 2)").unwrap();
        assert!((not.at([0.0, 0.0, 1.25], 0.0) - 0.25).abs() < 1e-15);
        // A disc written with squares: to second order in the distance from its edge.
        let disc = Formula::parse_distance("(x-0.5)^2 + (y-0.75)^2 < 0.15^2").unwrap();
        for d in [0.01, -0.01, 0.02] {
            let there = disc.at([0.5, 0.75 + 0.15 - d, 0.0], 0.0);
            assert!((there - d).abs() < 5.0 * d * d, "{d} {there}");
        }
        let wave = Formula::parse_distance("z < 1 + 0.1*cos(pi*x)").unwrap();
        let slope = 0.1 * std::f64::consts::PI;
        let cos_of_slope = 1.0 / (1.0 + slope * slope).sqrt();
        assert!((wave.at([0.5, 0.0, 0.99], 0.0) - 0.01 * cos_of_slope).abs() < 1e-12);
        // Conditions on time alone, and constants.
        let gate = Formula::parse_distance("t < 2 && z < 1").unwrap();
        assert!((gate.at([0.0; 3], 1.0) - 1.0).abs() < 1e-15);
        assert_eq!(gate.at([0.0; 3], 2.0), -FAR);
        assert_eq!(Formula::parse_distance("true").unwrap().at([0.0; 3], 0.0), FAR);
    }

    #[test]
    fn tables_are_linear_in_time() {
        let series =
            Arc::new(TimeSeries { times: vec![0.0, 1.0, 3.0], values: vec![0.0, 2.0, -2.0] });
        let f = Formula::table(series, 0.5);
        for (t, v) in [(-1.0, 0.0), (0.25, 0.25), (1.0, 1.0), (2.0, 0.0), (3.0, -1.0), (9.0, -1.0)]
        {
            assert_eq!(f.at([0.0; 3], t), v);
        }
    }

    #[test]
    fn errors_name_the_place_and_the_nearest_name() {
        for (text, message) in [
            ("sim(x)", "unknown name \"sim\"; did you mean \"sin\"?"),
            (
                "2*r",
                "unknown name \"r\"; valid names: x, y, z, t, pi, e, true, false, sin, cos, tan, asin, acos, atan, sinh, cosh, tanh, exp, log, sqrt, abs, floor, min, max",
            ),
            ("sin x", "sin needs its argument in parentheses"),
            ("sin(1, 2)", "sin takes 1 argument, 2 given"),
            ("min(1)", "min takes 2 arguments, 1 given"),
            ("(1 + 2", "a closing parenthesis is missing"),
            ("1 + 2)", "\")\" at column 6 is one too many"),
            ("1 +", "the formula ends where a number was expected"),
            ("1 + * 2", "a number was expected at column 5, found \"*\""),
            ("1 2", "an operator was expected at column 3, found \"2\""),
            (
                "x < 1 and z < 2",
                "an operator was expected at column 7, found \"and\"; and is written &&",
            ),
            ("1 = 2", "\"=\" at column 3 is no operator; to compare write =="),
            ("x & y", "unknown character \"&\" at column 3"),
            ("1.2.3", "\"1.2.3\" is no number"),
            ("", "the formula is empty"),
            ("x && y", "\"&&\" joins conditions such as z < 0.5; the left one is a number"),
            ("!x", "\"!\" negates a condition such as z < 0.5, not a number"),
        ] {
            assert_eq!(Formula::parse(text).unwrap_err().to_string(), message, "{text}");
        }
        assert_eq!(
            Formula::parse_distance("z - 0.5").unwrap_err().to_string(),
            "a condition such as z < 0.5 was expected, not a number"
        );
        let deep = format!("{}x{}", "sin(".repeat(300), ")".repeat(300));
        assert!(Formula::parse(&deep).unwrap_err().to_string().contains("nested too deeply"));
        let wide = format!("{}x{}", "(1 + x*".repeat(60), ")".repeat(60));
        assert!(Formula::parse(&wide).unwrap_err().to_string().contains("nested too deeply"));
    }
}
