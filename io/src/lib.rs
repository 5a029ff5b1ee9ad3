//! Files: Gmsh meshes, STL and OBJ surfaces, VTKHDF fields, checkpoints, gauges and histories.
//! `hdf5` is a dependency of this crate alone.

mod blocks;
pub mod checkpoint;
pub mod error;
pub mod gmsh;
pub mod moving;
mod room;
mod shared_file;
pub mod surface;
pub mod table;
pub mod vtkhdf;

pub use error::Error;
pub use moving::MovingFile;
pub use table::{Table, TableWriter};
pub use vtkhdf::{FieldsFile, FieldsMesh};
