//! Signed distance to the structures at the nodes: `d = min over structures`, positive in the fluid, exact
//! within one element's edge of a flat surface and cut off beyond.
//!
//! Between nodes the distance is linear, which makes of a ball of radius R a polyhedron: by h²/6R too small in cubes
//! of size h, 2 % of its volume where it is ten of them across. Round surfaces are therefore put outwards by as much
//! as they would be too far in, in the mean over the elements around a node: `½ Σ_{i<j} λ_iλ_j Δx·∇∇d·Δx`. Their
//! volumes are then right to 1e-4.
//!
//! Only nodes in a structure's box are asked (shapes answer through a tree over their triangles). Nodes closer
//! to a surface than 1e-7 of the longest edge are put on it: what would be cut off there is nothing.
//!
//! Structures that hold together are one: inside them, the face that two have in common is not a surface.

use crate::mesh::MeshPart;
use crate::mesh::tetrahedron::volume;
use crate::shape::{Bounds, Pose, Shape};
use nalgebra::{Matrix3, Vector3};

/// Distance that counts as none, over the longest edge.
const ON_SURFACE: f64 = 1e-7;

/// A structure where it stands.
#[derive(Clone, Copy, Debug)]
pub struct Solid<'a> {
    /// Its shape.
    pub shape: &'a Shape,
    /// Where it stands.
    pub pose: Pose,
    /// The fluid is inside the shape, what is outside is solid.
    pub outside_in: bool,
}

impl Solid<'_> {
    /// Signed distance from the structure [m], positive in the fluid.
    #[inline]
    pub fn distance(&self, x: [f64; 3]) -> f64 {
        let d = self.shape.distance(self.pose.to_local(Vector3::from(x)));
        if self.outside_in { -d } else { d }
    }

    /// Its second derivatives at the surface next to `x` [1/m]; none where that is flat.
    fn curvature(&self, x: [f64; 3]) -> Option<Matrix3<f64>> {
        let h = self.shape.curvature(self.pose.to_local(Vector3::from(x)))?;
        let axes = self.pose.rotation.to_rotation_matrix();
        let h = axes.matrix() * h * axes.matrix().transpose();
        Some(if self.outside_in { -h } else { h })
    }
}

/// Where two structures hold together, so closely that no fluid gets between: the prism over their common
/// face, through both.
#[derive(Clone, Debug)]
pub struct Bridge {
    /// Outward normals and offsets of its sides.
    pub sides: Vec<(Vector3<f64>, f64)>,
    /// Around the two structures.
    pub bounds: Bounds,
    /// Widest gap that holds [m].
    pub gap: f64,
}

impl Bridge {
    /// Depth inside the prism [m], negative outside.
    fn depth(&self, x: [f64; 3]) -> f64 {
        let x = Vector3::from(x);
        self.sides.iter().map(|(n, offset)| offset - n.dot(&x)).fold(f64::INFINITY, f64::min)
    }

    /// Distance where it was `d`. A node in the gap is in the prism; one beside the structures is as far from
    /// the prism as from them.
    fn joined(&self, d: f64, x: [f64; 3]) -> f64 {
        let depth = self.depth(x);
        if d <= self.gap && depth > -0.5 * d.max(0.0) { d.min(-depth.max(0.0)) } else { d }
    }
}

/// Distances at the local nodes.
#[derive(Clone, Debug, PartialEq)]
pub struct LevelSet {
    /// d [m].
    pub distance: Vec<f64>,
    /// The nearest structure, of nodes near one.
    pub body: Vec<u32>,
}

/// Nodes in the order of x, and how far from a surface an element may reach.
#[derive(Clone, Debug)]
pub struct Nodes {
    order: Vec<u32>,
    /// Longest edge [m].
    pub band: f64,
    /// Σ Δx Δx / 40 over the edges of an element, in the mean of those around each node [m²]: xx, yy, zz, xy, xz, yz.
    /// Empty without round surfaces.
    spread: Vec<[f64; 6]>,
}

