//! Halo exchange: owners' values to ghosts, and ghosts' contributions back to owners.

use crate::{Communicator, IndexMap, Item};

/// The halo of one index map.
#[derive(Clone, Debug)]
pub struct Exchange {
    n_owned: usize,
}

impl Exchange {
    /// Collective: finds out who needs which of my owned indices.
    pub fn new(_comm: &Communicator, map: &IndexMap) -> Self {
        Self { n_owned: map.n_owned }
    }
    /// Ghost values become their owners' values.
    pub fn update_ghosts<T: Item>(&self, _x: &mut [T]) {}
    /// As `update_ghosts`, while `interior` runs on the owned values (ghosts not yet valid).
    pub fn update_ghosts_during<T: Item, R>(
        &self,
        x: &mut [T],
        interior: impl FnOnce(&[T]) -> R,
    ) -> R {
        interior(&x[..self.n_owned])
    }
    /// Ghost contributions are added to their owners' entries (neighbours in rank order, so the sum
    /// is reproducible); ghosts are then stale.
    pub fn sum_to_owners<T: Item + std::ops::AddAssign>(&self, _x: &mut [T]) {}
}
