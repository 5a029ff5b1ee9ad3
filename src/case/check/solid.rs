//! The shape that `[[obstacle]]` or `[[body]]` says.

use super::super::Solid;
use super::super::error::Problem;
use super::values::{corners, positive};
use std::path::Path;

/// What a table says of it: one of these.
pub struct Said<'a> {
    pub cuboid: Option<[f64; 3]>,
    pub sphere: Option<f64>,
    pub cylinder: Option<[f64; 2]>,
    pub points: Option<&'a [[f64; 3]]>,
    pub surface: Option<&'a str>,
}

/// The shape in the table `key`; `None` if it does not say one and one only.
pub fn solid(key: &str, said: &Said, folder: &Path) -> Result<Option<Solid>, Problem> {
    let all_positive = |name: &str, sizes: &[f64]| {
        sizes.iter().enumerate().try_for_each(|(k, &size)| {
            positive(&format!("{key}.{name}[{}]", k + 1), size).map(|_| ())
        })
    };
    let Said { cuboid, sphere, cylinder, points, surface } = said;
    Ok(Some(match (cuboid, sphere, cylinder, points, surface) {
        (Some(edges), None, None, None, None) => {
            all_positive("cuboid", edges)?;
            Solid::Cuboid(*edges)
        }
        (None, Some(radius), None, None, None) => {
            Solid::Sphere(positive(&format!("{key}.sphere"), *radius)?)
        }
        (None, None, Some(size), None, None) => {
            all_positive("cylinder", size)?;
            Solid::Cylinder(*size)
        }
        (None, None, None, Some(points), None) => {
            Solid::Points(corners(&format!("{key}.points"), points)?)
        }
        (None, None, None, None, Some(name)) => Solid::Surface(folder.join(name)),
        _ => return Ok(None),
    }))
}
