//! Sparse blocks, Krylov methods, multigrid: no physics.

pub mod block_csr;
pub use block_csr::BlockCsr;
