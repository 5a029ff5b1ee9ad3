//! Case → the shapes of obstacles and bodies, some of them from files.

use super::SetupError;
use super::terrain::ground;
use crate::case::{Case, ObstacleShape, Solid};
use crate::shape::{Shape, Surface};
use io::surface::SurfaceFile;
use partition::Communicator;
use std::path::Path;

/// Those of all obstacles. Collective.
///
/// # Errors
/// A file that cannot be read, a surface that is not closed: the key in the case file.
pub fn obstacles(case: &Case, comm: &Communicator) -> Result<Vec<Shape>, SetupError> {
    let shape = |(i, obstacle): (usize, &crate::case::Obstacle)| {
        let key = format!("obstacle[{i}]");
        match &obstacle.shape {
            ObstacleShape::Solid(solid) => shape(case, &key, solid, comm),
            ObstacleShape::Terrain(path) => terrain(case, &format!("{key}.terrain"), path, comm),
        }
    };
    (1..).zip(&case.obstacles).map(shape).collect()
}

/// That of the table `key`. Collective.
///
/// # Errors
/// A file that cannot be read, a surface that is not closed: the key in the case file.
pub fn shape(
    case: &Case,
    key: &str,
    solid: &Solid,
    comm: &Communicator,
) -> Result<Shape, SetupError> {
    match solid {
        Solid::Cuboid(edges) => Ok(Shape::cuboid(*edges)),
        Solid::Sphere(radius) => Ok(Shape::sphere(*radius)),
        Solid::Cylinder([radius, height]) => Ok(Shape::cylinder(*radius, *height)),
        Solid::Points(points) => Shape::hull(points)
            .map_err(|e| case.source.error(&format!("{key}.points"), e.to_string()).into()),
        Solid::Surface(path) => {
            let key = format!("{key}.surface");
            let file = surface(case, &key, path, comm)?;
            Shape::drawn(Surface::new(&file.vertices, &file.triangles))
                .map_err(|e| case.source.error(&key, format!("{}: {e}", path.display())).into())
        }
    }
}

/// A surface of a file, read by one rank. Collective.
///
/// # Errors
/// A file that cannot be read.
pub fn surface(
    case: &Case,
    key: &str,
    path: &Path,
    comm: &Communicator,
) -> Result<SurfaceFile, SetupError> {
    let read = match comm.rank() {
        0 => io::surface::read(path),
        _ => Ok(SurfaceFile::default()),
    };
    let wrong = |e: io::Error| case.source.error(key, e.to_string());
    let read = comm.agree(read.map_err(wrong)).map_err(SetupError::Elsewhere)?;
    Ok(SurfaceFile {
        vertices: comm.broadcast(0, read.vertices),
        triangles: comm.broadcast(0, read.triangles),
    })
}

/// The ground under a grid of heights, read by one rank. Collective.
fn terrain(case: &Case, key: &str, path: &Path, comm: &Communicator) -> Result<Shape, SetupError> {
    let wrong = |message: String| case.source.error(key, format!("{}: {message}", path.display()));
    let read = match comm.rank() {
        0 => std::fs::read_to_string(path),
        _ => Ok(String::new()),
    };
    let text = read.map_err(|e| wrong(e.to_string()));
    let text = comm.agree(text).map_err(SetupError::Elsewhere)?;
    let bytes = comm.broadcast(0, text.into_bytes());
    let text = String::from_utf8(bytes).expect("what was a text is one");
    let ground = ground(&text).map_err(wrong)?;
    Shape::mesh(ground).map_err(|e| wrong(e.to_string()).into())
}
