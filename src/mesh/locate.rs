//! Which element a point is in: corner weights N_i(x) ≥ 0, up to rounding, so that points on faces,
//! edges and nodes belong to all elements around them; the element of the lowest global number
//! answers, whichever rank holds it.

use super::{Mesh, MeshError, MeshPart};
use crate::mesh::tetrahedron::Tetrahedron;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::math::Vector;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy, BvhNode};
use std::ops::Range;

/// A point is in an element if it is at most this many roundings of the largest coordinate outside.
const ROUNDINGS: f64 = 64.0 * f64::EPSILON;

/// A point in an element.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// The element, a number in the mesh.
    pub element: u32,
    /// Weights of its corners: not negative, sum 1.
    pub weights: [f64; 4],
}

impl Place {
    /// The P1 field with these nodal values at the point.
    pub fn value(&self, mesh: &Mesh, at_node: impl Fn(usize) -> f64) -> f64 {
        let tet = mesh.tets[self.element as usize];
        (0..4).map(|i| self.weights[i] * at_node(tet[i] as usize)).sum()
    }
}

/// Finds points and lines among some elements of a mesh: a tree of their boxes. The mesh passed to a
/// search is the one it was built from.
pub struct Locator {
    first: usize,
    tree: Bvh,
    /// By element, bit i: its face i is on the boundary.
    boundary: Vec<u8>,
    /// Largest coordinate of all boxes.
    scale: f64,
}

impl Locator {
    /// Of a range of elements.
    pub fn new(mesh: &Mesh, elements: Range<usize>) -> Self {
        let first = elements.start;
        let mut boundary = vec![0; elements.len()];
        for f in mesh.boundary.iter().filter(|f| elements.contains(&(f.element as usize))) {
            for (i, corner) in mesh.tets[f.element as usize].iter().enumerate() {
                if !f.nodes.contains(corner) {
                    boundary[f.element as usize - first] |= 1 << i;
                }
            }
        }
        let scale = elements.clone().map(|e| extent(&mesh.corners(e))).fold(0.0, f64::max);
        let boxes = elements.map(|e| {
            let x = mesh.corners(e).map(Vector::from);
            let low = x[0].min(x[1]).min(x[2].min(x[3]));
            Aabb::new(low, x[0].max(x[1]).max(x[2].max(x[3])))
        });
        let tree = Bvh::from_iter(BvhBuildStrategy::Binned, boxes.enumerate());
        Self { first, tree, boundary, scale }
    }

    /// Of the elements a rank owns.
    pub fn owned(part: &MeshPart) -> Self {
        Self::new(&part.mesh, 0..part.n_owned_elements)
    }

    /// Every element that contains the point, in no particular order; none if it is not a place.
    pub fn candidates(&self, mesh: &Mesh, x: [f64; 3]) -> Vec<Place> {
        if !x.iter().all(|x| x.is_finite()) {
            return Vec::new();
        }
        let near = Vector::splat(2.0 * ROUNDINGS * self.scale.max(extent(&[x])));
        let x_box = Aabb::new(Vector::from(x) - near, Vector::from(x) + near);
        self.tree
            .intersect_aabb(&x_box)
            .filter_map(|leaf| place(mesh, self.first + leaf as usize, x))
            .collect()
    }

    /// The element that contains the point, the first of several.
    pub fn find(&self, mesh: &Mesh, x: [f64; 3]) -> Option<Place> {
        self.candidates(mesh, x).into_iter().min_by_key(|p| p.element)
    }

    /// For each point (the same on all ranks) the place on the one rank that answers for it, `None`
    /// on the others. The locator is of `owned` elements. Collective.
    ///
    /// # Errors
    /// `Outside`, on all ranks: a point that no rank's elements contain.
    pub fn places(
        &self,
        part: &MeshPart,
        points: &[[f64; 3]],
    ) -> Result<Vec<Option<Place>>, MeshError> {
        let global = |p: &Place| part.element_global[p.element as usize];
        let mut mine: Vec<_> = points
            .iter()
            .map(|&x| self.candidates(&part.mesh, x).into_iter().min_by_key(global))
            .collect();
        let none = u64::MAX;
        let offers: Vec<u64> = mine.iter().map(|p| p.as_ref().map_or(none, global)).collect();
        let all = part.comm.all_gather(&offers);
        for (i, &at) in points.iter().enumerate() {
            let lowest = all.iter().map(|offers| offers[i]).min().unwrap_or(none);
            if lowest == none {
                return Err(MeshError::Outside { at });
            }
            if offers[i] != lowest {
                mine[i] = None;
            }
        }
        Ok(mine)
    }

    /// Elements whose boxes the line from `a` to `b` meets.
    pub(super) fn along(&self, [a, b]: [[f64; 3]; 2]) -> impl Iterator<Item = usize> {
        let near = Vector::splat(2.0 * ROUNDINGS * self.scale.max(extent(&[a, b])));
        let (a, b) = (Vector::from(a), Vector::from(b));
        let (middle, half) = (0.5 * (a + b), 0.5 * (b - a).abs());
        let direction = 0.5 * (b - a);
        // No axis, and no axis × line, separates them.
        let meets = move |node: &BvhNode| {
            let c = middle - 0.5 * (node.mins() + node.maxs());
            let e = 0.5 * (node.maxs() - node.mins()) + near;
            let turned = c.cross(direction).abs();
            let reach = Vector::new(
                e.y * half.z + e.z * half.y,
                e.z * half.x + e.x * half.z,
                e.x * half.y + e.y * half.x,
            );
            c.abs().cmple(e + half).all() && turned.cmple(reach).all()
        };
        self.tree.leaves(meets).map(|leaf| self.first + leaf as usize)
    }

