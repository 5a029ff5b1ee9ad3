//! The tables about bodies.

use super::super::bodies::{
    Bodies, Body, BodyMotion, Bond, Compression, ContactLaw, Coupling, Pieces, Wall, WallShape,
};
use super::super::error::Problem;
use super::super::file::bodies::{BodyTable, Freedom, WallTable};
use super::super::file::{CaseFile, Condition, Expression};
use super::super::formula::Formula;
use super::super::nearest::did_you_mean;
use super::super::{MeshSource, Obstacle, Solid};
use super::block;
use super::solid::{Said, solid};
use super::values::{
    Reader, at_least_one, between, finite_vector, not_negative, positive, refuse, share,
};
use std::path::Path;

/// The material of whatever does not name one.
const PLAIN: &str = "plain";

/// Bodies, if there are any.
pub fn check(
    file: &mut CaseFile,
    paper: bool,
    reader: &Reader,
    folder: &Path,
    mesh: &MeshSource,
    obstacles: &[Obstacle],
) -> Result<Option<Bodies>, Problem> {
    let Some(table) = &mut file.bodies else {
        for (key, there) in [
            ("body", !file.body.is_empty()),
            ("wall", !file.wall.is_empty()),
            ("contact", !file.contact.is_empty()),
        ] {
            if there {
                return refuse(key, "needs the table [bodies], with at least sphere_radius");
            }
        }
        return Ok(None);
    };
    if file.body.is_empty() {
        return refuse("bodies", "there are no bodies: give at least one [[body]]");
    }
    let sphere_radius = positive("bodies.sphere_radius", table.sphere_radius)?;
    let spacing = *table.sphere_spacing.get_or_insert(2.0 * sphere_radius);
    let bond = match &mut table.bond {
        None => None,
        Some(bond) => {
            let compression = if paper { Compression::Contact } else { Compression::Bond };
            let damping = *bond.damping.get_or_insert(if paper { 0.0 } else { 0.05 });
            let gap = *bond.gap.get_or_insert(0.01 * sphere_radius);
            Some(Bond {
                strength: positive("bodies.bond.strength", bond.strength)?,
                opening: positive("bodies.bond.opening", bond.opening)?,
                area: share("bodies.bond.area", bond.area)?,
                points: at_least_one("bodies.bond.points", bond.points)?,
                unloading: bond.unloading,
                compression: *bond.compression.get_or_insert(compression),
                damping: not_negative("bodies.bond.damping", damping)?,
                gap: not_negative("bodies.bond.gap", gap)?,
            })
        }
    };
    let contact = contact_law("bodies", table.stiffness, table.restitution, table.friction_angle)?;
    let mut bodies = Bodies {
        sphere_radius,
        sphere_spacing: positive("bodies.sphere_spacing", spacing)?,
        materials: vec![PLAIN.into()],
        contact,
        contacts: Vec::new(),
        no_tension: table.no_tension,
        time_step: table.time_step.map(|h| positive("bodies.time_step", h)).transpose()?,
        fraction: between("bodies.fraction", table.fraction, 0.0, 1.0)?,
        settle: not_negative("bodies.settle", table.settle)?,
        ranks: table.ranks.map(|n| at_least_one("bodies.ranks", n)).transpose()?,
        coupling: *table.coupling.get_or_insert(if paper {
            Coupling::Loose
        } else {
            Coupling::Auto
        }),
        base_pressure: table.base_pressure,
        slip: table.slip,
        bond,
        bodies: Vec::new(),
        walls: Vec::new(),
    };
    for (i, typed) in file.wall.iter().enumerate() {
        let wall = wall(&format!("wall[{}]", i + 1), typed, &mut bodies, folder)?;
        bodies.walls.push(wall);
    }
    for (i, name) in table.walls.iter().enumerate() {
        let key = format!("bodies.walls[{}]", i + 1);
        let wall = named_wall(&key, name, &bodies.walls, mesh, obstacles)?;
        bodies.walls.push(wall);
    }
    for (i, typed) in file.body.iter().enumerate() {
        let body = body(&format!("body[{}]", i + 1), typed, &mut bodies, reader, folder)?;
        bodies.bodies.push(body);
    }
    for (i, typed) in file.contact.iter().enumerate() {
        let key = format!("contact[{}]", i + 1);
        let mut between = [0; 2];
        for (k, name) in typed.between.iter().enumerate() {
            let names: Vec<&str> = bodies.materials.iter().map(|m| &**m).collect();
            let Some(found) = names.iter().position(|n| n == name) else {
                let hint = did_you_mean(name, &names, "materials");
                let message = format!("nothing is made of \"{name}\"; {hint}");
                return refuse(format!("{key}.between[{}]", k + 1), message);
            };
            between[k] = found as u32;
        }
        let law = contact_law(
            &key,
            typed.stiffness.unwrap_or(table.stiffness),
            typed.restitution.unwrap_or(table.restitution),
            typed.friction_angle.unwrap_or(table.friction_angle),
        )?;
        bodies.contacts.push((between, law));
    }
    Ok(Some(bodies))
}

