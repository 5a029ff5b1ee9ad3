//! The case file as typed: one struct a table, the defaults, and what may stand where a formula may.
//!
//! The comments of these types are the descriptions in `fcm-fsi --schema`.

pub mod bodies;
pub mod obstacles;

pub use obstacles::{ObstacleTable, WallWord};

use super::{Gravity, Regularisation, VolumeCorrection};
use schemars::JsonSchema;
use serde::de::{self, Deserializer, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;

/// A case of fcm-fsi. SI units throughout.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CaseFile {
    /// What this case is, for people.
    #[serde(default)]
    pub title: String,
    /// Choices made together; keys given explicitly override them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub preset: Option<Preset>,
    /// Gravity [m/s²].
    #[serde(default = "earth")]
    pub gravity: [f64; 3],
    /// Force per mass added to gravity [m/s²].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body_force: Option<[Expression; 3]>,
    /// Velocity given everywhere, always [m/s]: only the free surface is computed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prescribed_velocity: Option<[Expression; 3]>,
    /// The mesh: a box or a file. A case of bodies alone has none.
    #[serde(default, skip_serializing_if = "MeshTable::is_nothing")]
    pub mesh: MeshTable,
    /// Structures that stand in the mesh or move as told; the mesh does not know them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub obstacle: Vec<ObstacleTable>,
    /// Conditions by boundary name; `default` holds for every boundary not named. A box has x_min, x_max,
    /// y_min, y_max, z_min, z_max and the names of its holes.
    #[serde(default)]
    pub boundaries: BTreeMap<String, BoundaryEntry>,
    /// State at t = 0.
    #[serde(default)]
    pub initial: InitialTable,
    /// The liquid.
    #[serde(default = "FluidTable::water")]
    pub water: FluidTable,
    /// The gas. Without this table there is one fluid and no free surface.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub air: Option<AirTable>,
    /// How the free surface is computed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub free_surface: Option<FreeSurfaceTable>,
    /// How the flow is computed.
    #[serde(default)]
    pub flow: FlowTable,
    /// Time stepping.
    pub time: TimeTable,
    /// Linear solvers.
    #[serde(default)]
    pub solver: SolverTable,
    /// What is written, and how often.
    #[serde(default)]
    pub output: OutputTable,
    /// Places where something is recorded.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub gauge: Vec<GaugeTable>,
    /// What holds for all bodies.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bodies: Option<bodies::BodiesTable>,
    /// Bodies.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub body: Vec<bodies::BodyTable>,
    /// Walls that bodies cannot pass.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub wall: Vec<bodies::WallTable>,
    /// Contact between materials.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub contact: Vec<bodies::ContactTable>,
}

impl CaseFile {
    /// JSON schema of case files, for editors.
    pub fn schema() -> String {
        serde_json::to_string_pretty(&schemars::schema_for!(CaseFile))
            .expect("a schema can be written as JSON")
    }
}

fn earth() -> [f64; 3] {
    [0.0, 0.0, -9.81]
}

/// Choices made together.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Preset {
    /// The literal choices of the paper the method follows.
    Paper,
}

/// A box or a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeshTable {
    /// A box of tetrahedra.
    #[serde(rename = "box", default, skip_serializing_if = "Option::is_none")]
    pub block: Option<BoxTable>,
    /// A Gmsh file (2.2 or 4.1) with named physical groups, found from the case file's folder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// Solid blocks left out of a box.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub holes: Vec<HoleTable>,
    /// Nodes inside a box are moved at random by up to this fraction of the spacing.
    #[serde(default)]
    pub jitter: f64,
    /// Another seed, other moves.
    #[serde(default = "one")]
    pub jitter_seed: u64,
    /// How many times every tetrahedron is split into eight.
    #[serde(default)]
    pub refine: u32,
}

fn one() -> u64 {
    1
}

impl Default for MeshTable {
    fn default() -> Self {
        Self {
            block: None,
            file: None,
            holes: Vec::new(),
            jitter: 0.0,
            jitter_seed: one(),
            refine: 0,
        }
    }
}

