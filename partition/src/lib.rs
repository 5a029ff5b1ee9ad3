//! The ranks: who owns what, and how values cross borders.
//!
//! Nothing here knows what a mesh, a flow or a body is. `mpi` and `metis` are dependencies of this
//! crate alone.

pub mod communicator;
pub mod cost;
pub mod exchange;
pub mod index_map;
pub mod message;
pub mod metis;
pub mod ranks;
pub mod rendezvous;

pub use communicator::{Communicator, RawCommunicator};
pub use cost::{Clock, Cost};
pub use exchange::{Exchange, Traffic};
pub use index_map::IndexMap;
pub use message::{Accumulate, Item};
pub use metis::PartitionError;
pub use ranks::{Ranks, abort, leave, return_memory, start};
