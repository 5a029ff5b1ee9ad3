//! Sparse blocks, Krylov methods, multigrid: no physics.
//!
//! `operator` what a method needs to know · `krylov` FGMRES and CG · `pattern` which entries matrices have · `block_csr` the matrix,
//! `saddle` that of the coupled flow system ·
//! `relaxation` one-level preconditioners · `multigrid` for scalar diffusion ·
//! `schur` for the coupled flow system, `viscous` its part where viscosity rules · `distributed` the only file that meets the ranks.

pub mod block_csr;
pub mod distributed;
pub mod krylov;
pub mod multigrid;
pub mod operator;
pub mod pattern;
pub mod relaxation;
pub mod saddle;
pub mod schur;
pub mod viscous;

pub use block_csr::{BlockCsr, Rows, Value};
pub use distributed::{DistributedOperator, Halo, NodeGraph, OwnedProduct};
pub use krylov::{Converged, Diverged, KrylovSettings, Reason, Workspace, cg, fgmres};
pub use multigrid::{Multigrid, MultigridSettings};
pub use operator::{Identity, InnerProduct, Operator, Preconditioner};
pub use pattern::Pattern;
pub use saddle::{SaddleCsr, residual_weights};
pub use schur::SchurPreconditioner;
pub use viscous::ViscousOperators;