impl MeshTable {
    fn is_nothing(&self) -> bool {
        *self == Self::default()
    }
}

/// A box of tetrahedra.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BoxTable {
    /// Along x.
    pub x: Axis,
    /// Along y.
    pub y: Axis,
    /// Along z.
    pub z: Axis,
    /// Numbers of cells along x, y, z, where all three are plain ranges.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cells: Option<[u32; 3]>,
}

/// A range, or blocks of cells one after the other.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Axis {
    /// From, to [m].
    Range([f64; 2]),
    /// Blocks between edges.
    Blocks(Blocks),
}

/// Blocks of cells between edges. Give `cells`, with `ratio` if they grow, or `sizes`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Blocks {
    /// Ends of the blocks [m], increasing.
    pub edges: Vec<f64>,
    /// Number of cells in each block.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cells: Option<Vec<u32>>,
    /// Last cell over first cell, in each block.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ratio: Option<Vec<f64>>,
    /// Size of the cells wanted at each edge [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sizes: Option<Vec<f64>>,
}

/// A solid block left out of a box.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HoleTable {
    /// Boundary name of its faces.
    pub name: String,
    /// From, to [m], on grid lines.
    pub x: [f64; 2],
    /// From, to [m], on grid lines.
    pub y: [f64; 2],
    /// From, to [m], on grid lines.
    pub z: [f64; 2],
}

/// Where a formula may stand.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Expression {
    /// A number.
    Number(f64),
    /// A formula of x, y, z, t: + - * / ^, sin cos tan asin acos atan sinh cosh tanh exp log sqrt abs floor,
    /// min(a, b), max(a, b), pi, e; conditions (< <= > >= == != && || !) count 1 or 0.
    Formula(String),
    /// A column of a table.
    Table(TableColumn),
}

/// A column of a CSV file with a header, linear in time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TableColumn {
    /// The file, found from the case file's folder. Its column "t" is the time [s].
    pub table: String,
    /// Name of the column.
    pub column: String,
}

/// Where a condition may stand: true, false, or a formula such as "z < 0.55 && x > 1.992".
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Condition {
    /// Everywhere or nowhere.
    Always(bool),
    /// A condition on x, y, z, t.
    Formula(String),
}

/// A word, or a table that gives velocity, pressure or a wave maker.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum BoundaryEntry {
    /// A condition that needs no number.
    Word(BoundaryWord),
    /// A condition with values.
    Table(Box<BoundaryTable>),
}

/// Conditions that need no number.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BoundaryWord {
    /// The fluid sticks.
    NoSlip,
    /// The fluid slides freely along.
    Slip,
    /// Pressure 0; what flows back in is gas.
    Open,
}

/// One of velocity, pressure, wave_maker.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BoundaryTable {
    /// Velocity [m/s].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity: Option<[Expression; 3]>,
    /// Pressure [Pa].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pressure: Option<Expression>,
    /// A CSV file of inflow speeds [m/s], with `column` and `direction`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wave_maker: Option<String>,
    /// The wave maker's column.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub column: Option<String>,
    /// Where the wave maker's positive speeds point; its length does not matter.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction: Option<[f64; 3]>,
    /// Where that which flows in is water. Without it, air flows in if there is air.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub water: Option<Condition>,
}

/// State at t = 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InitialTable {
    /// Where the water is. Without it, everywhere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub water: Option<Condition>,
    /// Velocity of water and air [m/s].
    #[serde(default = "at_rest")]
    pub velocity: [Expression; 3],
    /// The free surface is moved at random by up to this much, node by node [m].
    #[serde(default)]
    pub noise: f64,
    /// Another seed, other noise.
    #[serde(default = "one")]
    pub noise_seed: u64,
}

fn at_rest() -> [Expression; 3] {
    [Expression::Number(0.0), Expression::Number(0.0), Expression::Number(0.0)]
}

impl Default for InitialTable {
    fn default() -> Self {
        Self { water: None, velocity: at_rest(), noise: 0.0, noise_seed: one() }
    }
}

/// The liquid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default = "FluidTable::water", deny_unknown_fields)]
pub struct FluidTable {
    /// Density [kg/m³].
    pub density: f64,
    /// Dynamic viscosity [Pa s].
    pub viscosity: f64,
}

