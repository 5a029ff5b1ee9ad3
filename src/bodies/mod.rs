//! Rigid clusters that move, collide, hold together and break: distinct elements with cohesive bonds
//! (Takase et al. 2015, [18-28]).
//!
//! - `cluster` what one is, and where all stand · `packing` its contact spheres · `motion` kick, drift, kick.
//! - `broad_phase`, `neighbours` who may touch whom · `contact_law` spring, dashpot, slider at a point ·
//!   `contact` of clusters · `balls` those of one sphere · `material` · `walls`.
//! - `touching` faces in common · `cohesion` joints there · `cohesion_law` [28].
//! - `glued` who holds together · `overlap` who stands inside another · `leaving` those that have left the mesh.
//! - `time_step` the longest stable one · `account` where the energy is · `step` the sub-cycle · `record`
//!   all of it as lists, for checkpoints.
//!
//! A cluster is known by its number in the case, the same on every rank. Lists with an entry for each
//! cluster are valid for a rank's own clusters and those near them. A pair is computed by every rank that
//! owns one of the two, with the same operations in the same order, and forces on a cluster are summed in
//! the order of its partners' numbers: results do not depend on ranks.
//!
//! May name `shape` and `case`; `ownership` alone meets the ranks.

pub mod account;
mod balls;
mod broad_phase;
pub mod cluster;
pub mod cohesion;
pub mod cohesion_law;
pub mod contact;
mod contact_law;
mod glued;
pub mod leaving;
pub mod material;
pub mod motion;
pub mod neighbours;
mod overlap;
pub mod ownership;
pub mod packing;
pub mod record;
mod step;
#[cfg(test)]
mod tests;
pub mod time_step;
pub mod touching;
pub mod walls;

pub use account::{Account, Momentum};
pub use cluster::{Cluster, Form, Motion, State, Tracked};
pub use cohesion::{Break, Joints};
pub use contact::World;
pub use leaving::Left;
pub use motion::Load;
pub use ownership::Ownership;
pub use record::Record;
pub use step::{Bodies, Placed, Saved, Settings, Unstable};
