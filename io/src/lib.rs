//! Files: Gmsh meshes, VTKHDF fields, checkpoints, gauges and histories. `hdf5` is a dependency of
//! this crate alone.

pub mod error;

pub use error::Error;
