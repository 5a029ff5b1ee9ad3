//! Boxes that meet: found in the cells of a grid, which share the places of a hash table.

use crate::shape::Bounds;
use nalgebra::Vector3;

/// All pairs of boxes that meet, the lower number first, sorted. Cost linear for boxes of like size.
pub(super) fn meeting(boxes: &[(u32, Bounds)]) -> Vec<(u32, u32)> {
    let mut pairs = Vec::new();
    if boxes.len() < 2 {
        return pairs;
    }
    let low = boxes.iter().fold(Vector3::repeat(f64::INFINITY), |low, b| low.inf(&b.1.min));
    let mut sizes: Vec<f64> = boxes.iter().map(|b| (b.1.max - b.1.min).max()).collect();
    sizes.sort_unstable_by(f64::total_cmp);
    let mut cell = 1.5 * sizes[sizes.len() / 2];
    // First and last cell of each box.
    let ranges = |cell: f64| -> Vec<[Vector3<i64>; 2]> {
        let place = |x: Vector3<f64>| ((x - low) * (1.0 / cell)).map(|x| x as i64);
        boxes.iter().map(|(_, b)| [place(b.min), place(b.max)]).collect()
    };
    let cells = |ranges: &[[Vector3<i64>; 2]]| -> i64 {
        ranges.iter().map(|[from, to]| (to - from).add_scalar(1).product()).sum()
    };
    // A few large ones among small ones must not fill the grid.
    let mut range = ranges(cell);
    while cells(&range) > 27 * boxes.len() as i64 {
        cell *= 1.5;
        range = ranges(cell);
    }
    // A cell in one number, and its place in the table.
    let [_, wide, high] = <[i64; 3]>::from(
        range.iter().fold(Vector3::zeros(), |most, [_, to]| most.sup(&to.add_scalar(1))),
    );
    let number = |x: i64, y: i64, z: i64| (x * wide + y) * high + z;
    let bits = boxes.len().ilog2() + 1;
    let place = |cell: i64| ((cell as u64).wrapping_mul(HASH) >> (64 - bits)) as usize;
    let each_cell = |[from, to]: &[Vector3<i64>; 2]| {
        let (from, to) = (*from, *to);
        (from.x..=to.x).flat_map(move |x| {
            (from.y..=to.y).flat_map(move |y| (from.z..=to.z).map(move |z| number(x, y, z)))
        })
    };
    let mut starts = vec![0u32; (1 << bits) + 1];
    range.iter().flat_map(each_cell).for_each(|cell| starts[place(cell) + 1] += 1);
    (0..1 << bits).for_each(|i| starts[i + 1] += starts[i]);
    let mut entries = vec![(0, 0); starts[1 << bits] as usize];
    let mut next = starts.clone();
    for (n, range) in (0u32..).zip(&range) {
        for cell in each_cell(range) {
            let at = &mut next[place(cell)];
            entries[*at as usize] = (cell, n);
            *at += 1;
        }
    }
    for ends in starts.windows(2) {
        let mates = &entries[ends[0] as usize..ends[1] as usize];
        for (m, &(here, a)) in mates.iter().enumerate() {
            let (p, p_box) = &boxes[a as usize];
            for &(_, b) in mates[m + 1..].iter().filter(|mate| mate.0 == here) {
                let (q, q_box) = &boxes[b as usize];
                if p_box.meets(q_box) {
                    // A pair is found once: in the cell of its boxes' common lower corner.
                    let corner = range[a as usize][0].sup(&range[b as usize][0]);
                    if number(corner.x, corner.y, corner.z) == here {
                        pairs.push((*p.min(q), *p.max(q)));
                    }
                }
            }
        }
    }
    sorted(pairs)
}

/// Spreads the numbers of cells (2⁶⁴ over the golden ratio).
const HASH: u64 = 0x9e37_79b9_7f4a_7c15;

/// Sorts by counting: by the second numbers, then by the first.
fn sorted(mut pairs: Vec<(u32, u32)>) -> Vec<(u32, u32)> {
    let n = pairs.iter().map(|p| p.1 as usize + 1).max().unwrap_or(0);
    let mut other = pairs.clone();
    for key in [|p: &(u32, u32)| p.1 as usize, |p: &(u32, u32)| p.0 as usize] {
        let mut next = vec![0u32; n + 1];
        pairs.iter().for_each(|p| next[key(p) + 1] += 1);
        (0..n).for_each(|i| next[i + 1] += next[i]);
        for p in &pairs {
            let at = &mut next[key(p)];
            other[*at as usize] = *p;
            *at += 1;
        }
        std::mem::swap(&mut pairs, &mut other);
    }
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_that_meet_are_found_once() {
        let mut seed = 1u64;
        let mut random = || {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (seed >> 11) as f64 / (1u64 << 53) as f64
        };
        let boxes: Vec<(u32, Bounds)> = (0..300)
            .map(|i| {
                let min = Vector3::new(random(), random(), random());
                let size = if i % 50 == 0 { 0.7 } else { 0.08 };
                (i, Bounds { min, max: min + Vector3::repeat(size * (0.5 + random())) })
            })
            .collect();
        let found = meeting(&boxes);
        let mut all = Vec::new();
        for (i, a) in &boxes {
            all.extend(boxes.iter().filter(|(j, b)| j > i && a.meets(b)).map(|(j, _)| (*i, *j)));
        }
        assert_eq!(found, all);
    }
}
