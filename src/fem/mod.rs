//! First-order tetrahedra: shape functions, quadrature, the element loop.

pub mod tetrahedron;