impl Nodes {
    /// Of this rank's mesh, for surfaces some of which are `round`. Collective.
    pub fn new(part: &MeshPart, round: bool) -> Self {
        let x = &part.mesh.nodes;
        let mut order: Vec<u32> = (0..x.len() as u32).collect();
        order.sort_unstable_by(|&a, &b| x[a as usize][0].total_cmp(&x[b as usize][0]));
        let mut longest = 0.0f64;
        for e in 0..part.mesh.tets.len() {
            let c = part.mesh.corners(e);
            for i in 0..3 {
                for j in i + 1..4 {
                    let edge: f64 = (0..3).map(|k| (c[i][k] - c[j][k]).powi(2)).sum();
                    longest = longest.max(edge);
                }
            }
        }
        let spread = if round { spread(part) } else { Vec::new() };
        Self { order, band: part.max(longest.sqrt()), spread }
    }

    /// How much too far from node `n` a surface would be seen whose distance has these second derivatives [m].
    fn excess(&self, n: u32, h: &Matrix3<f64>) -> f64 {
        let [xx, yy, zz, xy, xz, yz] = self.spread[n as usize];
        let sides = xy * h[(0, 1)] + xz * h[(0, 2)] + yz * h[(1, 2)];
        xx * h[(0, 0)] + yy * h[(1, 1)] + zz * h[(2, 2)] + 2.0 * sides
    }

    /// The nodes whose x lies in the range, sorted by x.
    fn between(&self, x: &[[f64; 3]], from: f64, to: f64) -> &[u32] {
        let start = self.order.partition_point(|&n| x[n as usize][0] < from);
        let end = self.order.partition_point(|&n| x[n as usize][0] <= to);
        &self.order[start..end.max(start)]
    }
}

/// See `Nodes`. Collective.
fn spread(part: &MeshPart) -> Vec<[f64; 6]> {
    let mut sums = vec![[0.0; 7]; part.n_local()];
    for (e, tet) in part.mesh.tets.iter().enumerate() {
        let x = part.mesh.corners(e);
        let mut terms = [0.0; 7];
        for i in 0..3 {
            for j in i + 1..4 {
                let d: [f64; 3] = std::array::from_fn(|k| x[j][k] - x[i][k]);
                for (t, (a, b)) in
                    [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)].iter().enumerate()
                {
                    terms[t] += d[*a] * d[*b] / 40.0;
                }
            }
        }
        terms[6] = 1.0;
        let volume = volume(&x);
        for &n in tet {
            sums[n as usize].iter_mut().zip(terms).for_each(|(sum, t)| *sum += volume * t);
        }
    }
    part.exchange.update_ghosts(&mut sums);
    sums.into_iter().map(|s| std::array::from_fn(|k| s[k] / s[6])).collect()
}

