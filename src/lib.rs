//! Free-surface flow that hits, moves and breaks structures: stabilised finite elements on tetrahedra, a
//! conservative phase field, distributed solvers. After Takase et al. 2015 (J. JSCE A2 71).
//!
//! ```text
//!   main ─► setup, simulation ─► coupling ─► flow   phase   bodies     siblings never name each other
//!                │                            └─► cut ◄─┘      ▼      a cut element: another quadrature
//!                │                            ▼               shape    solids and their poses
//!                │                           fem              constraints by boundary name, quadrature
//!                ▼                     ▼
//!             report ─► io            mesh              geometry; mesh::part alone meets the ranks
//!                        └─► partition ◄┘   linear      sparse blocks, Krylov, multigrid: no physics
//! ```
//!
//! - [`case`]: the case file as typed, then checked.
//! - [`setup`]: case → this rank's part of the mesh and the initial state.
//! - [`simulation`]: state, one step, the run, restart.
//! - [`flow`]: velocity and pressure. [`phase`]: the free surface.
//! - [`obstacles`]: structures of the case; [`shape`]: their geometry; [`cut`]: the mesh as they leave it.
//! - [`fem`], [`mesh`], [`linear`]: what they stand on.
//! - [`bodies`]: rigid clusters that collide, hold together and break. [`coupling`]: they and the water.
//! - [`report`]: gauges, files, progress, the summary.
//!
//! What stays true: kernels know nothing of ranks; matrix rows belong to the owner of the node and are
//! assembled without communication; integrals run over elements that METIS gave to the rank, each once;
//! every rank reaches every collective, and an error on one is an error on all; no kernel allocates in a
//! step. `tests/layers.rs` holds the arrows.

pub mod bodies;
pub mod case;
pub mod coupling;
pub mod cut;
pub mod fem;
pub mod flow;
pub mod linear;
pub mod mesh;
pub mod obstacles;
pub mod phase;
pub mod report;
pub mod setup;
pub mod shape;
pub mod simulation;
