//! Bad input, each kind with its exact message, on one rank and on two: the program says what is wrong
//! in one sentence, with file, line and key, and ends with status 2. No panic, no hang.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// A good case; each line below spoils it.
const GOOD: &str = r#"title = "tank"
gravity = [0, 0, -9.81]

[mesh]
box = { x = [0, 2], y = [0, 1], z = [0, 1], cells = [8, 4, 4] }
holes = [{ name = "pier", x = [0.5, 0.75], y = [0.25, 0.5], z = [0, 1] }]
jitter = 0.1

[boundaries]
default = "slip"
x_min = { velocity = ["sin(t)", 0, 0], water = "z < 0.5" }
x_max = { wave_maker = "in.csv", column = "u", direction = [-1, 0, 0] }
z_max = "open"

[initial]
water = "z < 0.5"
velocity = [0, 0, 0]

[water]
density = 1000
viscosity = 1e-3

[air]
density = 1.2

[free_surface]
thickness_cells = 1
regularisation = "psi"

[time]
end = 1.0
max_cfl = 1

[solver]
tolerance = 1e-3

[output]
fields_every = 0.1

[[gauge]]
name = "H1"
water_level = [[1, 0.5, 0], [1, 0.5, 1]]

[[gauge]]
name = "P1"
pressure = [1, 0.5, 0.1]
"#;

/// The table of `GOOD`.
const TABLE: &str = "t, u\n0, 0\n0.5, 1\n2, 1\n";

