//! What the fluid does to each body: the reaction of the weak form (`wall`), and its traction alone.

use super::material::Material;
use super::step::Flow;
use crate::cut::surface::cross;
use crate::cut::{CutMesh, Surface};
use crate::mesh::MeshPart;

/// Force, and torque about the motion's centre.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    /// [N]
    pub force: [f64; 3],
    /// [N m]
    pub torque: [f64; 3],
}

impl Load {
    pub(super) fn add(&mut self, force: [f64; 3], arm: [f64; 3]) {
        let torque = cross(arm, force);
        for k in 0..3 {
            self.force[k] += force[k];
            self.torque[k] += torque[k];
        }
    }
}

/// Both measures of what a body bears.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BodyLoad {
    /// What the discrete momentum equation passes to the body.
    pub reaction: Load,
    /// ∮ (p n − 2με(u)n) alone.
    pub traction: Load,
    /// Wetted area [m²].
    pub area: f64,
}

impl Flow {
    /// Loads of the last step on each of `surfaces`, the same on every rank. Collective.
    pub fn loads(
        &self,
        part: &MeshPart,
        cut: &CutMesh,
        material: &Material,
        surfaces: &[Surface],
    ) -> Vec<BodyLoad> {
        let mut loads = vec![BodyLoad::default(); surfaces.len()];
        for c in cut.owned(part) {
            let tet = &part.mesh.tets[c.element as usize];
            let surface = &surfaces[c.body as usize];
            let (u, p) = (tet.map(|n| self.u[n as usize]), tet.map(|n| self.p[n as usize]));
            let [reaction, traction] = self.last_reaction(part, cut, material, c, surface, &u, &p);
            let load = &mut loads[c.body as usize];
            load.area += c.pieces.wall.size;
            for (i, x) in part.mesh.corners(c.element as usize).into_iter().enumerate() {
                let arm = std::array::from_fn(|k| x[k] - surface.motion.centre[k]);
                load.reaction.add(reaction[i], arm);
                load.traction.add(traction[i], arm);
            }
        }
        let mut sums: Vec<f64> = Vec::with_capacity(13 * loads.len());
        for l in &loads {
            for load in [&l.reaction, &l.traction] {
                sums.extend(load.force);
                sums.extend(load.torque);
            }
            sums.push(l.area);
        }
        part.comm.sum_all(&mut sums);
        for (l, s) in loads.iter_mut().zip(sums.chunks_exact(13)) {
            let load = |at: usize| Load {
                force: std::array::from_fn(|k| s[at + k]),
                torque: std::array::from_fn(|k| s[at + 3 + k]),
            };
            *l = BodyLoad { reaction: load(0), traction: load(6), area: s[12] };
        }
        loads
    }
}
