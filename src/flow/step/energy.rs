//! Where the energy of a step goes: its momentum equations, tested with `v = ½(uⁿ + uⁿ⁺¹)`, term by term.
//!
//! The inertia term gives the change of kinetic energy at the step's densities, exactly; all others are work or loss.
//! What the rows leave is the solver's residual. The wall's rows are split in the work on the structure, tested with
//! ū, its pressure, and the rest. It is `u − u'` that carries φ and so the weight of the fluids: what gravity does on u'
//! belongs to the pressure's stabilisation, `∫(∇p − F)·u'`.

use super::*;
use crate::cut::ghost::GhostFace;
use crate::fem::dot;
use crate::fem::region::Region;
use crate::flow::mass_balance::Gain;

/// Energy that went over a step [J]; losses and work done by the fluid are positive.
#[derive(Clone, Debug, Default)]
pub struct StepEnergy {
    /// ∫½ρu² at its beginning and end, at its densities and around its structures.
    pub kinetic: [f64; 2],
    /// −∫ρ g·x.
    pub potential: f64,
    /// What gravity does on uⁿ and on uⁿ⁺¹, in half a step each.
    pub fall: [f64; 2],
    /// What other forces do on the fluid.
    pub forces: f64,
    /// ∫2με(v):ε(u).
    pub viscous: f64,
    /// SUPG.
    pub streamline: f64,
    /// −∫p∇·v but for the walls' share.
    pub pressure: f64,
    /// What gravity does on u'.
    pub fine_fall: f64,
    /// LSIC.
    pub divergence: f64,
    /// Walls of structures, beyond their work.
    pub walls: f64,
    /// Ghost penalty.
    pub ghost: f64,
    /// ∫ρ v·(a·∇u), and what mass that appears comes with.
    pub convection: f64,
    /// Work on boundaries.
    pub boundaries: f64,
    /// Kinetic and potential energy that leaves through boundaries.
    pub outflow: [f64; 2],
    /// The same through the walls of structures as they move.
    pub swept: [f64; 2],
    /// Work on each structure.
    pub structures: Vec<f64>,
}

impl Flow {
    /// ∫½ρu² and −∫ρ g·x now, with these densities [J]. Collective.
    pub fn energies(&self, part: &MeshPart, cut: &CutMesh, material: &Material) -> [f64; 2] {
        let mut energies = [0.0; 2];
        for e in 0..part.n_owned_elements {
            let element = self.element(part, material, e, &self.u, 1.0, 1.0);
            let x = part.mesh.corners(e);
            let mut add = |kinetic: f64, potential: f64| {
                energies = [energies[0] + kinetic, energies[1] + potential];
            };
            let g = material.gravity();
            match cut.cell(e) {
                Cell::Solid => {}
                Cell::Cut(c) => {
                    let fluid = &c.pieces.fluid;
                    let kinetic = element.kinetic_energy(fluid, &element.u);
                    add(kinetic, element.potential_energy(fluid, &x, g));
                }
                Cell::Whole => {
                    let fluid = &Whole(element.geometry.volume);
                    let kinetic = element.kinetic_energy(fluid, &element.u);
                    add(kinetic, element.potential_energy(fluid, &x, g));
                }
            }
        }
        part.comm.sum_all(&mut energies);
        energies
    }

