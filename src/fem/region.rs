//! The part of an element that integrals run over, known by its P1 moments `∫1`, `∫N_i`, `∫N_iN_j`.
//!
//! They are all that the weak forms ask of a quadrature, so an element that a structure cuts is an ordinary
//! element with other moments (METHOD.md, 5). Weak forms are written once, over `Region`, and compiled twice.

use crate::fem::number::Real;

/// Moments of a region inside a tetrahedron.
pub trait Region<R: Real = f64>: Copy {
    /// ∫1 [m³]
    fn volume(&self) -> R;
    /// ∫N_i [m³]
    fn first(&self, i: usize) -> R;
    /// ∫N_i N_j [m³]
    fn second(&self, i: usize, j: usize) -> R;

    /// ∫f of a function with these corner values, component by component.
    #[inline]
    fn integral<const C: usize>(&self, f: &[[R; C]; 4]) -> [R; C] {
        std::array::from_fn(|k| {
            (self.first(0) * f[0][k] + self.first(1) * f[1][k])
                + (self.first(2) * f[2][k] + self.first(3) * f[3][k])
        })
    }
    /// ∫N_i f
    #[inline]
    fn weighted<const C: usize>(&self, i: usize, f: &[[R; C]; 4]) -> [R; C] {
        std::array::from_fn(|k| {
            (self.second(i, 0) * f[0][k] + self.second(i, 1) * f[1][k])
                + (self.second(i, 2) * f[2][k] + self.second(i, 3) * f[3][k])
        })
    }
    /// The mean of f.
    #[inline]
    fn mean<const C: usize>(&self, f: &[[R; C]; 4]) -> [R; C] {
        let share = R::of(1.0) / self.volume();
        self.integral(f).map(|v| v * share)
    }
}

/// All of a tetrahedron of this volume.
#[derive(Clone, Copy, Debug)]
pub struct Whole<R = f64>(pub R);

impl<R: Real> Region<R> for Whole<R> {
    #[inline]
    fn volume(&self) -> R {
        self.0
    }
    #[inline]
    fn first(&self, _: usize) -> R {
        R::of(0.25) * self.0
    }
    #[inline]
    fn second(&self, i: usize, j: usize) -> R {
        R::of(if i == j { 0.1 } else { 0.05 }) * self.0
    }
    #[inline]
    fn integral<const C: usize>(&self, f: &[[R; C]; 4]) -> [R; C] {
        self.mean(f).map(|v| v * self.0)
    }
    #[inline]
    fn weighted<const C: usize>(&self, i: usize, f: &[[R; C]; 4]) -> [R; C] {
        let share = R::of(0.05) * self.0;
        std::array::from_fn(|k| share * (f[0][k] + f[1][k] + f[2][k] + f[3][k] + f[i][k]))
    }
    #[inline]
    fn mean<const C: usize>(&self, f: &[[R; C]; 4]) -> [R; C] {
        std::array::from_fn(|k| R::of(0.25) * (f[0][k] + f[1][k] + f[2][k] + f[3][k]))
    }
}

/// Part of a tetrahedron, or of a plane through it (with areas for volumes).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moments {
    /// ∫1
    pub size: f64,
    /// ∫N_i
    pub first: [f64; 4],
    /// ∫N_iN_j
    pub second: [[f64; 4]; 4],
}

impl Moments {
    /// Adds a simplex of this size with `corners` given by their shape functions, `N = corners.len()`.
    #[inline]
    pub fn add_simplex<const N: usize>(&mut self, size: f64, corners: [[f64; 4]; N]) {
        let sum: [f64; 4] = std::array::from_fn(|i| corners.iter().map(|l| l[i]).sum());
        let n = N as f64;
        self.size += size;
        for i in 0..4 {
            self.first[i] += size / n * sum[i];
            for j in 0..4 {
                let products: f64 = corners.iter().map(|l| l[i] * l[j]).sum();
                self.second[i][j] += size / (n * (n + 1.0)) * (sum[i] * sum[j] + products);
            }
        }
    }
}

impl Region for Moments {
    #[inline]
    fn volume(&self) -> f64 {
        self.size
    }
    #[inline]
    fn first(&self, i: usize) -> f64 {
        self.first[i]
    }
    #[inline]
    fn second(&self, i: usize, j: usize) -> f64 {
        self.second[i][j]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_whole_element_is_a_simplex_of_its_own_corners() {
        let corners: [[f64; 4]; 4] =
            std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
        let mut m = Moments::default();
        m.add_simplex(3.0, corners);
        let whole = Whole(3.0);
        let f = [[1.0, 2.0], [0.5, -1.0], [3.0, 0.0], [-2.0, 7.0]];
        assert!((m.volume() - whole.volume()).abs() < 1e-15);
        for i in 0..4 {
            assert!((m.first(i) - whole.first(i)).abs() < 1e-15);
            for j in 0..4 {
                assert!((m.second(i, j) - whole.second(i, j)).abs() < 1e-15);
            }
            for k in 0..2 {
                assert!((m.weighted(i, &f)[k] - whole.weighted(i, &f)[k]).abs() < 1e-14);
                assert!((m.mean(&f)[k] - whole.mean(&f)[k]).abs() < 1e-14);
                assert!((m.integral(&f)[k] - whole.integral(&f)[k]).abs() < 1e-14);
            }
        }
    }
}