fn contact_law(
    key: &str,
    stiffness: f64,
    restitution: f64,
    angle: f64,
) -> Result<ContactLaw, Problem> {
    let key = |name: &str| format!("{key}.{name}");
    not_negative(&key("restitution"), restitution)?;
    if restitution > 1.0 {
        return refuse(key("restitution"), format!("must be at most 1, is {restitution}"));
    }
    not_negative(&key("friction_angle"), angle)?;
    if angle >= 90.0 {
        return refuse(key("friction_angle"), format!("must be below 90 degrees, is {angle}"));
    }
    let stiffness = positive(&key("stiffness"), stiffness)?;
    Ok(ContactLaw { stiffness, restitution, friction: angle.to_radians().tan() })
}

fn material(bodies: &mut Bodies, name: Option<&String>) -> u32 {
    let Some(name) = name else { return 0 };
    let found = bodies.materials.iter().position(|m| m == name);
    found.unwrap_or_else(|| {
        bodies.materials.push(name.clone());
        bodies.materials.len() - 1
    }) as u32
}

fn new_name<'a>(
    key: &str,
    name: &str,
    mut others: impl Iterator<Item = &'a String>,
) -> Result<String, Problem> {
    let plain = |c: char| c.is_alphanumeric() || "_-.+".contains(c);
    if name.is_empty() || !name.chars().all(plain) {
        return refuse(format!("{key}.name"), "is letters, digits, _ - . +");
    }
    if others.any(|other| other == name) {
        return refuse(format!("{key}.name"), format!("another one is called \"{name}\" too"));
    }
    Ok(name.into())
}

fn wall(key: &str, typed: &WallTable, bodies: &mut Bodies, folder: &Path) -> Result<Wall, Problem> {
    let name = new_name(key, &typed.name, bodies.walls.iter().map(|w| &w.name))?;
    let surface = match (&typed.plane, &typed.surface) {
        (Some(plane), None) => {
            let point = finite_vector(&format!("{key}.plane.point"), &plane.point)?;
            let normal = finite_vector(&format!("{key}.plane.normal"), &plane.normal)?;
            let length = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
            if length == 0.0 {
                return refuse(format!("{key}.plane.normal"), "needs a direction, is 0");
            }
            WallShape::Plane { point, normal: normal.map(|n| n / length) }
        }
        (None, Some(name)) => WallShape::Surface(folder.join(name)),
        _ => return refuse(key, "needs one of plane, surface"),
    };
    Ok(Wall { name, material: material(bodies, typed.material.as_ref()), surface })
}

