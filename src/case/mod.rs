//! The case file: as typed (`CaseFile`), then checked, in SI units (`Case`).

pub mod bodies;
mod check;
pub mod error;
pub mod file;
pub mod formula;
mod grading;
pub mod nearest;
mod reader;
pub mod sources;

pub use bodies::{BasePressure, Bodies, Compression, Coupling, Unloading};
pub use error::{CaseError, Source};
pub use file::CaseFile;
pub use formula::Formula;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
pub use sources::Sources;
use std::path::PathBuf;

/// Everything a run needs to know, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// For people.
    pub title: String,
    /// The file it came from (tables and meshes are found relative to it).
    pub path: PathBuf,
    /// Where the mesh comes from.
    pub mesh: MeshSource,
    /// How many times every tetrahedron is split into eight, after distribution.
    pub refine: u32,
    /// Structures that stand or move as told.
    pub obstacles: Vec<Obstacle>,
    /// Boundary condition of every boundary not listed in `boundaries`.
    pub default_boundary: Boundary,
    /// By boundary name.
    pub boundaries: Vec<(String, Boundary)>,
    /// Liquid (φ = 1).
    pub liquid: Fluid,
    /// Gas (φ = 0); `None`: one fluid, no free surface.
    pub gas: Option<Fluid>,
    /// Gravity [m/s²].
    pub gravity: [f64; 3],
    /// Extra body force per mass [m/s²], formulas of x, y, z, t.
    pub body_force: Option<[Formula; 3]>,
    /// Initial state.
    pub initial: Initial,
    /// A given velocity, formulas of x, y, z, t: the phase field alone is computed.
    pub prescribed_velocity: Option<[Formula; 3]>,
    /// Time stepping.
    pub time: Time,
    /// Phase field settings.
    pub free_surface: FreeSurface,
    /// Flow settings.
    pub flow: Flow,
    /// Linear solver settings.
    pub solver: Solver,
    /// Output settings.
    pub output: Output,
    /// Gauges.
    pub gauges: Vec<Gauge>,
    /// Rigid bodies and walls.
    pub bodies: Option<Bodies>,
    /// The case file with defaults filled in: itself a case file that gives this case.
    pub effective: String,
    /// The file as it was typed: `case.source.error("boundaries.inlet", …)` names its line.
    pub source: Source,
}

/// Mesh of the mathematical domain.
#[derive(Clone, Debug, PartialEq)]
pub enum MeshSource {
    /// A graded box.
    Box(BoxMesh),
    /// A Gmsh file with named physical groups.
    Gmsh(PathBuf),
    /// None: bodies alone.
    Nothing,
}

/// Mesh source together with what is done to it.
#[derive(Clone, Debug, PartialEq)]
pub struct BoxMesh {
    /// Grid lines along x, y, z, made from edges, cells, ratios or sizes.
    pub lines: [Vec<f64>; 3],
    /// Solid blocks left out: [x, y, z] ranges and the name of their surface.
    pub holes: Vec<Hole>,
    /// Interior nodes moved at random by up to this fraction of the local spacing, and the seed.
    pub jitter: Option<(f64, u64)>,
}

/// A solid block left out of a box mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Hole {
    /// Range along x, y, z [m]; must lie on grid lines.
    pub range: [[f64; 2]; 3],
    /// Boundary name of its faces.
    pub name: String,
}

/// Density [kg/m³] and dynamic viscosity [Pa s].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fluid {
    /// ρ [kg/m³].
    pub density: f64,
    /// μ [Pa s].
    pub viscosity: f64,
}

/// A condition on one named boundary.
#[derive(Clone, Debug, PartialEq)]
pub enum Boundary {
    /// u = 0.
    NoSlip,
    /// u·n = 0, no shear.
    Slip,
    /// u given, formulas of x, y, z, t; `water`: where the inflow is liquid (distance formula).
    Velocity {
        /// [m/s]
        velocity: [Formula; 3],
        /// Positive where the inflow is liquid; `None`: gas if there is one, else liquid.
        water: Option<Formula>,
    },
    /// Pressure given [Pa], backflow stabilised; what flows back in is gas unless `water` says so.
    Pressure {
        /// Formula of x, y, z, t.
        pressure: Formula,
        /// Positive where back-flow is liquid.
        water: Option<Formula>,
    },
}

/// A structure cut through the mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Obstacle {
    /// In loads.csv.
    pub name: String,
    /// In its own frame.
    pub shape: ObstacleShape,
    /// Where its origin is put [m].
    pub at: [f64; 3],
    /// Angles about x, then y, then z [rad].
    pub turned: [f64; 3],
    /// The fluid is inside.
    pub outside_in: bool,
    /// The fluid slides along.
    pub slip: bool,
    /// From `at`, formulas of t [m].
    pub displacement: Option<[Formula; 3]>,
    /// Rotation vector about the origin, formulas of t [degrees].
    pub rotation: Option<[Formula; 3]>,
    /// In place of `displacement`: of the origin, formulas of t [m/s].
    pub velocity: Option<[Formula; 3]>,
    /// In place of `rotation`: formulas of t [rad/s].
    pub spin: Option<[Formula; 3]>,
}

