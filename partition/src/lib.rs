//! The ranks: who owns what, and how values cross borders.
//!
//! Nothing here knows what a mesh, a flow or a body is. `mpi` and `metis` are dependencies of this
//! crate alone.

pub mod communicator;
pub mod exchange;
pub mod index_map;

pub use communicator::{Communicator, Item};
pub use exchange::Exchange;
pub use index_map::IndexMap;