/// A boundary or an obstacle as a wall. Names of a mesh's file are looked up when it has been read.
fn named_wall(
    key: &str,
    name: &str,
    walls: &[Wall],
    mesh: &MeshSource,
    obstacles: &[Obstacle],
) -> Result<Wall, Problem> {
    if walls.iter().any(|wall| wall.name == name) {
        return refuse(key, format!("another wall is called \"{name}\" too"));
    }
    let boundaries = match mesh {
        MeshSource::Box(block) => block::boundary_names(block),
        MeshSource::Gmsh(_) => vec![name],
        MeshSource::Nothing => Vec::new(),
    };
    let surface = match obstacles.iter().position(|o| o.name == name) {
        Some(_) if matches!(mesh, MeshSource::Box(_)) && boundaries.contains(&name) => {
            return refuse(key, format!("both a boundary and an obstacle are called \"{name}\""));
        }
        Some(i) if obstacles[i].is_led() => {
            return refuse(
                key,
                format!("\"{name}\" moves, walls do not: lead a [[body]] in its place"),
            );
        }
        Some(i) => WallShape::Obstacle(i),
        None if boundaries.contains(&name) => WallShape::Boundary,
        None => {
            let others = obstacles.iter().map(|o| &*o.name);
            let names: Vec<&str> = boundaries.into_iter().chain(others).collect();
            let hint = match names[..] {
                [] => ": there is no mesh".into(),
                _ => format!("; {}", did_you_mean(name, &names, "names")),
            };
            let message = format!("no boundary or obstacle is called \"{name}\"{hint}");
            return refuse(key, message);
        }
    };
    Ok(Wall { name: name.into(), material: 0, surface })
}

fn body(
    key: &str,
    typed: &BodyTable,
    bodies: &mut Bodies,
    reader: &Reader,
    folder: &Path,
) -> Result<Body, Problem> {
    let at = |name: &str| format!("{key}.{name}");
    let name = new_name(key, &typed.name, bodies.bodies.iter().map(|b| &b.name))?;
    let said = Said {
        cuboid: typed.cuboid,
        sphere: typed.sphere,
        cylinder: typed.cylinder,
        points: typed.points.as_deref(),
        surface: typed.surface.as_deref(),
    };
    let Some(shape) = solid(key, &said, folder)? else {
        return refuse(key, "needs one of cuboid, sphere, cylinder, points, surface");
    };
    let pieces = pieces(key, typed, &shape, reader)?;
    let (count, spacing) = match &typed.copies {
        None => ([1; 3], [0.0; 3]),
        Some(copies) => {
            for (i, n) in copies.count.iter().enumerate() {
                at_least_one(&at(&format!("copies.count[{}]", i + 1)), *n)?;
            }
            (copies.count, finite_vector(&at("copies.spacing"), &copies.spacing)?)
        }
    };
    let mut ignores = Vec::new();
    for (i, wall) in typed.ignores.iter().enumerate() {
        let names: Vec<&str> = bodies.walls.iter().map(|w| &*w.name).collect();
        let Some(found) = names.iter().position(|n| n == wall) else {
            let hint = did_you_mean(wall, &names, "walls");
            let message = format!("there is no wall \"{wall}\"; {hint}");
            return refuse(at(&format!("ignores[{}]", i + 1)), message);
        };
        ignores.push(found as u32);
    }
    if typed.bonded && bodies.bond.is_none() {
        return refuse(at("bonded"), "needs the table [bodies.bond], with strength and opening");
    }
    for (i, point) in typed.track.iter().enumerate() {
        finite_vector(&at(&format!("track[{}]", i + 1)), point)?;
    }
    let times = [0.0, 0.5 * reader.end, reader.end];
    let formulas = |name: &str, typed: &Option<[Expression; 3]>| {
        let nothing = || [(); 3].map(|()| Formula::constant(0.0));
        Ok(reader.vector(&at(name), typed, &[[0.0; 3]], &times)?.unwrap_or_else(nothing))
    };
    let applied = if typed.force.is_some() || typed.torque.is_some() {
        let [fx, fy, fz] = formulas("force", &typed.force)?;
        let [tx, ty, tz] = formulas("torque", &typed.torque)?;
        Some([fx, fy, fz, tx, ty, tz])
    } else {
        None
    };
    let sphere_radius = typed.sphere_radius.unwrap_or(bodies.sphere_radius);
    Ok(Body {
        name,
        shape,
        pieces,
        at: finite_vector(&at("at"), &typed.at)?,
        turned: finite_vector(&at("turned"), &typed.turned)?.map(f64::to_radians),
        copies: (count, spacing),
        density: positive(&at("density"), typed.density)?,
        material: material(bodies, typed.material.as_ref()),
        velocity: finite_vector(&at("velocity"), &typed.velocity)?,
        spin: finite_vector(&at("spin"), &typed.spin)?,
        motion: motion(key, typed, reader, formulas)?,
        applied,
        ignores,
        bonded: typed.bonded,
        sphere_radius: positive(&at("sphere_radius"), sphere_radius)?,
        track: typed.track.clone(),
    })
}

