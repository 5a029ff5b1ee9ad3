//! The linear system of a step: elements, walls, open faces, ghost penalties; then what the boundaries and dry
//! nodes fix.

use super::energy::wet_face;
use super::*;
use crate::flow::loads::Load;
use crate::flow::mass_balance::Gain;

impl Flow {
    /// The wall in a cut element.
    pub(super) fn wall<'a>(
        &self,
        cut: &CutMesh,
        element: &'a Element,
        c: &'a CutElement,
        surface: &'a Surface,
        x: &'a [[f64; 3]; 4],
    ) -> WallElement<'a> {
        let swept = !cut.gained.is_empty();
        WallElement { element, pieces: &c.pieces, surface, x, method: self.wall, swept }
    }

    /// What element `e`, which has fluid, and the wall in it add to the step's system, where `unknowns` are.
    pub(super) fn system(
        &self,
        part: &MeshPart,
        cut: &CutMesh,
        surfaces: &[Surface],
        e: usize,
        element: &Element,
        unknowns: &[[f64; 4]; 4],
        matrix: bool,
    ) -> ElementSystem {
        let mut system = ElementSystem::default();
        let Cell::Cut(c) = cut.cell(e) else {
            element.system(&Whole(element.geometry.volume), unknowns, matrix, &mut system);
            return system;
        };
        element.system(&c.pieces.fluid, unknowns, matrix, &mut system);
        let x = part.mesh.corners(e);
        self.wall(cut, element, c, &surfaces[c.body as usize], &x).add(unknowns, &mut system);
        system
    }

    /// Asks for the memory that element `e` adds to.
    #[inline]
    fn fetch(&self, part: &MeshPart, e: usize) {
        let tet = &part.mesh.tets[e];
        for i in (0..4).filter(|&i| (tet[i] as usize) < part.n_owned()) {
            self.matrix.fetch(tet[i] as usize, self.graph.entries(e, tet, i));
        }
    }

    /// Adds what element `e` does, with or without its matrix.
    #[inline]
    fn add_system(&mut self, part: &MeshPart, e: usize, system: &ElementSystem, matrix: bool) {
        let tet = &part.mesh.tets[e];
        for i in 0..4 {
            let node = tet[i] as usize;
            if node >= part.n_owned() {
                continue;
            }
            add(&mut self.rhs[node], &system.rhs[i]);
            add(&mut self.left[node], &system.left[i]);
            if !matrix {
                continue;
            }
            let entries = self.graph.entries(e, tet, i);
            self.matrix.add(node, entries, &system.matrix.as_chunks().0[i]);
            for (at, pressure) in entries.into_iter().zip(&system.pressure[4 * i..]) {
                self.pressure.values[at][0][0] += f64::from(*pressure);
            }
        }
    }

    /// What `x` leaves of the equations and, with `matrix`, the matrix of its change.
    pub(super) fn assemble(
        &mut self,
        part: &MeshPart,
        cut: &CutMesh,
        surfaces: &[Surface],
        material: &Material,
        dt: f64,
        theta: f64,
        matrix: bool,
    ) -> Squeezed {
        if matrix {
            self.matrix.clear();
            self.pressure.clear();
        }
        self.rhs.fill([0.0; 4]);
        self.left.fill([0.0; 4]);
        let n = part.n_assembled_elements;
        let (mut together, mut each) = (ElementSystem::default(), [ElementSystem::default(); 4]);
        for (four, n) in fours(cut.uncut(n)) {
            if matrix {
                four.iter().for_each(|&e| self.fetch(part, e));
            }
            let elements = self.elements(part, material, four, &self.u, dt, theta);
            let x = corners(&four.map(|e| part.mesh.tets[e]), &self.x);
            elements.system(&Whole(elements.geometry.volume), &x, matrix, &mut together);
            together.unpacked(matrix, &mut each);
            for (&e, system) in four.iter().zip(&each).take(n) {
                self.add_system(part, e, system, matrix);
            }
        }
        for c in cut.cut(n) {
            let e = c.element as usize;
            let element = self.element(part, material, e, &self.u, dt, theta);
            let x = part.mesh.tets[e].map(|n| self.x[n as usize]);
            let system = self.system(part, cut, surfaces, e, &element, &x, matrix);
            self.add_system(part, e, &system, matrix);
        }
        // Where structures move, the continuity equation counts the very volume that nodes gain by it.
        if self.wall == Method::Nitsche {
            let rows = self.rhs.iter_mut().zip(&mut self.left).zip(&cut.gained);
            for ((rhs, left), gained) in rows.take(part.n_owned()) {
                rhs[3] -= gained / dt;
                left[3] -= gained / dt;
            }
        }
        let squeezed = self.sealed.spread(part, material, &self.rhs, &mut self.left, dt);
        self.assemble_open_faces(part, cut, material, theta, matrix);
        self.assemble_slivers(part, cut, material, dt, matrix);
        self.assemble_gains(theta, matrix);
        self.constrain_left(cut);
        if matrix {
            self.constrain_matrix();
            self.fix_dry_nodes(cut);
        }
        squeezed
    }

    fn assemble_open_faces(
        &mut self,
        part: &MeshPart,
        cut: &CutMesh,
        material: &Material,
        theta: f64,
        matrix: bool,
    ) {
        for f in 0..self.open_faces.len() {
            let Some(face) = self.open_face(part, cut, material, f, &self.u, theta) else {
                continue;
            };
            let (nodes, mass) = (self.open_faces[f].1, face.mass);
            let n = nodes.map(|n| n as usize);
            let (rhs, c) = face.system();
            for i in 0..3 {
                if n[i] >= part.n_owned() {
                    continue;
                }
                let left = &mut self.left[n[i]];
                for k in 0..3 {
                    let x = (0..3).map(|j| mass[i][j] * self.x[n[j]][k]).sum::<f64>();
                    left[k] += rhs[i][k] - c * x;
                }
                for j in (0..3).filter(|_| matrix) {
                    let slot = self.matrix.pattern.entry(nodes[i], nodes[j]) as usize;
                    self.matrix.add_velocity(n[i], slot, c * mass[i][j]);
                }
            }
        }
    }

    /// Face `f` of the open ones, in the step that began with the velocity `old`; none if it is dry.
    pub(super) fn open_face(
        &self,
        part: &MeshPart,
        cut: &CutMesh,
        material: &Material,
        f: usize,
        old: &[[f64; 3]],
        theta: f64,
    ) -> Option<OpenFace> {
        let (e, nodes) = self.open_faces[f];
        let (normal, mass) = wet_face(part, cut, e as usize, nodes)?;
        let (tet, corners) = (&part.mesh.tets[e as usize], part.mesh.corners(e as usize));
        let n = nodes.map(|n| n as usize);
        Some(OpenFace {
            normal,
            mass,
            u: n.map(|n| old[n]),
            a: n.map(|n| self.a[n]),
            p: n.map(|n| self.x[n][3]),
            rho: material.element(tet, &corners).rho,
            theta,
        })
    }

    /// All momentum rows of the last step without the terms of structures' walls, added up: with rows that no
    /// boundary constrains, minus what these walls bore. Force, and torque about the origin; ghost penalties
    /// have neither. Collective.
    pub fn momentum_left(&self, part: &MeshPart, cut: &CutMesh, material: &Material) -> Load {
        let (dt, theta) = (self.dt_old, if self.steps <= START_STEPS { 1.0 } else { 0.5 });
        let mut left = Load::default();
        for e in 0..part.n_owned_elements {
            let element = self.element(part, material, e, &self.u_old, dt, theta);
            let x = part.mesh.tets[e].map(|n| self.x[n as usize]);
            let mut system = ElementSystem::default();
            match cut.cell(e) {
                Cell::Solid => continue,
                Cell::Cut(c) => element.system(&c.pieces.fluid, &x, false, &mut system),
                Cell::Whole => {
                    element.system(&Whole(element.geometry.volume), &x, false, &mut system);
                }
            }
            for (i, place) in part.mesh.corners(e).into_iter().enumerate() {
                left.add(system.momentum(i), place);
            }
        }
        for (f, (e, nodes)) in self.open_faces.iter().enumerate() {
            if *e as usize >= part.n_owned_elements {
                continue;
            }
            let Some(face) = self.open_face(part, cut, material, f, &self.u_old, theta) else {
                continue;
            };
            for (&n, row) in nodes.iter().zip(self.face_rows(&face, nodes)) {
                left.add(row, part.mesh.nodes[n as usize]);
            }
        }
        for gain in &self.balance.gains {
            left.add(self.gain_row(gain, theta), part.mesh.nodes[gain.node as usize]);
        }
        let mut sums = [left.force, left.torque];
        part.comm.sum_all(sums.as_flattened_mut());
        Load { force: sums[0], torque: sums[1] }
    }

    /// The ghost penalty on faces of cut elements.
    fn assemble_slivers(
        &mut self,
        part: &MeshPart,
        cut: &CutMesh,
        material: &Material,
        dt: f64,
        matrix: bool,
    ) {
        self.across.clear();
        for face in &cut.ghost_faces {
            let [c, inertia] = slivers::coefficients(face, material, &self.a, dt);
            for (i, &row) in face.nodes.iter().enumerate() {
                if row as usize >= part.n_owned() {
                    continue;
                }
                for (j, &column) in face.nodes.iter().enumerate() {
                    let both = face.jump[i] * face.jump[j];
                    let value = (c + inertia) * both;
                    let (x, u) = (self.x[column as usize], self.u[column as usize]);
                    for k in 0..3 {
                        self.left[row as usize][k] -= value * x[k] - inertia * both * u[k];
                    }
                    if i.min(j) == 3 && i != j {
                        self.across.push(Entry { row, column, value });
                    } else if matrix {
                        let slot = self.matrix.pattern.entry(row, column) as usize;
                        self.matrix.add_velocity(row as usize, slot, value);
                    }
                }
            }
        }
    }

    /// What mass that appears brings along.
    fn assemble_gains(&mut self, theta: f64, matrix: bool) {
        for &Gain { node, rate, velocity } in &self.balance.gains {
            let i = node as usize;
            for k in 0..3 {
                let known = rate * (velocity[k] - (1.0 - theta) * self.u[i][k]);
                self.rhs[i][k] += known;
                self.left[i][k] += known - rate * theta * self.x[i][k];
            }
            if matrix {
                let at = self.matrix.pattern.diagonals()[i] as usize;
                self.matrix.add_velocity(i, at, theta * rate);
            }
        }
    }

    /// Nodes without fluid keep what they have.
    fn fix_dry_nodes(&mut self, cut: &CutMesh) {
        let n_owned = self.matrix.n_rows();
        for i in cut.dry_nodes.iter().map(|&i| i as usize).take_while(|&i| i < n_owned) {
            let at = self.matrix.pattern.diagonals()[i] as usize;
            let one = |r: usize, c: usize| f64::from(u8::from(r == c));
            let identity = std::array::from_fn(|r| std::array::from_fn(|c| one(r, c)));
            self.matrix.set(i, at, &identity);
            self.pressure.values[at] = [[1.0]];
        }
    }

    /// `r ← P r`: what is given is in `x` already.
    fn constrain_left(&mut self, cut: &CutMesh) {
        let n_owned = self.matrix.n_rows();
        for (left, c) in self.left[..n_owned].iter_mut().zip(self.constraints.nodes.iter()) {
            *left = c.project_all(*left);
        }
        for i in cut.dry_nodes.iter().map(|&i| i as usize).take_while(|&i| i < n_owned) {
            self.left[i] = [0.0; 4];
        }
    }

    /// `A ← P A P + (I−P) D`.
    fn constrain_matrix(&mut self) {
        let nodes = &self.constraints.nodes;
        for &(entry, i, j) in &self.constrained_entries {
            let (ci, cj) = (&nodes[i as usize], &nodes[j as usize]);
            let original = self.matrix.block(i as usize, entry as usize);
            let mut block = original;
            if !cj.is_free() {
                for row in &mut block {
                    let v = cj.project([row[0], row[1], row[2]]);
                    row[..3].copy_from_slice(&v);
                    if cj.pressure_given == 1 {
                        row[3] = 0.0;
                    }
                }
            }
            if !ci.is_free() {
                for c in 0..4 {
                    let v = ci.project([block[0][c], block[1][c], block[2][c]]);
                    for r in 0..3 {
                        block[r][c] = v[r];
                    }
                }
                if ci.pressure_given == 1 {
                    block[3] = [0.0; 4];
                }
            }
            if i == j {
                let scale = (original[0][0] + original[1][1] + original[2][2]) / 3.0;
                for r in 0..3 {
                    for c in 0..3 {
                        block[r][c] += scale * (FREE.free[r][c] - ci.free[r][c]);
                    }
                }
                if ci.pressure_given == 1 {
                    block[3][3] = original[3][3];
                }
            } else if ci.pressure_given == 1 || cj.pressure_given == 1 {
                self.pressure.values[entry as usize][0][0] = 0.0;
            }
            self.matrix.set(i as usize, entry as usize, &block);
        }
    }
}

#[inline]
pub(super) fn add(sum: &mut [f64; 4], v: &[f64; 4]) {
    for k in 0..4 {
        sum[k] += v[k];
    }
}
