//! Gauges: water along lines, pressure and velocity at points, anywhere in the mesh or riding on structures. Inside a
//! structure there is no water, and no pressure or velocity: NaN.
//!
//! A gauge on a surface takes the fields of the element it is in if that has fluid, whose pressure is continued up to
//! the surface; else of the first that has, outwards.

use crate::case::{Case, CaseError, GaugeKind};
use crate::mesh::chord::Stretch;
use crate::mesh::locate::{Locator, Place};
use crate::mesh::tetrahedron::Tetrahedron;
use crate::mesh::{MeshError, MeshPart};

/// The case's gauges, found in the mesh.
pub struct Gauges {
    gauges: Vec<Gauge>,
    /// (name, unit) of the columns of `values`.
    pub columns: Vec<(String, &'static str)>,
    /// For those that ride.
    locator: Option<Locator>,
    /// Steps outwards [m].
    stride: f64,
}

/// Strides outwards at most: about two elements.
const STRIDES: u64 = 20;
/// Elements have smaller global numbers.
const NOWHERE: u64 = u64::MAX;

/// What this rank contributes to one gauge.
enum Gauge {
    Water(Vec<Stretch>),
    Pressure(Option<Place>),
    Velocity(Option<Place>),
    /// The number of the rider; whether of velocity.
    Rides(usize, bool),
}

impl Gauges {
    /// Finds the gauges. `solid`: nodes that never have fluid around them. Collective.
    ///
    /// # Errors
    /// A gauge outside the mesh or where there is never fluid: its key in the case file.
    pub fn new(case: &Case, part: &MeshPart, solid: &[u32]) -> Result<Self, CaseError> {
        let mut this = Self { gauges: Vec::new(), columns: Vec::new(), locator: None, stride: 0.0 };
        if case.gauges.is_empty() {
            return Ok(this);
        }
        let locator = Locator::owned(part);
        let mut riders = 0;
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
            let axes = ["x", "y", "z"].map(|axis| (format!("{name}_{axis}"), "m/s"));
            if gauge.on.is_some() {
                let velocity = matches!(gauge.kind, GaugeKind::Velocity { .. });
                this.gauges.push(Gauge::Rides(riders, velocity));
                riders += 1;
                if velocity {
                    this.columns.extend(axes);
                } else {
                    this.columns.push((name.clone(), "Pa"));
                }
                continue;
            }
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
                    this.columns.extend(axes);
                }
            }
        }
        if riders > 0 {
            let sizes = (0..part.n_owned_elements).map(|e| Tetrahedron::of(&part.mesh, e).size());
            this.stride = 0.1 * part.max(sizes.fold(0.0, f64::max));
            this.locator = Some(locator);
        }
        Ok(this)
    }

    /// Where each rider takes its values from: the place, on the one rank that answers; None on all if there is no
    /// fluid near. `riding`: place and outward normal. Collective.
    fn beside(&self, part: &MeshPart, dry: &[u32], riding: &[[[f64; 3]; 2]]) -> Vec<Option<Place>> {
        let Some(locator) = &self.locator else { return Vec::new() };
        let global = |p: &Place| part.element_global[p.element as usize];
        // (stride, element) of the first place with fluid.
        let first = |[x, out]: &[[f64; 3]; 2]| {
            (0..=STRIDES).find_map(|k| {
                let away = k as f64 * self.stride;
                let y = std::array::from_fn(|i| x[i] + away * out[i]);
                let wet = locator.candidates(&part.mesh, y).into_iter();
                let wet = wet.filter(|p| !touches(part, p, dry));
                wet.min_by_key(global).map(|place| ([k, global(&place)], place))
            })
        };
        let mut mine: Vec<_> = riding.iter().map(first).collect();
        let offers: Vec<[u64; 2]> =
            mine.iter().map(|found| found.as_ref().map_or([NOWHERE; 2], |f| f.0)).collect();
        let all = part.comm.all_gather(offers.as_flattened());
        let place = |(i, found): (usize, &mut Option<([u64; 2], Place)>)| {
            let best = all.iter().map(|list| [list[2 * i], list[2 * i + 1]]).min();
            found.take().filter(|(offer, _)| Some(*offer) == best).map(|(_, place)| place)
        };
        mine.iter_mut().enumerate().map(place).collect()
    }

    /// The columns' values, on every rank, of nodal φ (empty: liquid everywhere), p and u; `dry`: nodes without fluid,
    /// `riding`: place and outward normal of those that ride. Collective.
    pub fn values(
        &self,
        part: &MeshPart,
        dry: &[u32],
        phi: &[f64],
        p: &[f64],
        u: &[[f64; 3]],
        riding: &[[[f64; 3]; 2]],
    ) -> Vec<f64> {
        let mesh = &part.mesh;
        let beside = self.beside(part, dry, riding);
        let found = beside.iter().map(|place| f64::from(u8::from(place.is_some())));
        let mut found: Vec<f64> = found.collect();
        part.comm.sum_all(&mut found);
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
                Gauge::Rides(i, velocity) => {
                    let none = if found[*i] > 0.0 { 0.0 } else { f64::NAN };
                    let value = |field: &dyn Fn(usize) -> f64| match &beside[*i] {
                        Some(x) => x.value(mesh, field),
                        None => none,
                    };
                    if *velocity {
                        values.extend((0..3).map(|k| value(&|n| u[n][k])));
                    } else {
                        values.push(value(&|n| p[n]));
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
