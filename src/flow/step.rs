//! The flow's state, and one step of it: assemble, impose the boundary conditions, solve.
//!
//! Time: `u` at tⁿ, `p` at the middle of the last step. The first two steps are implicit Euler.

mod assembly;
mod elements;
mod energy;

pub use energy::StepEnergy;

use assembly::add;

use super::mass_balance::MassBalance;
use super::material::Material;
use super::open_boundary::OpenFace;
use super::sealed::{Sealed, Squeezed};
use super::slivers::{self, Entry, WithEntries};
use super::stabilisation;
use super::wall::{Method, WallElement};
use super::weak_form::{Element, ElementSystem, unknowns};
use super::{viscous, viscous_force};
use crate::case::{Boundary, Case, Formula};
use crate::cut::tetrahedron::cut_face;
use crate::cut::{Cell, CutElement, CutMesh, Extension, Surface};
use crate::fem::constraints::{Constraints, FREE};
use crate::fem::number::{corners, f64x4, fours, scalars};
use crate::fem::region::Whole;
use crate::fem::tetrahedron::Tetrahedron;
use crate::fem::{norm, triangle_normal};
use crate::linear::{
    BlockCsr, Converged, DistributedOperator, Diverged, InnerProduct, KrylovSettings, NodeGraph,
    OwnedProduct, Reason, SaddleCsr, SchurPreconditioner, Workspace, fgmres, residual_weights,
};
use crate::mesh::MeshPart;
use crate::mesh::part::Cost;

/// Steps that are implicit Euler before Crank-Nicolson takes over.
const START_STEPS: u64 = 2;
/// A residual this small beside the right-hand side is rounding.
const FLOOR: f64 = 1e-13;
/// Preconditioned directions kept before a restart.
const RESTART: u32 = 15;
/// The matrix is stored in single precision: good for a change that leaves this much of the equations...
const TRUSTED: f64 = 5e-4;
/// ... and, where less is asked for, used down to this before what is left is computed anew.
const DEEPEST: f64 = 1e-4;

/// State and system of the flow on this rank.
pub struct Flow {
    /// uⁿ at local nodes [m/s].
    pub u: Vec<[f64; 3]>,
    /// uⁿ⁻¹ [m/s].
    pub u_old: Vec<[f64; 3]>,
    /// p at n−½ [Pa].
    pub p: Vec<f64>,
    /// Fine-scale velocity u' of each local element in the last step [m/s].
    pub fine_scale: Vec<[f64; 3]>,
    /// Length of the last step [s].
    pub dt_old: f64,
    /// The time step that stabilisation went by in it [s]: `stabilisation::time_step`.
    pub dt_tau: f64,
    /// Steps done.
    pub steps: u64,
    /// What the boundaries fix.
    pub constraints: Constraints,
    /// Residual to reach in a step, relative to that of the previous step's solution.
    pub tolerance: f64,
    /// The same for the first steps, at most.
    start_tolerance: f64,
    /// How the walls of structures are imposed.
    pub wall: Method,
    max_iterations: u32,
    picard: u32,
    body_force: Option<[Formula; 3]>,
    /// Element and nodes.
    open_faces: Vec<(u32, [u32; 3])>,
    /// Size of the smallest element on any rank [m].
    smallest: f64,
    /// Of the change of `x` (`solve`).
    matrix: SaddleCsr,
    pressure: BlockCsr<1>,
    /// Entries of the ghost penalty that the matrix has no place for.
    across: Vec<Entry>,
    constrained_entries: Vec<(u32, u32, u32)>,
    /// Fluid without an open boundary, while structures move.
    sealed: Sealed,
    rhs: Vec<[f64; 4]>,
    /// What `x` leaves of the equations.
    left: Vec<[f64; 4]>,
    change: Vec<[f64; 4]>,
    x: Vec<[f64; 4]>,
    /// What the solve of this step began with, if the step is done again.
    again: Option<f64>,
    /// The same, whether it is or not.
    began: f64,
    a: Vec<[f64; 3]>,
    /// ∇²uⁿ [1/(m s)]; empty where it does not matter.
    laplacian: Vec<[f64; 3]>,
    nodal_force: Vec<[f64; 3]>,
    balance: MassBalance,
    graph: NodeGraph,
    weights: Vec<f64>,
    preconditioner: SchurPreconditioner,
    /// Whether that is the matrix's.
    is_prepared: bool,
    workspace: Workspace,
}

