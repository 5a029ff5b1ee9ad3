//! One tetrahedron cut by a level set that is linear in it: the part where `d > 0`, and the plane `d = 0`.
//!
//! A node with d = 0 counts as solid: pieces that then have no size are left out, and a wall that runs along
//! a face belongs to the element on its fluid side, once. Points are held by their shape functions
//! λ = (N_0 … N_3); the size of a simplex of λ's is |det λ| of the element's.

use crate::fem::region::Moments;
use crate::mesh::FACES;
use crate::mesh::tetrahedron::Tetrahedron;

/// What a level set leaves of an element.
#[allow(clippy::large_enum_variant)] // lives on the stack
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Part {
    /// All of it.
    Whole,
    /// A part with a wall.
    Cut(Pieces),
    /// Nothing.
    Solid,
}

/// The fluid part of a cut element and its wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pieces {
    /// Moments of the fluid part [m³].
    pub fluid: Moments,
    /// Moments of the wall [m²].
    pub wall: Moments,
    /// Unit normal of the wall, out of the fluid.
    pub normal: [f64; 3],
}

/// Shape functions at a point.
type Lambda = [f64; 4];

fn corner(i: usize) -> Lambda {
    std::array::from_fn(|j| f64::from(u8::from(i == j)))
}

/// Where d = 0 on the edge from the fluid corner `p` to the solid corner `s`.
fn crossing(d: &[f64; 4], p: usize, s: usize) -> Lambda {
    let t = d[p] / (d[p] - d[s]);
    let mut l = [0.0; 4];
    l[p] = 1.0 - t;
    l[s] = t;
    l
}

/// Three tetrahedra of the prism with the ends `a` and `b`, corner k of one joined to corner k of the other.
fn prism(a: [Lambda; 3], b: [Lambda; 3]) -> [[Lambda; 4]; 3] {
    [[a[0], a[1], a[2], b[2]], [a[0], a[1], b[1], b[2]], [a[0], b[0], b[1], b[2]]]
}

/// The fluid part of the tetrahedron `t` with corners `x` and level set `d` there.
pub fn cut(t: &Tetrahedron, x: &[[f64; 3]; 4], d: &[f64; 4]) -> Part {
    let wet = d.map(|d| d > 0.0);
    match wet.iter().filter(|&&w| w).count() {
        0 => return Part::Solid,
        4 => return Part::Whole,
        _ => {}
    }
    let mut fluid = Moments::default();
    let wall = split(d, wet, |simplex| fluid.add_simplex(t.volume * det(&simplex).abs(), simplex));

    let slope = t.gradient(*d);
    let mut surface = Moments::default();
    let mut sum = [0.0; 3];
    for triangle in wall {
        let mut area = area_vector(x, &triangle);
        if crate::fem::dot(area, slope) > 0.0 {
            area = area.map(|a| -a);
        }
        sum = std::array::from_fn(|k| sum[k] + area[k]);
        surface.add_simplex(crate::fem::norm(area), triangle);
    }
    let size = crate::fem::norm(sum);
    let normal = if size > 0.0 { sum.map(|n| n / size) } else { [0.0; 3] };
    Part::Cut(Pieces { fluid, wall: surface, normal })
}

/// Calls `piece` for each tetrahedron of the fluid part; returns the triangles of the wall (a triangle twice
/// as a triangle and nothing).
fn split(d: &[f64; 4], wet: [bool; 4], mut piece: impl FnMut([Lambda; 4])) -> [[Lambda; 3]; 2] {
    let of = |wanted: bool| {
        let mut list = [0; 4];
        (0..4).filter(|&i| wet[i] == wanted).enumerate().for_each(|(n, i)| list[n] = i);
        list
    };
    let (p, s) = (of(true), of(false));
    match wet.iter().filter(|&&w| w).count() {
        1 => {
            let c = [0, 1, 2].map(|k| crossing(d, p[0], s[k]));
            piece([corner(p[0]), c[0], c[1], c[2]]);
            [c, [c[0]; 3]]
        }
        2 => {
            let c = [p[0], p[1]].map(|p| [s[0], s[1]].map(|s| crossing(d, p, s)));
            let ends = [0, 1].map(|k| [corner(p[k]), c[k][0], c[k][1]]);
            prism(ends[0], ends[1]).into_iter().for_each(piece);
            [[c[0][0], c[0][1], c[1][1]], [c[0][0], c[1][1], c[1][0]]]
        }
        3 => {
            let corners = [0, 1, 2].map(|k| corner(p[k]));
            let c = [0, 1, 2].map(|k| crossing(d, p[k], s[0]));
            prism(corners, c).into_iter().for_each(piece);
            [c, [c[0]; 3]]
        }
        _ => unreachable!("an element that is cut has wet and dry corners"),
    }
}

