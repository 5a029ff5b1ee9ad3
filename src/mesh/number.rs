//! The numbers that formulas of elements are written in: one, or four at once, each of another element.

use super::tetrahedron::cube_root;
use std::ops::{Add, AddAssign, Mul, Neg, Sub};
pub use wide::{f32x4, f64x4};

/// What adds and multiplies.
pub trait Number:
    Copy
    + Default
    + Neg<Output = Self>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + AddAssign
{
}

impl Number for f32 {}
impl Number for f64 {}
impl Number for f32x4 {}
impl Number for f64x4 {}

/// What is left of real numbers in double precision.
pub trait Real: Number + std::ops::Div<Output = Self> {
    /// The same in single precision.
    type Single: Number;
    /// This value, in all lanes.
    fn of(value: f64) -> Self;
    /// Rounded.
    fn single(self) -> Self::Single;
    /// The larger one.
    fn larger(self, other: Self) -> Self;
    /// `then` where `self` is larger than `other`.
    fn where_larger(self, other: Self, then: Self, otherwise: Self) -> Self;
    /// √
    fn square_root(self) -> Self;
    /// ∛
    fn cube_root(self) -> Self;
}

impl Real for f64 {
    type Single = f32;
    #[inline]
    fn of(value: f64) -> Self {
        value
    }
    #[inline]
    fn single(self) -> f32 {
        self as f32
    }
    #[inline]
    fn larger(self, other: Self) -> Self {
        self.max(other)
    }
    #[inline]
    fn where_larger(self, other: Self, then: Self, otherwise: Self) -> Self {
        if self > other { then } else { otherwise }
    }
    #[inline]
    fn square_root(self) -> Self {
        self.sqrt()
    }
    #[inline]
    fn cube_root(self) -> Self {
        cube_root(self)
    }
}

impl Real for f64x4 {
    type Single = f32x4;
    #[inline]
    fn of(value: f64) -> Self {
        Self::splat(value)
    }
    #[inline]
    fn single(self) -> f32x4 {
        f32x4::from(self.to_array().map(|value| value as f32))
    }
    #[inline]
    fn larger(self, other: Self) -> Self {
        self.fast_max(other)
    }
    #[inline]
    fn where_larger(self, other: Self, then: Self, otherwise: Self) -> Self {
        self.simd_gt(other).bitselect(then, otherwise)
    }
    #[inline]
    fn square_root(self) -> Self {
        self.sqrt()
    }
    #[inline]
    fn cube_root(self) -> Self {
        self.cbrt()
    }
}

/// Lane by lane, from the same value of each of four.
#[inline(always)]
pub fn packed<T>(four: &[T; 4], value: impl Fn(&T) -> f64) -> f64x4 {
    f64x4::from([value(&four[0]), value(&four[1]), value(&four[2]), value(&four[3])])
}

/// Elements, four at a time, and how many of the four are meant: the last ones are filled up.
pub fn fours(
    mut elements: impl Iterator<Item = usize>,
) -> impl Iterator<Item = ([usize; 4], usize)> {
    std::iter::from_fn(move || {
        let mut four = [elements.next()?; 4];
        let rest = four[1..].iter_mut().zip(&mut elements);
        let n = 1 + rest.map(|(place, e)| *place = e).count();
        Some((four, n))
    })
}

/// Nodal values at the corners of four elements.
#[inline(always)]
pub fn scalars(tets: &[[u32; 4]; 4], of: &[f64]) -> [f64x4; 4] {
    corners(tets, of.as_chunks::<1>().0).map(|[v]| v)
}

/// Nodal vectors at the corners of four elements.
#[inline(always)]
pub fn corners<const C: usize>(tets: &[[u32; 4]; 4], of: &[[f64; C]]) -> [[f64x4; C]; 4] {
    let mut packed = [[f64x4::default(); C]; 4];
    for i in 0..4 {
        let [a, b, c, d] = [0, 1, 2, 3].map(|l| &of[tets[l][i] as usize]);
        for k in 0..C {
            packed[i][k] = f64x4::from([a[k], b[k], c[k], d[k]]);
        }
    }
    packed
}