fn motion(
    key: &str,
    typed: &BodyTable,
    reader: &Reader,
    formulas: impl Fn(&str, &Option<[Expression; 3]>) -> Result<[Formula; 3], Problem>,
) -> Result<BodyMotion, Problem> {
    let at = |name: &str| format!("{key}.{name}");
    if typed.led_velocity.is_some() || typed.led_spin.is_some() {
        let others = [
            ("fixed", typed.fixed.is_some()),
            ("locked", !typed.locked.is_empty()),
            ("velocity", typed.velocity != [0.0; 3]),
            ("spin", typed.spin != [0.0; 3]),
            ("force", typed.force.is_some()),
            ("torque", typed.torque.is_some()),
        ];
        if let Some((name, _)) = others.iter().find(|(_, there)| *there) {
            return refuse(at(name), "has no effect on a body that is led");
        }
        return Ok(BodyMotion::Led {
            velocity: formulas("led_velocity", &typed.led_velocity)?,
            spin: formulas("led_spin", &typed.led_spin)?,
        });
    }
    let mut locked = [false; 6];
    for freedom in &typed.locked {
        let order = [Freedom::X, Freedom::Y, Freedom::Z, Freedom::Rx, Freedom::Ry, Freedom::Rz];
        locked[order.iter().position(|f| f == freedom).expect("six freedoms")] = true;
    }
    let nowhere = Condition::Always(false);
    let fixed = typed.fixed.as_ref().unwrap_or(&nowhere);
    let fixed = reader.condition(&at("fixed"), fixed, &[], &[])?;
    Ok(BodyMotion::Free { locked, fixed })
}

fn pieces(key: &str, typed: &BodyTable, shape: &Solid, reader: &Reader) -> Result<Pieces, Problem> {
    let at = |name: &str| format!("{key}.{name}");
    match (&typed.grid, &typed.fragments) {
        (Some(_), Some(_)) => refuse(at("fragments"), "a body is cut by a grid or into fragments"),
        (Some(count), None) => {
            if !matches!(shape, Solid::Cuboid(_)) {
                return refuse(at("grid"), "cuts a cuboid only");
            }
            for (i, n) in count.iter().enumerate() {
                at_least_one(&at(&format!("grid[{}]", i + 1)), *n)?;
            }
            let opening = |(i, typed): (usize, &Condition)| {
                reader.condition(&at(&format!("openings[{}]", i + 1)), typed, &[], &[])
            };
            let openings = typed.openings.iter().enumerate().map(opening);
            let openings = openings.collect::<Result<_, _>>()?;
            Ok(Pieces::Grid { count: *count, hollow: typed.hollow, openings })
        }
        (None, _) if typed.hollow => refuse(at("hollow"), "leaves blocks out of a grid"),
        (None, _) if !typed.openings.is_empty() => {
            refuse(at("openings"), "leave blocks out of a grid")
        }
        (None, Some(typed)) => {
            if matches!(shape, Solid::Sphere(_) | Solid::Cylinder(_)) {
                return refuse(at("fragments"), "are made of a cuboid, points or a surface");
            }
            let size = positive(&at("fragments.size"), typed.size)?;
            Ok(Pieces::Fragments { size, seed: typed.seed })
        }
        (None, None) => Ok(Pieces::One),
    }
}
