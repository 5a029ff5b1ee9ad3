//! Numbers and formulas of a case file, one at a time.

use super::super::error::Problem;
use super::super::file::{Condition, Expression};
use super::super::formula::Formula;
use super::super::sources::Sources;
use std::sync::Arc;

pub fn refuse<T>(key: impl Into<String>, message: impl Into<String>) -> Result<T, Problem> {
    Err(Problem::new(key, message))
}

pub fn finite(key: &str, x: f64) -> Result<f64, Problem> {
    if x.is_finite() { Ok(x) } else { refuse(key, format!("must be a finite number, is {x}")) }
}

pub fn finite_vector(key: &str, x: &[f64; 3]) -> Result<[f64; 3], Problem> {
    for (i, x) in x.iter().enumerate() {
        finite(&format!("{key}[{}]", i + 1), *x)?;
    }
    Ok(*x)
}

/// Corners of a convex polyhedron.
pub fn corners(key: &str, points: &[[f64; 3]]) -> Result<Vec<[f64; 3]>, Problem> {
    if points.len() < 4 {
        return refuse(key, format!("needs at least 4, has {}", points.len()));
    }
    points.iter().enumerate().map(|(i, x)| finite_vector(&format!("{key}[{}]", i + 1), x)).collect()
}

pub fn positive(key: &str, x: f64) -> Result<f64, Problem> {
    finite(key, x)?;
    if x > 0.0 { Ok(x) } else { refuse(key, format!("must be greater than 0, is {x}")) }
}

pub fn not_negative(key: &str, x: f64) -> Result<f64, Problem> {
    finite(key, x)?;
    if x >= 0.0 { Ok(x) } else { refuse(key, format!("must not be negative, is {x}")) }
}

pub fn between(key: &str, x: f64, low: f64, high: f64) -> Result<f64, Problem> {
    if x > low && x < high {
        Ok(x)
    } else {
        refuse(key, format!("must lie between {low} and {high}, is {x}"))
    }
}

pub fn share(key: &str, x: f64) -> Result<f64, Problem> {
    if x > 0.0 && x <= 1.0 {
        Ok(x)
    } else {
        refuse(key, format!("must lie above 0 and not above 1, is {x}"))
    }
}

pub fn at_least_one(key: &str, n: u32) -> Result<u32, Problem> {
    if n >= 1 { Ok(n) } else { refuse(key, "must be at least 1, is 0") }
}

/// Formulas as typed to formulas that can be evaluated, tried out in a few places.
pub struct Reader<'a> {
    pub sources: &'a Sources,
    pub end: f64,
}

impl Reader<'_> {
    /// A number, formula or table column.
    pub fn value(
        &self,
        key: &str,
        typed: &Expression,
        points: &[[f64; 3]],
        times: &[f64],
    ) -> Result<Formula, Problem> {
        let formula = match typed {
            Expression::Number(number) => Formula::constant(finite(key, *number)?),
            Expression::Formula(text) => {
                Formula::parse(text).map_err(|e| Problem::new(key, e.to_string()))?
            }
            Expression::Table(column) => {
                self.series(key, &format!("{key}.column"), &column.table, &column.column, 1.0)?
            }
        };
        tried(key, formula, points, times)
    }

    /// Three of them, or none.
    pub fn vector(
        &self,
        key: &str,
        typed: &Option<[Expression; 3]>,
        points: &[[f64; 3]],
        times: &[f64],
    ) -> Result<Option<[Formula; 3]>, Problem> {
        typed.as_ref().map(|typed| self.three(key, typed, points, times)).transpose()
    }

    /// Three of them.
    pub fn three(
        &self,
        key: &str,
        typed: &[Expression; 3],
        points: &[[f64; 3]],
        times: &[f64],
    ) -> Result<[Formula; 3], Problem> {
        let one = |i: usize| self.value(&format!("{key}[{}]", i + 1), &typed[i], points, times);
        Ok([one(0)?, one(1)?, one(2)?])
    }

    /// A condition as a distance.
    pub fn condition(
        &self,
        key: &str,
        typed: &Condition,
        points: &[[f64; 3]],
        times: &[f64],
    ) -> Result<Formula, Problem> {
        let formula = match typed {
            Condition::Always(holds) => Formula::everywhere(*holds),
            Condition::Formula(text) => {
                Formula::parse_distance(text).map_err(|e| Problem::new(key, e.to_string()))?
            }
        };
        tried(key, formula, points, times)
    }

    /// `factor` times a table's column, which must cover the whole run.
    pub fn series(
        &self,
        table_key: &str,
        column_key: &str,
        table: &str,
        column: &str,
        factor: f64,
    ) -> Result<Formula, Problem> {
        let series = self.sources.series(table, column);
        let series = series.map_err(|message| Problem::new(column_key, message))?;
        let (first, last) = (series.times[0], series.times[series.times.len() - 1]);
        if first > 0.0 || last < self.end {
            let end = self.end;
            let message = format!("{table}: covers {first} s to {last} s, the run 0 s to {end} s");
            return refuse(table_key, message);
        }
        Ok(Formula::table(Arc::new(series), factor))
    }
}

/// A formula that gives finite numbers wherever it is tried.
fn tried(
    key: &str,
    formula: Formula,
    points: &[[f64; 3]],
    times: &[f64],
) -> Result<Formula, Problem> {
    if let Some(value) = formula.as_constant()
        && !value.is_finite()
    {
        return refuse(key, format!("is {value}, which is no finite number"));
    }
    for &t in times {
        for &x in points {
            let value = formula.at(x, t);
            if !value.is_finite() {
                let [x, y, z] = x;
                return refuse(key, format!("is {value} at x = {x}, y = {y}, z = {z}, t = {t}"));
            }
        }
    }
    Ok(formula)
}