/// Everything later steps depend on.
#[derive(Clone, Debug)]
pub struct Saved {
    u: Vec<[f64; 3]>,
    u_old: Vec<[f64; 3]>,
    p: Vec<f64>,
    fine_scale: Vec<[f64; 3]>,
    dt_old: f64,
    dt_tau: f64,
    steps: u64,
}

/// What a step cost.
#[derive(Clone, Copy, Debug, Default)]
pub struct FlowReport {
    /// Solver iterations, all Picard passes together.
    pub iterations: u32,
    /// Residual of the previous step's solution, and the last one.
    pub initial_residual: f64,
    /// Residual at the end.
    pub residual: f64,
    /// What walls did to sealed fluid.
    pub squeezed: Squeezed,
    /// ∫ ½ρ u² at the end [J].
    pub kinetic: f64,
    /// −∫ ρ g·x of the step's densities [J].
    pub potential: f64,
    /// Of element matrices.
    pub assembly: Cost,
    /// Of preconditioner and solve.
    pub solve: Cost,
}

impl Flow {
    /// With the given velocity but for what the boundaries fix at t = 0; pressure unknown. Collective.
    pub fn new(
        case: &Case,
        part: &MeshPart,
        cut: &CutMesh,
        graph: &NodeGraph,
        mut u: Vec<[f64; 3]>,
    ) -> Self {
        let n = part.n_local();
        assert_eq!(u.len(), n, "one velocity per local node");
        let constraints = Constraints::new(case, part, &cut.bodies_of_fluid(part));
        let mut p = vec![0.0; n];
        constraints.impose(part, 0.0, 0.0, &mut u, &mut p);
        cut.dry_nodes.iter().for_each(|&i| u[i as usize] = [0.0; 3]);
        let open_faces = part
            .mesh
            .boundary
            .iter()
            .filter(|f| {
                let name = &part.mesh.boundary_names[f.name as usize];
                matches!(case.boundary(name), Boundary::Pressure { .. })
            })
            .map(|f| (f.element, f.nodes))
            .collect();
        let owned = 0..part.n_owned_elements;
        let sizes = owned.map(|e| Tetrahedron::of(&part.mesh, e).size());
        let smallest = part.comm.min(sizes.fold(f64::INFINITY, f64::min));
        let preconditioner = SchurPreconditioner::new(&graph.halo);
        let mut flow = Self {
            u_old: u.clone(),
            u,
            p,
            fine_scale: vec![[0.0; 3]; part.mesh.tets.len()],
            dt_old: f64::INFINITY,
            dt_tau: 0.0,
            steps: 0,
            constraints,
            tolerance: case.solver.tolerance,
            start_tolerance: case.solver.start_tolerance,
            wall: case.flow.wall_penalty.map_or(Method::Nitsche, Method::Penalty),
            max_iterations: case.solver.max_iterations,
            picard: case.flow.iterations.max(1),
            body_force: case.body_force.clone(),
            open_faces,
            smallest,
            rhs: vec![[0.0; 4]; n],
            left: vec![[0.0; 4]; n],
            change: vec![[0.0; 4]; n],
            x: vec![[0.0; 4]; n],
            again: None,
            began: 0.0,
            a: vec![[0.0; 3]; n],
            laplacian: Vec::new(),
            nodal_force: Vec::new(),
            balance: MassBalance::default(),
            matrix: SaddleCsr::zero(&graph.pattern),
            pressure: BlockCsr::zero(&graph.pattern),
            across: Vec::new(),
            constrained_entries: Vec::new(),
            sealed: Sealed::default(),
            graph: graph.clone(),
            weights: Vec::new(),
            preconditioner,
            is_prepared: false,
            workspace: Workspace::default(),
        };
        flow.list_constrained();
        flow
    }

