//! Structures of a case file.

use super::super::error::Problem;
use super::super::file::{CaseFile, ObstacleTable, WallWord};
use super::super::sources::Sources;
use super::super::{Obstacle, Solid};
use super::values::{Reader, corners, finite_vector, positive, refuse};

/// All obstacles; `viscosity` is the liquid's.
pub fn check(
    file: &CaseFile,
    reader: &Reader,
    sources: &Sources,
    always: &[f64],
    viscosity: f64,
) -> Result<Vec<Obstacle>, Problem> {
    if let (Some(_), [_, ..]) = (&file.prescribed_velocity, &file.obstacle[..]) {
        return refuse("obstacle[1]", "has no effect beside prescribed_velocity");
    }
    let mut obstacles: Vec<Obstacle> = Vec::new();
    for (i, typed) in file.obstacle.iter().enumerate() {
        let key = |name: &str| format!("obstacle[{}].{name}", i + 1);
        let name = &typed.name;
        if name.is_empty() || !name.chars().all(|c| c.is_alphanumeric() || "_-.+".contains(c)) {
            let message = "is part of column names: letters, digits, _ - . +";
            return refuse(key("name"), format!("\"{name}\" {message}"));
        }
        if obstacles.iter().any(|o| o.name == *name) {
            return refuse(key("name"), format!("another obstacle is called \"{name}\" too"));
        }
        if typed.wall == WallWord::NoSlip && viscosity == 0.0 {
            return refuse(key("wall"), "a fluid without viscosity cannot stick: use \"slip\"");
        }
        for (name, is_given, beside, other) in [
            ("velocity", typed.velocity.is_some(), "displacement", typed.displacement.is_some()),
            ("spin", typed.spin.is_some(), "rotation", typed.rotation.is_some()),
        ] {
            if is_given && other {
                return refuse(
                    key(name),
                    format!("says again what {beside} says: give one of them"),
                );
            }
        }
        let formulas = |name: &str, typed| reader.vector(&key(name), typed, &[[0.0; 3]], always);
        obstacles.push(Obstacle {
            name: name.clone(),
            solid: solid(typed, &key, sources)?,
            at: finite_vector(&key("at"), &typed.at)?,
            turned: finite_vector(&key("turned"), &typed.turned)?.map(f64::to_radians),
            outside_in: typed.outside_in,
            slip: typed.wall == WallWord::Slip,
            displacement: formulas("displacement", &typed.displacement)?,
            rotation: formulas("rotation", &typed.rotation)?,
            velocity: formulas("velocity", &typed.velocity)?,
            spin: formulas("spin", &typed.spin)?,
        });
    }
    Ok(obstacles)
}

fn solid(
    typed: &ObstacleTable,
    key: &dyn Fn(&str) -> String,
    sources: &Sources,
) -> Result<Solid, Problem> {
    let all_positive = |name: &str, sizes: &[f64]| {
        sizes.iter().enumerate().try_for_each(|(k, &size)| {
            positive(&format!("{}[{}]", key(name), k + 1), size).map(|_| ())
        })
    };
    let ObstacleTable { cuboid, sphere, cylinder, points, surface, terrain, .. } = typed;
    match (cuboid, sphere, cylinder, points, surface, terrain) {
        (Some(size), None, None, None, None, None) => {
            all_positive("cuboid", size)?;
            Ok(Solid::Cuboid(*size))
        }
        (None, Some(radius), None, None, None, None) => {
            Ok(Solid::Sphere(positive(&key("sphere"), *radius)?))
        }
        (None, None, Some(size), None, None, None) => {
            all_positive("cylinder", size)?;
            Ok(Solid::Cylinder(*size))
        }
        (None, None, None, Some(points), None, None) => {
            Ok(Solid::Points(corners(&key("points"), points)?))
        }
        (None, None, None, None, Some(name), None) => Ok(Solid::Surface(sources.folder.join(name))),
        (None, None, None, None, None, Some(name)) => Ok(Solid::Terrain(sources.folder.join(name))),
        _ => refuse(
            key("name").trim_end_matches(".name"),
            "needs one of cuboid, sphere, cylinder, points, surface, terrain",
        ),
    }
}
