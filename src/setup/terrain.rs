//! The ground under an ESRI ASCII grid of heights, as a closed surface.
//!
//! Heights stand at the cells' centres, the first row in the north. Beyond the grid the ground goes on level, by
//! the grid's own width; it reaches as far down.

use crate::shape::Surface;
use std::collections::HashMap;

/// From the text of a file.
///
/// # Errors
/// A missing or impossible header, a number that is none, a cell without height.
pub fn ground(text: &str) -> Result<Surface, String> {
    let mut header: HashMap<String, f64> = HashMap::new();
    let mut heights: Vec<f64> = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        let broken = |word: &str| format!("line {number}: `{word}` is not a number");
        let mut words = line.split_whitespace().peekable();
        let names = |word: &&str| word.starts_with(|c: char| c.is_ascii_alphabetic());
        if let Some(name) = words.next_if(names) {
            let word = words.next().unwrap_or_default();
            header.insert(name.to_lowercase(), word.parse().map_err(|_| broken(word))?);
            continue;
        }
        for word in words {
            heights.push(word.parse().map_err(|_| broken(word))?);
        }
    }
    let get = |name: &str| header.get(name).copied().ok_or(format!("its header has no {name}"));
    let (columns, rows, cell) = (get("ncols")? as usize, get("nrows")? as usize, get("cellsize")?);
    if columns < 2 || rows < 2 || cell <= 0.0 || heights.len() != columns * rows {
        return Err(format!("has {} heights for {columns} × {rows} cells", heights.len()));
    }
    let none = header.get("nodata_value").copied().unwrap_or(-9999.0);
    if let Some(at) = heights.iter().position(|&h| h == none || !h.is_finite()) {
        return Err(format!("row {}, column {}: no height", at / columns + 1, at % columns + 1));
    }
    let first = |axis: &str| {
        get(&format!("{axis}llcenter"))
            .or_else(|_| get(&format!("{axis}llcorner")).map(|corner| corner + 0.5 * cell))
    };
    let start = [first("x")?, first("y")?];
    let width = cell * columns.max(rows) as f64;
    let lowest = heights.iter().copied().fold(f64::INFINITY, f64::min) - width;

    // One more row and column on each side.
    let (nx, ny) = (columns + 2, rows + 2);
    let place = |i: usize, n: usize, start: f64| match i {
        0 => start - width,
        i if i == n + 1 => start + cell * (n - 1) as f64 + width,
        i => start + cell * (i - 1) as f64,
    };
    let mut surface = Surface::default();
    for bottom in [false, true] {
        for j in 0..ny {
            for i in 0..nx {
                let column = i.clamp(1, columns) - 1;
                let row = rows - j.clamp(1, rows);
                let z = if bottom { lowest } else { heights[row * columns + column] };
                let (x, y) = (place(i, columns, start[0]), place(j, rows, start[1]));
                surface.vertices.push([x, y, z].into());
            }
        }
    }
    let top = |i: usize, j: usize| (j * nx + i) as u32;
    let under = |v: u32| v + (nx * ny) as u32;
    for j in 0..ny - 1 {
        for i in 0..nx - 1 {
            let [a, b, c, d] = [top(i, j), top(i + 1, j), top(i + 1, j + 1), top(i, j + 1)];
            surface.triangles.extend([[a, b, c], [a, c, d]]);
            surface.triangles.extend([[a, c, b], [a, d, c]].map(|t| t.map(under)));
        }
    }
    // Round the border, anticlockwise from above.
    let mut border: Vec<u32> = (0..nx - 1).map(|i| top(i, 0)).collect();
    border.extend((0..ny - 1).map(|j| top(nx - 1, j)));
    border.extend((1..nx).rev().map(|i| top(i, ny - 1)));
    border.extend((1..ny).rev().map(|j| top(0, j)));
    for (k, &a) in border.iter().enumerate() {
        let b = border[(k + 1) % border.len()];
        surface.triangles.extend([[under(a), under(b), b], [under(a), b, a]]);
    }
    Ok(surface)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::Shape;
    use nalgebra::Vector3;

    #[test]
    fn a_slope_is_closed_and_where_its_heights_are() {
        // z = 0.1 y, rows from the north.
        let text = "ncols 4\nnrows 3\nxllcorner 0\nyllcorner -0.5\ncellsize 1\nNODATA_value -9999\n\
                    0.2 0.2 0.2 0.2\n0.1 0.1 0.1 0.1\n0 0 0 0\n";
        let shape = Shape::mesh(ground(text).unwrap()).unwrap();
        let away = |x: f64, y: f64, d: f64| {
            let cosine = 1.01f64.sqrt().recip();
            shape.distance(Vector3::new(x, y, 0.1 * y + d / cosine)) - d
        };
        for (x, y, d) in [(1.5, 1.0, 0.2), (2.2, 0.7, -0.2), (0.6, 1.4, 0.05)] {
            assert!(away(x, y, d).abs() < 1e-9, "{x} {y}: {}", away(x, y, d));
        }
        assert!(ground("ncols 2\nnrows 2\ncellsize 1\nxllcorner 0\nyllcorner 0\n1 2 3").is_err());
        let hole = text.replace("0.1 0.1", "0.1 -9999");
        assert!(ground(&hole).unwrap_err().contains("row 2, column 2"));
    }
}