/// What replaces what in the good case, and what the program then says after `error: case.toml`.
const BAD_CASES: &[(&str, &str, &str)] = &[
    // Not TOML at all.
    (
        "end = 1.0",
        "end = 1,0",
        ":31: not valid TOML: unexpected key or value, expected newline, `#`",
    ),
    ("[time]", "[time", ":30: not valid TOML: unclosed table, expected `]`"),
    (
        "\"slip\"",
        "slip",
        ":10: not valid TOML: string values must be quoted, expected literal string",
    ),
    ("z_max = \"open\"", "x_min = \"open\"", ":13: x_min: given twice"),
    // Keys.
    ("viscosity", "viscosty", ":21: water.viscosty: unknown key; did you mean \"viscosity\"?"),
    ("[solver]", "[sover]", ":34: sover: unknown key; did you mean \"solver\"?"),
    (
        "jitter = 0.1",
        "periodic = true",
        ":7: mesh.periodic: unknown key; valid keys: box, file, holes, jitter, jitter_seed, refine",
    ),
    ("end = 1.0", "", ":30: time: the key \"end\" is missing"),
    (
        "default = \"slip\"",
        "",
        ":9: boundaries: the key \"default\" is missing: the condition of boundaries not named",
    ),
    (
        ", cells = [8, 4, 4]",
        "",
        ":5: mesh.box: the key \"cells\" is missing: numbers of cells along x, y, z",
    ),
    (
        "column = \"u\", ",
        "",
        ":12: boundaries.x_max: the key \"column\" is missing: the wave_maker's column of speeds",
    ),
    // Words.
    (
        "\"open\"",
        "\"opne\"",
        ":13: boundaries.z_max: unknown word \"opne\"; did you mean \"open\"?",
    ),
    (
        "\"slip\"",
        "\"periodic\"",
        ":10: boundaries.default: unknown word \"periodic\"; valid words: no_slip, slip, open",
    ),
    (
        "\"psi\"",
        "\"PSY\"",
        ":28: free_surface.regularisation: unknown word \"PSY\"; did you mean \"psi\"?",
    ),
    (
        "z_max",
        "zmax",
        ":13: boundaries.zmax: the mesh has no boundary of this name; did you mean \"z_max\"?",
    ),
    (
        "fields_every = 0.1",
        "fields_every = \"step\"",
        ":38: output.fields_every: takes a time in seconds or \"never\"",
    ),
    // Types.
    (
        "density = 1000",
        "density = \"1000 kg\"",
        ":20: water.density: a number expected, found \"1000 kg\"",
    ),
    (
        "gravity = [0, 0, -9.81]",
        "gravity = -9.81",
        ":2: gravity: a list of 3 values expected, found -9.81",
    ),
    (
        "gravity = [0, 0, -9.81]",
        "gravity = [0, -9.81]",
        ":2: gravity: a list of 3 values expected, found 2 values",
    ),
    (
        "cells = [8, 4, 4]",
        "cells = [8, 4, 4.5]",
        ":5: mesh.box.cells[3]: a whole number, 0 or more, expected, found 4.5",
    ),
    (
        "cells = [8, 4, 4]",
        "cells = [8, -4, 4]",
        ":5: mesh.box.cells[2]: a whole number, 0 or more, expected, found -4",
    ),
    (
        "\"open\"",
        "0",
        ":13: boundaries.z_max: a word (no_slip, slip, open) or a table with velocity, pressure or wave_maker expected, found 0",
    ),
    (
        "water = \"z < 0.5\"\nvelocity",
        "water = 0.5\nvelocity",
        ":16: initial.water: true, false or a condition such as \"z < 0.5\" expected, found 0.5",
    ),
    (
        "x = [0, 2]",
        "x = [0, 1, 2]",
        ":5: mesh.box.x: a range [from, to] or a table with edges and cells or sizes expected, found 3 values",
    ),
    // Numbers.
    ("density = 1000", "density = -1000", ":20: water.density: must be greater than 0, is -1000"),
    ("density = 1.2", "density = nan", ":24: air.density: must be a finite number, is NaN"),
    (
        "viscosity = 1e-3",
        "viscosity = -1e-3",
        ":21: water.viscosity: must not be negative, is -0.001",
    ),
    ("end = 1.0", "end = 0", ":31: time.end: must be greater than 0, is 0"),
    ("end = 1.0", "end = inf", ":31: time.end: must be a finite number, is inf"),
    (
        "max_cfl = 1",
        "max_cfl = 1\nstep = 0.01",
        ":32: time.max_cfl: has no effect beside a fixed time.step",
    ),
    (
        "tolerance = 1e-3",
        "tolerance = 10",
        ":35: solver.tolerance: must lie between 0 and 1, is 10",
    ),
    ("x = [0, 2]", "x = [2, 0]", ":5: mesh.box.x: must increase, but 2 is followed by 0"),
    (
        "cells = [8, 4, 4]",
        "cells = [8, 0, 4]",
        ":5: mesh.box.cells[2]: must lie between 1 and 1000000, is 0",
    ),
    ("jitter = 0.1", "jitter = 0.9", ":7: mesh.jitter: must lie between 0 and 0.3, is 0.9"),
    (
        "x = [0.5, 0.75]",
        "x = [0.5, 0.8]",
        ":6: mesh.holes[1].x: 0.8 is on no grid line; the nearest is 0.75",
    ),
    (
        "direction = [-1, 0, 0]",
        "direction = [0, 0, 0]",
        ":12: boundaries.x_max.direction: must not be zero",
    ),
    // Formulas.
    (
        "sin(t)",
        "sim(t)",
        ":11: boundaries.x_min.velocity[1]: unknown name \"sim\"; did you mean \"sin\"?",
    ),
    ("sin(t)", "2*(t + 1", ":11: boundaries.x_min.velocity[1]: a closing parenthesis is missing"),
    (
        "sin(t)",
        "log(t)",
        ":11: boundaries.x_min.velocity[1]: is -inf at x = 0, y = 0.507, z = 0.961, t = 0",
    ),
    (
        "water = \"z < 0.5\"\nvelocity",
        "water = \"z - 0.5\"\nvelocity",
        ":16: initial.water: a condition such as z < 0.5 was expected, not a number",
    ),
    // Contradictions.
    (
        "[air]\ndensity = 1.2\n",
        "",
        ":24: free_surface: without the table [air] there is no free surface",
    ),
    (
        "sin(t)\", 0, 0]",
        "sin(t)\", 0, 0], pressure = 0",
        ":11: boundaries.x_min: needs one of velocity, pressure, wave_maker",
    ),
    ("jitter = 0.1", "file = \"in.csv\"", ":7: mesh.file: the mesh is a box or a file, not both"),
    ("\"P1\"", "\"H1\"", ":45: gauge[2].name: another gauge is called \"H1\" too"),
    ("pressure = [1, 0.5, 0.1]", "", ":44: gauge[2]: needs one of water_level, pressure, velocity"),
    // Structures.
    (
        "[[gauge]]\nname = \"H1\"",
        "[[obstacle]]\nname = \"pier\"\ncuboid = [0.8, 0.6, 3]\nat = [1, 0.5, 0.5]\n\n[[gauge]]\nname = \"H1\"",
        ":51: gauge[2].pressure: (1, 0.5, 0.1) lies inside a structure",
    ),
    (
        "[[gauge]]\nname = \"H1\"",
        "[[obstacle]]\nname = \"pier\"\nsphere = -1\n\n[[gauge]]\nname = \"H1\"",
        ":42: obstacle[1].sphere: must be greater than 0, is -1",
    ),
    (
        "[[gauge]]\nname = \"H1\"",
        "[[obstacle]]\nname = \"pier\"\nspere = 1\n\n[[gauge]]\nname = \"H1\"",
        ":42: obstacle[1].spere: unknown key; did you mean \"sphere\"?",
    ),
    (
        "[[gauge]]\nname = \"H1\"",
        "[[obstacle]]\nname = \"pier\"\n\n[[gauge]]\nname = \"H1\"",
        ":40: obstacle[1]: needs one of cuboid, sphere, cylinder, points, surface, terrain",
    ),
    (
        "[[gauge]]\nname = \"H1\"",
        "[[obstacle]]\nname = \"pier\"\nsurface = \"pier.stl\"\n\n[[gauge]]\nname = \"H1\"",
        ":42: obstacle[1].surface: FOLDER/pier.stl: No such file or directory (os error 2)",
    ),
    (
        "[[gauge]]\nname = \"H1\"",
        "[[obstacle]]\nname = \"pier\"\nsphere = 0.2\nvelocity = [0, 0, 1]\ndisplacement = [0, 0, \"t\"]\n\n[[gauge]]\nname = \"H1\"",
        ":43: obstacle[1].velocity: says again what displacement says: give one of them",
    ),
    (
        "[[gauge]]\nname = \"H1\"",
        "[[obstacle]]\nname = \"pier\"\nsphere = 0.2\nspin = [0, 0, 1]\nrotation = [0, 0, \"t\"]\n\n[[gauge]]\nname = \"H1\"",
        ":43: obstacle[1].spin: says again what rotation says: give one of them",
    ),
    (
        "[[gauge]]\nname = \"H1\"",
        "[[obstacle]]\nname = \"pier\"\npoints = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\n\n[[gauge]]\nname = \"H1\"",
        ":42: obstacle[1].points: needs at least 4, has 3",
    ),
    (
        "[[gauge]]\nname = \"H1\"",
        "[[obstacle]]\nname = \"pier\"\npoints = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]\n\n[[gauge]]\nname = \"H1\"",
        ":42: obstacle[1].points: it encloses no volume",
    ),
    (
        "[1, 0.5, 0.1]",
        "[1, 0.5, 0.1]\non = \"pier\"",
        ":47: gauge[2].on: there is neither obstacle nor body to ride on",
    ),
    (
        "[[gauge]]\nname = \"P1\"",
        "[[obstacle]]\nname = \"ball\"\nsphere = 0.2\nat = [1, 0.5, 0.9]\n\n[[gauge]]\nname = \"P1\"\non = \"bal\"",
        ":51: gauge[2].on: no obstacle or body is called \"bal\"; did you mean \"ball\"?",
    ),
    (
        "[[gauge]]\nname = \"P1\"",
        "[[obstacle]]\nname = \"ball\"\nsphere = 0.2\nat = [1, 0.5, 0.9]\n\n[[gauge]]\nname = \"P1\"\non = \"ball\"",
        ":52: gauge[2].pressure: (1, 0.5, 0.1) is 0.6000 m away from the surface of what it is on",
    ),
    (
        "[[gauge]]\nname = \"H1\"",
        "[bodies]\nsphere_radius = 0.1\n\n[[body]]\nname = \"rock\"\ndensity = 2000\n\n[[gauge]]\nname = \"H1\"",
        ":43: body[1]: needs one of cuboid, sphere, cylinder, points, surface",
    ),
    (
        "[[gauge]]\nname = \"H1\"",
        "[bodies]\nsphere_radius = 0.1\n\n[[body]]\nname = \"rock\"\ndensity = 2000\npoints = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\n\n[[gauge]]\nname = \"H1\"",
        ":46: body[1].points: needs at least 4, has 3",
    ),
    (
        "[[gauge]]\nname = \"H1\"",
        "[bodies]\nsphere_radius = 0.1\n\n[[body]]\nname = \"rock\"\ndensity = 2000\npoints = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]\n\n[[gauge]]\nname = \"H1\"",
        ":46: body[1].points: it encloses no volume",
    ),
    // Tables.
    ("in.csv", "out.csv", ":12: boundaries.x_max.wave_maker: out.csv: no such file"),
    (
        "column = \"u\"",
        "column = \"v\"",
        ":12: boundaries.x_max.column: in.csv: has no column \"v\"; valid columns: t, u",
    ),
    (
        "end = 1.0",
        "end = 3.0",
        ":12: boundaries.x_max.wave_maker: in.csv: covers 0 s to 2 s, the run 0 s to 3 s",
    ),
    // Walls by name.
    (
        "[[gauge]]\nname = \"H1\"",
        "[bodies]\nsphere_radius = 0.01\nwalls = [\"zmin\"]\n[[body]]\nname = \"a\"\nsphere = 0.1\ndensity = 1\n\n[[gauge]]\nname = \"H1\"",
        ":42: bodies.walls[1]: no boundary or obstacle is called \"zmin\"; did you mean \"z_min\"?",
    ),
    (
        "[[gauge]]\nname = \"H1\"",
        "[bodies]\nsphere_radius = 0.01\nwalls = [\"z_min\", \"boulder\"]\n[[body]]\nname = \"a\"\nsphere = 0.1\ndensity = 1\n[[obstacle]]\nname = \"bolder\"\nsphere = 0.1\n\n[[gauge]]\nname = \"H1\"",
        ":42: bodies.walls[2]: no boundary or obstacle is called \"boulder\"; did you mean \"bolder\"?",
    ),
    (
        "[[gauge]]\nname = \"H1\"",
        "[bodies]\nsphere_radius = 0.01\nwalls = [\"pier\"]\n[[body]]\nname = \"a\"\nsphere = 0.1\ndensity = 1\n[[obstacle]]\nname = \"pier\"\nsphere = 0.1\n\n[[gauge]]\nname = \"H1\"",
        ":42: bodies.walls[1]: both a boundary and an obstacle are called \"pier\"",
    ),
    (
        "[[gauge]]\nname = \"H1\"",
        "[bodies]\nsphere_radius = 0.01\nwalls = [\"z_min\", \"z_min\"]\n[[body]]\nname = \"a\"\nsphere = 0.1\ndensity = 1\n\n[[gauge]]\nname = \"H1\"",
        ":42: bodies.walls[2]: another wall is called \"z_min\" too",
    ),
    (
        "[[gauge]]\nname = \"H1\"",
        "[bodies]\nsphere_radius = 0.01\nwalls = [\"gate\"]\n[[body]]\nname = \"a\"\nsphere = 0.1\ndensity = 1\n[[obstacle]]\nname = \"gate\"\nsphere = 0.1\nvelocity = [1, 0, 0]\n\n[[gauge]]\nname = \"H1\"",
        ":42: bodies.walls[1]: \"gate\" moves, walls do not: lead a [[body]] in its place",
    ),
];