    /// Matrix entries that the constraints change.
    fn list_constrained(&mut self) {
        let nodes = &self.constraints.nodes;
        self.constrained_entries.clear();
        for i in 0..self.matrix.n_rows() {
            for entry in self.matrix.row(i) {
                let j = self.matrix.pattern.columns[entry];
                if !nodes[i].is_free() || !nodes[j as usize].is_free() {
                    self.constrained_entries.push((entry as u32, i as u32, j));
                }
            }
        }
    }

    /// The structures have moved: nodes that are wet now and were not take their history from `extension`.
    /// Collective.
    pub fn follow(
        &mut self,
        part: &MeshPart,
        cut: &CutMesh,
        extension: &Extension,
        gravity: [f64; 3],
    ) {
        for u in [&mut self.u, &mut self.u_old] {
            extension.apply(part, u);
            cut.dry_nodes.iter().for_each(|&i| u[i as usize] = [0.0; 3]);
        }
        let (p, _) = self.p.as_chunks_mut::<1>();
        extension.apply(part, p);
        let fluid = cut.bodies_of_fluid(part);
        if self.constraints.pin(gravity, part, &fluid) {
            self.list_constrained();
        }
        self.sealed = Sealed::new(part, cut, &fluid, &self.constraints.pinned);
    }

    /// `material` takes over the densities of `phi`. They have come from its own with uⁿ and u' and by `flux` [m/s] against
    /// the fluid in `dt`; with no flux there is no account of mass.
    pub fn take_phase(
        &mut self,
        part: &MeshPart,
        cut: &CutMesh,
        material: &mut Material,
        phi: &[f64],
        flux: Vec<[f64; 3]>,
        dt: f64,
    ) {
        // At first there is no u' yet.
        if flux.is_empty() || self.steps == 0 {
            material.set_phase(phi);
            material.set_flux(flux);
            self.balance.gains.clear();
        } else {
            let carried = [&self.u[..], &self.fine_scale];
            self.balance.find(part, cut, material, carried, (phi, flux), dt);
        }
    }

    /// Advances u from `t` to `t + dt`, and p to the middle, around the `surfaces` of structures. Collective.
    pub fn advance(
        &mut self,
        part: &MeshPart,
        cut: &CutMesh,
        surfaces: &[Surface],
        material: &Material,
        t: f64,
        dt: f64,
    ) -> Result<FlowReport, Diverged> {
        let starting = self.steps < START_STEPS;
        let theta = if starting { 1.0 } else { 0.5 };
        let ratio = 0.5 * dt / self.dt_old;
        self.dt_tau = stabilisation::time_step(dt, self.dt_tau);
        for (a, (u, old)) in self.a.iter_mut().zip(self.u.iter().zip(&self.u_old)) {
            *a = std::array::from_fn(|k| u[k] + ratio * (u[k] - old[k]));
        }
        self.evaluate_body_force(part, t + theta * dt);
        self.laplacian = if viscous::matters(material, self.smallest, dt) {
            viscous_force::laplacian(part, cut, &self.constraints.nodes, &self.u)
        } else {
            Vec::new()
        };

        // The previous solution, with what the boundaries give at the new time, is the first guess; in a step
        // done again, the solution found for it before.
        let again = self.again.take();
        if again.is_none() {
            let mut u = self.u.clone();
            let mut p = self.p.clone();
            self.constraints.impose(part, t + dt, t + 0.5 * dt, &mut u, &mut p);
            for (x, (u, p)) in self.x.iter_mut().zip(u.iter().zip(&p)) {
                *x = [u[0], u[1], u[2], *p];
            }
        }

        let mut report = FlowReport::default();
        for pass in 0..self.picard {
            if pass > 0 {
                for (a, (u, x)) in self.a.iter_mut().zip(self.u.iter().zip(&self.x)) {
                    *a = std::array::from_fn(|k| 0.5 * (u[k] + x[k]));
                }
            }
            let solved =
                self.solve(part, cut, surfaces, material, [dt, theta], again, &mut report)?;
            report.iterations += solved.iterations;
            if pass == 0 {
                report.initial_residual = again.unwrap_or(solved.initial);
            }
            report.residual = solved.residual;
        }

        std::mem::swap(&mut self.u_old, &mut self.u);
        for (x, (u, p)) in self.x.iter().zip(self.u.iter_mut().zip(&mut self.p)) {
            *u = [x[0], x[1], x[2]];
            *p = x[3];
        }
        [report.kinetic, report.potential] = self.find_fine_scale(part, cut, material, dt, theta);
        self.dt_old = dt;
        self.steps += 1;
        self.began = report.initial_residual;
        Ok(report)
    }

