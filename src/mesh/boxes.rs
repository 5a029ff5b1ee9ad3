//! Tetrahedral boxes: a tensor grid of cells, six tetrahedra each, mirrored from cell to cell; solid
//! blocks left out; nodes moved at random.

use super::{BoundaryFace, Mesh, MeshError};
use crate::case::{BoxMesh, Hole};
use crate::mesh::tetrahedron::Tetrahedron;

/// Kuhn's six tetrahedra of a unit cell as paths 000 → 111 along the axes in each order.
const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];
const SIDES: [&str; 6] = ["x_min", "x_max", "y_min", "y_max", "z_min", "z_max"];
const AXES: [char; 3] = ['x', 'y', 'z'];
/// A hole's face counts as on a grid line within this fraction of the neighbouring cell.
const ON_LINE: f64 = 1e-6;
/// Jitter never takes more than this share of an element's volume.
const KEPT_VOLUME: f64 = 0.2;

/// A box from its grid lines along x, y, z. Diagonals alternate from cell to cell, so that no
/// direction is preferred. Boundaries: `x_min x_max y_min y_max z_min z_max`.
pub fn tensor_box(lines: [&[f64]; 3]) -> Mesh {
    grid(lines, &[])
}

/// The box of a case file: grid, holes, jitter. Holes have their own boundary names, after the six
/// sides; where two overlap, faces belong to the one listed first. Nodes of holes alone are left
/// out. With jitter, a node keeps each coordinate in which it lies on a side of the box, nodes on
/// holes stay, and across a slab one cell thick both sheets move alike.
///
/// # Errors
/// Grid lines that do not increase, holes off the grid, empty or ill-named, too many nodes, nothing
/// left, a jitter outside [0, 0.5).
pub fn box_mesh(settings: &BoxMesh) -> Result<Mesh, MeshError> {
    check_lines(&settings.lines)?;
    let lines: [&[f64]; 3] = std::array::from_fn(|a| &settings.lines[a][..]);
    let blocks = settings.holes.iter().map(|h| block(h, lines)).collect::<Result<Vec<_>, _>>()?;
    let mut mesh = grid(lines, &blocks);
    if mesh.tets.is_empty() {
        return Err(MeshError::Empty { because: ": its holes leave nothing of the box" });
    }
    if let Some((fraction, seed)) = settings.jitter {
        jitter(&mut mesh, lines, &blocks, fraction, seed)?;
    }
    if !blocks.is_empty() {
        mesh.drop_unused_nodes();
    }
    Ok(mesh)
}

fn check_lines(lines: &[Vec<f64>; 3]) -> Result<(), MeshError> {
    for (l, axis) in lines.iter().zip(AXES) {
        if l.len() < 2 {
            return Err(MeshError::NoCells { axis });
        }
        for i in 1..l.len() {
            let step = l[i] - l[i - 1];
            if !(step > 0.0 && step.is_finite()) {
                return Err(MeshError::Lines { axis, line: i, at: l[i], before: l[i - 1] });
            }
        }
    }
    let count = |cells: fn(usize) -> usize| {
        lines.iter().fold(1u64, |n, l| n.saturating_mul(cells(l.len()) as u64))
    };
    let (nodes, tets) = (count(|n| n), count(|n| n - 1).saturating_mul(6));
    if nodes.max(tets) >= u32::MAX as u64 {
        return Err(MeshError::TooLarge { nodes, tets });
    }
    Ok(())
}

/// A hole in grid numbers: cells `range[a][0]..range[a][1]` along each axis.
struct Block {
    range: [[usize; 2]; 3],
    name: String,
}

impl Block {
    fn holds_cell(&self, cell: [usize; 3]) -> bool {
        (0..3).all(|a| (self.range[a][0]..self.range[a][1]).contains(&cell[a]))
    }
    fn touches_node(&self, p: [usize; 3]) -> bool {
        (0..3).all(|a| (self.range[a][0]..=self.range[a][1]).contains(&p[a]))
    }
}

fn block(hole: &Hole, lines: [&[f64]; 3]) -> Result<Block, MeshError> {
    let name = hole.name.clone();
    if SIDES.contains(&&name[..]) {
        return Err(MeshError::HoleName { name });
    }
    let mut range = [[0; 2]; 3];
    for a in 0..3 {
        let axis = AXES[a];
        let [from, to] = hole.range[a];
        if from >= to || from.is_nan() || to.is_nan() {
            return Err(MeshError::HoleEmpty { name, axis, range: [from, to] });
        }
        for (side, at) in [from, to].into_iter().enumerate() {
            let l = lines[a];
            let above = l.partition_point(|&x| x < at).clamp(1, l.len() - 1);
            let i = if at - l[above - 1] < l[above] - at { above - 1 } else { above };
            if (at - l[i]).abs() > ON_LINE * (l[above] - l[above - 1]) {
                return Err(MeshError::HoleOffGrid { name, axis, at, nearest: l[i] });
            }
            range[a][side] = i;
        }
    }
    Ok(Block { range, name })
}

