//! Triangle surfaces: closedness with the place where it fails, orientation, and those of simple solids.

use nalgebra::Vector3;
use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

/// Triangles whose corners run anticlockwise seen from outside.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// [m]
    pub vertices: Vec<Vector3<f64>>,
    /// Corners as indices into `vertices`.
    pub triangles: Vec<[u32; 3]>,
}

/// Why a surface encloses nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OpenSurface {
    /// No triangle has an area.
    #[error("it has no triangles")]
    Empty,
    /// Edges at which not exactly two triangles meet, both with the same side outwards.
    #[error(
        "it is not closed: {count} edges, the first near ({:.6}, {:.6}, {:.6}), are not shared by two \
         triangles of the same orientation", place[0], place[1], place[2]
    )]
    Edges {
        /// Middle of one of them [m].
        place: [f64; 3],
        /// How many.
        count: usize,
    },
    /// It runs through itself.
    #[error(
        "it runs through itself near ({:.6}, {:.6}, {:.6}): join the parts that overlap, or give each as a structure \
         of its own", place[0], place[1], place[2]
    )]
    Crossing {
        /// A point where it does [m].
        place: [f64; 3],
    },
    /// It encloses no volume.
    #[error("it encloses no volume")]
    Flat,
}

impl Surface {
    /// From corners, in whatever order a file has them.
    pub fn new(vertices: &[[f64; 3]], triangles: &[[u32; 3]]) -> Self {
        Self {
            vertices: vertices.iter().map(|&v| v.into()).collect(),
            triangles: triangles.to_vec(),
        }
    }

