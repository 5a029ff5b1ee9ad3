//! The sections of an MSH file, as tags; versions 2.2 and 4.1 differ in how they group elements.

use super::cursor::Cursor;
use crate::Error;
use std::collections::BTreeMap;

/// The two versions read.
#[derive(Clone, Copy, PartialEq)]
pub enum Version {
    V2,
    V4,
}

/// How a triangle says which physical surface it is on.
#[derive(Clone, Copy)]
pub enum Group {
    /// Number of the physical surface, 0: none (2.2).
    Physical(u32),
    /// Tag of the geometric surface (4.1).
    Entity(i32),
}

type Triangles = Vec<([u64; 3], Group)>;
type Tets = Vec<[u64; 4]>;

/// What the file says, before tags are resolved.
#[derive(Default)]
pub struct Raw {
    /// Name by (dimension, number).
    pub names: BTreeMap<(u32, u32), String>,
    /// Physical numbers of each geometric surface (4.1).
    pub surfaces: BTreeMap<i32, Vec<u32>>,
    /// Tags and coordinates.
    pub nodes: Option<(Vec<u64>, Vec<[f64; 3]>)>,
    /// Triangles and tetrahedra, by node tags.
    pub elements: Option<(Triangles, Tets)>,
}

const EXPORT: &str = "save it with Mesh.MshFileVersion = 4.1 (or 2.2)";

/// `$MeshFormat`: version, ASCII or binary, size of numbers, byte order.
pub fn format(c: &mut Cursor) -> Result<Version, Error> {
    match c.section()?.as_deref() {
        Some("MeshFormat") => (),
        Some("NOD") => return Err(c.fail(format!("MSH version 1 is not read: {EXPORT}"))),
        _ => return Err(c.fail("is not a Gmsh mesh: it does not begin with $MeshFormat")),
    }
    let version = match c.word("the version")? {
        "2.2" => Version::V2,
        "4.1" => Version::V4,
        other => return Err(c.fail(format!("MSH version {other} is not read: {EXPORT}"))),
    };
    let binary = match c.word("0 (ASCII) or 1 (binary)")? {
        "0" => false,
        "1" => true,
        other => return Err(c.fail(format!("0 (ASCII) or 1 (binary) expected, not {other}"))),
    };
    let size: u32 = c.text("the size of numbers")?;
    if size != 8 {
        return Err(c.fail(format!("numbers of {size} bytes are not read: {EXPORT}, on 64 bits")));
    }
    c.binary = binary;
    if binary {
        c.newline()?;
        let one = c.int("the number 1")?;
        if one != 1 {
            return Err(c.fail(if one == 1i32.swap_bytes() {
                "was written on a big-endian machine: save it as ASCII".to_string()
            } else {
                format!("the number 1, which tells the byte order, is {one}")
            }));
        }
    }
    c.end_of("MeshFormat")?;
    Ok(version)
}

/// `$PhysicalNames`: text in every format.
pub fn physical_names(c: &mut Cursor, raw: &mut Raw) -> Result<(), Error> {
    let count: u64 = c.text("the number of names")?;
    for _ in 0..count {
        let dimension: u32 = c.text("the dimension of a physical group")?;
        let number: u32 = c.text("the number of a physical group")?;
        let name = c.line()?;
        let name = name.strip_prefix('"').and_then(|n| n.strip_suffix('"'));
        let Some(name) = name.filter(|n| !n.is_empty()) else {
            return Err(c.fail(format!("physical group {number}: a name in quotes expected")));
        };
        if raw.names.insert((dimension, number), name.into()).is_some_and(|old| old != name) {
            return Err(c.fail(format!("physical group {number} has two names")));
        }
    }
    Ok(())
}