/// What a table holds instead, and what the program then says after the place of its column.
const BAD_TABLES: &[(&str, &str)] = &[
    ("t, u\n0, 0\n0.5, abc\n2, 1\n", "in.csv:3: `abc` in column `u` is no number"),
    ("t, u\n0, 0\n0.5\n2, 1\n", "in.csv:3: 1 values for 2 columns (t, u)"),
    ("t, u\n0, 0\n2, 1\n1, 1\n", "in.csv: time 1 does not come after 2"),
    ("t, u\n", "in.csv: has no lines of numbers"),
];

/// A good case on a mesh from a file.
const WITH_MESH: &str = r#"[mesh]
file = "tank.msh"
[boundaries]
default = "slip"
wall = "no_slip"
[time]
end = 1
"#;

/// Its mesh: two tetrahedra and the name of one triangle.
const MESH: &str = r#"$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
2
2 1 "wall"
3 2 "fluid"
$EndPhysicalNames
$Nodes
5
1 0 0 0
2 1 0 0
3 0 1 0
4 0 0 1
5 1 1 1
$EndNodes
$Elements
3
1 2 2 1 1 1 2 3
2 4 2 2 1 1 2 3 4
3 4 2 2 1 2 3 4 5
$EndElements
"#;

/// What replaces what in the mesh (nothing: it ends there), and what the program then says after
/// `error: case.toml:2: mesh.file: `, FILE being the mesh's full name.
const BAD_MESHES: &[(&str, Option<&str>, &str)] = &[
    ("$MeshFormat", None, "FILE:1: is not a Gmsh mesh: it does not begin with $MeshFormat"),
    ("4 0 0 1", None, "FILE:14: the file ends inside $Nodes, where the number of a node should be"),
    (
        "2.2 0 8",
        Some("3.0 0 8"),
        "FILE:2: MSH version 3.0 is not read: save it with Mesh.MshFileVersion = 4.1 (or 2.2)",
    ),
    ("5 1 1 1", Some("5 nan 1 1"), "FILE:15: node 5: its coordinate is NaN"),
    ("5 1 1 1", Some("5 1 one 1"), "FILE:15: a coordinate expected, not \"one\""),
    ("2 3 4 5", Some("2 3 4 9"), "FILE: a tetrahedron names node 9, which is not in $Nodes"),
    (
        "5 1 1 1",
        Some("5 0.25 0.25 0.5"),
        "tetrahedron 1 is flat: volume 0.000e0 m³, longest edge 1.414e0 m, corners (1, 0, 0) (0, 1, 0) (0, 0, 1) (0.25, 0.25, 0.5): remesh, or let the mesh generator optimise",
    ),
    (
        "5 1 1 1",
        Some("5 0.1 0.1 0.1"),
        "tetrahedra [0, 1] overlap: they lie on the same side of the face with centre (0.3333333333333333, 0.3333333333333333, 0.3333333333333333)",
    ),
];

