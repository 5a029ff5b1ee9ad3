//! Signed distance to the structures at the nodes: `d = min over structures`, positive in the fluid, exact
//! within one element's edge of a surface and cut off beyond.
//!
//! Only nodes in a structure's box are asked (shapes answer through a tree over their triangles). Nodes closer
//! to a surface than 1e-7 of the longest edge are put on it: what would be cut off there is nothing.
//!
//! Structures that hold together are one: inside them, the face that two have in common is not a surface.

use crate::mesh::MeshPart;
use crate::shape::{Bounds, Pose, Shape};
use nalgebra::Vector3;

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
}

impl Nodes {
    /// Of this rank's mesh.
    pub fn new(part: &MeshPart) -> Self {
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
        Self { order, band: part.max(longest.sqrt()) }
    }

    /// The nodes whose x lies in the range, sorted by x.
    fn between(&self, x: &[[f64; 3]], from: f64, to: f64) -> &[u32] {
        let start = self.order.partition_point(|&n| x[n as usize][0] < from);
        let end = self.order.partition_point(|&n| x[n as usize][0] <= to);
        &self.order[start..end.max(start)]
    }
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
                    lower(n, if within(p) { solid.distance(*p).max(-band) } else { -band });
                }
            } else {
                for &n in nodes.between(x, bounds.min[0], bounds.max[0]) {
                    if within(&x[n as usize]) {
                        lower(n, solid.distance(x[n as usize]).max(-band));
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
        let nodes = Nodes::new(part);
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

    #[test]
    fn volume_and_area_of_a_sphere_converge_at_second_order() {
        let shape = Shape::sphere(0.3);
        let exact = [4.0 / 3.0 * std::f64::consts::PI * 0.027, 4.0 * std::f64::consts::PI * 0.09];
        for outside_in in [false, true] {
            let solid = Solid { shape: &shape, pose: at([0.51, 0.48, 0.505]), outside_in };
            let errors = [12, 24, 48].map(|n| {
                let [fluid, area] = sizes(&grid(n), &[solid]);
                let volume = if outside_in { fluid } else { 1.0 - fluid };
                [(volume / exact[0] - 1.0).abs(), (area / exact[1] - 1.0).abs()]
            });
            for k in 0..2 {
                for n in 0..2 {
                    let order = (errors[n][k] / errors[n + 1][k]).log2();
                    assert!((1.8..2.3).contains(&order), "{order}: {errors:?}");
                }
            }
            // 29 cells across: within the 0.35 % that linear cuts cost at 32.
            assert!(errors[2][0] < 4e-3 && errors[2][1] < 4e-3, "{errors:?}");
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
        let nodes = Nodes::new(&part);
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
        let nodes = Nodes::new(&part);
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
