//! A straight line through the mesh, cut into stretches that each lie in one element: water levels
//! are ∫φ ds. Where the line runs inside a face or along an edge, several elements, perhaps of
//! several ranks, contain it; each piece of it counts once.
//!
//! Each element finds its interval of the line, wide by rounding at faces it shares, so that
//! neighbours overlap and nothing is lost between them; from all intervals of all ranks the same rule
//! then picks the cover, whichever rank holds which element.

use super::locate::{Locator, proper, weights};
use super::{Mesh, MeshError, MeshPart};

/// A piece of a line in one element.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// The element, a number in the mesh.
    pub element: u32,
    /// Where it begins and ends, as fractions of the line.
    pub range: [f64; 2],
    /// Weights of the element's corners at its beginning and its end.
    pub weights: [[f64; 4]; 2],
    /// Its length [m].
    pub length: f64,
}

impl Stretch {
    /// ∫f ds of the P1 field with these nodal values: exact.
    pub fn integral(&self, mesh: &Mesh, at_node: impl Fn(usize) -> f64) -> f64 {
        let tet = mesh.tets[self.element as usize];
        let [from, to] = &self.weights;
        let ends: f64 = (0..4).map(|i| (from[i] + to[i]) * at_node(tet[i] as usize)).sum();
        0.5 * ends * self.length
    }
}

/// What an element offers of a line: from, to, the element's global number.
type Interval = ([f64; 2], u64);

impl Locator {
    /// For each line (the same on all ranks) this rank's stretches of it, in order along it; over all
    /// ranks together they cover the line's part in the mesh once. The locator is of `owned`
    /// elements. Collective.
    ///
    /// # Errors
    /// `LineOutside`, on all ranks: a line that does not meet the mesh.
    pub fn stretches(
        &self,
        part: &MeshPart,
        lines: &[[[f64; 3]; 2]],
    ) -> Result<Vec<Vec<Stretch>>, MeshError> {
        let mut offers: Vec<(u64, Interval)> = Vec::new();
        let mut elements = Vec::new();
        for (l, &line) in lines.iter().enumerate() {
            for (range, element) in self.intervals(&part.mesh, line) {
                offers.push((l as u64, (range, part.element_global[element])));
                elements.push(element);
            }
        }
        let all = part.comm.all_gather(&offers);
        // Where this rank's offers stand in the list of all.
        let before: usize = all[..part.comm.rank()].iter().map(Vec::len).sum();
        let all = all.concat();
        let mut mine = vec![Vec::new(); lines.len()];
        let mut start = vec![Vec::new(); lines.len()];
        for (i, (l, interval)) in all.into_iter().enumerate() {
            start[l as usize].push((interval, i));
        }
        for (l, (offers, &ends)) in start.into_iter().zip(lines).enumerate() {
            let cover = cover(offers);
            let covered: f64 = cover.iter().map(|c| c.0[1] - c.0[0]).sum();
            if covered <= 1e-12 {
                return Err(MeshError::LineOutside { ends });
            }
            for (range, i) in cover {
                if let Some(&element) = i.checked_sub(before).and_then(|i| elements.get(i)) {
                    mine[l].push(stretch(&part.mesh, element, ends, range));
                }
            }
        }
        Ok(mine)
    }

    /// The interval of the line in each element that has more than a point of it.
    fn intervals(&self, mesh: &Mesh, line: [[f64; 3]; 2]) -> Vec<([f64; 2], usize)> {
        if !line.as_flattened().iter().all(|x| x.is_finite()) {
            return Vec::new();
        }
        self.along(line)
            .filter_map(|e| self.interval(mesh, e, line).map(|range| (range, e)))
            .collect()
    }

    /// Where the line's weights in the element are not negative: exactly at boundary faces (unless
    /// the line runs inside one), up to rounding at the others.
    fn interval(&self, mesh: &Mesh, element: usize, line: [[f64; 3]; 2]) -> Option<[f64; 2]> {
        let ([a, b], below) = weights(mesh, element, line);
        let mut range = [0.0, 1.0];
        for i in 0..4 {
            cut(&mut range, a[i] + below[i], b[i] + below[i]);
        }
        for i in (0..4).filter(|&i| self.on_boundary(element, i)) {
            let [from, to] = range.map(|s| a[i] + s * (b[i] - a[i]));
            if from.max(to) > below[i] {
                cut(&mut range, a[i], b[i]);
            }
        }
        (range[0] < range[1]).then_some(range)
    }
}