/// What replaces what in the case with a mesh, and what the program then says after `error: case.toml`.
const BAD_WITH_MESH: &[(&str, &str, &str)] = &[
    ("tank.msh", "tnk.msh", ":2: mesh.file: tnk.msh: no such file"),
    (
        "wall",
        "wal",
        ":5: boundaries.wal: the mesh has no boundary of this name; did you mean \"wall\"?",
    ),
    (
        "[boundaries]",
        "jitter = 0.1\n[boundaries]",
        ":3: mesh.jitter: moves the nodes of a box only",
    ),
    (
        "[boundaries]",
        "[bodies]\nsphere_radius = 0.01\nwalls = [\"wal\"]\n\
         [[body]]\nname = \"a\"\nsphere = 0.1\ndensity = 1\n[boundaries]",
        ":5: bodies.walls[1]: the mesh has no boundary of this name; did you mean \"wall\"?",
    ),
    (
        "[boundaries]",
        "[bodies]\nsphere_radius = 0.01\nwalls = [\"wall\"]\n\
         [[body]]\nname = \"a\"\nsphere = 0.1\ndensity = 1\n\
         [[obstacle]]\nname = \"wall\"\nsphere = 0.1\n[boundaries]",
        ":5: bodies.walls[1]: both a boundary and an obstacle are called \"wall\"",
    ),
];