/// All cells but those of the blocks; all nodes of the grid, used or not.
fn grid(lines: [&[f64]; 3], blocks: &[Block]) -> Mesh {
    let n: [usize; 3] = std::array::from_fn(|a| lines[a].len() - 1);
    let mut mesh = Mesh { boundary_names: SIDES.map(String::from).to_vec(), ..Mesh::default() };
    let names: Vec<u32> = blocks
        .iter()
        .map(|b| {
            let known = mesh.boundary_names.iter().position(|n| *n == b.name);
            known.unwrap_or_else(|| {
                mesh.boundary_names.push(b.name.clone());
                mesh.boundary_names.len() - 1
            }) as u32
        })
        .collect();
    let block_at = |cell| blocks.iter().position(|b| b.holds_cell(cell));
    mesh.nodes.reserve_exact(n.iter().map(|n| n + 1).product());
    mesh.tets.reserve_exact(6 * n.iter().product::<usize>());
    for k in 0..=n[2] {
        for j in 0..=n[1] {
            for i in 0..=n[0] {
                mesh.nodes.push([lines[0][i], lines[1][j], lines[2][k]]);
            }
        }
    }
    for k in 0..n[2] {
        for j in 0..n[1] {
            for i in 0..n[0] {
                let cell = [i, j, k];
                if block_at(cell).is_some() {
                    continue;
                }
                // What lies behind each side of the cell: a side of the box, a block, or fluid.
                let mut behind = [[None; 2]; 3];
                for a in 0..3 {
                    for side in 0..2 {
                        let mut next = cell;
                        next[a] = cell[a].wrapping_add(2 * side).wrapping_sub(1);
                        behind[a][side] = if next[a] >= n[a] {
                            Some((2 * a + side) as u32)
                        } else {
                            block_at(next).map(|b| names[b])
                        };
                    }
                }
                push_cell(&mut mesh, n, cell, behind);
            }
        }
    }
    mesh
}

/// Number of grid point `p` where there are `n` cells along each axis.
fn node_at(n: [usize; 3], p: [usize; 3]) -> usize {
    p[0] + (n[0] + 1) * (p[1] + (n[1] + 1) * p[2])
}

/// The six tetrahedra of a cell and the boundary faces among theirs.
fn push_cell(mesh: &mut Mesh, n: [usize; 3], cell: [usize; 3], behind: [[Option<u32>; 2]; 3]) {
    let odd = (cell[0] + cell[1] + cell[2]) % 2 == 1;
    for (o, order) in ORDERS.iter().enumerate() {
        // Corner offsets of the path, mirrored in every odd cell index.
        let mut offset = [0usize; 3];
        let mut tet = [0u32; 4];
        let mut on = [[0usize; 3]; 4];
        for v in 0..4 {
            if v > 0 {
                offset[order[v - 1]] = 1;
            }
            on[v] = std::array::from_fn(|a| offset[a] ^ (cell[a] % 2));
            tet[v] = node_at(n, std::array::from_fn(|a| cell[a] + on[v][a])) as u32;
        }
        // Even permutations are positive in an unmirrored cell.
        if (o >= 3) != odd {
            tet.swap(2, 3);
            on.swap(2, 3);
        }
        let element = mesh.tets.len() as u32;
        for f in super::FACES {
            for a in 0..3 {
                for side in 0..2 {
                    if let Some(name) = behind[a][side]
                        && f.iter().all(|&v| on[v][a] == side)
                    {
                        mesh.boundary.push(BoundaryFace {
                            nodes: f.map(|v| tet[v]),
                            element,
                            name,
                        });
                    }
                }
            }
        }
        mesh.tets.push(tet);
    }
}

