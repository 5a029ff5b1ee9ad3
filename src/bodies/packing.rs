//! Spheres that feel for contact: just inside a shape, tangent to its surface.
//!
//! Spheres centred on the surface (as a drawing would have them) overlap those of the neighbour, and
//! push the two apart as soon as the bond between them breaks.

use crate::shape::{Mesh, Shape};
use nalgebra::Vector3;
use std::f64::consts::TAU;

/// One sphere of a cluster, in the cluster's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// [m]
    pub centre: Vector3<f64>,
    /// [m]
    pub radius: f64,
}

/// The spheres do not fit.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("spheres of radius {radius} do not fit into the shape near ({:.4}, {:.4}, {:.4}) of its own frame", place[0], place[1], place[2])]
pub struct TooThin {
    /// Radius asked for [m].
    pub radius: f64,
    /// Where it is too much [m].
    pub place: [f64; 3],
}

/// Spheres of this radius, neighbours at most `spacing` apart (2 radii leave no gap). A sphere is felt by
/// one sphere, itself.
///
/// # Errors
/// The shape is thinner than a sphere.
pub fn spheres(shape: &Shape, radius: f64, spacing: f64) -> Result<Vec<Sphere>, TooThin> {
    let thin = TooThin { radius, place: [0.0; 3] };
    let centres = match shape {
        Shape::Sphere(ball) => {
            return Ok(vec![Sphere { centre: Vector3::zeros(), radius: ball.radius }]);
        }
        Shape::Cuboid(cuboid) => {
            let h = cuboid.half_extents;
            in_cuboid([h.x, h.y, h.z], radius, spacing).ok_or(thin)?
        }
        Shape::Cylinder(c) => in_cylinder(c.radius, c.half_height, radius, spacing).ok_or(thin)?,
        Shape::Mesh(mesh) => in_mesh(shape, mesh, radius, spacing)?,
    };
    Ok(centres.into_iter().map(|centre| Sphere { centre, radius }).collect())
}

/// Equally spaced places from −half to half, as few as the spacing allows.
fn places(half: f64, spacing: f64) -> Vec<f64> {
    let intervals = (2.0 * half / spacing * (1.0 - 1e-9)).ceil() as usize;
    match intervals {
        0 => vec![0.0],
        n => (0..=n).map(|i| half * (2.0 * i as f64 / n as f64 - 1.0)).collect(),
    }
}

/// Half extent less the radius; none if the shape is thinner.
fn inner(half: f64, radius: f64) -> Option<f64> {
    (half >= radius * (1.0 - 1e-9)).then(|| (half - radius).max(0.0))
}

fn in_cuboid(half: [f64; 3], radius: f64, spacing: f64) -> Option<Vec<Vector3<f64>>> {
    let mut axes = [const { Vec::new() }; 3];
    for k in 0..3 {
        axes[k] = places(inner(half[k], radius)?, spacing);
    }
    let [x, y, z] = &axes;
    let edge = |i: usize, list: &[f64]| i == 0 || i + 1 == list.len();
    let mut centres = Vec::new();
    for (i, &x_i) in x.iter().enumerate() {
        for (j, &y_j) in y.iter().enumerate() {
            for (k, &z_k) in z.iter().enumerate() {
                if edge(i, x) || edge(j, y) || edge(k, z) {
                    centres.push(Vector3::new(x_i, y_j, z_k));
                }
            }
        }
    }
    Some(centres)
}

fn in_cylinder(
    outer: f64,
    half_height: f64,
    radius: f64,
    spacing: f64,
) -> Option<Vec<Vector3<f64>>> {
    let (r, h) = (inner(outer, radius)?, inner(half_height, radius)?);
    let levels = places(h, spacing);
    let mut centres = Vec::new();
    for (i, &z) in levels.iter().enumerate() {
        let capped = i == 0 || i + 1 == levels.len();
        let rings = if capped { (r / spacing * (1.0 - 1e-9)).ceil() as usize } else { 0 };
        for ring in 0..=rings {
            let r = r * (1.0 - ring as f64 / rings.max(1) as f64);
            let around = ((TAU * r / spacing).ceil() as usize).max(1);
            centres.extend((0..around).map(|k| {
                let angle = TAU * k as f64 / around as f64;
                Vector3::new(r * angle.cos(), r * angle.sin(), z)
            }));
        }
    }
    Some(centres)
}

