//! The tables about bodies, as typed: `[bodies]`, `[[body]]`, `[[wall]]`, `[[contact]]`.

use super::{Condition, Expression};
use crate::case::{BasePressure, Compression, Coupling, Unloading};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What holds for all bodies.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BodiesTable {
    /// Radius of the contact spheres that are put into every body but spheres [m].
    pub sphere_radius: f64,
    /// Distance of neighbouring contact spheres [m] (default: 2 radii, no gaps).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sphere_spacing: Option<f64>,
    /// Contact stiffness, normal and tangential [N/m].
    #[serde(default = "stiffness")]
    pub stiffness: f64,
    /// Speed after over speed before an impact.
    #[serde(default = "restitution")]
    pub restitution: f64,
    /// Angle of friction [degrees].
    #[serde(default = "friction_angle")]
    pub friction_angle: f64,
    /// Leaves out the pull of the dashpot at the end of a contact; bodies then rebound faster.
    #[serde(default)]
    pub no_tension: bool,
    /// Length of a sub-step [s] (default: `fraction` of the longest stable one).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_step: Option<f64>,
    /// Sub-step over the longest stable one.
    #[serde(default = "fraction")]
    pub fraction: f64,
    /// Bodies come to rest under gravity for this long before t = 0 [s].
    #[serde(default)]
    pub settle: f64,
    /// Ranks that share the bodies, at most all; as many as have half a millisecond of work each in a sub-step, if
    /// not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ranks: Option<u32>,
    /// How flow and bodies are solved: auto (default) together where a body is light for the water around it,
    /// strong together for all bodies in water, loose one after the other (preset "paper").
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coupling: Option<Coupling>,
    /// Under a body that rests on something there is water (wet, default) or not (dry).
    #[serde(default = "wet")]
    pub base_pressure: BasePressure,
    /// The fluid slides along the bodies instead of sticking to them.
    #[serde(default)]
    pub slip: bool,
    /// Boundaries of the mesh and obstacles that bodies bump into, by their names; they are walls like those of
    /// [[wall]]. A flat boundary with the whole mesh on one side goes on beyond the mesh.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub walls: Vec<String>,
    /// What glues bonded bodies.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bond: Option<BondTable>,
}

fn wet() -> BasePressure {
    BasePressure::Wet
}
fn stiffness() -> f64 {
    1e7
}
fn restitution() -> f64 {
    0.2
}
fn friction_angle() -> f64 {
    30.0
}
fn fraction() -> f64 {
    0.1
}

/// Glue between faces that touch: traction 27/4 strength (d/opening)(1 − d/opening)² at a distance d.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BondTable {
    /// Largest traction [Pa].
    pub strength: f64,
    /// Distance at which a bond is broken for good [m].
    pub opening: f64,
    /// How much of a face is glued, from 0 to 1.
    #[serde(default = "whole")]
    pub area: f64,
    /// Integration points along each side of a face.
    #[serde(default = "four")]
    pub points: u32,
    /// curve (default): the bond closes as it opened; damage: straight back to zero.
    #[serde(default = "on_the_curve")]
    pub unloading: Unloading,
    /// What carries compression: bond (default) or contact (preset "paper").
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub compression: Option<Compression>,
    /// Fraction of critical damping (default 0.05, preset "paper": 0).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damping: Option<f64>,
    /// Faces this far apart still count as touching [m] (default: 1 % of the sphere radius).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gap: Option<f64>,
}

fn whole() -> f64 {
    1.0
}
fn four() -> u32 {
    4
}
fn on_the_curve() -> Unloading {
    Unloading::Curve
}

