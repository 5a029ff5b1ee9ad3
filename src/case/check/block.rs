//! The `[mesh]` table of a box: grid lines, holes, and points where formulas are tried.

use super::super::error::Problem;
use super::super::file::{Axis, BoxTable, HoleTable, MeshTable};
use super::super::{BoxMesh, Hole, MeshSource};
use super::values::{finite, positive, refuse};
use crate::case::grading::{lines_of_cells, lines_of_sizes};

const AXES: [&str; 3] = ["x", "y", "z"];
/// Boundary names of a box's sides.
pub const SIDES: [&str; 6] = ["x_min", "x_max", "y_min", "y_max", "z_min", "z_max"];
/// A block with more cells than this along one axis is a slip of the finger.
const MOST_CELLS: f64 = 1e6;

/// The box of a mesh table.
pub fn check(mesh: &MeshTable) -> Result<BoxMesh, Problem> {
    let block = mesh.block.as_ref().expect("called for boxes");
    let axes = [&block.x, &block.y, &block.z];
    if block.cells.is_some()
        && let Some(a) = axes.iter().position(|a| matches!(a, Axis::Blocks(_)))
    {
        let message =
            format!("has no place beside the blocks of {}: give each axis its cells", AXES[a]);
        return refuse("mesh.box.cells", message);
    }
    let mut lines = [Vec::new(), Vec::new(), Vec::new()];
    for a in 0..3 {
        lines[a] = lines_along(a, axes[a], block)?;
    }
    let mut holes = Vec::new();
    for (i, typed) in mesh.holes.iter().enumerate() {
        holes.push(hole(&format!("mesh.holes[{}]", i + 1), typed, &lines)?);
    }
    let jitter = mesh.jitter;
    if !(0.0..=0.3).contains(&jitter) {
        return refuse("mesh.jitter", format!("must lie between 0 and 0.3, is {jitter}"));
    }
    let jitter = (jitter > 0.0).then_some((jitter, mesh.jitter_seed));
    Ok(BoxMesh { lines, holes, jitter })
}

fn lines_along(a: usize, axis: &Axis, block: &BoxTable) -> Result<Vec<f64>, Problem> {
    let key = format!("mesh.box.{}", AXES[a]);
    let blocks = match axis {
        Axis::Range(range) => {
            increasing(&key, range)?;
            let Some(cells) = block.cells else {
                return refuse(
                    "mesh.box",
                    "the key \"cells\" is missing: numbers of cells along x, y, z",
                );
            };
            let n = cells_of(&format!("mesh.box.cells[{}]", a + 1), cells[a])?;
            return Ok(lines_of_cells(range, &[n], &[1.0]));
        }
        Axis::Blocks(blocks) => blocks,
    };
    let edges = &blocks.edges;
    let edges_key = format!("{key}.edges");
    if edges.len() < 2 {
        return refuse(edges_key, format!("needs at least 2 edges, found {}", edges.len()));
    }
    increasing(&edges_key, edges)?;
    match (&blocks.cells, &blocks.sizes) {
        (Some(cells), None) => {
            per_block(&format!("{key}.cells"), cells.len(), edges.len() - 1, "blocks")?;
            for (i, n) in cells.iter().enumerate() {
                cells_of(&format!("{key}.cells[{}]", i + 1), *n)?;
            }
            let ratio = blocks.ratio.clone().unwrap_or_else(|| vec![1.0; cells.len()]);
            per_block(&format!("{key}.ratio"), ratio.len(), cells.len(), "blocks")?;
            for (i, r) in ratio.iter().enumerate() {
                positive(&format!("{key}.ratio[{}]", i + 1), *r)?;
            }
            Ok(lines_of_cells(edges, cells, &ratio))
        }
        (None, Some(sizes)) => {
            if blocks.ratio.is_some() {
                return refuse(format!("{key}.ratio"), "follows from sizes where those are given");
            }
            per_block(&format!("{key}.sizes"), sizes.len(), edges.len(), "edges")?;
            for (i, h) in sizes.iter().enumerate() {
                let key = format!("{key}.sizes[{}]", i + 1);
                positive(&key, *h)?;
                let length = edges[edges.len() - 1] - edges[0];
                if length / h > MOST_CELLS {
                    return refuse(key, format!("{h} m is too small for {length} m"));
                }
            }
            Ok(lines_of_sizes(edges, sizes))
        }
        (Some(_), Some(_)) => refuse(format!("{key}.sizes"), "give cells or sizes, not both"),
        (None, None) => refuse(key, "needs cells or sizes beside its edges"),
    }
}