/// `$Entities` of 4.1: which physical surfaces each geometric surface belongs to.
pub fn entities(c: &mut Cursor, raw: &mut Raw) -> Result<(), Error> {
    let mut counts = [0; 4];
    for n in &mut counts {
        *n = c.size("the number of points, curves, surfaces or volumes")?;
    }
    for (dimension, count) in counts.into_iter().enumerate() {
        for _ in 0..count {
            let tag = c.int("the tag of an entity")?;
            // A place, or the corners of the bounding box.
            for _ in 0..if dimension == 0 { 3 } else { 6 } {
                c.double("a coordinate of an entity")?;
            }
            let physicals = c.size("a number of physical groups")?;
            let mut numbers = Vec::new();
            for _ in 0..physicals {
                // A minus sign means the opposite orientation.
                numbers.push(c.int("the number of a physical group")?.unsigned_abs());
            }
            if dimension == 2 {
                raw.surfaces.insert(tag, numbers);
            }
            if dimension > 0 {
                for _ in 0..c.size("a number of bounding entities")? {
                    c.int("the tag of a bounding entity")?;
                }
            }
        }
    }
    Ok(())
}

/// `$Nodes`.
pub fn nodes(c: &mut Cursor, version: Version, raw: &mut Raw) -> Result<(), Error> {
    if raw.nodes.is_some() {
        return Err(c.fail("a second section $Nodes"));
    }
    let (mut tags, mut places) = (Vec::new(), Vec::new());
    let announced = match version {
        Version::V2 => {
            let count: u64 = c.text("the number of nodes")?;
            c.newline()?;
            let n = c.count(count, 28, "nodes")?;
            tags.reserve_exact(n);
            places.reserve_exact(n);
            for _ in 0..n {
                let tag = c.int("the number of a node")?;
                tags.push(positive(c, tag, "node")?);
                places.push(place(c, tags[tags.len() - 1])?);
            }
            count
        }
        Version::V4 => {
            let blocks = c.size("the number of blocks")?;
            let count = c.size("the number of nodes")?;
            let n = c.count(count, 32, "nodes")?;
            tags.reserve_exact(n);
            places.reserve_exact(n);
            smallest_and_largest(c)?;
            for _ in 0..blocks {
                let dimension = c.int("the dimension of an entity")?;
                c.int("the tag of an entity")?;
                let parametric = c.int("0 or 1 (parametric)")? != 0;
                let size = c.size("the number of nodes of a block")?;
                let size = c.count(size, 32, "nodes in a block")?;
                for _ in 0..size {
                    tags.push(c.size("the tag of a node")?);
                }
                for i in tags.len() - size..tags.len() {
                    places.push(place(c, tags[i])?);
                    for _ in 0..if parametric { dimension.clamp(0, 3) } else { 0 } {
                        c.double("a parametric coordinate")?;
                    }
                }
            }
            count
        }
    };
    if announced != tags.len() as u64 {
        let found = tags.len();
        return Err(c.fail(format!("$Nodes announces {announced} nodes but holds {found}")));
    }
    raw.nodes = Some((tags, places));
    Ok(())
}

/// Tags may have gaps: their range says nothing.
fn smallest_and_largest(c: &mut Cursor) -> Result<(), Error> {
    c.size("the smallest tag")?;
    c.size("the largest tag")?;
    Ok(())
}

fn positive(c: &Cursor, tag: i32, what: &str) -> Result<u64, Error> {
    u64::try_from(tag).map_err(|_| c.fail(format!("{what} {tag}: a positive number expected")))
}

fn place(c: &mut Cursor, tag: u64) -> Result<[f64; 3], Error> {
    let mut x = [0.0; 3];
    for x in &mut x {
        *x = c.double("a coordinate")?;
        if !x.is_finite() {
            return Err(c.fail(format!("node {tag}: its coordinate is {x}")));
        }
    }
    Ok(x)
}

/// `$Elements`.
pub fn elements(c: &mut Cursor, version: Version, raw: &mut Raw) -> Result<(), Error> {
    if raw.elements.is_some() {
        return Err(c.fail("a second section $Elements"));
    }
    raw.elements = Some(match version {
        Version::V2 => elements_v2(c)?,
        Version::V4 => elements_v4(c)?,
    });
    Ok(())
}

