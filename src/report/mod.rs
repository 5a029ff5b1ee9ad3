//! What a run tells: stage times, progress, gauges, files, the summary.
//!
//! May name `case`, `mesh` and the crate `io`; knows of the physics only the values it writes.

pub mod bodies;
pub mod energy;
pub mod gauges;
pub mod output;
pub mod plan;
pub mod progress;
pub mod stages;
pub mod summary;
