//! Structures cut through the mesh (METHOD.md, 5): which part of each element is fluid, and where the walls are.
//!
//! - `tetrahedron`: one element cut by a level set that is linear in it.
//! - `level_set`: signed distances to the structures at the nodes, only near them.
//! - `mesh`: all elements of a rank: whole, cut or solid; nodes without fluid; faces that carry the ghost penalty.
//! - `extension`: values for nodes that become wet.
//! - `ghost`: the ghost penalty on a face.
//! - `surface`: what the flow must know of a structure: its wall and its motion.
//!
//! A cut element is an ordinary element with other moments (`fem::region`). May name `mesh`, `fem`, `shape` and
//! `case`; knows neither flow nor phase, and of the ranks only what `MeshPart` offers.

pub mod extension;
pub mod ghost;
pub mod level_set;
pub mod mesh;
pub mod surface;
pub mod tetrahedron;

pub use extension::Extension;
pub use level_set::LevelSet;
pub use mesh::{Cell, CutElement, CutMesh};
pub use surface::{Motion, Surface, Wall};