/// A good case with a surface, which is all that is wrong with it.
const WITH_SURFACE: &str = r#"[mesh]
box = { x = [0, 1], y = [0, 1], z = [0, 1], cells = [2, 2, 2] }
[boundaries]
default = "slip"
[time]
end = 1
[[obstacle]]
name = "pier"
surface = "pier.obj"
"#;

/// Surfaces, and what the program then says after `error: case.toml:9: obstacle[1].surface: FOLDER/pier.obj: `.
const BAD_SURFACES: &[(&str, &str)] = &[
    (
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\n",
        "it is not closed: 3 edges, the first near (0.000000, 0.500000, 0.000000), are not shared by two triangles \
         of the same orientation",
    ),
    // Two tetrahedra, one pushed into the other.
    (
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n\
         v 0.25 0.25 -1\nv 1.25 0.25 -1\nv 0.25 1.25 -1\nv 0.25 0.25 0.125\nf 5 7 6\nf 5 6 8\nf 6 7 8\nf 5 8 7\n",
        "it runs through itself near (0.361111, 0.250000, 0.000000): join the parts that overlap, or give each as a \
         structure of its own",
    ),
];

/// Arguments, and the status and words the program then ends with.
const BAD_ARGUMENTS: &[(&[&str], i32, &str)] = &[
    (&["nowhere.toml"], 2, "error: nowhere.toml: no such file"),
    (&["binary.toml"], 2, "error: binary.toml: is not text (UTF-8)"),
    (
        &["case.toml", "--step", "3"],
        2,
        "error: unexpected argument '--step' found\n\n  tip: a similar argument exists: '--steps'\n\n\
         Usage: fcm-fsi --steps <N> <CASE>\n\nFor more information, try '--help'.",
    ),
    (
        &["case.toml", "--steps", "few"],
        2,
        "error: invalid value 'few' for '--steps <N>': invalid digit found in string\n\n\
         For more information, try '--help'.",
    ),
    (
        &["case.toml", "--restart", "nowhere"],
        1,
        "error: nowhere: there is no checkpoint here (output.checkpoint_every writes them)",
    ),
    (&["case.toml", "--out", "in.csv"], 1, "error: in.csv: a file, not a folder for results"),
];

