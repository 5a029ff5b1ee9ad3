//! Gauges: water along lines, pressure and velocity at points, anywhere in the mesh. Inside a structure there is no
//! water, and no pressure or velocity: NaN.

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
    /// Finds the gauges. `solid`: nodes that never have fluid around them. Collective.
    ///
    /// # Errors
    /// A gauge outside the mesh or where there is never fluid: its key in the case file.
    pub fn new(case: &Case, part: &MeshPart, solid: &[u32]) -> Result<Self, CaseError> {
        let locator = Locator::owned(part);
        let mut this = Self { gauges: Vec::new(), columns: Vec::new() };
        for (i, gauge) in case.gauges.iter().enumerate() {
            let fail = |key: &str, error: MeshError| {
                case.source.error(&format!("gauge[{}].{key}", i + 1), error.to_string())
            };
            let point = |key, at| {
                let found = locator.places(part, &[at]).map_err(|e| fail(key, e))?;
                let found = found.into_iter().next().flatten();
                if part.comm.any(found.as_ref().is_some_and(|x| touches(part, x, solid))) {
                    return Err(fail(key, MeshError::InStructure { at }));
                }
                Ok(found)
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

    /// The columns' values, on every rank, of nodal φ (empty: liquid everywhere), p and u; `dry`: nodes without fluid.
    /// Collective.
    pub fn values(
        &self,
        part: &MeshPart,
        dry: &[u32],
        phi: &[f64],
        p: &[f64],
        u: &[[f64; 3]],
    ) -> Vec<f64> {
        let mesh = &part.mesh;
        let is_dry = |n: usize| dry.binary_search(&(n as u32)).is_ok();
        let at = |place: &Option<Place>, field: &dyn Fn(usize) -> f64| match place {
            Some(x) if touches(part, x, dry) => f64::NAN,
            Some(x) => x.value(mesh, field),
            None => 0.0,
        };
        let mut values = Vec::with_capacity(self.columns.len());
        for gauge in &self.gauges {
            match gauge {
                Gauge::Water(stretches) => {
                    let liquid =
                        |n: usize| if is_dry(n) { 0.0 } else { phi.get(n).copied().unwrap_or(1.0) };
                    values.push(stretches.iter().map(|s| s.integral(mesh, liquid)).sum());
                }
                Gauge::Pressure(place) => {
                    values.push(at(place, &|n| p[n]));
                }
                Gauge::Velocity(place) => {
                    for k in 0..3 {
                        values.push(at(place, &|n| u[n][k]));
                    }
                }
            }
        }
        part.comm.sum_all(&mut values);
        values
    }
}

/// Whether the value at a place takes from one of these nodes, which ascend.
fn touches(part: &MeshPart, place: &Place, nodes: &[u32]) -> bool {
    let tet = &part.mesh.tets[place.element as usize];
    let mut counts = tet.iter().zip(place.weights).filter(|(_, weight)| *weight > 1e-9);
    counts.any(|(n, _)| nodes.binary_search(n).is_ok())
}