    /// Of the last step, around structures with these `surfaces`. Collective.
    pub fn step_energy(
        &self,
        part: &MeshPart,
        cut: &CutMesh,
        surfaces: &[Surface],
        material: &Material,
    ) -> StepEnergy {
        let (dt, theta) = (self.dt_old, if self.steps <= START_STEPS { 1.0 } else { 0.5 });
        let mut sum = StepEnergy { structures: vec![0.0; surfaces.len()], ..StepEnergy::default() };
        let mean = |n: u32| self.mean_velocity(n as usize);
        for e in 0..part.n_owned_elements {
            let element = self.element(part, material, e, &self.u_old, dt, theta);
            match cut.cell(e) {
                Cell::Solid => {}
                Cell::Cut(c) => {
                    self.add_element(part, material, e, &element, &c.pieces.fluid, &mut sum);
                    let surface = &surfaces[c.body as usize];
                    self.add_wall(part, cut, material, &element, c, surface, &mut sum);
                }
                Cell::Whole => {
                    let fluid = Whole(element.geometry.volume);
                    self.add_element(part, material, e, &element, &fluid, &mut sum);
                }
            }
        }
        for gain in &self.balance.gains {
            sum.convection += dt * dot(mean(gain.node), self.gain_row(gain, theta));
        }
        for face in &cut.ghost_faces {
            let force = self.ghost_force(face, material, dt);
            for (i, &n) in face.nodes.iter().enumerate() {
                if (n as usize) < part.n_owned() {
                    sum.ghost += dt * face.jump[i] * dot(mean(n), force);
                }
            }
        }
        for (f, (e, nodes)) in self.open_faces.iter().enumerate() {
            if *e as usize >= part.n_owned_elements {
                continue;
            }
            if let Some(face) = self.open_face(part, cut, material, f, &self.u_old, theta) {
                let rows = self.face_rows(&face, nodes);
                for (&n, row) in nodes.iter().zip(rows) {
                    sum.boundaries += dt * dot(mean(n), row);
                }
            }
        }
        self.add_given(part, cut, surfaces, material, dt, theta, &mut sum);
        self.add_outflow(part, cut, material, dt, &mut sum);
        sum.gather(part);
        sum
    }

    fn mean_velocity(&self, n: usize) -> [f64; 3] {
        std::array::from_fn(|k| 0.5 * (self.u_old[n][k] + self.u[n][k]))
    }

    /// M⁺ (u_θ − ū), after the step [N].
    pub(super) fn gain_row(&self, gain: &Gain, theta: f64) -> [f64; 3] {
        let i = gain.node as usize;
        std::array::from_fn(|k| {
            let mid = theta * self.u[i][k] + (1.0 - theta) * self.u_old[i][k];
            gain.rate * (mid - gain.velocity[k])
        })
    }

    /// What a face's ghost penalty puts into the momentum rows, over [∂ₙN_i] there [N m].
    fn ghost_force(&self, face: &GhostFace, material: &Material, dt: f64) -> [f64; 3] {
        let [c, inertia] = slivers::coefficients(face, material, &self.a, dt);
        std::array::from_fn(|k| {
            let jump = |u: &[[f64; 3]]| -> f64 {
                face.nodes.iter().zip(face.jump).map(|(&n, jump)| jump * u[n as usize][k]).sum()
            };
            (c + inertia) * jump(&self.u) - inertia * jump(&self.u_old)
        })
    }

    /// What an open face leaves in the momentum rows of its corners [N].
    pub(super) fn face_rows(&self, face: &OpenFace, nodes: &[u32; 3]) -> [[f64; 3]; 3] {
        let (rhs, c) = face.system();
        std::array::from_fn(|i| {
            std::array::from_fn(|k| {
                let terms = nodes.iter().zip(face.mass[i]);
                terms.map(|(&n, m)| c * m * self.u[n as usize][k]).sum::<f64>() - rhs[i][k]
            })
        })
    }

    fn add_element(
        &self,
        part: &MeshPart,
        material: &Material,
        e: usize,
        element: &Element,
        fluid: &impl Region,
        sum: &mut StepEnergy,
    ) {
        let tet = &part.mesh.tets[e];
        let dt = element.dt;
        let v = tet.map(|n| self.mean_velocity(n as usize));
        let (new, p) = (tet.map(|n| self.u[n as usize]), tet.map(|n| self.p[n as usize]));
        let powers = element.powers(fluid, &v, &new, &p);
        sum.kinetic[0] += element.kinetic_energy(fluid, &element.u);
        sum.kinetic[1] += element.kinetic_energy(fluid, &new);
        let x = part.mesh.corners(e);
        sum.potential += element.potential_energy(fluid, &x, material.gravity());
        let gravity = material.element(tet, &x).force;
        let fall = |u: &[[f64; 3]; 4]| {
            let work = (0..4).map(|i| fluid.first(i) * dot(u[i], gravity[i]));
            0.5 * dt * work.sum::<f64>()
        };
        let fall = [fall(&element.u), fall(&new)];
        sum.fall = [sum.fall[0] + fall[0], sum.fall[1] + fall[1]];
        sum.forces -= dt * powers.force + fall[0] + fall[1];
        sum.viscous += dt * powers.viscous;
        sum.streamline += dt * powers.streamline;
        sum.divergence += dt * powers.divergence;
        sum.convection += dt * powers.convection;
        let whole = 0.25 * element.geometry.volume * dt;
        let on_fine_scale: f64 = gravity.iter().map(|f| whole * dot(*f, self.fine_scale[e])).sum();
        sum.fine_fall += on_fine_scale;
        sum.pressure += dt * powers.pressure;
    }

