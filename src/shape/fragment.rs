//! A solid cut into the Voronoi cells of random points inside it. Cracks along the faces between them choose
//! their way.
//!
//! Each cell is the solid, cut by the planes halfway to the other points, nearest first, until those left
//! are too far to matter.

use super::{Bounds, Shape, Surface, clip};
use nalgebra::Vector3;

/// Fragments of about `size` [m]; the same seed gives the same ones. Together they fill the solid.
///
/// # Errors
/// In words, where the surface is too rough to be cut.
pub fn fragments(solid: &Shape, size: f64, seed: u64) -> Result<Vec<Surface>, String> {
    let surface = solid.surface(0.25 * size);
    let points = points_inside(solid, &surface, size, seed);
    let mut cells = Vec::with_capacity(points.len());
    for (i, p) in points.iter().enumerate() {
        let mut others: Vec<(f64, usize)> =
            (0..points.len()).filter(|&j| j != i).map(|j| ((points[j] - p).norm(), j)).collect();
        others.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut cell = surface.clone();
        for (distance, j) in others {
            let reach = cell.vertices.iter().map(|v| (v - p).norm());
            if distance > 2.0 * reach.fold(0.0, f64::max) {
                break;
            }
            let axis = (points[j] - p) / distance;
            let bias = axis.dot(&(0.5 * (points[j] + p)));
            cell =
                clip::below(&cell, axis, bias).map_err(|e| format!("fragment {}: {e}", i + 1))?;
        }
        cells.push(cell.closed().map_err(|e| format!("fragment {}: {e}", i + 1))?);
    }
    Ok(cells)
}

/// Random points, about one for each size³, none closer than 0.6 sizes to another.
fn points_inside(solid: &Shape, surface: &Surface, size: f64, seed: u64) -> Vec<Vector3<f64>> {
    const TRIES: usize = 100;
    let bounds = Bounds::of(surface.vertices.iter().copied());
    let wanted = ((surface.volume() / size.powi(3)).round() as usize).max(1);
    let mut random = Random(seed);
    let mut points: Vec<Vector3<f64>> = Vec::with_capacity(wanted);
    let mut tries = 0;
    while points.len() < wanted && (points.is_empty() || tries < TRIES * wanted) {
        tries += 1;
        let share = Vector3::from_fn(|_, _| random.next());
        let x = bounds.min + share.component_mul(&(bounds.max - bounds.min));
        let far = points.iter().all(|p| (p - x).norm() > 0.6 * size);
        if far && solid.distance(x) < 0.0 {
            points.push(x);
        }
    }
    points
}

/// SplitMix64.
struct Random(u64);

impl Random {
    /// Uniform in [0, 1).
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An L: not convex.
    fn angle() -> Surface {
        let outline = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
        let mut vertices: Vec<[f64; 3]> = Vec::new();
        for z in [0.0, 0.8] {
            vertices.extend(outline.map(|[x, y]| [x, y, z]));
        }
        let caps = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]];
        let mut triangles: Vec<[u32; 3]> = Vec::new();
        for [a, b, c] in caps {
            triangles.extend([[a, c, b], [a + 6, b + 6, c + 6]]);
        }
        for k in 0..6 {
            let (a, b) = (k, (k + 1) % 6);
            triangles.extend([[a, b, b + 6], [a, b + 6, a + 6]]);
        }
        Surface::new(&vertices, &triangles)
    }

    #[test]
    fn fragments_fill_the_solid() {
        let solids = [Shape::cuboid([1.0, 0.3, 0.2]), Shape::mesh(angle()).unwrap()];
        for (solid, size) in solids.iter().zip([0.12, 0.5]) {
            let whole = solid.mass_properties();
            let cells = fragments(solid, size, 3).unwrap();
            assert!(cells.len() > 10, "{}", cells.len());
            let volume: f64 = cells.iter().map(Surface::volume).sum();
            assert!((volume / whole.volume - 1.0).abs() < 1e-12, "{volume}, not {}", whole.volume);
            let moment: Vector3<f64> = cells
                .iter()
                .map(|c| Shape::mesh(c.clone()).unwrap().mass_properties())
                .map(|m| m.volume * m.centroid)
                .sum();
            assert!((moment / whole.volume - whole.centroid).norm() < 1e-12);
            assert_eq!(cells, fragments(solid, size, 3).unwrap());
            assert_ne!(cells, fragments(solid, size, 4).unwrap());
        }
    }
}