/// Keeps of the range where a linear function, `a` at 0 and `b` at 1, is not negative.
fn cut(range: &mut [f64; 2], a: f64, b: f64) {
    let zero = a / (a - b);
    match (a < 0.0, b < 0.0) {
        (true, true) => *range = [1.0, 0.0],
        (true, false) => range[0] = range[0].max(zero),
        (false, true) => range[1] = range[1].min(zero),
        (false, false) => (),
    }
}

/// Covers the union of the intervals once: from where the cover ends, the interval that reaches
/// furthest continues it, of equals the one of the lowest element. Returns ranges and what the
/// intervals carry.
fn cover(mut offers: Vec<(Interval, usize)>) -> Vec<([f64; 2], usize)> {
    offers.sort_by(|((a, m), _), ((b, n), _)| a[0].total_cmp(&b[0]).then(m.cmp(n)));
    let mut cover = Vec::new();
    let mut end = f64::NEG_INFINITY;
    let mut best: Option<(Interval, usize)> = None;
    let mut rest = offers.into_iter().peekable();
    loop {
        while let Some(next) = rest.next_if(|((range, _), _)| range[0] <= end) {
            let ((range, element), _) = next;
            let better = best.is_none_or(|((b, e), _)| (range[1], e) > (b[1], element));
            if better {
                best = Some(next);
            }
        }
        match best {
            Some(((range, _), carried)) if range[1] > end => {
                cover.push(([end, range[1]], carried));
                end = range[1];
            }
            // A gap, or the end.
            _ => match rest.peek() {
                Some(((range, _), _)) => end = range[0],
                None => return cover,
            },
        }
    }
}