    fn add_wall(
        &self,
        part: &MeshPart,
        cut: &CutMesh,
        material: &Material,
        element: &Element,
        c: &CutElement,
        surface: &Surface,
        sum: &mut StepEnergy,
    ) {
        if c.pieces.wall.size == 0.0 {
            return;
        }
        let (tet, x) = (&part.mesh.tets[c.element as usize], part.mesh.corners(c.element as usize));
        let (wall, n, dt) = (&c.pieces.wall, c.pieces.normal, element.dt);
        let (new, p) = (tet.map(|n| self.u[n as usize]), tet.map(|n| self.p[n as usize]));
        let [rows, _] = self.wall(cut, element, c, surface, &x).reaction(&new, &p);
        let moving = x.map(|x| surface.motion.at(x));
        let v = tet.map(|n| self.mean_velocity(n as usize));
        let on_body: f64 = (0..4).map(|i| dot(moving[i], rows[i])).sum();
        let all: f64 = (0..4).map(|i| dot(v[i], rows[i])).sum();
        // The pressure's share is that of Nitsche's method: the penalty alone has none.
        let pressure =
            |w: &[[f64; 3]; 4]| -> f64 { (0..4).map(|j| p[j] * dot(wall.weighted(j, w), n)).sum() };
        let consistent = self.wall == Method::Nitsche;
        let past = if consistent { pressure(&v) - pressure(&moving) } else { 0.0 };
        sum.structures[c.body as usize] += dt * on_body;
        sum.pressure += dt * past;
        sum.walls += dt * (all - on_body - past);
        let flux: [f64; 4] = std::array::from_fn(|j| dt * dot(wall.weighted(j, &moving), n));
        let g = material.gravity();
        for j in 0..4 {
            sum.swept[0] += 0.5 * element.material.rho * dot(v[j], v[j]) * flux[j];
            sum.swept[1] -= element.material.rho * dot(g, x[j]) * flux[j];
        }
    }

    /// Work on boundaries that give a velocity: what their rows are held with.
    fn add_given(
        &self,
        part: &MeshPart,
        cut: &CutMesh,
        surfaces: &[Surface],
        material: &Material,
        dt: f64,
        theta: f64,
        sum: &mut StepEnergy,
    ) {
        let given = |n: u32| -> [f64; 3] {
            let v = self.mean_velocity(n as usize);
            let free = self.constraints.nodes[n as usize].project(v);
            let given: [f64; 3] = std::array::from_fn(|k| v[k] - free[k]);
            // A wall at rest gives zero, but for rounding.
            if norm(given) > 1e-12 * norm(v) { given } else { [0.0; 3] }
        };
        let given: Vec<[f64; 3]> = (0..part.n_local() as u32).map(given).collect();
        let any = |nodes: &[u32]| nodes.iter().any(|&n| given[n as usize] != [0.0; 3]);
        for e in 0..part.n_owned_elements {
            let tet = &part.mesh.tets[e];
            if !any(tet) || matches!(cut.cell(e), Cell::Solid) {
                continue;
            }
            let element = self.element(part, material, e, &self.u_old, dt, theta);
            let (u, p) = (tet.map(|n| self.u[n as usize]), tet.map(|n| self.p[n as usize]));
            let system = self.system(part, cut, surfaces, e, &element, &unknowns(&u, &p), false);
            for i in 0..4 {
                let row = system.momentum(i);
                sum.boundaries -= dt * dot(given[tet[i] as usize], row);
            }
        }
        for face in cut.ghost_faces.iter().filter(|f| any(&f.nodes)) {
            let force = self.ghost_force(face, material, dt);
            for (i, &n) in face.nodes.iter().enumerate() {
                if (n as usize) < part.n_owned() {
                    sum.boundaries -= dt * face.jump[i] * dot(given[n as usize], force);
                }
            }
        }
        for (f, (e, nodes)) in self.open_faces.iter().enumerate() {
            if *e as usize >= part.n_owned_elements || !any(nodes) {
                continue;
            }
            if let Some(face) = self.open_face(part, cut, material, f, &self.u_old, theta) {
                for (&n, row) in nodes.iter().zip(self.face_rows(&face, nodes)) {
                    sum.boundaries -= dt * dot(given[n as usize], row);
                }
            }
        }
    }