impl LevelSet {
    /// Of these structures; a node as near to two takes the first.
    pub fn new(part: &MeshPart, nodes: &Nodes, solids: &[Solid<'_>], bridges: &[Bridge]) -> Self {
        Self::nothing(part, nodes).with(part, nodes, (0..).zip(solids), bridges)
    }

    /// Without structures.
    pub fn nothing(part: &MeshPart, nodes: &Nodes) -> Self {
        let n = part.mesh.nodes.len();
        Self { distance: vec![nodes.band; n], body: vec![0; n] }
    }

    /// With more structures, by their numbers.
    pub fn with<'a>(
        self,
        part: &MeshPart,
        nodes: &Nodes,
        solids: impl Iterator<Item = (u32, &'a Solid<'a>)>,
        bridges: &[Bridge],
    ) -> Self {
        let x = &part.mesh.nodes;
        let band = nodes.band;
        let mut levels = self;
        for (body, solid) in solids {
            let distance = |n: u32, p: [f64; 3]| {
                let d = solid.distance(p);
                let near = d.abs() < band && !nodes.spread.is_empty();
                let h = if near { solid.curvature(p) } else { None };
                h.map_or(d, |h| d - nodes.excess(n, &h)).max(-band)
            };
            let mut lower = |n: u32, d: f64| {
                let at = &mut levels.distance[n as usize];
                if d < *at {
                    *at = d;
                    levels.body[n as usize] = body;
                }
            };
            let bounds = solid.shape.bounds(&solid.pose).inflated(band);
            let within =
                |p: &[f64; 3]| (0..3).all(|k| (bounds.min[k]..=bounds.max[k]).contains(&p[k]));
            if solid.outside_in {
                for (n, p) in (0u32..).zip(x) {
                    lower(n, if within(p) { distance(n, *p) } else { -band });
                }
            } else {
                for &n in nodes.between(x, bounds.min[0], bounds.max[0]) {
                    if within(&x[n as usize]) {
                        lower(n, distance(n, x[n as usize]));
                    }
                }
            }
        }
        for bridge in bridges {
            let Bounds { min, max } = bridge.bounds;
            for &n in nodes.between(x, min[0], max[0]) {
                let p = x[n as usize];
                if (1..3).all(|k| (min[k]..=max[k]).contains(&p[k])) {
                    let d = &mut levels.distance[n as usize];
                    *d = bridge.joined(*d, p).max(-band);
                }
            }
        }
        for d in &mut levels.distance {
            if d.abs() < ON_SURFACE * band {
                *d = 0.0;
            }
        }
        levels
    }
}

