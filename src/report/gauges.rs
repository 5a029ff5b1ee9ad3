//! Gauges: water along lines, pressure and velocity at points, anywhere in the mesh.

use crate::case::{Case, CaseError, GaugeKind};
use crate::mesh::chord::Stretch;
use crate::mesh::locate::{Locator, Place};
use crate::mesh::{MeshError, MeshPart};

/// The case's gauges, found in the mesh.
pub struct Gauges {
    gauges: Vec<Gauge>,
    /// (name, unit) of the columns of `values`.
    pub columns: Vec<(String, &'static str)>,
}

/// What this rank contributes to one gauge.
enum Gauge {
    Water(Vec<Stretch>),
    Pressure(Option<Place>),
    Velocity(Option<Place>),
}

impl Gauges {
    /// Finds the gauges. Collective.
    ///
    /// # Errors
    /// A gauge outside the mesh: its key in the case file.
    pub fn new(case: &Case, part: &MeshPart) -> Result<Self, CaseError> {
        let locator = Locator::owned(part);
        let mut this = Self { gauges: Vec::new(), columns: Vec::new() };
        for (i, gauge) in case.gauges.iter().enumerate() {
            let fail = |key: &str, error: MeshError| {
                case.source.error(&format!("gauge[{}].{key}", i + 1), error.to_string())
            };
            let point = |key, at| {
                let found = locator.places(part, &[at]).map_err(|e| fail(key, e))?;
                Ok::<_, CaseError>(found.into_iter().next().flatten())
            };
            let name = &gauge.name;
            match gauge.kind {
                GaugeKind::WaterLevel { line } => {
                    let found =
                        locator.stretches(part, &[line]).map_err(|e| fail("water_level", e))?;
                    this.gauges.push(Gauge::Water(found.into_iter().flatten().collect()));
                    this.columns.push((name.clone(), "m"));
                }
                GaugeKind::Pressure { at } => {
                    this.gauges.push(Gauge::Pressure(point("pressure", at)?));
                    this.columns.push((name.clone(), "Pa"));
                }
                GaugeKind::Velocity { at } => {
                    this.gauges.push(Gauge::Velocity(point("velocity", at)?));
                    for axis in ["x", "y", "z"] {
                        this.columns.push((format!("{name}_{axis}"), "m/s"));
                    }
                }
            }
        }
        Ok(this)
    }

    /// The columns' values, on every rank, of nodal φ (empty: liquid everywhere), p and u. Collective.
    pub fn values(&self, part: &MeshPart, phi: &[f64], p: &[f64], u: &[[f64; 3]]) -> Vec<f64> {
        let mesh = &part.mesh;
        let mut values = Vec::with_capacity(self.columns.len());
        for gauge in &self.gauges {
            match gauge {
                Gauge::Water(stretches) => {
                    let liquid = |n: usize| phi.get(n).copied().unwrap_or(1.0);
                    values.push(stretches.iter().map(|s| s.integral(mesh, liquid)).sum());
                }
                Gauge::Pressure(place) => {
                    values.push(place.as_ref().map_or(0.0, |x| x.value(mesh, |n| p[n])));
                }
                Gauge::Velocity(place) => {
                    for k in 0..3 {
                        values.push(place.as_ref().map_or(0.0, |x| x.value(mesh, |n| u[n][k])));
                    }
                }
            }
        }
        part.comm.sum_all(&mut values);
        values
    }
}