    fn add_outflow(
        &self,
        part: &MeshPart,
        cut: &CutMesh,
        material: &Material,
        dt: f64,
        sum: &mut StepEnergy,
    ) {
        let g = material.gravity();
        for face in &part.mesh.boundary {
            let e = face.element as usize;
            if e >= part.n_owned_elements {
                continue;
            }
            let Some((normal, mass)) = wet_face(part, cut, e, face.nodes) else { continue };
            let (tet, x) = (&part.mesh.tets[e], part.mesh.corners(e));
            let rho = material.element(tet, &x).rho;
            let v = face.nodes.map(|n| self.mean_velocity(n as usize));
            for (i, &n) in face.nodes.iter().enumerate() {
                let flux: f64 = (0..3).map(|j| mass[i][j] * dot(v[j], normal)).sum();
                sum.outflow[0] += dt * 0.5 * rho * dot(v[i], v[i]) * flux;
                sum.outflow[1] -= dt * rho * dot(g, part.mesh.nodes[n as usize]) * flux;
            }
        }
    }
}

impl StepEnergy {
    /// Sums over all ranks. Collective.
    fn gather(&mut self, part: &MeshPart) {
        let Self { kinetic, fall, outflow, swept, structures, .. } = self;
        part.comm.sum_all(kinetic);
        part.comm.sum_all(fall);
        part.comm.sum_all(outflow);
        part.comm.sum_all(swept);
        part.comm.sum_all(structures);
        let one_by_one = [
            &mut self.potential,
            &mut self.forces,
            &mut self.viscous,
            &mut self.streamline,
            &mut self.pressure,
            &mut self.fine_fall,
            &mut self.divergence,
            &mut self.walls,
            &mut self.ghost,
            &mut self.convection,
            &mut self.boundaries,
        ];
        one_by_one.into_iter().for_each(|sum| *sum = part.comm.sum(*sum));
    }
}

/// Of a boundary face of element `e`: its normal out of the fluid and ∮N_iN_j of its corners [m²]; none if it is dry.
pub(super) fn wet_face(
    part: &MeshPart,
    cut: &CutMesh,
    e: usize,
    nodes: [u32; 3],
) -> Option<([f64; 3], [[f64; 3]; 3])> {
    let mesh = &part.mesh;
    let area = triangle_normal(nodes.map(|n| mesh.nodes[n as usize]));
    let size = norm(area);
    let mass = match cut.cell(e) {
        Cell::Solid => return None,
        Cell::Whole => {
            [0, 1, 2].map(|i| [0, 1, 2].map(|j| size * if i == j { 1.0 / 6.0 } else { 1.0 / 12.0 }))
        }
        Cell::Cut(_) => {
            let tet = &mesh.tets[e];
            let corner = nodes.map(|n| tet.iter().position(|&m| m == n));
            let corner = corner.map(|c| c.expect("a face has three of its element's nodes"));
            let d = tet.map(|n| cut.distance[n as usize]);
            let fluid = cut_face(&mesh.corners(e), &d, 6 - corner.iter().sum::<usize>());
            corner.map(|i| corner.map(|j| fluid.second(i, j)))
        }
    };
    Some((area.map(|a| a / size), mass))
}
