//! Free-surface flow that hits, moves and breaks structures.

pub mod case;
pub mod fem;
pub mod flow;
pub mod linear;
pub mod mesh;
pub mod phase;
pub mod report;
pub mod setup;
pub mod simulation;