/// A body, or many by a rule. One of cuboid, sphere, cylinder, points, surface says its shape.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BodyTable {
    /// Name, for results and errors.
    pub name: String,
    /// Edges along x, y, z [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cuboid: Option<[f64; 3]>,
    /// Radius of a sphere [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sphere: Option<f64>,
    /// Radius and height of a cylinder along z [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cylinder: Option<[f64; 2]>,
    /// Corners of a convex polyhedron [m]: what is between these points.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub points: Option<Vec<[f64; 3]>>,
    /// A closed surface: an STL or OBJ file [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surface: Option<String>,
    /// Where the centre of cuboid, sphere or cylinder, or the origin of the points or the surface, is put [m].
    #[serde(default)]
    pub at: [f64; 3],
    /// Turned about x, then y, then z [degrees].
    #[serde(default)]
    pub turned: [f64; 3],
    /// Density [kg/m³].
    pub density: f64,
    /// Material, for [[contact]].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub material: Option<String>,
    /// Velocity at t = 0 [m/s].
    #[serde(default)]
    pub velocity: [f64; 3],
    /// Spin at t = 0 [rad/s], each body about its own centroid.
    #[serde(default)]
    pub spin: [f64; 3],
    /// Bodies whose centroid meets the condition stand still: true, false or a condition on x, y, z.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fixed: Option<Condition>,
    /// Velocity of a body that is led [m/s].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub led_velocity: Option<[Expression; 3]>,
    /// Spin of a body that is led [rad/s].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub led_spin: Option<[Expression; 3]>,
    /// Motions that do not take place: x, y, z along the axes, rx, ry, rz about them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub locked: Vec<Freedom>,
    /// Force besides gravity [N].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub force: Option<[Expression; 3]>,
    /// Torque [N m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub torque: Option<[Expression; 3]>,
    /// Walls it passes through.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ignores: Vec<String>,
    /// Whether its faces are glued to faces of other bonded bodies that they touch.
    #[serde(default)]
    pub bonded: bool,
    /// Blocks along the edges of the box: each is a body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grid: Option<[u32; 3]>,
    /// Of the grid, only the blocks along its four upright sides.
    #[serde(default)]
    pub hollow: bool,
    /// Blocks of the grid that are left out: those whose middle meets the condition on x, y, z.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub openings: Vec<Condition>,
    /// Random (Voronoi) fragments of the shape: each is a body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fragments: Option<FragmentsTable>,
    /// The same again, many times.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub copies: Option<CopiesTable>,
    /// Radius of the contact spheres of this body [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sphere_radius: Option<f64>,
    /// Points whose place is recorded in bodies.csv [m]; they move with the body that is nearest at t = 0.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub track: Vec<[f64; 3]>,
}

/// Random fragments.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FragmentsTable {
    /// Typical size [m].
    pub size: f64,
    /// Another seed, other fragments.
    #[serde(default = "first")]
    pub seed: u64,
}

fn first() -> u64 {
    1
}

/// Copies at equal distances.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CopiesTable {
    /// How many along x, y, z.
    pub count: [u32; 3],
    /// From one to the next [m].
    pub spacing: [f64; 3],
}

/// A motion of a rigid body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Freedom {
    /// Along x.
    X,
    /// Along y.
    Y,
    /// Along z.
    Z,
    /// About x.
    Rx,
    /// About y.
    Ry,
    /// About z.
    Rz,
}

/// A wall: one of plane, surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WallTable {
    /// Name.
    pub name: String,
    /// A plane.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plane: Option<PlaneTable>,
    /// Terrain: an STL or OBJ file [m], open or closed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surface: Option<String>,
    /// Material, for [[contact]].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub material: Option<String>,
}

/// A plane.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlaneTable {
    /// A point of it [m].
    pub point: [f64; 3],
    /// Towards the side where bodies are; its length does not matter.
    pub normal: [f64; 3],
}

/// What two materials are to each other, where it differs from [bodies].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ContactTable {
    /// Two materials, or one twice.
    pub between: [String; 2],
    /// Contact stiffness [N/m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffness: Option<f64>,
    /// Speed after over speed before.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub restitution: Option<f64>,
    /// Angle of friction [degrees].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction_angle: Option<f64>,
}
