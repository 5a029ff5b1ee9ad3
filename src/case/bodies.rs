//! What a case says about bodies, checked.

use super::{Formula, Solid};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Bodies, walls and what is between them.
#[derive(Clone, Debug, PartialEq)]
pub struct Bodies {
    /// Of contact spheres [m].
    pub sphere_radius: f64,
    /// Of neighbouring contact spheres [m].
    pub sphere_spacing: f64,
    /// Names of materials; the first is that of bodies without a word about it.
    pub materials: Vec<String>,
    /// Contact where nothing else is said.
    pub contact: ContactLaw,
    /// Contact between two materials.
    pub contacts: Vec<([u32; 2], ContactLaw)>,
    /// No pull of the dashpot.
    pub no_tension: bool,
    /// Sub-step [s]; `None`: `fraction` of the longest stable one.
    pub time_step: Option<f64>,
    /// Of the longest stable sub-step.
    pub fraction: f64,
    /// Time to come to rest before t = 0 [s].
    pub settle: f64,
    /// Ranks that share the bodies; `None`: as many as have enough to do.
    pub ranks: Option<u32>,
    /// How flow and bodies are solved.
    pub coupling: Coupling,
    /// What is under bodies that rest on something.
    pub base_pressure: BasePressure,
    /// The fluid slides along them.
    pub slip: bool,
    /// Glue.
    pub bond: Option<Bond>,
    /// The entries.
    pub bodies: Vec<Body>,
    /// The walls.
    pub walls: Vec<Wall>,
}

/// Contact of two materials.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactLaw {
    /// [N/m]
    pub stiffness: f64,
    /// Speed after over speed before.
    pub restitution: f64,
    /// Tangent of the friction angle.
    pub friction: f64,
}

/// What a bond does after the opening shrinks again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Unloading {
    /// It returns on the curve (paper).
    Curve,
    /// It returns straight to zero: damage stays.
    Damage,
}

/// How flow and bodies are solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Coupling {
    /// Together where a body is light for the water it carries along, or glued to the ground, else one after the
    /// other.
    Auto,
    /// Together for every free body in water.
    Strong,
    /// One after the other (paper).
    Loose,
}

/// What is under a body that rests on the bottom or on another one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BasePressure {
    /// Water, as deep as beside it.
    Wet,
    /// Nothing: the water presses it down.
    Dry,
}

/// What carries compression across a bonded face.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Compression {
    /// The spheres of the two clusters (paper).
    Contact,
    /// The bond, as stiff as at first in tension; the spheres come in when its first point is broken.
    Bond,
}

/// Glue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bond {
    /// σ_c [Pa].
    pub strength: f64,
    /// δ_f [m].
    pub opening: f64,
    /// Share of a face that is glued.
    pub area: f64,
    /// Integration points along each side of a face.
    pub points: u32,
    /// After the opening shrinks.
    pub unloading: Unloading,
    /// Under compression.
    pub compression: Compression,
    /// Fraction of critical damping.
    pub damping: f64,
    /// Faces this far apart touch [m].
    pub gap: f64,
}

/// How an entry becomes several bodies.
#[derive(Clone, Debug, PartialEq)]
pub enum Pieces {
    /// It does not.
    One,
    /// Blocks of a box.
    Grid {
        /// Along its edges.
        count: [u32; 3],
        /// Only along the upright sides.
        hollow: bool,
        /// Left out where positive.
        openings: Vec<Formula>,
    },
    /// Voronoi cells.
    Fragments {
        /// [m]
        size: f64,
        /// Of the random numbers.
        seed: u64,
    },
}

/// Who decides how bodies move.
#[derive(Clone, Debug, PartialEq)]
pub enum BodyMotion {
    /// Forces, where `fixed` (a distance formula) is not positive.
    Free {
        /// Along x, y, z, about x, y, z.
        locked: [bool; 6],
        /// Where bodies stand still.
        fixed: Formula,
    },
    /// Formulas of t.
    Led {
        /// [m/s]
        velocity: [Formula; 3],
        /// [rad/s]
        spin: [Formula; 3],
    },
}

/// An entry.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// For results.
    pub name: String,
    /// Shape.
    pub shape: Solid,
    /// Into how many.
    pub pieces: Pieces,
    /// Place [m].
    pub at: [f64; 3],
    /// About x, then y, then z [rad].
    pub turned: [f64; 3],
    /// Number and distance [m] of copies along x, y, z.
    pub copies: ([u32; 3], [f64; 3]),
    /// [kg/m³]
    pub density: f64,
    /// Index into `materials`.
    pub material: u32,
    /// At t = 0 [m/s].
    pub velocity: [f64; 3],
    /// At t = 0 [rad/s].
    pub spin: [f64; 3],
    /// Who decides.
    pub motion: BodyMotion,
    /// Force [N] and torque [N m].
    pub applied: Option<[Formula; 6]>,
    /// Indices into `walls`.
    pub ignores: Vec<u32>,
    /// Whether it is glued to what it touches.
    pub bonded: bool,
    /// Of its contact spheres [m].
    pub sphere_radius: f64,
    /// Points that are recorded [m].
    pub track: Vec<[f64; 3]>,
}

/// A wall.
#[derive(Clone, Debug, PartialEq)]
pub struct Wall {
    /// For results.
    pub name: String,
    /// Index into `materials`.
    pub material: u32,
    /// Where it is.
    pub surface: WallShape,
}

impl Wall {
    /// Whether it is a boundary or an obstacle.
    pub fn has_no_table(&self) -> bool {
        matches!(self.surface, WallShape::Boundary | WallShape::Obstacle(_))
    }
}

/// The surface of a wall.
#[derive(Clone, Debug, PartialEq)]
pub enum WallShape {
    /// A plane.
    Plane {
        /// A point of it [m].
        point: [f64; 3],
        /// Of length 1, towards the bodies.
        normal: [f64; 3],
    },
    /// STL or OBJ.
    Surface(PathBuf),
    /// The boundary of the mesh that has the wall's name.
    Boundary,
    /// An obstacle: an index into the case's.
    Obstacle(usize),
}