#[test]
fn one_rank_refuses_each_with_its_message() {
    refuses_all(1);
}

#[test]
fn two_ranks_refuse_each_with_one_message() {
    refuses_all(2);
}

/// One run that must fail.
struct Attempt {
    /// What lies in its folder: names and contents.
    files: Vec<(&'static str, Vec<u8>)>,
    arguments: Vec<&'static str>,
    /// How it ends; FOLDER stands for its folder.
    status: i32,
    message: String,
}

/// Every line of the tables above.
fn attempts() -> Vec<Attempt> {
    let attempt = |files: Vec<(&'static str, &str)>, message: String| Attempt {
        files: files.into_iter().map(|(name, text)| (name, text.into())).collect(),
        arguments: vec!["case.toml"],
        status: 2,
        message: format!("error: case.toml{message}"),
    };
    let replaced = |good: &str, from: &str, to: &str| {
        assert!(good.contains(from), "the good case has no {from:?}");
        good.replacen(from, to, 1)
    };
    let mut all = Vec::new();
    for (from, to, message) in BAD_CASES {
        let case = replaced(GOOD, from, to);
        all.push(attempt(vec![("case.toml", &case), ("in.csv", TABLE)], message.to_string()));
    }
    for (table, message) in BAD_TABLES {
        let message = format!(":12: boundaries.x_max.column: {message}");
        all.push(attempt(vec![("case.toml", GOOD), ("in.csv", table)], message));
    }
    for (from, to, message) in BAD_MESHES {
        let mesh = match to {
            Some(to) => replaced(MESH, from, to),
            None => MESH[..MESH.find(from).expect("the good mesh goes further")].to_string(),
        };
        let message = format!(":2: mesh.file: {}", message.replace("FILE", "FOLDER/tank.msh"));
        all.push(attempt(vec![("case.toml", WITH_MESH), ("tank.msh", &mesh)], message));
    }
    for (from, to, message) in BAD_WITH_MESH {
        let case = replaced(WITH_MESH, from, to);
        all.push(attempt(vec![("case.toml", &case), ("tank.msh", MESH)], message.to_string()));
    }
    for (surface, message) in BAD_SURFACES {
        let message = format!(":9: obstacle[1].surface: FOLDER/pier.obj: {message}");
        all.push(attempt(vec![("case.toml", WITH_SURFACE), ("pier.obj", surface)], message));
    }
    for (arguments, status, message) in BAD_ARGUMENTS {
        let mut attempt = attempt(vec![("case.toml", GOOD), ("in.csv", TABLE)], String::new());
        attempt.files.push(("binary.toml", vec![b'a', 0xff, 0xfe]));
        attempt.arguments = arguments.to_vec();
        (attempt.status, attempt.message) = (*status, message.to_string());
        all.push(attempt);
    }
    all
}

/// Three at a time: starting the ranks is mostly waiting.
fn refuses_all(ranks: usize) {
    let attempts = attempts();
    assert!(attempts.len() >= 40);
    let (next, wrong) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..3 {
            scope.spawn(|| {
                while let Some(i) = Some(next.fetch_add(1, Ordering::Relaxed))
                    && let Some(attempt) = attempts.get(i)
                {
                    let folder = format!("bad_input/{ranks}/{i}");
                    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(folder);
                    std::fs::create_dir_all(&folder).unwrap();
                    for (name, text) in &attempt.files {
                        std::fs::write(folder.join(name), text).unwrap();
                    }
                    let message = attempt.message.replace("FOLDER", &folder.display().to_string());
                    let found = run(&folder, ranks, &attempt.arguments);
                    if found != Ok((attempt.status, message.clone())) {
                        let expected = (attempt.status, message);
                        let line = format!("expected {expected:?}\n   found {found:?}");
                        wrong.lock().unwrap().push(line);
                    }
                }
            });
        }
    });
    let wrong = wrong.into_inner().unwrap();
    assert!(wrong.is_empty(), "{} of them on {ranks} ranks:\n{}", wrong.len(), wrong.join("\n"));
}