impl FluidTable {
    fn water() -> Self {
        Self { density: 1000.0, viscosity: 1e-3 }
    }
}

/// The gas.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct AirTable {
    /// Density [kg/m³].
    pub density: f64,
    /// Dynamic viscosity [Pa s].
    pub viscosity: f64,
}

impl Default for AirTable {
    fn default() -> Self {
        Self { density: 1.2, viscosity: 1.8e-5 }
    }
}

/// How the free surface is computed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FreeSurfaceTable {
    /// Thickness δ of the profile ½(1 + tanh(distance / 2δ)) [m]; overrides thickness_cells. From 10 to 90 % of water it
    /// is 4.4 δ: give it where that is more than what matters, such as a body's freeboard; half a cell is the least.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thickness: Option<f64>,
    /// δ over the mean size of cells at the initial surface.
    pub thickness_cells: f64,
    /// The form that conserves water; false: the form that moves by curvature.
    pub conservative: bool,
    /// How the profile is kept in shape: psi (default) or plain (preset "paper").
    #[serde(skip_serializing_if = "Option::is_none")]
    pub regularisation: Option<Regularisation>,
    /// Strength of the regularisation, over the top speed near the surface.
    pub mobility: f64,
    /// Transport of the exact profile (default), or of its linear interpolant (preset "paper").
    #[serde(skip_serializing_if = "Option::is_none")]
    pub profile_correction: Option<bool>,
    /// off, global (preset "paper") or per_body (default).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub volume_correction: Option<VolumeCorrection>,
}

impl Default for FreeSurfaceTable {
    fn default() -> Self {
        Self {
            thickness: None,
            thickness_cells: 1.0,
            conservative: true,
            regularisation: None,
            mobility: 1.0,
            profile_correction: None,
            volume_correction: None,
        }
    }
}

/// How the flow is computed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FlowTable {
    /// Form of the gravity force: edge (default; still water stays still) or quadrature (preset "paper").
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gravity: Option<Gravity>,
    /// Linear solves a step.
    pub iterations: u32,
    /// Hold the fluid at obstacles by this penalty alone, as the paper does [Pa s/m]; by Nitsche's method
    /// without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wall_penalty: Option<f64>,
}

impl Default for FlowTable {
    fn default() -> Self {
        Self { gravity: None, iterations: 1, wall_penalty: None }
    }
}

/// Time stepping: a fixed `step`, or steps from `max_cfl`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TimeTable {
    /// The run stops here [s].
    pub end: f64,
    /// Every step is this long [s].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub step: Option<f64>,
    /// The fastest fluid crosses at most this many cells a step (default 1).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_cfl: Option<f64>,
    /// No step is longer [s] (default: no limit but `end`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_step: Option<f64>,
    /// The first step [s] (default: a fluid at rest falls 1 % of a cell).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub first_step: Option<f64>,
}

/// Linear solvers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SolverTable {
    /// Residual at which the flow solve stops, relative to that of the previous step's solution.
    pub tolerance: f64,
    /// The same for the first two steps, which begin without a pressure (default 1e-11 with air, so that still
    /// water starts still, 1e-6 without).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start_tolerance: Option<f64>,
    /// The same for the free surface.
    pub phase_tolerance: f64,
    /// A solve that needs more iterations ends the run; the flow's, more for each part in 10 000 of its residual.
    pub max_iterations: u32,
}

impl Default for SolverTable {
    fn default() -> Self {
        Self { tolerance: 1e-3, start_tolerance: None, phase_tolerance: 1e-8, max_iterations: 200 }
    }
}

/// What is written, and how often.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct OutputTable {
    /// Time between fields [s], or "never" (default end/50).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fields_every: Option<Every>,
    /// Time between lines of gauges.csv [s], or "step" (default).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gauges_every: Option<Every>,
    /// Time between pictures of bodies and lines of bodies.csv [s], or "never" (default end/100).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bodies_every: Option<Every>,
    /// Time between checkpoints [s], or "never" (default).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub checkpoint_every: Option<Every>,
    /// energy.csv: a line a step with where the energy is and where it went. Costs some time.
    pub energy: bool,
}