/// The fluid part of a triangle with level set `d` at its corners, as triangles of shape functions.
pub fn split_triangle(d: &[f64; 3]) -> impl Iterator<Item = [[f64; 3]; 3]> + use<> {
    let corner = |i: usize| [0, 1, 2].map(|j| f64::from(u8::from(i == j)));
    let crossing = |p: usize, s: usize| {
        let mut l = [0.0; 3];
        l[s] = d[p] / (d[p] - d[s]);
        l[p] = 1.0 - l[s];
        l
    };
    let wet = d.map(|d| d > 0.0);
    let odd = |wanted: bool| wet.iter().position(|&w| w == wanted).unwrap_or(0);
    let pieces = match wet.iter().filter(|&&w| w).count() {
        0 => [None, None],
        1 => {
            let p = odd(true);
            let (a, b) = ((p + 1) % 3, (p + 2) % 3);
            [Some([corner(p), crossing(p, a), crossing(p, b)]), None]
        }
        2 => {
            let s = odd(false);
            let (a, b) = ((s + 1) % 3, (s + 2) % 3);
            let (ca, cb) = (crossing(a, s), crossing(b, s));
            [Some([corner(a), corner(b), cb]), Some([corner(a), cb, ca])]
        }
        _ => [Some([0, 1, 2].map(corner)), None],
    };
    pieces.into_iter().flatten()
}

/// Moments of the fluid part of face `f` [m²]: the outer boundary is cut as the elements are.
pub fn cut_face(x: &[[f64; 3]; 4], d: &[f64; 4], f: usize) -> Moments {
    let mut fluid = Moments::default();
    for piece in split_triangle(&FACES[f].map(|c| d[c])) {
        let corners = piece.map(|l| {
            let mut in_element = [0.0; 4];
            FACES[f].iter().zip(l).for_each(|(&c, l)| in_element[c] = l);
            in_element
        });
        fluid.add_simplex(crate::fem::norm(area_vector(x, &corners)), corners);
    }
    fluid
}

/// Area times a unit normal.
fn area_vector(x: &[[f64; 3]; 4], triangle: &[Lambda; 3]) -> [f64; 3] {
    crate::fem::triangle_normal(triangle.map(|l| {
        std::array::from_fn(|k| l[0] * x[0][k] + l[1] * x[1][k] + l[2] * x[2][k] + l[3] * x[3][k])
    }))
}

