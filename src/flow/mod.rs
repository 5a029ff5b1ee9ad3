//! Incompressible two-fluid flow on P1/P1 tetrahedra: `ρ(∂t u + u·∇u − g) − ∇·σ = 0`, `∇·u = 0`
//! (Takase et al. 2015, [1-10]).
//!
//! - `stabilisation`: τ and τ_c.
//! - `material`: densities, viscosities and the gravity force of an element.
//! - `mass_balance`: mass that appears as densities change, and what momentum it has.
//! - `weak_form`: what one element adds to the linear system of a step.
//! - `open_boundary`: what a face with given pressure adds.
//! - `viscous`: what the preconditioner needs where viscosity rules.
//! - `viscous_force`: what linear elements do not see of it.
//! - `wall`: what the wall in a cut element adds, and what it bears. `slivers`: the ghost penalty.
//! - `sealed`: fluid shut in between walls that move.
//! - `loads`: forces and torques on bodies.
//! - `step`: state, assembly, solve, fine-scale velocity, where the energy of a step goes.
//!
//! May name `cut`, `fem`, `linear`, `mesh`, `case`. Knows nothing of ranks but what `MeshPart` offers, and
//! of the phase field only its values.

pub mod loads;
mod mass_balance;
pub mod material;
pub mod open_boundary;
mod sealed;
mod slivers;
pub mod stabilisation;
pub mod step;
mod viscous;
mod viscous_force;
pub mod wall;
pub mod weak_form;

pub use loads::{BodyLoad, Load};
pub use material::Material;
pub use sealed::Squeezed;
pub use step::{Flow, FlowReport, StepEnergy};