    /// Places of each triangle's corners.
    pub fn corners(&self) -> impl Iterator<Item = [Vector3<f64>; 3]> + '_ {
        self.triangles.iter().map(|t| t.map(|v| self.vertices[v as usize]))
    }

    /// The volume enclosed [m³]; negative if it is inside out.
    pub fn volume(&self) -> f64 {
        let Some(&near) = self.vertices.first() else { return 0.0 };
        self.corners().map(|[a, b, c]| (a - near).dot(&(b - near).cross(&(c - near))) / 6.0).sum()
    }

    /// One vertex for each place, no triangle without area, normals outwards.
    ///
    /// # Errors
    /// Where it is open.
    pub fn closed(&self) -> Result<Self, OpenSurface> {
        let mut surface = self.welded();
        if surface.triangles.is_empty() {
            return Err(OpenSurface::Empty);
        }
        // A closed surface runs along each edge as often forth as back.
        let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
        for t in &surface.triangles {
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                *edges.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
            }
        }
        let open = || edges.iter().filter(|(_, sum)| **sum != 0).map(|(edge, _)| *edge);
        if let Some((a, b)) = open().min() {
            let middle = 0.5 * (surface.vertices[a as usize] + surface.vertices[b as usize]);
            return Err(OpenSurface::Edges { place: middle.into(), count: open().count() });
        }
        let volume = surface.volume();
        let size = super::Bounds::of(surface.vertices.iter().copied()).diagonal();
        if volume.abs() < 1e-12 * size.powi(3) {
            return Err(OpenSurface::Flat);
        }
        if volume < 0.0 {
            surface.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        Ok(surface)
    }

    /// Vertices at the same place become one; triangles without three different corners go.
    fn welded(&self) -> Self {
        let mut index: HashMap<[u64; 3], u32> = HashMap::new();
        let mut welded = Self::default();
        let number: Vec<u32> = self
            .vertices
            .iter()
            .map(|&v| {
                // Zero has two signs.
                let key: [u64; 3] = (v + Vector3::repeat(0.0)).map(f64::to_bits).into();
                *index.entry(key).or_insert_with(|| {
                    welded.vertices.push(v);
                    welded.vertices.len() as u32 - 1
                })
            })
            .collect();
        welded.triangles = self
            .triangles
            .iter()
            .map(|t| t.map(|v| number[v as usize]))
            .filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0])
            .collect();
        welded
    }

    /// Of a cuboid with these edges, centred on the origin.
    pub fn cuboid([a, b, c]: [f64; 3]) -> Self {
        let vertices = (0..8)
            .map(|i| {
                let side =
                    |bit: u32, edge: f64| if i >> bit & 1 == 1 { 0.5 * edge } else { -0.5 * edge };
                Vector3::new(side(0, a), side(1, b), side(2, c))
            })
            .collect();
        let quads =
            [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        Self { vertices, triangles }
    }

    /// Of a sphere around the origin, in facets no longer than `facet`.
    pub fn sphere(radius: f64, facet: f64) -> Self {
        let rows = ((PI * radius / facet).ceil() as usize).clamp(6, 400);
        let profile = (1..rows).map(|i| {
            let angle = PI * i as f64 / rows as f64;
            (radius * angle.sin(), -radius * angle.cos())
        });
        Self::turned(profile, 2 * rows, [-radius, radius])
    }

    /// Of a cylinder along z around the origin, in facets no wider than `facet`.
    pub fn cylinder(radius: f64, height: f64, facet: f64) -> Self {
        let around = ((TAU * radius / facet).ceil() as usize).clamp(12, 800);
        let half = 0.5 * height;
        Self::turned([(radius, -half), (radius, half)].into_iter(), around, [-half, half])
    }

    /// What a profile (distance from the axis, z) encloses between its poles when it turns about z.
    fn turned(profile: impl Iterator<Item = (f64, f64)>, around: usize, poles: [f64; 2]) -> Self {
        let mut surface = Self::default();
        let mut rows = 0;
        for (r, z) in profile {
            rows += 1;
            surface.vertices.extend((0..around).map(|k| {
                let angle = TAU * k as f64 / around as f64;
                Vector3::new(r * angle.cos(), r * angle.sin(), z)
            }));
        }
        let at = |row: usize, k: usize| (row * around + k % around) as u32;
        let [bottom, top] = [0, 1].map(|i| (rows * around + i) as u32);
        surface.vertices.extend(poles.map(|z| Vector3::new(0.0, 0.0, z)));
        for k in 0..around {
            surface.triangles.push([bottom, at(0, k + 1), at(0, k)]);
            surface.triangles.push([top, at(rows - 1, k), at(rows - 1, k + 1)]);
            for row in 1..rows {
                let [a, b] = [at(row - 1, k), at(row - 1, k + 1)];
                let [c, d] = [at(row, k), at(row, k + 1)];
                surface.triangles.extend([[a, b, d], [a, d, c]]);
            }
        }
        surface
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_open_surface_says_where() {
        let mut surface = Surface::cuboid([1.0, 1.0, 1.0]);
        surface.triangles.pop();
        let Err(OpenSurface::Edges { place, count }) = surface.closed() else { panic!("open") };
        assert_eq!(count, 3);
        assert!((place[2] - 0.5).abs() < 1e-15, "the hole is in the top: {place:?}");
        let mut turned = Surface::cuboid([1.0, 1.0, 1.0]);
        turned.triangles[0].swap(0, 1);
        assert!(matches!(turned.closed(), Err(OpenSurface::Edges { count: 3, .. })));
        assert_eq!(Surface::default().closed(), Err(OpenSurface::Empty));
        let flat =
            Surface::new(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2], [0, 2, 1]]);
        assert_eq!(flat.closed(), Err(OpenSurface::Flat));
    }

    #[test]
    fn inside_out_is_turned_and_loose_corners_are_joined() {
        let cube = Surface::cuboid([1.0, 2.0, 3.0]);
        let mut soup = Surface::default();
        for [a, b, c] in cube.corners() {
            let n = soup.vertices.len() as u32;
            soup.vertices.extend([a, c, b]);
            soup.triangles.push([n, n + 1, n + 2]);
        }
        let closed = soup.closed().unwrap();
        assert_eq!(closed.vertices.len(), 8);
        assert!((closed.volume() - 6.0).abs() < 1e-14);
    }
}
