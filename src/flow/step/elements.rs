//! What is known of elements when a step begins: one by one, or four at a time.

use super::*;
use crate::fem::number::packed;

impl Flow {
    /// Element `e` of the step that began with the velocity `old`.
    pub(super) fn element(
        &self,
        part: &MeshPart,
        material: &Material,
        e: usize,
        old: &[[f64; 3]],
        dt: f64,
        theta: f64,
    ) -> Element {
        let tet = &part.mesh.tets[e];
        let corners = |of: &[[f64; 3]]| tet.map(|n| of[n as usize]);
        let x = corners(&part.mesh.nodes);
        let mut element = Element {
            geometry: Tetrahedron::new(x),
            material: material.element(tet, &x),
            u: corners(old),
            a: corners(&self.a),
            laplacian: self.laplacian_in(part, material, e),
            dt,
            dt_tau: self.dt_tau,
            theta,
        };
        if !self.nodal_force.is_empty() {
            element.material.add_force(&corners(&self.nodal_force));
        }
        element.carry(material.drift(e, element.material.rho));
        element
    }

    /// Four of them.
    #[inline(always)]
    pub(super) fn elements(
        &self,
        part: &MeshPart,
        material: &Material,
        four: [usize; 4],
        old: &[[f64; 3]],
        dt: f64,
        theta: f64,
    ) -> Element<f64x4> {
        let tets = four.map(|e| part.mesh.tets[e]);
        let x = corners(&tets, &part.mesh.nodes);
        let geometry = Tetrahedron::new(x);
        let mut element = Element {
            geometry,
            material: material.elements(&tets, &x, &geometry),
            u: corners(&tets, old),
            a: corners(&tets, &self.a),
            laplacian: [f64x4::default(); 3],
            dt,
            dt_tau: self.dt_tau,
            theta,
        };
        if !self.laplacian.is_empty() {
            let all = four.map(|e| self.laplacian_in(part, material, e));
            element.laplacian = [0, 1, 2].map(|k| packed(&all, |l| l[k]));
        }
        if !self.nodal_force.is_empty() {
            element.material.add_force(&corners(&tets, &self.nodal_force));
        }
        let rho = element.material.rho.to_array();
        let drift: [_; 4] = std::array::from_fn(|l| material.drift(four[l], rho[l]));
        element.carry([0, 1, 2].map(|k| packed(&drift, |d| d[k])));
        element
    }

    /// ∇²uⁿ in element `e`.
    #[inline]
    fn laplacian_in(&self, part: &MeshPart, material: &Material, e: usize) -> [f64; 3] {
        let tet = &part.mesh.tets[e];
        if self.laplacian.is_empty() || !material.is_pure(tet) {
            return [0.0; 3];
        }
        let l = tet.map(|n| self.laplacian[n as usize]);
        let share = 0.25 * viscous_force::share(&Tetrahedron::of(&part.mesh, e));
        std::array::from_fn(|k| share * (l[0][k] + l[1][k] + l[2][k] + l[3][k]))
    }

    pub(super) fn evaluate_body_force(&mut self, part: &MeshPart, t: f64) {
        if let Some(force) = &self.body_force {
            let at = |x: &[f64; 3]| std::array::from_fn(|k| force[k].at(*x, t));
            self.nodal_force = part.mesh.nodes.iter().map(at).collect();
        }
    }
}