/// Points of the surface (corners first, then edges, then faces) move inwards until the sphere fits;
/// those that end too close to another are left out.
fn in_mesh(
    shape: &Shape,
    mesh: &Mesh,
    radius: f64,
    spacing: f64,
) -> Result<Vec<Vector3<f64>>, TooThin> {
    let surface = mesh.surface();
    let mut starts: Vec<(u8, Vector3<f64>, Vector3<f64>)> = Vec::new();
    let mut normal_at = vec![Vector3::zeros(); surface.vertices.len()];
    for (t, [a, b, c]) in surface.triangles.iter().zip(surface.corners()) {
        let Some(n) = (b - a).cross(&(c - a)).try_normalize(0.0) else { continue };
        t.iter().for_each(|&v| normal_at[v as usize] += n);
        let longest = (b - a).norm().max((c - b).norm()).max((a - c).norm());
        let cuts = (2.0 * longest / spacing).ceil() as usize;
        for i in 0..=cuts {
            for j in 0..=cuts - i {
                let k = cuts - i - j;
                let zeros = [i, j, k].iter().filter(|&&n| n == 0).count();
                if zeros < 2 {
                    let x = (a * i as f64 + b * j as f64 + c * k as f64) / cuts as f64;
                    starts.push((2 - zeros as u8, x, n));
                }
            }
        }
    }
    let corners = surface.vertices.iter().zip(&normal_at).filter(|(_, n)| n.norm() > 0.0);
    starts.extend(corners.map(|(&x, n)| (0, x, n.normalize())));
    starts.sort_by_key(|start| start.0);

    let mut centres: Vec<Vector3<f64>> = Vec::new();
    for (_, x, n) in starts {
        let Some(centre) = sink(shape, x - radius * n, radius) else { continue };
        if centres.iter().all(|c| (c - centre).norm() > 0.7 * spacing) {
            centres.push(centre);
        }
    }
    if centres.is_empty() {
        let place = surface.vertices[0].into();
        return Err(TooThin { radius, place });
    }
    Ok(centres)
}

/// The place near `x` that is `radius` deep inside the shape.
fn sink(shape: &Shape, mut x: Vector3<f64>, radius: f64) -> Option<Vector3<f64>> {
    const ROUNDS: usize = 100;
    for _ in 0..ROUNDS {
        let (distance, nearest) = shape.nearest(x);
        if distance <= -radius {
            return Some(x);
        }
        // Inwards from the nearest place of the surface, a little too far so that this ends.
        let out = x - nearest;
        if out.norm() < 1e-12 * radius {
            return None;
        }
        let inwards = if distance < 0.0 { out.normalize() } else { -out.normalize() };
        x = nearest + inwards * (1.001 * radius);
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::Surface;

    fn check(shape: &Shape, radius: f64) -> usize {
        let spheres = spheres(shape, radius, 2.0 * radius).unwrap();
        for s in &spheres {
            let depth = -shape.distance(s.centre);
            assert!(depth > radius * (1.0 - 1e-9), "{depth} inside, {radius} needed");
            assert!(depth < radius * 1.002, "tangent: {depth}");
        }
        spheres.len()
    }

    #[test]
    fn spheres_lie_inside_and_touch_the_surface() {
        assert_eq!(check(&Shape::cuboid([0.4, 0.4, 0.4]), 0.1), 8);
        assert_eq!(check(&Shape::cuboid([0.6, 0.6, 0.6]), 0.1), 26);
        assert_eq!(check(&Shape::cuboid([0.6, 0.4, 0.2]), 0.1), 6);
        assert!(check(&Shape::cylinder(0.3, 1.0), 0.1) > 20);
        // As many on the mesh of a cube as on the cube: corners are found.
        let mesh = Shape::mesh(Surface::cuboid([0.6, 0.6, 0.6])).unwrap();
        let n = check(&mesh, 0.1);
        assert!((26..60).contains(&n), "{n}");
        for corner in spheres(&Shape::cuboid([0.6; 3]), 0.1, 0.2)
            .unwrap()
            .iter()
            .filter(|s| s.centre.amin() > 0.19)
        {
            let found = spheres(&mesh, 0.1, 0.2).unwrap();
            assert!(found.iter().any(|s| (s.centre - corner.centre).norm() < 2e-3));
        }
    }

    #[test]
    fn a_shape_thinner_than_a_sphere_is_refused() {
        assert!(spheres(&Shape::cuboid([1.0, 1.0, 0.1]), 0.1, 0.2).is_err());
        let mesh = Shape::mesh(Surface::cuboid([1.0, 1.0, 0.1])).unwrap();
        assert!(spheres(&mesh, 0.1, 0.2).is_err());
    }
}
