//! A closed surface cut by a plane, and closed again across the cut.

use super::Surface;
use nalgebra::{Vector2, Vector3};
use std::collections::HashMap;

/// What is left of the inside of a closed surface where `axis · x ≤ bias`.
///
/// # Errors
/// In words: the cut has a hole in it, or the surface touches itself there.
pub fn below(surface: &Surface, axis: Vector3<f64>, bias: f64) -> Result<Surface, String> {
    let mut vertices = surface.vertices.clone();
    let side: Vec<f64> = vertices.iter().map(|v| v.dot(&axis) - bias).collect();
    if side.iter().all(|&s| s <= 0.0) {
        return Ok(surface.clone());
    }
    let mut on_edge: HashMap<(u32, u32), u32> = HashMap::new();
    let mut cut = |a: u32, b: u32| {
        let (a, b) = (a.min(b), a.max(b));
        *on_edge.entry((a, b)).or_insert_with(|| {
            let (s, t) = (side[a as usize], side[b as usize]);
            let (x, y) = (vertices[a as usize], vertices[b as usize]);
            vertices.push(x + (y - x) * (s / (s - t)));
            vertices.len() as u32 - 1
        })
    };
    let mut triangles = Vec::new();
    // The rim of the cut, anticlockwise seen from above.
    let mut rim: HashMap<u32, u32> = HashMap::new();
    for t in &surface.triangles {
        let mut kept: Vec<u32> = Vec::with_capacity(4);
        let mut ends = [None; 2];
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            let [inside, next_inside] = [a, b].map(|v| side[v as usize] <= 0.0);
            if inside {
                kept.push(a);
            }
            if inside != next_inside {
                let v = cut(a, b);
                kept.push(v);
                ends[usize::from(next_inside)] = Some(v);
            }
        }
        if let [Some(leaves), Some(enters)] = ends
            && rim.insert(enters, leaves).is_some()
        {
            return Err("the surface touches itself where it is cut".into());
        }
        for k in 1..kept.len().max(2) - 1 {
            triangles.push([kept[0], kept[k], kept[k + 1]]);
        }
    }
    while let Some(&start) = rim.keys().min() {
        let mut ring = Vec::new();
        let mut at = start;
        while let Some(next) = rim.remove(&at) {
            ring.push(at);
            at = next;
        }
        if at != start {
            return Err("the surface is open where it is cut".into());
        }
        cap(&vertices, axis, &ring, &mut triangles)?;
    }
    let mut number = vec![u32::MAX; vertices.len()];
    let mut left = Surface::default();
    for t in triangles {
        left.triangles.push(t.map(|v| {
            let n = &mut number[v as usize];
            if *n == u32::MAX {
                *n = left.vertices.len() as u32;
                left.vertices.push(vertices[v as usize]);
            }
            *n
        }));
    }
    Ok(left)
}

/// Triangles of a flat ring: ears are cut off, the best shaped first, and no vertex is left out.
fn cap(
    vertices: &[Vector3<f64>],
    axis: Vector3<f64>,
    ring: &[u32],
    triangles: &mut Vec<[u32; 3]>,
) -> Result<(), String> {
    let across = if axis.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
    let u = axis.cross(&across).normalize();
    let v = axis.cross(&u);
    let flat = |i: u32| {
        let x = vertices[i as usize];
        Vector2::new(x.dot(&u), x.dot(&v))
    };
    let mut left: Vec<(u32, Vector2<f64>)> = ring.iter().map(|&i| (i, flat(i))).collect();
    let twice = |a: Vector2<f64>, b: Vector2<f64>, c: Vector2<f64>| (b - a).perp(&(c - a));
    let area: f64 =
        (1..left.len().max(2) - 1).map(|k| twice(left[0].1, left[k].1, left[k + 1].1)).sum();
    if area < 0.0 {
        return Err("a fragment would have a hole through it: make fragments smaller".into());
    }
    while left.len() > 2 {
        let n = left.len();
        let mut best = (f64::NEG_INFINITY, 0);
        for k in 0..n {
            let [a, b, c] = [left[(k + n - 1) % n].1, left[k].1, left[(k + 1) % n].1];
            let longest =
                (b - a).norm_squared().max((c - b).norm_squared()).max((a - c).norm_squared());
            let quality = twice(a, b, c) / longest;
            let inside = |p: Vector2<f64>| {
                twice(a, b, p) > 0.0 && twice(b, c, p) > 0.0 && twice(c, a, p) >= 0.0
            };
            let others = (0..n - 3).map(|i| left[(k + 2 + i) % n].1);
            if quality > best.0 && (quality <= 0.0 || !others.into_iter().any(inside)) {
                best = (quality, k);
            }
        }
        let k = best.1;
        triangles.push([left[(k + n - 1) % n].0, left[k].0, left[(k + 1) % n].0]);
        left.remove(k);
    }
    Ok(())
}
