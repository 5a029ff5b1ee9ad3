//! Where a triangle surface runs through itself: pairs of triangles whose boxes meet, found in a tree, of which an
//! edge of one passes through the inside of the other, or which lie in a plane, cover a part of each other and have
//! the same side outwards.
//!
//! Triangles that merely touch, along an edge, in a corner or back to back, do not cross.

use super::Surface;
use nalgebra::Vector3;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::math::Vector;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy};

/// What counts as touching, over the lengths involved.
const TOUCH: f64 = 1e-9;

/// A place where the surface crosses itself, that of the triangle with the lowest number [m].
pub fn crossing(surface: &Surface) -> Option<Vector3<f64>> {
    let corners: Vec<[Vector3<f64>; 3]> = surface.corners().collect();
    let boxes: Vec<Aabb> = corners
        .iter()
        .map(|x| {
            let [a, b, c] = x.map(|x| Vector::new(x.x, x.y, x.z));
            Aabb::new(a.min(b).min(c), a.max(b).max(c))
        })
        .collect();
    let tree = Bvh::from_iter(BvhBuildStrategy::Binned, boxes.iter().copied().enumerate());
    (0..corners.len()).find_map(|i| {
        let edges = [(0, 1), (1, 2), (2, 0)];
        tree.intersect_aabb(&boxes[i]).filter(|&j| j as usize != i).find_map(|j| {
            let j = j as usize;
            // An edge with a corner in common touches.
            let own = surface.triangles[j];
            let free = |&(a, b): &(usize, usize)| {
                let [a, b] = [a, b].map(|k| surface.triangles[i][k]);
                !own.contains(&a) && !own.contains(&b)
            };
            let mut free = edges.iter().filter(|e| free(e));
            free.find_map(|&(a, b)| through(corners[i][a], corners[i][b], &corners[j]))
                .or_else(|| common(&corners[i], &corners[j]))
        })
    })
}

/// Where the line from `a` to `b` passes through the inside of a triangle.
fn through(a: Vector3<f64>, b: Vector3<f64>, triangle: &[Vector3<f64>; 3]) -> Option<Vector3<f64>> {
    let [p, q, r] = *triangle;
    let normal = (q - p).cross(&(r - p));
    let size = normal.norm();
    if size == 0.0 {
        return None;
    }
    let (above, below) = (normal.dot(&(a - p)) / size, normal.dot(&(b - p)) / size);
    let least = TOUCH * ((b - a).norm() + size.sqrt());
    if above * below >= 0.0 || above.abs() < least || below.abs() < least {
        return None;
    }
    let x = a + (b - a) * (above / (above - below));
    let inside = [(p, q), (q, r), (r, p)]
        .iter()
        .all(|(from, to)| (to - from).cross(&(x - from)).dot(&normal) > TOUCH * size * size);
    inside.then_some(x)
}

/// The middle of what two triangles in a plane, with the same normal, both cover.
fn common(one: &[Vector3<f64>; 3], other: &[Vector3<f64>; 3]) -> Option<Vector3<f64>> {
    let area = |[a, b, c]: [Vector3<f64>; 3]| (b - a).cross(&(c - a));
    let (normal, size) = (area(*other), area(*other).norm());
    let off = |x: &Vector3<f64>| normal.dot(&(x - other[0])).abs();
    let flat = one.iter().all(|x| off(x) <= TOUCH * size * size.sqrt());
    if size == 0.0 || !flat || normal.dot(&area(*one)) <= 0.0 {
        return None;
    }
    // What of the one is on the inner side of each edge of the other.
    let mut left = one.to_vec();
    for k in 0..3 {
        let (from, to) = (other[k], other[(k + 1) % 3]);
        let side = |x: &Vector3<f64>| (to - from).cross(&(x - from)).dot(&normal);
        let mut kept = Vec::new();
        for (i, x) in left.iter().enumerate() {
            let y = &left[(i + 1) % left.len()];
            let (a, b) = (side(x), side(y));
            if a >= 0.0 {
                kept.push(*x);
            }
            if (a < 0.0) != (b < 0.0) {
                kept.push(x + (y - x) * (a / (a - b)));
            }
        }
        left = kept;
    }
    let covered: Vector3<f64> =
        (1..left.len().max(2) - 1).map(|i| area([left[0], left[i], left[i + 1]])).sum();
    let middle = || left.iter().sum::<Vector3<f64>>() / left.len() as f64;
    (left.len() > 2 && covered.norm() > TOUCH * size).then(middle)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joined(mut a: Surface, b: &Surface, shift: [f64; 3]) -> Surface {
        let n = a.vertices.len() as u32;
        a.vertices.extend(b.vertices.iter().map(|v| v + Vector3::from(shift)));
        a.triangles.extend(b.triangles.iter().map(|t| t.map(|v| v + n)));
        a
    }

    #[test]
    fn two_cubes_cross_touch_or_stand_apart() {
        let cube = Surface::cuboid([1.0; 3]);
        for (shift, crosses) in [
            ([0.4, 0.3, 0.2], true),
            ([0.9, 0.01, 0.0], true),
            ([0.9, 0.0, 0.0], true),
            ([0.0, 0.0, 0.0], true),
            ([1.0, 0.0, 0.0], false),
            ([1.0, 0.3, 0.2], false),
            ([1.0, 1.0, 1.0], false),
            ([1.1, 0.0, 0.0], false),
        ] {
            let found = crossing(&joined(cube.clone(), &cube, shift));
            assert_eq!(found.is_some(), crosses, "{shift:?}: {found:?}");
            // On the surfaces of both.
            if let Some(x) = found {
                let on = |x: Vector3<f64>| (x.amax() - 0.5).abs() < 1e-12;
                assert!(on(x) && on(x - Vector3::from(shift)), "{x}");
            }
        }
        // One inside the other: a hollow, or two of one; not a crossing.
        let small = Surface::cuboid([0.5; 3]);
        assert!(crossing(&joined(cube, &small, [0.0; 3])).is_none());
        assert!(crossing(&Surface::sphere(1.0, 0.1)).is_none());
        assert!(crossing(&Surface::cylinder(1.0, 0.5, 0.05)).is_none());
    }

    #[test]
    fn a_corner_pushed_through_the_other_side() {
        let mut cube = Surface::cuboid([1.0; 3]);
        cube.vertices[7] = Vector3::new(0.1, 0.2, -0.9);
        let x = crossing(&cube).expect("it runs through the bottom");
        assert!((x.z + 0.5).abs() < 1e-12, "{x}");
    }
}