fn elements_v2(c: &mut Cursor) -> Result<(Triangles, Tets), Error> {
    let (mut triangles, mut tets) = (Vec::new(), Vec::new());
    let announced: u64 = c.text("the number of elements")?;
    c.newline()?;
    c.count(announced, 8, "elements")?;
    let mut found = 0;
    while found < announced {
        // Text: number, type, tags. Binary: a header for several elements, then number and tags.
        let mut element = 0;
        if !c.binary {
            element = c.int("the number of an element")?;
        }
        let kind = c.int("the type of an element")?;
        let follow = if c.binary { c.int("how many elements follow")? } else { 1 };
        let tags = c.int("the number of tags of an element")?;
        let follow = u64::try_from(follow).ok().filter(|n| (1..=announced - found).contains(n));
        let (Some(follow), Ok(tags)) = (follow, u32::try_from(tags)) else {
            return Err(c.fail(format!(
                "impossible counts in an element header; {found} elements \
                                       of {announced} were read"
            )));
        };
        found += follow;
        for _ in 0..follow {
            if c.binary {
                element = c.int("the number of an element")?;
            }
            let mut physical = 0;
            for t in 0..tags {
                let tag = c.int("a tag of an element")?;
                if t == 0 {
                    physical = tag.unsigned_abs();
                }
            }
            let mut corner = || {
                let tag = c.int("a node of an element")?;
                positive(c, tag, "node")
            };
            match kind {
                POINT | LINE => {
                    for _ in 0..if kind == POINT { 1 } else { 2 } {
                        corner()?;
                    }
                }
                TRIANGLE => {
                    triangles.push(([corner()?, corner()?, corner()?], Group::Physical(physical)))
                }
                TET => tets.push([corner()?, corner()?, corner()?, corner()?]),
                other => return Err(unsupported(c, element as u64, other)),
            }
        }
    }
    Ok((triangles, tets))
}

fn elements_v4(c: &mut Cursor) -> Result<(Triangles, Tets), Error> {
    let (mut triangles, mut tets) = (Vec::new(), Vec::new());
    let blocks = c.size("the number of blocks")?;
    let announced = c.size("the number of elements")?;
    smallest_and_largest(c)?;
    let mut found: u64 = 0;
    for _ in 0..blocks {
        c.int("the dimension of an entity")?;
        let entity = c.int("the tag of an entity")?;
        let kind = c.int("the type of the elements of a block")?;
        let size = c.size("the number of elements of a block")?;
        let size = c.count(size, 16, "elements in a block")?;
        found += size as u64;
        for _ in 0..size {
            let element = c.size("the tag of an element")?;
            let mut corner = || c.size("a node of an element");
            match kind {
                POINT | LINE => {
                    for _ in 0..if kind == POINT { 1 } else { 2 } {
                        corner()?;
                    }
                }
                TRIANGLE => {
                    triangles.push(([corner()?, corner()?, corner()?], Group::Entity(entity)));
                }
                TET => tets.push([corner()?, corner()?, corner()?, corner()?]),
                other => return Err(unsupported(c, element, other)),
            }
        }
    }
    if found != announced {
        return Err(c.fail(format!("$Elements announces {announced} elements but holds {found}")));
    }
    Ok((triangles, tets))
}

const LINE: i32 = 1;
const TRIANGLE: i32 = 2;
const TET: i32 = 4;
const POINT: i32 = 15;

fn unsupported(c: &Cursor, element: u64, kind: i32) -> Error {
    const FIRST_ORDER: &str = "mesh with Mesh.ElementOrder = 1 (gmsh -order 1)";
    const SIMPLICES: &str = "only tetrahedra and triangles are read: remove Recombine";
    let (name, todo) = match kind {
        3 => ("a quadrangle", SIMPLICES),
        5 => ("a hexahedron", SIMPLICES),
        6 => ("a prism", SIMPLICES),
        7 => ("a pyramid", SIMPLICES),
        8 => ("a second-order line", FIRST_ORDER),
        9 => ("a second-order triangle", FIRST_ORDER),
        11 => ("a second-order tetrahedron", FIRST_ORDER),
        10 | 12..=14 | 16..=19 => {
            ("a second-order quadrangle, hexahedron, prism or pyramid", SIMPLICES)
        }
        20..=31 => ("of order three or more", FIRST_ORDER),
        _ => ("of a type", "only first-order tetrahedra and triangles are read"),
    };
    c.fail(format!("element {element} is {name} (type {kind}): {todo}"))
}
