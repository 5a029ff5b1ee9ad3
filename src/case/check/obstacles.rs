//! Structures of a case file.

use super::super::error::Problem;
use super::super::file::{CaseFile, ObstacleTable, WallWord};
use super::super::{Obstacle, ObstacleShape};
use super::solid::{Said, solid};
use super::values::{Reader, finite_vector, refuse};
use std::path::Path;

/// All obstacles; `viscosity` is the liquid's.
pub fn check(
    file: &CaseFile,
    reader: &Reader,
    folder: &Path,
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
            shape: shape(&format!("obstacle[{}]", i + 1), typed, folder)?,
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

/// The shape in the table `key`.
fn shape(key: &str, typed: &ObstacleTable, folder: &Path) -> Result<ObstacleShape, Problem> {
    let said = Said {
        cuboid: typed.cuboid,
        sphere: typed.sphere,
        cylinder: typed.cylinder,
        points: typed.points.as_deref(),
        surface: typed.surface.as_deref(),
    };
    match (solid(key, &said, folder)?, &typed.terrain) {
        (Some(solid), None) => Ok(ObstacleShape::Solid(solid)),
        (None, Some(name)) => Ok(ObstacleShape::Terrain(folder.join(name))),
        _ => refuse(key, "needs one of cuboid, sphere, cylinder, points, surface, terrain"),
    }
}