/// Moves each node of the full grid by up to `fraction` of the smaller neighbouring spacing along
/// each free axis; halves the motion around elements that would lose too much volume.
fn jitter(
    mesh: &mut Mesh,
    lines: [&[f64]; 3],
    blocks: &[Block],
    fraction: f64,
    seed: u64,
) -> Result<(), MeshError> {
    if !(0.0..0.5).contains(&fraction) {
        return Err(MeshError::Jitter { fraction });
    }
    let n: [usize; 3] = std::array::from_fn(|a| lines[a].len() - 1);
    let thin = n.map(|n| n == 1);
    // Both sheets of a slab share one displacement: that of the node with 0 along the thin axis.
    let shared =
        |p: [usize; 3]| node_at(n, std::array::from_fn(|a| if thin[a] { 0 } else { p[a] }));
    let point =
        |i: usize| [i % (n[0] + 1), i / (n[0] + 1) % (n[1] + 1), i / ((n[0] + 1) * (n[1] + 1))];
    let mut motion = vec![[0.0; 3]; mesh.nodes.len()];
    let mut fixed = vec![false; mesh.nodes.len()];
    for i in 0..mesh.nodes.len() {
        if blocks.iter().any(|b| b.touches_node(point(i))) {
            fixed[shared(point(i))] = true;
        }
    }
    for i in 0..mesh.nodes.len() {
        let p = point(i);
        if shared(p) != i || fixed[i] {
            continue;
        }
        for a in 0..3 {
            if p[a] > 0 && p[a] < n[a] {
                let l = lines[a];
                let spacing = (l[p[a]] - l[p[a] - 1]).min(l[p[a] + 1] - l[p[a]]);
                motion[i][a] = fraction * spacing * random(seed, 3 * i as u64 + a as u64);
            }
        }
    }
    let before: Vec<f64> = (0..mesh.tets.len()).map(|e| Tetrahedron::of(mesh, e).volume).collect();
    let at_rest = std::mem::take(&mut mesh.nodes);
    let moved = |motion: &[[f64; 3]], i: usize| -> [f64; 3] {
        let d = motion[shared(point(i))];
        std::array::from_fn(|a| at_rest[i][a] + d[a])
    };
    // Each round halves the motion at some node of every poor element: 60 rounds reach rest.
    for _ in 0..60 {
        let mut poor = vec![false; at_rest.len()];
        for (tet, v) in mesh.tets.iter().zip(&before) {
            let now = Tetrahedron::new(tet.map(|i| moved(&motion, i as usize))).volume;
            if now < KEPT_VOLUME * v {
                tet.iter().for_each(|&i| poor[shared(point(i as usize))] = true);
            }
        }
        if !poor.contains(&true) {
            break;
        }
        for (d, _) in motion.iter_mut().zip(poor).filter(|(_, poor)| *poor) {
            *d = d.map(|d| 0.5 * d);
        }
    }
    mesh.nodes = (0..at_rest.len()).map(|i| moved(&motion, i)).collect();
    Ok(())
}