    /// Whether face `i` of the element is on the boundary.
    pub(super) fn on_boundary(&self, element: usize, i: usize) -> bool {
        self.boundary[element - self.first] & (1 << i) != 0
    }
}

/// The largest coordinate.
pub(super) fn extent(x: &[[f64; 3]]) -> f64 {
    x.as_flattened().iter().fold(0.0, |m, x| x.abs().max(m))
}

/// Weights of an element's corners at some points, as they come, and how far below zero each weight
/// may be by rounding.
pub(super) fn weights<const N: usize>(
    mesh: &Mesh,
    element: usize,
    points: [[f64; 3]; N],
) -> ([[f64; 4]; N], [f64; 4]) {
    let corners = mesh.corners(element);
    let grad = Tetrahedron::new(corners).grad;
    // Seen from a corner on face i, where the weight i is zero, it is exact near the face.
    let weight = |x: [f64; 3], i: usize| {
        let from = corners[usize::from(i == 0)];
        (0..3).map(|k| grad[i][k] * (x[k] - from[k])).sum()
    };
    let rounding = ROUNDINGS * extent(&corners).max(extent(&points));
    let below = grad.map(|g| rounding * (g[0] * g[0] + g[1] * g[1] + g[2] * g[2]).sqrt());
    (points.map(|x| std::array::from_fn(|i| weight(x, i))), below)
}

/// Weights that are not negative and sum to 1.
pub(super) fn proper(weights: [f64; 4]) -> [f64; 4] {
    let positive = weights.map(|w| w.max(0.0));
    let sum: f64 = positive.iter().sum();
    positive.map(|w| w / sum)
}

/// The point in the element, if it is there.
fn place(mesh: &Mesh, element: usize, x: [f64; 3]) -> Option<Place> {
    let ([w], below) = weights(mesh, element, [x]);
    let inside = (0..4).all(|i| w[i] >= -below[i]);
    inside.then(|| Place { element: element as u32, weights: proper(w) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::case::BoxMesh;
    use crate::mesh::boxes::box_mesh;

    /// A jittered box, away from the origin.
    fn mesh() -> Mesh {
        let line = |n: usize, from: f64| (0..=n).map(|i| from + 0.1 * i as f64).collect();
        let lines = [line(7, 3.0), line(5, -0.2), line(6, 0.0)];
        box_mesh(&BoxMesh { lines, holes: vec![], jitter: Some((0.3, 5)) }).unwrap()
    }

    fn position(mesh: &Mesh, p: &Place) -> [f64; 3] {
        std::array::from_fn(|k| p.value(mesh, |n| mesh.nodes[n][k]))
    }

    fn close(a: [f64; 3], b: [f64; 3]) -> bool {
        (0..3).all(|k| (a[k] - b[k]).abs() < 1e-13)
    }

    #[test]
    fn points_are_found_where_they_are() {
        let mesh = mesh();
        let locator = Locator::new(&mesh, 0..mesh.tets.len());
        // Inside, on faces, edges and nodes of every element: also found in that element.
        let mixes = [
            [0.3, 0.1, 0.25, 0.35],
            [0.0, 0.2, 0.37, 0.43],
            [0.71, 0.0, 0.29, 0.0],
            [0.0, 0.0, 1.0, 0.0],
        ];
        for element in 0..mesh.tets.len() as u32 {
            for weights in mixes {
                let x = position(&mesh, &Place { element, weights });
                let all = locator.candidates(&mesh, x);
                assert!(all.iter().any(|p| p.element == element));
                for p in &all {
                    assert!(close(position(&mesh, p), x));
                    assert!(p.weights.iter().all(|w| (0.0..=1.0).contains(w)));
                }
                let inside = weights.iter().all(|w| *w > 0.0);
                assert!(!inside || all.len() == 1);
                let first = all.iter().map(|p| p.element).min();
                assert_eq!(locator.find(&mesh, x).map(|p| p.element), first);
            }
        }
    }

    #[test]
    fn points_outside_are_not_found() {
        let mesh = mesh();
        let locator = Locator::new(&mesh, 0..mesh.tets.len());
        for x in [
            [2.999_999_999_99, 0.0, 0.3],
            [3.1, 0.300_000_000_1, 0.3],
            [9.0, 0.0, 0.0],
            [f64::NAN, 0.0, 0.3],
            [f64::INFINITY, 0.0, 0.3],
        ] {
            assert_eq!(locator.find(&mesh, x), None);
        }
        let part = MeshPart::single(mesh);
        let error = locator.places(&part, &[[3.1, 0.0, 0.1], [9.0, 0.0, 0.5]]).unwrap_err();
        assert_eq!(error.to_string(), "(9, 0, 0.5) lies outside the mesh");
        for few in 0..3 {
            let locator = Locator::new(&part.mesh, 7..7 + few);
            let x = part.mesh.centre([0, 1, 2].map(|v| part.mesh.tets[7][v]));
            let found = locator.find(&part.mesh, x).map(|p| p.element);
            assert_eq!(found, (few > 0).then_some(7));
        }
    }
}
