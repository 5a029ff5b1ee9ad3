//! A group of ranks and the few collectives the program needs.

/// What can be sent between ranks: plain data.
pub trait Item: Copy + Default + 'static {}
impl<T: Copy + Default + 'static> Item for T {}

/// A group of ranks. Cheap to clone. `single()` needs no MPI.
#[derive(Clone, Debug)]
pub struct Communicator {}

impl Communicator {
    /// One rank, without MPI (unit tests).
    pub fn single() -> Self {
        Self {}
    }
    /// This rank, `0..size`.
    pub fn rank(&self) -> usize {
        0
    }
    /// Number of ranks.
    pub fn size(&self) -> usize {
        1
    }
    /// Sum over ranks, the same bits on every rank.
    pub fn sum(&self, x: f64) -> f64 {
        x
    }
    /// Element-wise sum over ranks, in place.
    pub fn sum_all(&self, _x: &mut [f64]) {}
    /// Sum of counts over ranks.
    pub fn sum_u64(&self, x: u64) -> u64 {
        x
    }
    /// Largest over ranks (NaN wins: a NaN on one rank is a NaN on all).
    pub fn max(&self, x: f64) -> f64 {
        x
    }
    /// Smallest over ranks (NaN wins).
    pub fn min(&self, x: f64) -> f64 {
        x
    }
    /// True on all ranks if true on any.
    pub fn any(&self, x: bool) -> bool {
        x
    }
    /// Sum of `x` over the ranks before this one.
    pub fn exclusive_sum(&self, _x: u64) -> u64 {
        0
    }
    /// Every rank's list, on every rank, in rank order.
    pub fn all_gather<T: Item>(&self, mine: &[T]) -> Vec<Vec<T>> {
        vec![mine.to_vec()]
    }
    /// Sends `outgoing[r]` to rank `r`; returns what each rank sent here, in rank order.
    pub fn exchange_lists<T: Item>(&self, outgoing: Vec<Vec<T>>) -> Vec<Vec<T>> {
        outgoing
    }
    /// `root`'s list on every rank.
    pub fn broadcast<T: Item>(&self, _root: usize, mine: Vec<T>) -> Vec<T> {
        mine
    }
    /// `Ok` only if every rank is `Ok`; otherwise every rank gets the lowest failing rank's message.
    pub fn agree<T, E: std::fmt::Display>(&self, mine: Result<T, E>) -> Result<T, String> {
        mine.map_err(|e| e.to_string())
    }
}