/// Exit status and error output of the program, run in a folder.
fn run(folder: &Path, ranks: usize, arguments: &[&str]) -> Result<(i32, String), String> {
    let program = PathBuf::from(env!("CARGO_BIN_EXE_fcm-fsi"));
    let mut command = if ranks == 1 {
        Command::new(program)
    } else {
        let mut command = Command::new("mpirun");
        // Quiet: mpirun's own words about the exit status are not the program's.
        command.args(["-q", "-n", &ranks.to_string()]).arg(program);
        command
    };
    command
        .args(arguments)
        .current_dir(folder)
        .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
        .env("OMPI_MCA_rmaps_base_oversubscribe", "1")
        .env("OMPI_MCA_mpi_yield_when_idle", "1")
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped());
    let mut child = command.spawn().map_err(|e| e.to_string())?;
    let mut stderr = child.stderr.take().expect("it is piped");
    let reader = std::thread::spawn(move || {
        let mut text = String::new();
        stderr.read_to_string(&mut text).map(|_| text)
    });
    let start = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().map_err(|e| e.to_string())? {
            break status;
        }
        if start.elapsed() > Duration::from_secs(60) {
            let _ = Command::new("kill").arg(child.id().to_string()).status();
            return Err("no end after 60 s".into());
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    let text = reader.join().expect("reading does not panic").map_err(|e| e.to_string())?;
    let code = status.code().ok_or_else(|| format!("{status}: {text}"))?;
    Ok((code, text.trim_end().to_string()))
}
