//! The account of energy: what the fluids have, what they lost and to whom, step by step.
//!
//! The phase field and the flow leapfrog: potential energy is found half a step before the velocity. What gravity does
//! in the half step between them is added, so that all of a line of energy.csv is at one time.

use crate::bodies::Bodies;
use crate::coupling;
use crate::cut::CutMesh;
use crate::flow::{Flow, Material, StepEnergy};
use crate::mesh::MeshPart;
use crate::phase::Phase;
use crate::report::energy::Energy;

/// Energies [J]: those that are there, and sums since t = 0 of what went.
#[derive(Clone, Debug)]
pub struct Ledger {
    /// What energy.csv says.
    pub energy: Energy,
    /// −∫ρ g·x of the last step.
    potential: f64,
    /// What gravity did in the second half of it.
    fall: f64,
    /// Kinetic and potential energy since the surface has moved.
    moved: [f64; 2],
}

impl Ledger {
    /// At the start. Collective.
    pub fn new(
        part: &MeshPart,
        cut: &CutMesh,
        flow: &Flow,
        material: &Material,
        bodies: Option<&Bodies>,
    ) -> Self {
        let moved = flow.energies(part, cut, material);
        let [kinetic, potential] = moved;
        let account = bodies.map(|bodies| bodies.account()).unwrap_or_default();
        let energy = Energy { kinetic, potential, account, ..Energy::default() };
        Self { energy, potential, fall: 0.0, moved }
    }

    /// The surface has moved, and the structures have not yet. Collective.
    pub fn surface_moved(
        &mut self,
        part: &MeshPart,
        cut: &CutMesh,
        flow: &Flow,
        material: &mut Material,
        phase: &Phase,
    ) {
        let mut before = self.potential;
        let mut losses = [0.0; 3];
        for (loss, phi) in losses.iter_mut().zip([&phase.stages[0], &phase.stages[1], &phase.phi]) {
            material.set_phase(phi);
            self.moved = flow.energies(part, cut, material);
            *loss = before - self.moved[1];
            before = self.moved[1];
        }
        let energy = &mut self.energy;
        energy.transport += losses[0];
        energy.regularisation += losses[1];
        energy.volume += losses[2];
        energy.convection -= self.moved[0] - energy.kinetic;
    }

    /// A step is done: the structures have moved on, then the flow and the bodies.
    pub fn add(
        &mut self,
        step: &StepEnergy,
        done: &coupling::Report,
        first_body: usize,
        bodies: Option<&Bodies>,
        dt: f64,
    ) {
        let energy = &mut self.energy;
        energy.recut += self.moved[0] - step.kinetic[0] + self.moved[1] - step.potential;
        energy.recut += step.swept[0] + step.swept[1];
        energy.convection += step.convection - step.outflow[0] - step.swept[0];
        energy.transport -= self.fall + step.fall[0] + step.outflow[1] + step.swept[1];
        // Gravity's part of what the fine scales do is the pressure's.
        energy.transport += step.fine_fall;
        energy.pressure += step.pressure - step.fine_fall;
        energy.boundaries += step.boundaries + step.outflow[0] + step.outflow[1];
        energy.forces += step.forces;
        energy.viscous += step.viscous;
        energy.streamline += step.streamline;
        energy.divergence += step.divergence;
        energy.walls += step.walls;
        energy.ghost += step.ghost;
        energy.obstacles += step.structures[..first_body].iter().sum::<f64>();
        let to_bodies: f64 = step.structures[first_body..].iter().sum();
        energy.bodies += to_bodies;
        energy.kinetic = step.kinetic[1];
        energy.potential = step.potential - step.fall[1];
        (self.potential, self.fall) = (step.potential, step.fall[1]);
        self.moved = [step.kinetic[1], step.potential];

        let Some(bodies) = bodies else { return };
        for ((seen, hidden), placed) in
            done.loads[first_body..].iter().zip(&done.hidden).zip(bodies.placed())
        {
            let (velocity, spin) = (placed.twist.velocity, placed.twist.spin);
            let force = nalgebra::Vector3::from(seen.reaction.force);
            let torque = nalgebra::Vector3::from(seen.reaction.torque);
            energy.received += dt * (force.dot(&velocity) + torque.dot(&spin));
            energy.hidden += dt * (hidden.force.dot(&velocity) + hidden.torque.dot(&spin));
        }
        energy.account = bodies.account();
    }

    /// Everything that later steps depend on.
    pub fn state(&self) -> Vec<f64> {
        let mut state = vec![self.potential, self.fall];
        state.extend(self.moved);
        state.extend(self.energy.sums());
        state
    }

    /// Goes on from `state`.
    pub fn restore(&mut self, state: &[f64]) {
        (self.potential, self.fall) = (state[0], state[1]);
        self.moved = [state[2], state[3]];
        self.energy.set_sums(&state[4..]);
    }
}
