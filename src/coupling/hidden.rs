//! Water under bodies that rest: the part of a body's surface that the cut does not see, because it lies on the
//! bottom or on another body, bears the pressure of the nearest water.
//!
//! With n into the body and r from its centroid, `∮n = ∮r×n = ∮(g·r) r×n = 0` and `∮(g·r)n = −gV` over the whole
//! surface: sums over what is seen give those over what is hidden. There `p = P + ρ g·r`, with P and ρ of the seen
//! facets next to it: each counts as `A exp(s/h)`, s its place along the hidden part's outward normal.
//!
//! Of a body that reaches out of the mesh, across a plane of symmetry, the part inside counts: normals of the plane
//! where it is cut off are left out of the sums.

use crate::bodies::{Cluster, Load, Placed};
use crate::cut::{CutElement, CutMesh};
use crate::fem::tetrahedron::Tetrahedron;
use crate::flow::{Flow, Material};
use crate::mesh::MeshPart;
use crate::shape::Bounds;
use nalgebra::Vector3;

/// A hidden part smaller than this share of the surface is an error of the cut.
const LEAST: f64 = 0.05;
/// What a body hides outside the mesh is not wet. One that reaches out by more than this share of its size is cut off.
const OUTSIDE: f64 = 0.05;

/// Bodies that something may hide, and the mesh they are in.
pub struct Hidden<'a> {
    /// All clusters.
    pub clusters: &'a [Cluster],
    /// Where they stand.
    pub placed: &'a [Placed],
    /// Whether each of them is free and unglued: glue lets no water in.
    pub loose: &'a [bool],
    /// Structures that are numbered before them.
    pub first: usize,
    /// Around the mesh.
    pub mesh: &'a Bounds,
}

/// A wall in an element, seen from the centroid of its body.
struct Facet {
    body: usize,
    element: usize,
    /// ∫N_i over its area.
    shares: [f64; 4],
    area: f64,
    /// Into the body.
    n: Vector3<f64>,
    r: Vector3<f64>,
    /// g·r [m²/s²].
    potential: f64,
}

/// Where a body reaches out of the mesh.
#[derive(Clone, Copy, Debug)]
struct CutOff {
    /// Across one of the mesh's two sides along each axis.
    across: [bool; 3],
    /// Of its volume, what is inside: exact for a box along the axes, and for symmetric shapes cut in the middle.
    inside: f64,
}

/// Sums over what is seen of a body: `∫1`, `∫n`, `∫r×n`, `∫(g·r)n`, `∫(g·r)r×n`.
const SUMS: usize = 13;

impl Hidden<'_> {
    /// What the hidden part of each body bears, the same on every rank. Collective.
    pub fn loads(
        &self,
        part: &MeshPart,
        cut: &CutMesh,
        material: &Material,
        flow: &Flow,
    ) -> Vec<Load> {
        let count = self.clusters.len();
        let facets = self.facets(part, cut, material);
        let cut_off: Vec<CutOff> = (0..count).map(|body| self.cut_off(body)).collect();
        let mut seen = vec![0.0; SUMS * count];
        for f in &facets {
            let turn = f.r.cross(&f.n);
            let vectors = [f.n, turn, f.n * f.potential, turn * f.potential];
            let sums = &mut seen[SUMS * f.body..SUMS * (f.body + 1)];
            sums[0] += f.area;
            let numbers = vectors.iter().flat_map(|v| v.iter());
            sums[1..].iter_mut().zip(numbers).for_each(|(sum, v)| *sum += f.area * v);
        }
        part.comm.sum_all(&mut seen);
        // Forces (k even) lose the components across, torques those along.
        let sum = |body: usize, k: usize| {
            let sum = &seen[SUMS * body + 3 * k + 1..SUMS * body + 3 * k + 4];
            let across = cut_off[body].across;
            Vector3::from_fn(|i, _| {
                let lost = if k.is_multiple_of(2) {
                    across[i]
                } else {
                    (0..3).any(|j| j != i && across[j])
                };
                if lost { 0.0 } else { sum[i] }
            })
        };
        // ∫n of the hidden part is minus that of the rest; it points into the body.
        let hides = |body: usize| {
            let (area, missing) = (seen[SUMS * body], sum(body, 0).norm());
            missing > LEAST * (area + missing)
        };

        // Weight, pressure, density and g·r next to the hidden part.
        let mut rim = vec![[0.0; 4]; count];
        for f in facets.iter().filter(|f| hides(f.body)) {
            let out = sum(f.body, 0).normalize();
            let tet = &part.mesh.tets[f.element];
            let size = Tetrahedron::of(&part.mesh, f.element).size();
            let form = &self.clusters[f.body].form;
            let weight = f.area * ((f.r.dot(&out) - form.radius) / size).exp();
            let mean = |of: &dyn Fn(usize) -> f64| {
                let terms = tet.iter().zip(f.shares).map(|(&n, share)| share * of(n as usize));
                terms.sum::<f64>() / f.area
            };
            let values = [1.0, mean(&|n| flow.p[n]), mean(&|n| material.density(n)), f.potential];
            rim[f.body].iter_mut().zip(values).for_each(|(sum, v)| *sum += weight * v);
        }
        part.comm.sum_all(rim.as_flattened_mut());

        let gravity = Vector3::from(material.gravity());
        let load = |body: usize| {
            let [weight, p, rho, potential] = rim[body];
            if weight == 0.0 {
                return Load::default();
            }
            let (p, rho, potential) = (p / weight, rho / weight, potential / weight);
            let level = p - rho * potential;
            let volume = self.clusters[body].form.mass.volume * cut_off[body].inside;
            Load {
                force: -level * sum(body, 0) - rho * (gravity * volume + sum(body, 2)),
                torque: -level * sum(body, 1) - rho * sum(body, 3),
            }
        };
        (0..count).map(load).collect()
    }

    fn cut_off(&self, body: usize) -> CutOff {
        let form = &self.clusters[body].form;
        let bounds = form.bounds_at(&self.placed[body].pose);
        let mut cut_off = CutOff { across: [false; 3], inside: 1.0 };
        for k in 0..3 {
            let (low, high) =
                (bounds.min[k].max(self.mesh.min[k]), bounds.max[k].min(self.mesh.max[k]));
            let (size, inside) = (bounds.max[k] - bounds.min[k], (high - low).max(0.0));
            if size - inside > OUTSIDE * form.radius {
                cut_off.across[k] = true;
                cut_off.inside *= inside / size;
            }
        }
        cut_off
    }

    fn facets(&self, part: &MeshPart, cut: &CutMesh, material: &Material) -> Vec<Facet> {
        let gravity = Vector3::from(material.gravity());
        let facet = |c: &CutElement| {
            let body = (c.body as usize).checked_sub(self.first)?;
            let area = c.pieces.wall.size;
            let r = Vector3::from(c.x) - self.placed[body].pose.position;
            (self.loose[body] && area > 0.0).then(|| Facet {
                body,
                element: c.element as usize,
                shares: c.pieces.wall.first,
                area,
                n: c.pieces.normal.into(),
                r,
                potential: gravity.dot(&r),
            })
        };
        cut.owned(part).filter_map(facet).collect()
    }
}
