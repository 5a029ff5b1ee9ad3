//! Gauges that ride on structures: each a point of a surface, given where the structure stands at t = 0.

use super::Structures;
use crate::bodies::Bodies;
use crate::case::{Carrier, Case, CaseError, GaugeKind};
use nalgebra::Vector3;

/// A point of a structure's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rider {
    /// Number of the structure: obstacles first, then bodies.
    structure: usize,
    /// In the structure's frame [m].
    at: Vector3<f64>,
    /// Unit normal out of the structure, in its frame.
    out: Vector3<f64>,
}

impl Structures {
    /// Of the gauges that ride, in their order.
    ///
    /// # Errors
    /// A point that is not on the surface, within an element's size: the key of its gauge.
    pub fn riders(&self, case: &Case, bodies: Option<&Bodies>) -> Result<Vec<Rider>, CaseError> {
        let solids = self.solids(bodies, 0.0);
        let mut riders = Vec::new();
        for (i, gauge) in case.gauges.iter().enumerate() {
            let Some(carrier) = gauge.on else { continue };
            let (key, x) = match gauge.kind {
                GaugeKind::Pressure { at } => ("pressure", at),
                GaugeKind::Velocity { at } => ("velocity", at),
                GaugeKind::WaterLevel { .. } => unreachable!("checked"),
            };
            let candidates: Vec<usize> = match carrier {
                Carrier::Obstacle(number) => vec![number],
                Carrier::Body(entry) => {
                    let clusters = bodies.map_or(&[][..], |b| &b.world.clusters);
                    let of = |&c: &usize| clusters[c].group as usize == entry;
                    (0..clusters.len()).filter(of).map(|c| self.first_body() + c).collect()
                }
            };
            let away = |&s: &usize| solids[s].distance(x).abs();
            let nearest = candidates.into_iter().min_by(|a, b| away(a).total_cmp(&away(b)));
            let off = nearest.as_ref().map_or(f64::INFINITY, away);
            let Some(structure) = nearest.filter(|_| off <= self.nodes.band) else {
                let message = format!(
                    "({}, {}, {}) is {off:.4} m away from the surface of what it is on",
                    x[0], x[1], x[2]
                );
                return Err(case.source.error(&format!("gauge[{}].{key}", i + 1), message));
            };
            let solid = &solids[structure];
            let at = solid.pose.to_local(x.into());
            let small = 1e-5 * self.nodes.band;
            let slope = Vector3::from_fn(|k, _| {
                let mut step = Vector3::zeros();
                step[k] = small;
                let d = |x| solid.distance(solid.pose.to_space(x).into());
                d(at + step) - d(at - step)
            });
            riders.push(Rider { structure, at, out: slope.normalize() });
        }
        Ok(riders)
    }

    /// Where they are and which way is out at time `t`, the bodies where they stand.
    pub fn ride(&self, riders: &[Rider], t: f64) -> Vec<[[f64; 3]; 2]> {
        let place = |rider: &Rider| {
            let pose = match rider.structure.checked_sub(self.first_body()) {
                Some(body) => self.placed[body].pose,
                None => self.obstacles.pose(rider.structure, t),
            };
            [pose.to_space(rider.at).into(), (pose.rotation * rider.out).into()]
        };
        riders.iter().map(place).collect()
    }
}
