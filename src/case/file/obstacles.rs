//! The table of a structure cut through the mesh, as typed: `[[obstacle]]`.

use super::Expression;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A structure: one of cuboid, sphere, cylinder, points, surface, terrain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObstacleTable {
    /// Its name in loads.csv; no body has the same.
    pub name: String,
    /// Edges along x, y, z [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cuboid: Option<[f64; 3]>,
    /// Radius [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sphere: Option<f64>,
    /// Radius and height [m] of a cylinder along z.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cylinder: Option<[f64; 2]>,
    /// Corners of a convex polyhedron [m]: what is between these points.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub points: Option<Vec<[f64; 3]>>,
    /// A closed surface: an STL or OBJ file [m], found from the case file's folder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surface: Option<String>,
    /// The ground under a grid of heights: an ESRI ASCII file [m], found from the case file's folder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub terrain: Option<String>,
    /// Where its origin is put: the centre of cuboid, sphere and cylinder [m].
    #[serde(default)]
    pub at: [f64; 3],
    /// Turned about its origin by these angles about x, then y, then z [degrees].
    #[serde(default)]
    pub turned: [f64; 3],
    /// The fluid is inside: a pipe, a tank.
    #[serde(default)]
    pub outside_in: bool,
    /// no_slip (default) or slip.
    #[serde(default)]
    pub wall: WallWord,
    /// How far it has moved from `at` at time t [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub displacement: Option<[Expression; 3]>,
    /// By how much it has turned about its origin at time t: a vector along the axis [degrees].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotation: Option<[Expression; 3]>,
    /// In place of displacement: the velocity of its origin at time t [m/s].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity: Option<[Expression; 3]>,
    /// In place of rotation: its spin at time t, a vector along the axis in space, through its origin [rad/s].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spin: Option<[Expression; 3]>,
}

/// How a wall holds the fluid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WallWord {
    /// The fluid sticks.
    #[default]
    NoSlip,
    /// The fluid slides freely along.
    Slip,
}