fn stretch(mesh: &Mesh, element: usize, line: [[f64; 3]; 2], range: [f64; 2]) -> Stretch {
    let [a, b] = line;
    let x = range.map(|s| std::array::from_fn(|k| a[k] + s * (b[k] - a[k])));
    let whole: f64 = (0..3).map(|k| (b[k] - a[k]).powi(2)).sum();
    let (weights, _) = weights(mesh, element, x);
    Stretch {
        element: element as u32,
        range,
        weights: weights.map(proper),
        length: (range[1] - range[0]) * whole.sqrt(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::case::{BoxMesh, Hole};
    use crate::mesh::boxes::box_mesh;

    /// [0, 1] × [0, 0.5] × [0, 0.75] with a hole, cells of 1/8.
    fn mesh(jitter: Option<(f64, u64)>) -> Mesh {
        let line = |n: usize| (0..=n).map(|i| 0.125 * i as f64).collect();
        let holes = vec![Hole { range: HOLE, name: "block".into() }];
        box_mesh(&BoxMesh { lines: [line(8), line(4), line(6)], holes, jitter }).unwrap()
    }

    const HOLE: [[f64; 2]; 3] = [[0.25, 0.5], [0.125, 0.5], [0.25, 0.375]];

    /// Fractions of the line inside a block.
    fn inside([a, b]: [[f64; 3]; 2], block: [[f64; 2]; 3]) -> f64 {
        let mut range = [0.0, 1.0];
        for k in 0..3 {
            cut(&mut range, a[k] - block[k][0], b[k] - block[k][0]);
            cut(&mut range, block[k][1] - a[k], block[k][1] - b[k]);
        }
        (range[1] - range[0]).max(0.0)
    }

    fn length([a, b]: [[f64; 3]; 2]) -> f64 {
        (0..3).map(|k| (b[k] - a[k]).powi(2)).sum::<f64>().sqrt()
    }

    /// Stretches add up to the chord, follow each other, integrate a linear function exactly, and
    /// are the same whichever rank offers which element.
    fn verify(mesh: &Mesh, line: [[f64; 3]; 2], fraction: f64) {
        let part = MeshPart::single(mesh.clone());
        let locator = Locator::owned(&part);
        let Ok(found) = locator.stretches(&part, &[line]) else {
            assert!(fraction < 1e-12, "{line:?} is lost");
            return;
        };
        let found = &found[0];
        let f = |x: [f64; 3]| 1.0 + 2.0 * x[0] - x[1] + 0.5 * x[2];
        let (mut sum, mut integral, mut wanted, mut end) = (0.0, 0.0, 0.0, -1.0);
        for s in found {
            let [from, to] = s.range;
            assert!(from >= end && to > from);
            end = to;
            sum += s.length;
            integral += s.integral(mesh, |n| f(mesh.nodes[n]));
            let [from, to] = s
                .range
                .map(|t| f(std::array::from_fn(|k| line[0][k] + t * (line[1][k] - line[0][k]))));
            wanted += 0.5 * (from + to) * s.length;
        }
        let chord = fraction * length(line);
        assert!((sum - chord).abs() < 1e-12, "{line:?}: {sum} of {chord}");
        assert!((integral - wanted).abs() < 1e-12);
        let offers = locator.intervals(mesh, line);
        let mut shared: Vec<_> = offers.iter().map(|(r, e)| ((*r, *e as u64), *e)).collect();
        shared.sort_by_key(|o| (o.1 % 3, o.1 % 7, o.1));
        let again: Vec<_> = cover(shared).iter().map(|c| (c.1 as u32, c.0)).collect();
        assert_eq!(again, found.iter().map(|s| (s.element, s.range)).collect::<Vec<_>>());
    }

    #[test]
    fn lines_anywhere_add_up() {
        let tank = [[0.0, 1.0], [0.0, 0.5], [0.0, 0.75]];
        let fluid = |line| inside(line, tank) - inside(line, HOLE);
        let mut seed = 1u64;
        let mut random = || {
            seed = seed
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1u64 << 53) as f64
        };
        for jitter in [None, Some((0.3, 2))] {
            let mesh = mesh(jitter);
            for _ in 0..100 {
                let mut end = || std::array::from_fn(|_| 1.4 * random() - 0.2);
                let line = [end(), end()];
                verify(&mesh, line, fluid(line));
            }
            // In planes of the grid and of its diagonals, along edges, through nodes; in the jittered
            // mesh anywhere between. None in a side of the hole, where `fluid` counts nothing.
            for _ in 0..100 {
                let mut end = || std::array::from_fn(|_| (12.0 * random()).floor() / 8.0 - 0.125);
                let line: [[f64; 3]; 2] = [end(), end()];
                let in_side =
                    (0..3).any(|k| line[0][k] == line[1][k] && HOLE[k].contains(&line[0][k]));
                if !in_side && line[0] != line[1] {
                    verify(&mesh, line, fluid(line));
                }
            }
        }
    }

    #[test]
    fn lines_in_sides_and_edges_add_up() {
        for jitter in [None, Some((0.3, 2))] {
            let mesh = mesh(jitter);
            for (line, fraction) in [
                ([[0.0, 0.2, 0.0], [0.0, 0.2, 0.75]], 1.0),
                ([[0.0, 0.2, -0.25], [0.0, 0.2, 0.75]], 0.75),
                ([[1.0, 0.125, 0.1], [1.0, 0.125, 0.7]], 1.0),
                ([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]], 0.75),
                ([[1.0, 0.5, 0.75], [1.0, 0.5, 0.0]], 1.0),
                ([[0.3, 0.0, 0.0], [0.9, 0.0, 0.7]], 1.0),
                ([[0.3, 0.0, 0.0], [0.3, 0.5, 0.0]], 1.0),
                ([[0.0, 0.0, 0.0], [1.0, 0.0, 0.75]], 1.0),
                // In sides and edges of the hole.
                ([[0.25, 0.3, 0.0], [0.25, 0.3, 0.75]], 1.0),
                ([[0.25, 0.0, 0.25], [0.25, 0.5, 0.25]], 1.0),
                ([[0.0, 0.3, 0.375], [1.0, 0.3, 0.375]], 1.0),
                ([[0.0, 0.3, 0.3], [1.0, 0.3, 0.3]], 0.75),
                // On the far side the hole is open: the line is in it, and in no element.
                ([[0.3, 0.5, 0.0], [0.3, 0.5, 0.75]], 1.0 - 0.125 / 0.75),
                // Beside the tank, by more than rounding; and away from it.
                ([[-1e-9, 0.2, 0.0], [-1e-9, 0.2, 0.75]], 0.0),
                ([[5.0, 0.2, 0.0], [5.0, 0.2, 0.75]], 0.0),
                ([[0.3, 0.2, 0.1], [f64::NAN, 0.2, 0.7]], 0.0),
                // Along two sides at once, almost: slopes near rounding.
                ([[0.0, 1e-15, 0.0], [1e-15, 0.0, 0.75]], 1.0),
            ] {
                verify(&mesh, line, fraction);
            }
        }
    }
}
