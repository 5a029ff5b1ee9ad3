//! Mass that appears, and the momentum it comes with.
//!
//! Densities change as the phase field does; the momentum equation carries mass with its own fluxes. Tested with N_i,
//! the difference
//!
//! ```text
//!     M_i = ∫N_i ∂tρ − ∫ρ ũ·∇N_i + ∫(ρ_l−ρ_g)(R+S)·∇N_i
//! ```
//!
//! is small where the mesh resolves the interface. In the form `ρ(∂t u + a·∇u)` mass that appears has the node's own
//! velocity, which makes `½M_i|u_i|²` of energy: where a splash is thinner than an element, air is fed with the mass of
//! water. Here it comes with ū_i, the mean velocity of the mass around: rows get `M_i⁺ (u_i − ū_i)`. A uniform flow is
//! left alone; mass that vanishes takes its momentum along.

use super::material::Material;
use crate::cut::{Cell, CutMesh};
use crate::fem::region::{Region, Whole};
use crate::fem::tetrahedron::Tetrahedron;
use crate::fem::{dot, norm, triangle_normal};
use crate::mesh::MeshPart;

/// φ(1−φ) from which on an element is mixed.
const MIXED: f64 = 1e-4;

/// Mass that appears at an owned node.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gain {
    /// The node.
    pub node: u32,
    /// M⁺ [kg/s].
    pub rate: f64,
    /// ū [m/s].
    pub velocity: [f64; 3],
}

#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
enum Kind {
    /// One fluid around it.
    Pure,
    Mixed,
    /// More comes than through the elements: at boundaries that let through, at walls that move.
    Open,
}

/// Gains of a step, and what they are found with.
#[derive(Clone, Debug, Default)]
pub(super) struct MassBalance {
    /// Where M > 0.
    pub gains: Vec<Gain>,
    kind: Vec<Kind>,
    /// M, and Σ ρ∫u and Σ ρV of both levels.
    sums: Vec<[f64; 5]>,
}

impl MassBalance {
    /// As the densities of `material` go over to those of `phi` in `dt`, carried by `u`, u' and `flux`.
    pub fn find(
        &mut self,
        part: &MeshPart,
        cut: &CutMesh,
        material: &mut Material,
        [u, fine_scale]: [&[[f64; 3]]; 2],
        (phi, flux): (&[f64], Vec<[f64; 3]>),
        dt: f64,
    ) {
        self.sort_nodes(part, cut, material, u, phi);
        self.sums.clear();
        self.sums.resize(part.n_local(), [0.0; 5]);
        material.set_flux(flux);
        self.add(part, cut, material, [u, fine_scale], -1.0 / dt);
        material.set_phase(phi);
        self.add(part, cut, material, [u, fine_scale], 1.0 / dt);
        self.gains.clear();
        for (i, &[rate, x, y, z, mass]) in self.sums[..part.n_owned()].iter().enumerate() {
            if rate > 0.0 && self.kind[i] == Kind::Mixed {
                let velocity = [x / mass, y / mass, z / mass];
                self.gains.push(Gain { node: i as u32, rate, velocity });
            }
        }
    }

    fn sort_nodes(
        &mut self,
        part: &MeshPart,
        cut: &CutMesh,
        material: &Material,
        u: &[[f64; 3]],
        phi: &[f64],
    ) {
        let mixed = |phi: f64| (phi * (1.0 - phi)).abs() > MIXED;
        self.kind.clear();
        self.kind.resize(part.n_local(), Kind::Pure);
        let still = cut.gained.is_empty();
        for (e, tet) in part.assembled().iter().enumerate() {
            let around = match cut.cell(e) {
                Cell::Cut(_) if !still => Kind::Open,
                _ if tet
                    .iter()
                    .any(|&n| mixed(phi[n as usize]) || mixed(material.phase(n as usize))) =>
                {
                    Kind::Mixed
                }
                _ => continue,
            };
            for &n in tet {
                let kind = &mut self.kind[n as usize];
                *kind = if *kind < around { around } else { *kind };
            }
        }
        for face in &part.mesh.boundary {
            let n = triangle_normal(face.nodes.map(|n| part.mesh.nodes[n as usize]));
            if face.nodes.iter().any(|&i| dot(u[i as usize], n).abs() > 1e-9 * norm(n)) {
                face.nodes.iter().for_each(|&i| self.kind[i as usize] = Kind::Open);
            }
        }
    }

    /// One level's half of the fluxes, its densities times `rate`.
    fn add(
        &mut self,
        part: &MeshPart,
        cut: &CutMesh,
        material: &Material,
        [u, fine_scale]: [&[[f64; 3]]; 2],
        rate: f64,
    ) {
        for (e, tet) in part.assembled().iter().enumerate() {
            if !tet.iter().any(|&n| self.kind[n as usize] == Kind::Mixed) {
                continue;
            }
            let x = part.mesh.corners(e);
            let t = Tetrahedron::new(x);
            let rho = material.element(tet, &x).rho;
            let u = tet.map(|n| u[n as usize]);
            let (first, swept) = match cut.cell(e) {
                Cell::Solid => continue,
                Cell::Whole => ([0.25 * t.volume; 4], Whole(t.volume).integral(&u)),
                Cell::Cut(c) => (c.pieces.fluid.first, c.pieces.fluid.integral(&u)),
            };
            let volume: f64 = first.iter().sum();
            let drift = material.drift(e, rho);
            // u' acts over the whole element.
            let carried: [f64; 3] = std::array::from_fn(|k| {
                0.5 * (swept[k] + volume * drift[k] - t.volume * fine_scale[e][k])
            });
            for (i, &n) in tet.iter().enumerate() {
                let sums = &mut self.sums[n as usize];
                sums[0] += rho * (rate * first[i] - dot(carried, t.grad[i]));
                (0..3).for_each(|k| sums[1 + k] += rho * swept[k]);
                sums[4] += rho * volume;
            }
        }
    }
}
