//! Water meets bodies (Takase et al. 2015, steps (a) to (f)): the one room that names flow and bodies both.
//!
//! - `structures` obstacles and bodies as the flow sees them: where they stand, and how their walls move.
//! - `thickness` which structures are too thin for the mesh. `riders` gauges on their surfaces.
//! - `hidden` what bodies bear where they rest on something.
//! - `added_mass` which bodies are light for the water around them.
//! - `quasi_newton` the iteration that finds their motion and the water's together.
//!
//! Loose coupling (the paper's): the walls move as they did over the last step; then the bodies move on under
//! what the flow did to them. Where a body is light for the water it carries along this diverges; strong
//! coupling repeats flow and bodies of the step until the walls move as the bodies do at its end. (As they do in
//! its mean, walls would be half a step behind: half as fast after the first step from rest, which then feels half
//! the added mass, and the next ones too much and too little of it in turns.) What glue holds to the ground trembles
//! faster than steps follow, what touches something bounces, and where a step ends in that is chance: their walls move
//! as they do in the step's mean.

pub mod added_mass;
pub mod hidden;
pub mod quasi_newton;
pub mod riders;
pub mod structures;
pub mod thickness;

pub use structures::Structures;

use crate::bodies::{Bodies, Load};
use crate::case::{self, BasePressure, Case};
use crate::cut::{CutMesh, Surface};
use crate::flow::{BodyLoad, Flow, FlowReport, Material};
use crate::linear::Diverged;
use crate::mesh::MeshPart;
use crate::mesh::part::Cost;
use hidden::Hidden;
use nalgebra::DVector;
use quasi_newton::QuasiNewton;

/// Change of the walls' velocities in a pass, over those velocities, that ends a step.
const TOLERANCE: f64 = 1e-3;
/// The same over what gravity changes in a step: bodies at rest.
const AT_REST: f64 = 1e-3;
/// Passes allowed.
const PASSES: u32 = 50;

/// A step of flow and bodies.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// The flow's last pass; its iterations and times are those of all passes.
    pub flow: FlowReport,
    /// Passes: 1 if coupled loosely.
    pub passes: u32,
    /// Of the bodies.
    pub bodies: Cost,
    /// What the flow did to each structure.
    pub loads: Vec<BodyLoad>,
    /// What each body bears where it rests on something.
    pub hidden: Vec<Load>,
    /// How the structures' walls moved in the last pass.
    pub surfaces: Vec<Surface>,
}

/// Why a step failed.
#[derive(Clone, Debug)]
pub enum Failure {
    /// The flow's solver.
    Flow(Diverged),
    /// Bodies and flow do not agree: what is left of the walls' velocities, over those velocities.
    Coupling {
        /// Passes made.
        passes: u32,
        /// What is left.
        residual: f64,
    },
}

/// Velocity and pressure, and the bodies with them, from `t` to `t + dt`. Collective.
///
/// # Errors
/// A solve, or the iteration of strong coupling, that does not converge: nothing has moved on then that could
/// be used.
pub fn advance(
    case: &Case,
    part: &MeshPart,
    cut: &CutMesh,
    material: &Material,
    flow: &mut Flow,
    structures: &mut Structures,
    bodies: Option<&mut Bodies>,
    [t, dt]: [f64; 2],
) -> Result<Report, Failure> {
    let mut report = Report::default();
    let Some(bodies) = bodies else {
        report.passes = 1;
        structures.pass(part, cut, material, flow, [t, dt], &mut report)?;
        return Ok(report);
    };
    let first = structures.first_body();
    let mut light = match case.bodies.as_ref().map(|b| b.coupling) {
        Some(case::Coupling::Loose) | None => Vec::new(),
        Some(choice) => added_mass::light(part, cut, material, bodies, first, choice),
    };
    let loose = match case.bodies.as_ref().map(|b| b.base_pressure) {
        Some(BasePressure::Wet) => bodies.loose(),
        _ => vec![false; bodies.state.len()],
    };
    let pass = |flow: &mut Flow, structures: &Structures, bodies: &Bodies, report: &mut Report| {
        structures.pass(part, cut, material, flow, [t, dt], report)?;
        let (clusters, placed) = (&bodies.world.clusters, &structures.placed);
        let hidden = Hidden { clusters, placed, loose: &loose, first, mesh: &structures.mesh };
        report.hidden = hidden.loads(part, cut, material, flow);
        Ok(())
    };
    let move_on = |bodies: &mut Bodies, report: &mut Report| {
        let clock = part.comm.clock();
        let seen = report.loads[first..].iter().map(structures::on_body);
        let both = seen.zip(&report.hidden).map(|(seen, hidden)| Load {
            force: seen.force + hidden.force,
            torque: seen.torque + hidden.torque,
        });
        let loads: Vec<Load> = both.collect();
        bodies.advance(dt, &loads);
        report.bodies += clock.elapsed();
        bodies.placed()
    };
    if light.is_empty() {
        report.passes = 1;
        pass(flow, structures, bodies, &mut report)?;
        structures.placed = move_on(bodies, &mut report);
        return Ok(report);
    }

    let (flow_before, bodies_before) = (flow.save(), bodies.save());
    let g = crate::fem::norm(case.gravity);
    let mut newton = QuasiNewton::new(&light);
    // What the flow's solver leaves of its equations moves a body by that many times as much.
    let lightest = light.iter().map(|l| l.ratio).fold(1.0, f64::max);
    let tolerance = flow.tolerance;
    flow.tolerance /= lightest;
    for l in &light {
        let placed = &mut structures.placed[l.body];
        placed.twist = *l.wall(placed);
    }
    let outcome = loop {
        if let Err(failure) = pass(flow, structures, bodies, &mut report) {
            break Err(failure);
        }
        let moved = move_on(bodies, &mut report);
        report.passes += 1;
        let touched = bodies.touched();
        let mut touches = false;
        for l in light.iter_mut().filter(|l| !l.held && touched[l.body]) {
            (l.held, touches) = (true, true);
        }
        if touches {
            newton.forget();
        }
        let wanted = added_mass::velocities(&light, |l| l.wall(&moved[l.body]));
        let given = added_mass::velocities(&light, |l| &structures.placed[l.body].twist);
        let change: DVector<f64> = &wanted - &given;
        let (left, size) = (change.norm(), wanted.norm());
        if left <= TOLERANCE * size + AT_REST * g * dt * (light.len() as f64).sqrt() {
            structures.placed = moved;
            break Ok(());
        }
        // A NaN does not get better.
        if report.passes == PASSES || left.is_nan() {
            break Err(Failure::Coupling { passes: report.passes, residual: left / size });
        }
        let next = newton.next(given, wanted);
        added_mass::set_velocities(&light, &next, &mut structures.placed);
        flow.restore(&flow_before);
        bodies.restore(&bodies_before);
    };
    flow.tolerance = tolerance;
    outcome.map(|()| report)
}
