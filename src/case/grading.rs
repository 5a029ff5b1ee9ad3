//! Grid lines along one axis: blocks between edges, cells growing geometrically inside each.
//!
//! A block of length L with n cells, the last R times the first, has cells a, aq, aq², … with
//! q = R^(1/(n−1)) and a = L (1−q)/(1−qⁿ).

/// Lines of blocks between increasing `edges`, block b having `cells[b] ≥ 1` cells, its last
/// `ratio[b] > 0` times as long as its first. The edges themselves are met exactly.
pub fn lines_of_cells(edges: &[f64], cells: &[u32], ratio: &[f64]) -> Vec<f64> {
    assert!(cells.len() + 1 == edges.len() && ratio.len() == cells.len(), "one entry per block");
    let mut lines = vec![edges[0]];
    for (b, ends) in edges.windows(2).enumerate() {
        let (n, length) = (cells[b], ends[1] - ends[0]);
        let q = if n > 1 { ratio[b].powf(1.0 / f64::from(n - 1)) } else { 1.0 };
        for i in 1..n {
            // (1 − qⁱ)/(1 − qⁿ), written so that q → 1 loses no digits.
            let log_q = q.ln();
            let s = if log_q.abs() < 1e-12 {
                f64::from(i) / f64::from(n)
            } else {
                (f64::from(i) * log_q).exp_m1() / (f64::from(n) * log_q).exp_m1()
            };
            lines.push(ends[0] + length * s);
        }
        lines.push(ends[1]);
    }
    lines
}

/// Lines of blocks whose cells have the wanted `sizes` at the edges, growing geometrically between
/// them, a little smaller where they do not fit: the size varies linearly, so a block of length L takes
/// ∫dx/h = L ln(h₁/h₀)/(h₁−h₀) cells.
pub fn lines_of_sizes(edges: &[f64], sizes: &[f64]) -> Vec<f64> {
    assert!(sizes.len() == edges.len(), "one size per edge");
    let mut cells = Vec::new();
    let mut ratio = Vec::new();
    for (ends, h) in edges.windows(2).zip(sizes.windows(2)) {
        let growth = h[1] / h[0];
        let mean = if (growth - 1.0).abs() < 1e-9 { h[0] } else { (h[1] - h[0]) / growth.ln() };
        let n = ((ends[1] - ends[0]) / mean - 1e-6).ceil().max(1.0);
        cells.push(n as u32);
        // The sizes hold at the edges, half a cell outside the first and last centres.
        ratio.push(growth.powf((n - 1.0) / n));
    }
    lines_of_cells(edges, &cells, &ratio)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sizes(lines: &[f64]) -> Vec<f64> {
        lines.windows(2).map(|l| l[1] - l[0]).collect()
    }

    #[test]
    fn equal_cells_are_equal() {
        let lines = lines_of_cells(&[0.0, 3.22], &[64], &[1.0]);
        assert_eq!((lines.len(), lines[0], lines[64]), (65, 0.0, 3.22));
        assert!(sizes(&lines).iter().all(|h| (h - 3.22 / 64.0).abs() < 1e-14));
    }

    #[test]
    fn ratio_is_last_over_first_and_growth_is_geometric() {
        let lines = lines_of_cells(&[-1.0, 0.0, 2.0], &[10, 7], &[0.2, 5.0]);
        assert_eq!((lines.len(), lines[10], lines[17]), (18, 0.0, 2.0));
        for (block, ratio) in [(&lines[..=10], 0.2), (&lines[10..], 5.0)] {
            let h = sizes(block);
            assert!((h[h.len() - 1] / h[0] - ratio).abs() < 1e-12);
            let q = h[1] / h[0];
            assert!(h.windows(2).all(|p| (p[1] / p[0] - q).abs() < 1e-11));
        }
    }

    #[test]
    fn wanted_sizes_are_met_at_edges() {
        let lines = lines_of_sizes(&[0.0, 0.9, 1.1, 1.5], &[0.05, 0.0025, 0.0025, 0.05]);
        for (at, wanted) in [(0.0, 0.05), (0.9, 0.0025), (1.1, 0.0025), (1.5, 0.05)] {
            let i = lines.iter().position(|x| *x == at).expect("edges are met exactly");
            for h in sizes(&lines[i.saturating_sub(1)..(i + 2).min(lines.len())]) {
                assert!(h < 1.06 * wanted && h > 0.8 * wanted, "{h} at {at}, wanted {wanted}");
            }
        }
        let h = sizes(&lines);
        assert!(h.windows(2).all(|p| (p[1] / p[0]).ln().abs() < 0.2), "{h:?}");
        assert_eq!(lines_of_sizes(&[0.0, 1.0], &[0.1, 0.1]).len(), 11);
        assert_eq!(lines_of_sizes(&[0.0, 0.01], &[0.05, 0.05]).len(), 2);
    }
}