impl Obstacle {
    /// Whether it is told to move.
    pub fn is_led(&self) -> bool {
        [&self.displacement, &self.rotation, &self.velocity, &self.spin].iter().any(|f| f.is_some())
    }
}

/// The shape of an obstacle.
#[derive(Clone, Debug, PartialEq)]
pub enum ObstacleShape {
    /// As bodies have them.
    Solid(Solid),
    /// The ground under an ESRI ASCII grid of heights.
    Terrain(PathBuf),
}

/// The shape of an obstacle or a body.
#[derive(Clone, Debug, PartialEq)]
pub enum Solid {
    /// Edges [m].
    Cuboid([f64; 3]),
    /// Radius [m].
    Sphere(f64),
    /// Radius, height [m].
    Cylinder([f64; 2]),
    /// Corners of a convex polyhedron [m].
    Points(Vec<[f64; 3]>),
    /// STL or OBJ.
    Surface(PathBuf),
}

/// State at t = 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Initial {
    /// Signed distance formula, positive in liquid; `None`: liquid everywhere.
    pub water: Option<Formula>,
    /// [m/s]
    pub velocity: [Formula; 3],
    /// Uniform random offset of the free surface, ± this many metres (and the seed).
    pub noise: Option<(f64, u64)>,
}

/// Time stepping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Time {
    /// End [s].
    pub end: f64,
    /// Fixed step [s]; `None`: from `max_cfl`.
    pub step: Option<f64>,
    /// Largest Courant number max |u| Δt / h.
    pub max_cfl: f64,
    /// Largest step [s].
    pub max_step: f64,
    /// First step [s]; `None`: a fluid at rest falls 1 % of a cell.
    pub first_step: Option<f64>,
}

/// How φ is regularised.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Regularisation {
    /// Explicit conservative sub-step in ψ.
    Psi,
    /// As the paper's [11].
    Plain,
}

/// Volume correction [16,17].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum VolumeCorrection {
    /// None; the drift is logged.
    Off,
    /// One shift for all water (paper).
    Global,
    /// Per connected body of water.
    PerBody,
}

/// Phase field settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreeSurface {
    /// δ [m]; `None`: `thickness_cells` times the mean size of cells at the initial surface.
    pub thickness: Option<f64>,
    /// δ/h.
    pub thickness_cells: f64,
    /// Conservative Allen-Cahn, or the form that moves by curvature.
    pub conservative: bool,
    /// How φ is regularised.
    pub regularisation: Regularisation,
    /// γ = ε/δ over the top speed in the band.
    pub mobility: f64,
    /// Profile correction of the transport.
    pub profile_correction: bool,
    /// Volume correction.
    pub volume_correction: VolumeCorrection,
}

/// Form of the gravity force.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Gravity {
    /// Whitney edge interpolation (still water stays still).
    Edge,
    /// ρg at quadrature points.
    Quadrature,
}

/// Flow settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flow {
    /// Form of the gravity force.
    pub gravity: Gravity,
    /// Picard iterations a step.
    pub iterations: u32,
    /// The paper's p̄ at obstacles [Pa s/m]; `None`: Nitsche's method.
    pub wall_penalty: Option<f64>,
}

/// Linear solver settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solver {
    /// Flow: residual relative to that of the previous step's solution.
    pub tolerance: f64,
    /// Flow, in its first two steps.
    pub start_tolerance: f64,
    /// Phase: likewise.
    pub phase_tolerance: f64,
    /// Iterations after which a solve is an error: the flow's, those of one round of refinement.
    pub max_iterations: u32,
}

/// Output settings.
#[derive(Clone, Debug, PartialEq)]
pub struct Output {
    /// Time between field outputs [s]; `None`: no fields.
    pub fields_every: Option<f64>,
    /// Time between gauge lines [s]; `None`: every step.
    pub gauges_every: Option<f64>,
    /// Time between pictures of bodies [s]; `None`: none.
    pub bodies_every: Option<f64>,
    /// Time between checkpoints [s]; `None`: none.
    pub checkpoint_every: Option<f64>,
    /// Whether the energy of the flow is accounted for.
    pub energy: bool,
}

/// A place where something is recorded.
#[derive(Clone, Debug, PartialEq)]
pub struct Gauge {
    /// Column name in gauges.csv.
    pub name: String,
    /// What and where.
    pub kind: GaugeKind,
    /// What it rides on, if it does; then its place is where it is at t = 0.
    pub on: Option<Carrier>,
}

/// What a gauge rides on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Carrier {
    /// An obstacle of the case.
    Obstacle(usize),
    /// A body of one of the case's entries.
    Body(usize),
}

/// What a gauge measures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GaugeKind {
    /// Length of liquid along a line [m] (∫φ ds).
    WaterLevel {
        /// Ends of the line.
        line: [[f64; 3]; 2],
    },
    /// Pressure [Pa] at a point.
    Pressure {
        /// Place.
        at: [f64; 3],
    },
    /// Velocity [m/s] at a point: three columns.
    Velocity {
        /// Place.
        at: [f64; 3],
    },
}

impl Case {
    /// The condition on the boundary of this name.
    pub fn boundary(&self, name: &str) -> &Boundary {
        self.boundaries.iter().find(|b| b.0 == name).map_or(&self.default_boundary, |b| &b.1)
    }
}