/// Which of four structures is nearest to a point.
pub fn nearest(solids: &[Solid<'_>], of: [u32; 4], x: [f64; 3]) -> u32 {
    let by_distance = |&a: &u32, &b: &u32| {
        solids[a as usize].distance(x).total_cmp(&solids[b as usize].distance(x)).then(a.cmp(&b))
    };
    of.into_iter().min_by(by_distance).expect("there are four")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cut::CutMesh;
    use crate::mesh::boxes::tensor_box;

    fn grid(n: usize) -> MeshPart {
        let lines: Vec<f64> = (0..=n).map(|i| i as f64 / n as f64).collect();
        MeshPart::single(tensor_box([&lines, &lines, &lines]))
    }

    /// Volume of fluid and area of walls in the unit cube.
    fn sizes(part: &MeshPart, solids: &[Solid<'_>]) -> [f64; 2] {
        let nodes = Nodes::new(part, true);
        let levels = LevelSet::new(part, &nodes, solids, &[]);
        let cut = CutMesh::new(part, levels, |x, of| nearest(solids, of, x));
        let mut sizes = [0.0; 2];
        for e in 0..part.mesh.tets.len() {
            sizes[0] += match cut.cell(e) {
                crate::cut::Cell::Whole => {
                    crate::mesh::tetrahedron::Tetrahedron::of(&part.mesh, e).volume
                }
                crate::cut::Cell::Cut(c) => c.pieces.fluid.size,
                crate::cut::Cell::Solid => 0.0,
            };
        }
        sizes[1] = cut.elements.iter().map(|c| c.pieces.wall.size).sum();
        sizes
    }

    fn at(x: [f64; 3]) -> Pose {
        Pose { position: x.into(), ..Pose::identity() }
    }

    /// 7, 14 and 29 elements across.
    #[test]
    fn a_sphere_has_its_volume_and_area() {
        let shape = Shape::sphere(0.3);
        let exact = [4.0 / 3.0 * std::f64::consts::PI * 0.027, 4.0 * std::f64::consts::PI * 0.09];
        for outside_in in [false, true] {
            let solid = Solid { shape: &shape, pose: at([0.51, 0.48, 0.505]), outside_in };
            for (n, limits) in [(12, [2e-3, 2e-2]), (24, [4e-4, 5e-3]), (48, [1e-4, 1.3e-3])] {
                let [fluid, area] = sizes(&grid(n), &[solid]);
                let volume = if outside_in { fluid } else { 1.0 - fluid };
                let errors = [volume / exact[0] - 1.0, area / exact[1] - 1.0];
                println!("{n} {errors:?}");
                assert!((0..2).all(|k| errors[k].abs() < limits[k]), "{n}: {errors:?}");
            }
        }
    }

    /// A cube whose faces lie on grid planes: all its distances are exact zeros there, and its volume is exact.
    #[test]
    fn a_cube_on_grid_planes_is_cut_out_exactly() {
        let part = grid(8);
        let shape = Shape::cuboid([0.5, 0.5, 0.25]);
        let [fluid, area] = sizes(
            &part,
            &[Solid { shape: &shape, pose: at([0.5, 0.5, 0.375]), outside_in: false }],
        );
        assert!((fluid - (1.0 - 0.0625)).abs() < 1e-12, "{fluid}");
        assert!((area - 1.0).abs() < 1e-12, "{area}");
    }

    #[test]
    fn structures_are_joined_and_facets_know_theirs() {
        let part = grid(12);
        let (ball, slab) = (Shape::sphere(0.2), Shape::cuboid([2.0, 2.0, 0.2]));
        let solids = [
            Solid { shape: &ball, pose: at([0.5, 0.5, 0.7]), outside_in: false },
            Solid { shape: &slab, pose: at([0.5, 0.5, 0.0]), outside_in: false },
        ];
        let nodes = Nodes::new(&part, true);
        let cut = CutMesh::new(&part, LevelSet::new(&part, &nodes, &solids, &[]), |x, of| {
            nearest(&solids, of, x)
        });
        let mut area = [0.0; 2];
        for c in &cut.elements {
            area[c.body as usize] += c.pieces.wall.size;
            let (z, n) = (c.x[2], c.pieces.normal);
            assert_eq!(c.body, u32::from(z < 0.3));
            if z < 0.3 {
                assert!((z - 0.1).abs() < 1e-12 && (n[2] + 1.0).abs() < 1e-12);
            }
        }
        assert!(
            (area[1] - 1.0).abs() < 1e-12 && (area[0] / 0.502_65 - 1.0).abs() < 0.1,
            "{area:?}"
        );
        assert!(cut.dry_nodes.iter().all(|&n| cut.distance[n as usize] <= 0.0));
        assert!(!cut.ghost_faces.is_empty());
    }

    /// Two blocks glued face to face, a crack between them that the bond still holds: one block, cut out as well as
    /// a block without a joint.
    #[test]
    fn a_joint_leaves_no_trace() {
        let part = grid(10);
        let (half, whole) = (Shape::cuboid([0.3, 0.4, 0.42]), Shape::cuboid([0.604, 0.4, 0.42]));
        // A plane of nodes lies in the crack.
        let block = |shape, x| Solid { shape, pose: at([x, 0.52, 0.51]), outside_in: false };
        let halves = [block(&half, 0.348), block(&half, 0.652)];
        let sides = [
            (Vector3::y(), 0.72),
            (-Vector3::y(), -0.32),
            (Vector3::z(), 0.72),
            (-Vector3::z(), -0.3),
            (Vector3::x(), 0.802),
            (-Vector3::x(), -0.198),
        ];
        let bounds = Bounds { min: Vector3::repeat(0.1), max: Vector3::repeat(0.9) };
        let bridge = Bridge { sides: sides.into(), bounds, gap: 0.01 };
        let nodes = Nodes::new(&part, true);
        let one = LevelSet::new(&part, &nodes, &[block(&whole, 0.5)], &[]);
        let two = LevelSet::new(&part, &nodes, &halves, &[]);
        let joined = LevelSet::new(&part, &nodes, &halves, &[bridge]);
        let off = |levels: &LevelSet| {
            let pairs = levels.distance.iter().zip(&one.distance);
            pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        // Outside, in line with the crack, the nearest corner is 2 mm aside: √(0.02² + 0.002²) − 0.02.
        assert!(off(&joined) < 1e-4, "{}", off(&joined));
        assert!(off(&two) > 0.1, "{}", off(&two));
    }
}
