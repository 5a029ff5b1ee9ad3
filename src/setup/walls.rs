//! Case → what bodies bump into: planes, surfaces of files, boundaries of the mesh, obstacles.

use super::SetupError;
use super::solids::surface;
use crate::bodies::walls::{Wall, WallSurface};
use crate::case::bodies::WallShape;
use crate::case::nearest::did_you_mean;
use crate::case::{Case, bodies as case};
use crate::cut::level_set::Solid;
use crate::mesh::MeshPart;
use nalgebra::Vector3;

/// A boundary is flat if its nodes are this close to a plane, over the size of the mesh.
const FLAT: f64 = 1e-9;

type Triangle = [[f64; 3]; 3];

/// All walls of a case, the same on every rank. `solids`: its obstacles. Collective.
///
/// # Errors
/// A surface that cannot be read, a name that the mesh does not have.
pub fn walls(
    case: &Case,
    asked: &case::Bodies,
    part: &MeshPart,
    solids: &[Solid],
) -> Result<Vec<Wall>, SetupError> {
    let mut walls = Vec::new();
    // Walls with a name alone come after those with a table.
    let tables = asked.walls.iter().take_while(|w| !w.has_no_table()).count();
    let refused = |i: usize, message: String| {
        case.source.error(&format!("bodies.walls[{}]", i - tables + 1), message)
    };
    for (i, wall) in asked.walls.iter().enumerate() {
        let file_key = || format!("wall[{}].surface", i + 1);
        let surface = match &wall.surface {
            WallShape::Plane { point, normal } => {
                let normal = Vector3::from(*normal);
                WallSurface::Plane { normal, offset: normal.dot(&Vector3::from(*point)) }
            }
            WallShape::Surface(path) => {
                let file = surface(case, &file_key(), path, &part.comm)?;
                WallSurface::triangles(&file.vertices, &file.triangles)
                    .map_err(|message| case.source.error(&file_key(), message))?
            }
            WallShape::Boundary => {
                boundary(part, &wall.name).map_err(|message| refused(i, message))?
            }
            WallShape::Obstacle(_) if part.mesh.boundary_names.contains(&wall.name) => {
                let message =
                    format!("both a boundary and an obstacle are called \"{}\"", wall.name);
                return Err(refused(i, message).into());
            }
            WallShape::Obstacle(o) => {
                let Solid { shape, pose, outside_in } = solids[*o];
                WallSurface::Solid { shape: shape.clone(), pose, outside_in }
            }
        };
        walls.push(Wall { name: wall.name.clone(), material: wall.material, surface });
    }
    Ok(walls)
}

/// A boundary of the mesh: a plane, if it is flat, the whole mesh is on one side and nothing else of the mesh's
/// boundary is in that plane; else its triangles.
fn boundary(part: &MeshPart, name: &str) -> Result<WallSurface, String> {
    let names: Vec<&str> = part.mesh.boundary_names.iter().map(|n| &**n).collect();
    let Some(number) = names.iter().position(|n| *n == name) else {
        let hint = did_you_mean(name, &names, "names");
        return Err(format!("the mesh has no boundary of this name; {hint}"));
    };
    let triangles = triangles(part, number as u32);
    if triangles.is_empty() {
        return Err("this boundary has no faces".into());
    }
    // Triangles look out of the fluid, walls at the bodies.
    let area: Vector3<f64> = triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(Vector3::from);
            (c - a).cross(&(b - a))
        })
        .sum();
    if let Some(normal) = area.try_normalize(0.0) {
        let offset = normal.dot(&Vector3::from(triangles[0][0]));
        let height = |x: &[f64; 3]| normal.dot(&Vector3::from(*x)) - offset;
        let nodes = &part.mesh.nodes;
        let lowest = part.comm.min(nodes.iter().map(height).fold(f64::INFINITY, f64::min));
        let highest = part.comm.max(nodes.iter().map(height).fold(0.0, f64::max));
        let flat = |x: &[f64; 3]| height(x).abs() <= FLAT * (highest - lowest);
        let faces = &part.mesh.boundary[..part.n_owned_faces];
        let others = faces.iter().filter(|f| f.name != number as u32);
        let beside = others.filter(|f| f.nodes.iter().all(|&n| flat(&nodes[n as usize]))).count();
        if part.comm.sum_u64(beside as u64) == 0
            && lowest >= -FLAT * (highest - lowest)
            && triangles.iter().flatten().all(flat)
        {
            return Ok(WallSurface::Plane { normal, offset });
        }
    }
    let corners: Vec<[f64; 3]> = triangles.concat();
    let numbers: Vec<[u32; 3]> =
        (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    WallSurface::triangles(&corners, &numbers)
}

/// All triangles of a boundary on every rank, in an order that does not depend on ranks.
fn triangles(part: &MeshPart, name: u32) -> Vec<Triangle> {
    let faces = part.mesh.boundary[..part.n_owned_faces].iter().filter(|f| f.name == name);
    let (mut ids, mut places): (Vec<[u64; 3]>, Vec<Triangle>) = (Vec::new(), Vec::new());
    for face in faces {
        let of = face.nodes.map(|n| part.nodes.global[n as usize]);
        // From the lowest node on: where a face begins may depend on its element.
        let first = (0..3).min_by_key(|&k| of[k]).expect("three corners");
        let turned: [usize; 3] = std::array::from_fn(|k| (first + k) % 3);
        ids.push(turned.map(|k| of[k]));
        places.push(turned.map(|k| part.mesh.nodes[face.nodes[k] as usize]));
    }
    let ids = part.comm.all_gather(&ids).concat();
    let places = part.comm.all_gather(&places).concat();
    let mut all: Vec<_> = ids.into_iter().zip(places).collect();
    all.sort_unstable_by_key(|(id, _)| *id);
    all.into_iter().map(|(_, place)| place).collect()
}