    /// What the system was last solved with.
    pub fn preconditioner(&self) -> &SchurPreconditioner {
        &self.preconditioner
    }

    /// The state, to go back to.
    pub fn save(&self) -> Saved {
        Saved {
            u: self.u.clone(),
            u_old: self.u_old.clone(),
            p: self.p.clone(),
            fine_scale: self.fine_scale.clone(),
            dt_old: self.dt_old,
            dt_tau: self.dt_tau,
            steps: self.steps,
        }
    }

    /// Back to what was saved, to do the last step again with walls that move a little differently.
    pub fn restore(&mut self, saved: &Saved) {
        self.u.clone_from(&saved.u);
        self.u_old.clone_from(&saved.u_old);
        self.p.clone_from(&saved.p);
        self.fine_scale.clone_from(&saved.fine_scale);
        (self.dt_old, self.dt_tau, self.steps) = (saved.dt_old, saved.dt_tau, saved.steps);
        self.again = Some(self.began);
    }

    /// Changes `x` until what it leaves of the equations is small enough, measured as power: |r_u|²/a + r_p²/l,
    /// with the diagonals of the momentum rows and of the pressure operator.
    ///
    /// What is left is summed over the elements in double precision, and only changes are found with a matrix in
    /// single: iterative refinement, in one round for the tolerances of ordinary steps.
    fn solve(
        &mut self,
        part: &MeshPart,
        cut: &CutMesh,
        surfaces: &[Surface],
        material: &Material,
        [dt, theta]: [f64; 2],
        again: Option<f64>,
        report: &mut FlowReport,
    ) -> Result<Converged, Diverged> {
        let starting = self.steps < START_STEPS;
        let relative =
            if starting { self.tolerance.min(self.start_tolerance) } else { self.tolerance };
        let mut done = Converged { iterations: 0, initial: 0.0, residual: f64::INFINITY };
        let mut target = 0.0;
        for round in 0.. {
            let clock = part.comm.clock();
            // In a step done again only the walls' velocities have changed, and its matrix will do.
            let anew = round == 0 && (again.is_none() || self.picard > 1 || !self.is_prepared);
            report.squeezed = self.assemble(part, cut, surfaces, material, dt, theta, anew);
            report.assembly += clock.elapsed();
            let clock = part.comm.clock();
            if anew {
                self.is_prepared = false;
                residual_weights(&self.matrix, &self.pressure, &mut self.weights);
            }
            let product = OwnedProduct::weighted::<4>(&self.graph.halo, &self.weights);
            let size = |v: &Vec<[f64; 4]>| product.dot(v.as_flattened(), v.as_flattened()).sqrt();
            let before = std::mem::replace(&mut done.residual, size(&self.left));
            if round == 0 {
                done.initial = done.residual;
                // A step done again is solved as well as it was, not better.
                target = (FLOOR * size(&self.rhs)).max(relative * again.unwrap_or(done.initial));
            }
            if done.residual <= target {
                return Ok(done);
            }
            let failed = |iterations, reason| {
                let Converged { initial, residual, .. } = done;
                Diverged { iterations, initial, residual, reason }
            };
            if done.residual > 0.5 * before {
                return Err(failed(done.iterations, Reason::Stagnated));
            }
            if !self.is_prepared {
                let viscous = viscous::rules(material, self.smallest, dt, theta).then(|| {
                    viscous::operators(part, cut, material, &self.constraints, &self.matrix, theta)
                });
                self.preconditioner.setup(&self.matrix, &self.pressure, viscous.as_ref());
                self.is_prepared = true;
            }
            let reduction = target / done.residual;
            let settings = KrylovSettings {
                relative: reduction.max(DEEPEST),
                absolute: 0.0,
                max_iterations: self.max_iterations,
                restart: RESTART,
            };
            let matrix = DistributedOperator::new(&self.matrix, &self.graph.halo);
            let constraints = &self.constraints.nodes;
            let solved = fgmres(
                &WithEntries { matrix, entries: &self.across, constraints },
                &mut self.preconditioner.with(&self.matrix),
                &product,
                self.left.as_flattened(),
                self.change.as_flattened_mut(),
                &settings,
                &mut self.workspace,
            )
            .map_err(|error| Diverged {
                residual: error.residual,
                ..failed(done.iterations + error.iterations, error.reason)
            })?;
            done.iterations += solved.iterations;
            let constraints = self.constraints.nodes.iter();
            for ((x, change), c) in self.x.iter_mut().zip(&self.change).zip(constraints) {
                add(x, &c.project_all(*change));
            }
            part.exchange.update_ghosts(&mut self.x);
            report.solve += clock.elapsed();
            if reduction >= TRUSTED {
                done.residual = solved.residual;
                return Ok(done);
            }
        }
        unreachable!("rounds end with success or failure")
    }