fn increasing(key: &str, edges: &[f64]) -> Result<(), Problem> {
    for edge in edges {
        finite(key, *edge)?;
    }
    match edges.windows(2).find(|e| e[1] <= e[0]) {
        Some(e) => refuse(key, format!("must increase, but {} is followed by {}", e[0], e[1])),
        None => Ok(()),
    }
}

fn cells_of(key: &str, n: u32) -> Result<u32, Problem> {
    if n >= 1 && f64::from(n) <= MOST_CELLS {
        Ok(n)
    } else {
        refuse(key, format!("must lie between 1 and {MOST_CELLS}, is {n}"))
    }
}

fn per_block(key: &str, found: usize, wanted: usize, what: &str) -> Result<(), Problem> {
    if found == wanted {
        Ok(())
    } else {
        refuse(key, format!("needs one value for each of the {wanted} {what}, found {found}"))
    }
}

fn hole(key: &str, typed: &HoleTable, lines: &[Vec<f64>; 3]) -> Result<Hole, Problem> {
    if SIDES.contains(&&*typed.name) || typed.name == "default" || typed.name.is_empty() {
        return refuse(format!("{key}.name"), format!("\"{}\" cannot name a hole", typed.name));
    }
    let range = [typed.x, typed.y, typed.z];
    for a in 0..3 {
        let key = format!("{key}.{}", AXES[a]);
        increasing(&key, &range[a])?;
        for at in range[a] {
            let l = &lines[a];
            let above = l.partition_point(|x| *x < at).clamp(1, l.len() - 1);
            let (below, above) = (l[above - 1], l[above]);
            let nearest = if at - below < above - at { below } else { above };
            if (at - nearest).abs() > 1e-6 * (above - below) {
                let message = format!("{at} is on no grid line; the nearest is {nearest}");
                return refuse(key, message);
            }
        }
    }
    Ok(Hole { range, name: typed.name.clone() })
}

/// Where formulas are tried: nowhere special, so that singular points on walls and axes are no error.
const SHARES: [[f64; 3]; 4] =
    [[0.053, 0.507, 0.961], [0.953, 0.211, 0.047], [0.489, 0.787, 0.523], [0.263, 0.061, 0.297]];

fn points(range: [[f64; 2]; 3]) -> Vec<[f64; 3]> {
    let at = |a: usize, s: f64| range[a][0] + s * (range[a][1] - range[a][0]);
    SHARES.iter().map(|s| std::array::from_fn(|a| at(a, s[a]))).collect()
}

fn extent(mesh: &BoxMesh) -> [[f64; 2]; 3] {
    std::array::from_fn(|a| [mesh.lines[a][0], mesh.lines[a][mesh.lines[a].len() - 1]])
}

/// A few points inside a box outside its holes; none for a mesh whose extent is not known yet.
pub fn points_inside(mesh: &MeshSource) -> Vec<[f64; 3]> {
    let MeshSource::Box(mesh) = mesh else { return Vec::new() };
    let solid = |x: &[f64; 3]| {
        let within = |h: &Hole| (0..3).all(|a| h.range[a][0] <= x[a] && x[a] <= h.range[a][1]);
        mesh.holes.iter().any(within)
    };
    points(extent(mesh)).into_iter().filter(|x| !solid(x)).collect()
}

/// A few points of a side of a box; none for holes and for meshes not known yet.
pub fn points_on(mesh: &MeshSource, boundary: &str) -> Vec<[f64; 3]> {
    let MeshSource::Box(mesh) = mesh else { return Vec::new() };
    let Some(side) = SIDES.iter().position(|s| *s == boundary) else { return Vec::new() };
    let mut range = extent(mesh);
    range[side / 2] = [range[side / 2][side % 2]; 2];
    points(range)
}

/// Every boundary name of a box.
pub fn boundary_names(mesh: &BoxMesh) -> Vec<&str> {
    SIDES.into_iter().chain(mesh.holes.iter().map(|h| &*h.name)).collect()
}