/// Uniform in [−1, 1), the same for the same seed and number (splitmix64).
fn random(seed: u64, number: u64) -> f64 {
    let mut z = seed.wrapping_add(number.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^= z >> 31;
    (z >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn even(n: usize) -> Vec<f64> {
        (0..=n).map(|i| i as f64 / n as f64).collect()
    }

    fn hole(range: [[f64; 2]; 3], name: &str) -> Hole {
        Hole { range, name: name.into() }
    }

    fn volume(mesh: &Mesh) -> f64 {
        (0..mesh.tets.len()).map(|e| Tetrahedron::of(mesh, e).volume).sum()
    }

    /// Vector area of each boundary.
    fn areas(mesh: &Mesh) -> Vec<[f64; 3]> {
        let mut area = vec![[0.0; 3]; mesh.boundary_names.len()];
        for f in &mesh.boundary {
            let [a, b, c] = f.nodes.map(|n| nalgebra::Vector3::from(mesh.nodes[n as usize]));
            let normal = 0.5 * (b - a).cross(&(c - a));
            (0..3).for_each(|k| area[f.name as usize][k] += normal[k]);
        }
        area
    }

    #[test]
    fn volumes_and_boundary_normals_sum() {
        let mesh = tensor_box([&even(5), &even(5), &[0.0, 0.1, 0.5]]);
        assert!((volume(&mesh) - 0.5).abs() < 1e-14);
        assert!((0..mesh.tets.len()).all(|e| Tetrahedron::of(&mesh, e).volume > 0.0));
        for (side, (a, wanted)) in
            areas(&mesh).iter().zip([0.5, 0.5, 0.5, 0.5, 1.0, 1.0]).enumerate()
        {
            for k in 0..3 {
                let outward = if side % 2 == 0 { -wanted } else { wanted };
                let wanted = if k == side / 2 { outward } else { 0.0 };
                assert!((a[k] - wanted).abs() < 1e-14, "{side} {a:?}");
            }
        }
    }

    #[test]
    fn holes_are_left_out_and_named() {
        let holes = vec![
            hole([[0.25, 0.5], [0.25, 0.75], [0.25, 0.5]], "block"),
            hole([[0.75, 1.0], [0.0, 1.0], [0.0, 0.25]], "step"), // at the outer boundary
            hole([[0.25, 0.5], [0.75, 1.0], [0.25, 0.5]], "block"), // touches the first
        ];
        let lines = [even(4), even(4), even(4)];
        let settings = BoxMesh { lines, holes, jitter: Some((0.2, 3)) };
        let mesh = box_mesh(&settings).unwrap();
        assert!((volume(&mesh) - (1.0 - 0.75 / 16.0 - 1.0 / 16.0)).abs() < 1e-14);
        assert_eq!(mesh.boundary_names[6..], ["block", "step"]);
        let a = areas(&mesh);
        let close = |x: [f64; 3], y: [f64; 3]| (0..3).all(|k| (x[k] - y[k]).abs() < 1e-14);
        assert!(close(a[0], [-1.0, 0.0, 0.0]) && close(a[1], [0.75, 0.0, 0.0]));
        assert!(close(a[6], [0.0, 1.0 / 16.0, 0.0]), "{:?}", a[6]); // open at y = 1
        assert!(close(a[7], [0.25, 0.0, -0.25]), "{:?}", a[7]);
        let used: std::collections::BTreeSet<u32> = mesh.tets.iter().flatten().copied().collect();
        assert_eq!(used.len(), mesh.nodes.len());
    }

    #[test]
    fn holes_off_the_grid_are_errors() {
        let settings = |range, name| BoxMesh {
            lines: [even(4), even(4), even(4)],
            holes: vec![hole(range, name)],
            jitter: None,
        };
        let error = |range, name| box_mesh(&settings(range, name)).unwrap_err().to_string();
        assert_eq!(
            error([[0.25, 0.5], [0.0, 0.3], [0.0, 0.25]], "post"),
            "hole \"post\": its face y = 0.3 m lies on no grid line (the nearest is y = 0.25 m): \
             move the face there or put a block edge at 0.3"
        );
        assert!(error([[0.25, 1.5], [0.0, 0.25], [0.0, 0.25]], "a").contains("x = 1.5 m"));
        assert!(error([[0.5, 0.5], [0.0, 0.25], [0.0, 0.25]], "a").contains("is empty"));
        assert!(error([[0.5, f64::NAN], [0.0, 0.25], [0.0, 0.25]], "a").contains("is empty"));
        assert!(error([[0.0, 1.0]; 3], "a").contains("leave nothing"));
        assert!(error([[0.0, 0.5]; 3], "x_min").contains("name of a side"));
    }

    #[test]
    fn jitter_moves_the_inside_and_keeps_planes_and_volume() {
        for (n, fraction) in [([6, 5, 4], 0.2), ([6, 5, 4], 0.49), ([8, 1, 7], 0.3)] {
            let lines: [Vec<f64>; 3] = n.map(even);
            let plain = tensor_box([&lines[0], &lines[1], &lines[2]]);
            let settings = BoxMesh { lines, holes: vec![], jitter: Some((fraction, 7)) };
            let mesh = box_mesh(&settings).unwrap();
            assert_eq!(mesh, box_mesh(&settings).unwrap());
            let (mut moved, mut free) = (0, 0);
            for (x, y) in mesh.nodes.iter().zip(&plain.nodes) {
                for a in 0..3 {
                    let on_side = y[a] == 0.0 || y[a] == 1.0;
                    assert!(!on_side || x[a] == y[a]);
                    assert!((x[a] - y[a]).abs() <= fraction / n[a] as f64);
                    free += usize::from(!on_side);
                    moved += usize::from(x[a] != y[a]);
                }
            }
            assert!(moved == free, "{moved} of {free}");
            for (e, _) in mesh.tets.iter().enumerate() {
                let share = Tetrahedron::of(&mesh, e).volume / Tetrahedron::of(&plain, e).volume;
                assert!(share >= KEPT_VOLUME);
            }
            assert!((volume(&mesh) - 1.0).abs() < 1e-13);
            if n[1] == 1 {
                for (i, x) in mesh.nodes.iter().enumerate().filter(|(_, x)| x[1] == 0.0) {
                    let opposite = mesh.nodes[i + n[0] + 1];
                    assert_eq!([x[0], 1.0, x[2]], opposite);
                }
            }
        }
    }
}