/// A time or a word.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Every {
    /// Time between two [s].
    Time(f64),
    /// A word.
    Word(EveryWord),
}

/// Words for how often.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum EveryWord {
    /// Not at all.
    Never,
    /// After every step.
    Step,
}

/// A place where something is recorded, in the mesh or on a structure: one of water_level, pressure, velocity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GaugeTable {
    /// Column name in gauges.csv.
    pub name: String,
    /// Ends of a line [m]: records the length of it that is in water.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub water_level: Option<[[f64; 3]; 2]>,
    /// A point [m]: records the pressure.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pressure: Option<[f64; 3]>,
    /// A point [m]: records the velocity, in three columns.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity: Option<[f64; 3]>,
    /// Name of the obstacle or body on whose surface the point lies at t = 0: it moves with it, and records what
    /// the fluid beside it has.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub on: Option<String>,
}

/// Implements `Deserialize` for a type that is written in one of several forms, so that what is refused
/// is refused with its own reason and place.
macro_rules! written_as {
    ($type:ty, $expecting:literal, { $($form:item)* }) => {
        impl<'de> Deserialize<'de> for $type {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                struct Forms;
                impl<'de> Visitor<'de> for Forms {
                    type Value = $type;
                    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                        f.write_str($expecting)
                    }
                    $($form)*
                }
                deserializer.deserialize_any(Forms)
            }
        }
    };
}

written_as!(Axis, "a range [from, to] or a table with edges and cells or sizes", {
    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Axis, A::Error> {
        let ends = Vec::<f64>::deserialize(de::value::SeqAccessDeserializer::new(list))?;
        match ends[..] {
            [from, to] => Ok(Axis::Range([from, to])),
            _ => Err(de::Error::invalid_length(ends.len(), &self)),
        }
    }
    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Axis, A::Error> {
        Blocks::deserialize(de::value::MapAccessDeserializer::new(map)).map(Axis::Blocks)
    }
});

written_as!(Expression, "a number, a formula or { table, column }", {
    fn visit_f64<E>(self, number: f64) -> Result<Expression, E> {
        Ok(Expression::Number(number))
    }
    fn visit_i64<E>(self, number: i64) -> Result<Expression, E> {
        Ok(Expression::Number(number as f64))
    }
    fn visit_str<E>(self, text: &str) -> Result<Expression, E> {
        Ok(Expression::Formula(text.into()))
    }
    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Expression, A::Error> {
        TableColumn::deserialize(de::value::MapAccessDeserializer::new(map)).map(Expression::Table)
    }
});

written_as!(Condition, "true, false or a condition such as \"z < 0.5\"", {
    fn visit_bool<E>(self, holds: bool) -> Result<Condition, E> {
        Ok(Condition::Always(holds))
    }
    fn visit_str<E>(self, text: &str) -> Result<Condition, E> {
        Ok(Condition::Formula(text.into()))
    }
});

written_as!(
    BoundaryEntry,
    "a word (no_slip, slip, open) or a table with velocity, pressure or wave_maker",
    {
        fn visit_str<E: de::Error>(self, word: &str) -> Result<BoundaryEntry, E> {
            let word = de::value::StrDeserializer::new(word);
            BoundaryWord::deserialize(word).map(BoundaryEntry::Word)
        }
        fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<BoundaryEntry, A::Error> {
            let table = de::value::MapAccessDeserializer::new(map);
            BoundaryTable::deserialize(table).map(|t| BoundaryEntry::Table(Box::new(t)))
        }
    }
);

written_as!(Every, "a time in seconds or a word (never, step)", {
    fn visit_f64<E>(self, time: f64) -> Result<Every, E> {
        Ok(Every::Time(time))
    }
    fn visit_i64<E>(self, time: i64) -> Result<Every, E> {
        Ok(Every::Time(time as f64))
    }
    fn visit_str<E: de::Error>(self, word: &str) -> Result<Every, E> {
        EveryWord::deserialize(de::value::StrDeserializer::new(word)).map(Every::Word)
    }
});