/// Of a matrix whose rows sum to 1: the columns may be reduced to three differences.
fn det(m: &[Lambda; 4]) -> f64 {
    let r = |i: usize| [1, 2, 3].map(|k| m[i][k] - m[0][k]);
    let (a, b, c) = (r(1), r(2), r(3));
    a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::{norm, triangle_normal};

    /// Numbers in [0, 1), the same every time (xorshift64*).
    struct Random(u64);
    impl Random {
        fn next(&mut self) -> f64 {
            self.0 ^= self.0 >> 12;
            self.0 ^= self.0 << 25;
            self.0 ^= self.0 >> 27;
            (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) as f64 / (1u64 << 53) as f64
        }
    }

    fn pieces(t: &Tetrahedron, x: &[[f64; 3]; 4], d: &[f64; 4]) -> Pieces {
        let empty =
            Pieces { fluid: Moments::default(), wall: Moments::default(), normal: [0.0; 3] };
        match cut(t, x, d) {
            Part::Cut(pieces) => pieces,
            Part::Whole => {
                let mut fluid = Moments::default();
                fluid.add_simplex(t.volume, [0, 1, 2, 3].map(corner));
                Pieces { fluid, ..empty }
            }
            Part::Solid => empty,
        }
    }

    /// 10⁵ elements, with zeros, planes through corners and elements in all sign cases: both parts together
    /// are the element, moment by moment, and the surface of each part is closed.
    #[test]
    fn parts_add_up_and_are_closed() {
        let mut random = Random(7);
        let mut cases = [0; 5];
        let mut zeros = 0;
        for _ in 0..100_000 {
            let mut x: [[f64; 3]; 4] =
                std::array::from_fn(|_| std::array::from_fn(|_| random.next()));
            let t = Tetrahedron::new(x);
            if t.volume < 0.0 {
                x.swap(2, 3);
            }
            let t = Tetrahedron::new(x);
            if t.volume < 1e-4 {
                continue;
            }
            let d: [f64; 4] = std::array::from_fn(|_| {
                let v = random.next();
                if v < 0.15 {
                    0.0
                } else if v < 0.2 {
                    1e-9 * (v - 0.17)
                } else {
                    v - 0.6
                }
            });
            // No plane at all.
            if d == [0.0; 4] {
                continue;
            }
            zeros += d.iter().filter(|&&d| d == 0.0).count();
            cases[d.iter().filter(|&&d| d > 0.0).count()] += 1;
            // A zero is solid from both sides: the two parts still add up.
            let (wet, dry) = (pieces(&t, &x, &d), pieces(&t, &x, &d.map(|d| -d)));
            let whole = pieces(&t, &x, &[1.0; 4]);
            let both = |a: f64, b: f64, all: f64| {
                assert!(
                    (a + b - all).abs() < 1e-12 * t.volume.max(1e-2),
                    "{a} + {b} != {all}: {d:?}"
                );
            };
            both(wet.fluid.size, dry.fluid.size, t.volume);
            for i in 0..4 {
                both(wet.fluid.first[i], dry.fluid.first[i], whole.fluid.first[i]);
                for j in 0..4 {
                    let all = whole.fluid.second[i][j];
                    both(wet.fluid.second[i][j], dry.fluid.second[i][j], all);
                }
            }
            for (pieces, d) in [(wet, d), (dry, d.map(|d| -d))] {
                let mut sum = pieces.normal.map(|n| n * pieces.wall.size);
                // ∮ x·n = 3V.
                let mut flux = 0.0;
                let place = |m: &Moments| -> [f64; 3] {
                    std::array::from_fn(|k| (0..4).map(|i| m.first[i] * x[i][k]).sum())
                };
                flux += crate::fem::dot(place(&pieces.wall), pieces.normal);
                for f in 0..4 {
                    let area = triangle_normal(FACES[f].map(|i| x[i]));
                    let unit = area.map(|a| a / norm(area));
                    let m = cut_face(&x, &d, f);
                    sum = std::array::from_fn(|k| sum[k] + m.size * unit[k]);
                    flux += crate::fem::dot(place(&m), unit);
                }
                // Along a face that is all zeros, the wall is the face's other side.
                let on_wall = d.iter().filter(|&&d| d == 0.0).count() == 3;
                if !on_wall || d.iter().any(|&d| d > 0.0) {
                    assert!(norm(sum) < 1e-12, "{sum:?}: {d:?}");
                    assert!((flux - 3.0 * pieces.fluid.size).abs() < 1e-12, "{d:?}");
                }
            }
        }
        assert!(cases.iter().all(|&n| n > 500), "{cases:?}");
        assert!(zeros > 20_000);
    }

    #[test]
    fn moments_integrate_a_quadratic_over_a_known_part() {
        // d = ½ − x − y − z in the unit tetrahedron: half of it along each axis.
        let x = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]];
        let t = Tetrahedron::new(x);
        let p = pieces(&t, &x, &[0.5, -0.5, -0.5, -0.5]);
        assert!((p.fluid.size - 1.0 / 48.0).abs() < 1e-16);
        // ∫x² = a⁵/60, ∫xy = a⁵/120 over the tetrahedron of edge a; N_1 = x, N_2 = y.
        let a5 = 0.5f64.powi(5);
        assert!((p.fluid.second[1][1] - a5 / 60.0).abs() < 1e-16);
        assert!((p.fluid.second[1][2] - a5 / 120.0).abs() < 1e-16);
        assert!((p.wall.size - 0.25 * 3f64.sqrt() / 2.0).abs() < 1e-15);
        assert!(p.normal.iter().all(|n| (n - 3f64.sqrt().recip()).abs() < 1e-15));
        // ∮x over the wall is area times the centroid's x.
        assert!((p.wall.first[1] - p.wall.size / 6.0).abs() < 1e-15);
    }
}