    /// u' of every local element and, on the way, the energies of all owned ones. Collective.
    fn find_fine_scale(
        &mut self,
        part: &MeshPart,
        cut: &CutMesh,
        material: &Material,
        dt: f64,
        theta: f64,
    ) -> [f64; 2] {
        let (g, n_owned) = (material.gravity(), part.n_owned_elements);
        let mut energies = [0.0; 2];
        let mut count = |e: usize, energy: [f64; 2]| {
            if e < n_owned {
                energies = [energies[0] + energy[0], energies[1] + energy[1]];
            }
        };
        self.fine_scale.fill([0.0; 3]);
        for (four, n) in fours(cut.uncut(part.mesh.tets.len())) {
            let element = self.elements(part, material, four, &self.u_old, dt, theta);
            let fluid = Whole(element.geometry.volume);
            let tets = four.map(|e| part.mesh.tets[e]);
            let (u, x) = (corners(&tets, &self.u), corners(&tets, &part.mesh.nodes));
            let p = scalars(&tets, &self.p);
            let fine = element.fine_scale(&fluid, &u, &p).map(f64x4::to_array);
            let kinetic = element.kinetic_energy(&fluid, &u).to_array();
            let potential = element.potential_energy(&fluid, &x, g).to_array();
            for (l, &e) in four.iter().take(n).enumerate() {
                self.fine_scale[e] = fine.map(|f| f[l]);
                count(e, [kinetic[l], potential[l]]);
            }
        }
        for c in &cut.elements {
            let (e, fluid) = (c.element as usize, &c.pieces.fluid);
            let element = self.element(part, material, e, &self.u_old, dt, theta);
            let tet = &part.mesh.tets[e];
            let (u, p) = (tet.map(|n| self.u[n as usize]), tet.map(|n| self.p[n as usize]));
            self.fine_scale[e] = element.fine_scale(fluid, &u, &p);
            let kinetic = element.kinetic_energy(fluid, &u);
            count(e, [kinetic, element.potential_energy(fluid, &part.mesh.corners(e), g)]);
        }
        part.comm.sum_all(&mut energies);
        energies
    }

    /// What the wall in `c` bore in each corner's momentum equation over the last step: the reaction of the
    /// weak form, and its traction alone [N].
    pub(super) fn last_reaction(
        &self,
        part: &MeshPart,
        cut: &CutMesh,
        material: &Material,
        c: &CutElement,
        surface: &Surface,
        u: &[[f64; 3]; 4],
        p: &[f64; 4],
    ) -> [[[f64; 3]; 4]; 2] {
        let e = c.element as usize;
        let theta = if self.steps <= START_STEPS { 1.0 } else { 0.5 };
        let element = self.element(part, material, e, &self.u_old, self.dt_old, theta);
        let x = part.mesh.corners(e);
        self.wall(cut, &element, c, surface, &x).reaction(u, p)
    }
}
