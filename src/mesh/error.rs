//! What can be wrong with a mesh.

use thiserror::Error;

/// A mesh that cannot be computed on, and what to change.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum MeshError {
    /// Grid lines that make no cells.
    #[error(
        "box mesh: grid lines along {axis} must increase from one to the next; line {line} is at \
         {at} m after {before} m"
    )]
    Lines {
        /// x, y or z.
        axis: char,
        /// Number of the line, from 0.
        line: usize,
        /// Its place [m].
        at: f64,
        /// Place of the line before it [m].
        before: f64,
    },
    /// No cell along an axis.
    #[error("box mesh: at least one cell is needed along {axis}")]
    NoCells {
        /// x, y or z.
        axis: char,
    },
    /// More nodes or tetrahedra than 32-bit numbers can name.
    #[error(
        "the mesh would have {nodes} nodes and {tets} tetrahedra; at most {} of each can be \
         numbered: use larger cells, or refine after the mesh has been distributed",
        u32::MAX - 1
    )]
    TooLarge {
        /// Nodes.
        nodes: u64,
        /// Tetrahedra.
        tets: u64,
    },
    /// A hole whose face lies between grid lines.
    #[error(
        "hole \"{name}\": its face {axis} = {at} m lies on no grid line (the nearest is {axis} = \
         {nearest} m): move the face there or put a block edge at {at}"
    )]
    HoleOffGrid {
        /// Name of the hole.
        name: String,
        /// x, y or z.
        axis: char,
        /// Wanted place [m].
        at: f64,
        /// Place of the nearest line [m].
        nearest: f64,
    },
    /// A hole without volume.
    #[error("hole \"{name}\": its {axis} range [{}, {}] is empty", range[0], range[1])]
    HoleEmpty {
        /// Name of the hole.
        name: String,
        /// x, y or z.
        axis: char,
        /// Range [m].
        range: [f64; 2],
    },
    /// A hole named like a side of the box.
    #[error("hole \"{name}\": this is the name of a side of the box; choose another")]
    HoleName {
        /// Name of the hole.
        name: String,
    },
    /// Nothing to compute on.
    #[error("the mesh has no tetrahedra{}", because)]
    Empty {
        /// Why, beginning with ": ", or nothing.
        because: &'static str,
    },
    /// Jitter out of range.
    #[error("jitter must lie between 0 and 0.5 of the local spacing, not {fraction}")]
    Jitter {
        /// Wanted fraction.
        fraction: f64,
    },
    /// A coordinate that is NaN or infinite.
    #[error("node {node}: its place is ({}, {}, {})", at[0], at[1], at[2])]
    NotANumber {
        /// Number of the node, from 0.
        node: usize,
        /// Coordinates.
        at: [f64; 3],
    },
    /// An element that names a node which does not exist.
    #[error("{what} {index} names node {node}; the mesh has {nodes} nodes")]
    NoSuchNode {
        /// "tetrahedron" or "surface triangle".
        what: &'static str,
        /// Its number, from 0.
        index: usize,
        /// The node.
        node: u32,
        /// How many there are.
        nodes: usize,
    },
    /// Two nodes at one place.
    #[error(
        "nodes {nodes:?} are both at ({}, {}, {}): volumes that touch must share their nodes \
         (Gmsh: Coherence; or BooleanFragments)", at[0], at[1], at[2]
    )]
    SamePlace {
        /// Numbers of the nodes.
        nodes: [usize; 2],
        /// Their place [m].
        at: [f64; 3],
    },
    /// A node of no element.
    #[error("node {node} belongs to no tetrahedron")]
    Orphan {
        /// Number of the node.
        node: usize,
    },
    /// An element of negative volume.
    #[error(
        "tetrahedron {element} is inverted: volume {volume:.3e} m³, corners {}",
        Corners(corners)
    )]
    Inverted {
        /// Number of the element, from 0.
        element: usize,
        /// Volume [m³].
        volume: f64,
        /// Corners [m].
        corners: Box<[[f64; 3]; 4]>,
    },
    /// An element without volume.
    #[error(
        "tetrahedron {element} is flat: volume {volume:.3e} m³, longest edge {edge:.3e} m, corners \
         {}: remesh, or let the mesh generator optimise",
        Corners(corners)
    )]
    Flat {
        /// Number of the element, from 0.
        element: usize,
        /// Volume [m³].
        volume: f64,
        /// Longest edge [m].
        edge: f64,
        /// Corners [m].
        corners: Box<[[f64; 3]; 4]>,
    },
    /// Two elements on the same side of a face.
    #[error(
        "tetrahedra {elements:?} overlap: they lie on the same side of the face with centre ({}, \
         {}, {})", at[0], at[1], at[2]
    )]
    Overlap {
        /// Two of the elements.
        elements: [u32; 2],
        /// Centre of the face [m].
        at: [f64; 3],
    },
    /// One triangle with two names.
    #[error(
        "the boundary face at ({}, {}, {}) belongs to \"{}\" and to \"{}\": each face needs exactly \
         one name", at[0], at[1], at[2], names[0], names[1]
    )]
    TwoNames {
        /// Centre of the face [m].
        at: [f64; 3],
        /// Its names.
        names: [String; 2],
    },
    /// A named triangle between two elements.
    #[error(
        "surface \"{name}\" lies inside the mesh at ({}, {}, {}), between two tetrahedra: only \
         surfaces that bound the fluid can carry a name", at[0], at[1], at[2]
    )]
    Interior {
        /// Name of the surface.
        name: String,
        /// Centre of the triangle [m].
        at: [f64; 3],
    },
    /// A named triangle that is no face of any element.
    #[error(
        "surface \"{name}\": its triangle at ({}, {}, {}) is no face of any tetrahedron: is the \
         volume behind it meshed, and in a physical group?", at[0], at[1], at[2]
    )]
    Loose {
        /// Name of the surface.
        name: String,
        /// Centre of the triangle [m].
        at: [f64; 3],
    },
    /// A mesh in several pieces.
    #[error(
        "the mesh falls into {pieces} pieces that share no node (one of them contains ({}, {}, \
         {})): a run computes one connected domain", at[0], at[1], at[2]
    )]
    Pieces {
        /// Number of pieces.
        pieces: usize,
        /// A node of the last piece [m].
        at: [f64; 3],
    },
    /// Elements that could not be shared out among the ranks.
    #[error("the mesh cannot be distributed: {reason}")]
    Undistributed {
        /// What the reader says.
        reason: String,
    },
    /// A point where there is no fluid.
    #[error("({}, {}, {}) lies inside a structure", at[0], at[1], at[2])]
    InStructure {
        /// [m]
        at: [f64; 3],
    },
    /// A point outside the mesh.
    #[error("({}, {}, {}) lies outside the mesh", at[0], at[1], at[2])]
    Outside {
        /// The point [m].
        at: [f64; 3],
    },
    /// A line that misses the mesh.
    #[error(
        "the line from ({}, {}, {}) to ({}, {}, {}) does not meet the mesh",
        ends[0][0], ends[0][1], ends[0][2], ends[1][0], ends[1][1], ends[1][2]
    )]
    LineOutside {
        /// Its ends [m].
        ends: [[f64; 3]; 2],
    },
}

struct Corners<'a>(&'a [[f64; 3]; 4]);

impl std::fmt::Display for Corners<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (i, [x, y, z]) in self.0.iter().enumerate() {
            write!(f, "{}({x}, {y}, {z})", if i == 0 { "" } else { " " })?;
        }
        Ok(())
    }
}
