//! The linear system of a step: elements, walls, open faces, ghost penalties; then what the boundaries and dry
//! nodes fix.

use super::*;
use crate::flow::loads::Load;

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
        let x = tet.map(|n| part.mesh.nodes[n as usize]);
        let geometry = Tetrahedron::new(x);
        let mut material = material.element(tet, &x, &geometry);
        if !self.nodal_force.is_empty() {
            let f = tet.map(|n| self.nodal_force[n as usize]);
            for k in 0..3 {
                let sum = f[0][k] + f[1][k] + f[2][k] + f[3][k];
                for i in 0..4 {
                    material.force[i][k] += material.rho * (sum + f[i][k]) / 5.0;
                }
            }
        }
        let laplacian = if material.grad_mu == [0.0; 3] {
            let l = tet.map(|n| self.laplacian[n as usize]);
            let share = 0.25 * viscous_force::share(&geometry);
            std::array::from_fn(|k| share * (l[0][k] + l[1][k] + l[2][k] + l[3][k]))
        } else {
            [0.0; 3]
        };
        Element {
            geometry,
            material,
            u: tet.map(|n| old[n as usize]),
            a: tet.map(|n| self.a[n as usize]),
            laplacian,
            dt,
            theta,
        }
    }

    pub(super) fn evaluate_body_force(&mut self, part: &MeshPart, t: f64) {
        if let Some(force) = &self.body_force {
            let at = |x: &[f64; 3]| std::array::from_fn(|k| force[k].at(*x, t));
            self.nodal_force = part.mesh.nodes.iter().map(at).collect();
        }
    }

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

    pub(super) fn assemble(
        &mut self,
        part: &MeshPart,
        cut: &CutMesh,
        surfaces: &[Surface],
        material: &Material,
        dt: f64,
        theta: f64,
    ) {
        self.matrix.clear();
        self.pressure.clear();
        self.rhs.fill([0.0; 4]);
        let n_owned = part.n_owned();
        for e in 0..part.n_assembled_elements {
            let cell = cut.cell(e);
            if matches!(cell, Cell::Solid) {
                continue;
            }
            let element = self.element(part, material, e, &self.u, dt, theta);
            let system = match cell {
                Cell::Cut(c) => {
                    let mut system = element.system(&c.pieces.fluid);
                    let x = part.mesh.corners(e);
                    self.wall(cut, &element, c, &surfaces[c.body as usize], &x).add(&mut system);
                    system
                }
                _ => element.system(&Whole(element.geometry.volume)),
            };
            let tet = &part.mesh.tets[e];
            for i in 0..4 {
                if tet[i] as usize >= n_owned {
                    continue;
                }
                let rhs = &mut self.rhs[tet[i] as usize];
                for k in 0..4 {
                    rhs[k] += system.rhs[i][k];
                }
                for (j, at) in self.graph.entries(e, tet, i).into_iter().enumerate() {
                    let block = self.matrix.values[at].as_flattened_mut();
                    for (block, add) in
                        block.iter_mut().zip(system.matrix[4 * i + j].as_flattened())
                    {
                        *block += add;
                    }
                    self.pressure.values[at][0][0] += system.pressure[4 * i + j];
                }
            }
        }
        // Where structures move, the continuity equation counts the very volume that nodes gain by it.
        if self.wall == Method::Nitsche {
            for (rhs, gained) in self.rhs.iter_mut().zip(&cut.gained).take(part.n_owned()) {
                rhs[3] -= gained / dt;
            }
        }
        self.assemble_open_faces(part, cut, material, theta);
    }

    fn assemble_open_faces(
        &mut self,
        part: &MeshPart,
        cut: &CutMesh,
        material: &Material,
        theta: f64,
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
                for k in 0..3 {
                    self.rhs[n[i]][k] += rhs[i][k];
                }
                for j in 0..3 {
                    let slot = self.matrix.pattern.entry(nodes[i], nodes[j]) as usize;
                    for k in 0..3 {
                        self.matrix.values[slot][k][k] += c * mass[i][j];
                    }
                }
            }
        }
    }

    /// Face `f` of the open ones, in the step that began with the velocity `old`; none if it is dry.
    fn open_face(
        &self,
        part: &MeshPart,
        cut: &CutMesh,
        material: &Material,
        f: usize,
        old: &[[f64; 3]],
        theta: f64,
    ) -> Option<OpenFace> {
        let mesh = &part.mesh;
        let (e, nodes) = self.open_faces[f];
        let tet = &mesh.tets[e as usize];
        let corners = mesh.corners(e as usize);
        let area = triangle_normal(nodes.map(|n| mesh.nodes[n as usize]));
        let size = norm(area);
        let mass = match cut.cell(e as usize) {
            Cell::Solid => return None,
            Cell::Whole => [0, 1, 2]
                .map(|i| [0, 1, 2].map(|j| size * if i == j { 1.0 / 6.0 } else { 1.0 / 12.0 })),
            Cell::Cut(_) => {
                let corner = nodes.map(|n| tet.iter().position(|&m| m == n));
                let corner = corner.map(|c| c.expect("a face has three of its element's nodes"));
                let d = tet.map(|n| cut.distance[n as usize]);
                let fluid = cut_face(&corners, &d, 6 - corner.iter().sum::<usize>());
                corner.map(|i| corner.map(|j| fluid.second(i, j)))
            }
        };
        let n = nodes.map(|n| n as usize);
        Some(OpenFace {
            normal: area.map(|a| a / size),
            mass,
            u: n.map(|n| old[n]),
            a: n.map(|n| self.a[n]),
            p: n.map(|n| self.x[n][3]),
            rho: material.element(tet, &corners, &Tetrahedron::new(corners)).rho,
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
            let system = match cut.cell(e) {
                Cell::Solid => continue,
                Cell::Cut(c) => element.system(&c.pieces.fluid),
                Cell::Whole => element.system(&Whole(element.geometry.volume)),
            };
            let x = part.mesh.tets[e].map(|n| self.x[n as usize]);
            for (i, place) in part.mesh.corners(e).into_iter().enumerate() {
                let row = |k: usize| {
                    let terms = (0..4).map(|j| {
                        let row = &system.matrix[4 * i + j][k];
                        (0..4).map(|c| row[c] * x[j][c]).sum::<f64>()
                    });
                    terms.sum::<f64>() - system.rhs[i][k]
                };
                left.add([row(0), row(1), row(2)], place);
            }
        }
        for (f, (e, nodes)) in self.open_faces.iter().enumerate() {
            if *e as usize >= part.n_owned_elements {
                continue;
            }
            let Some(face) = self.open_face(part, cut, material, f, &self.u_old, theta) else {
                continue;
            };
            let (rhs, c) = face.system();
            for (i, &node) in nodes.iter().enumerate() {
                let row = |k: usize| {
                    let terms = nodes.iter().zip(face.mass[i]);
                    terms.map(|(&n, m)| c * m * self.x[n as usize][k]).sum::<f64>() - rhs[i][k]
                };
                left.add([row(0), row(1), row(2)], part.mesh.nodes[node as usize]);
            }
        }
        let mut sums = [left.force, left.torque];
        part.comm.sum_all(sums.as_flattened_mut());
        Load { force: sums[0], torque: sums[1] }
    }

    /// The ghost penalty on faces of cut elements.
    pub(super) fn assemble_slivers(
        &mut self,
        part: &MeshPart,
        cut: &CutMesh,
        material: &Material,
        dt: f64,
    ) {
        self.across.clear();
        for face in &cut.ghost_faces {
            let c = slivers::coefficient(face, material, &self.a, dt);
            for (i, &row) in face.nodes.iter().enumerate() {
                if row as usize >= part.n_owned() {
                    continue;
                }
                for (j, &column) in face.nodes.iter().enumerate() {
                    let value = c * face.jump[i] * face.jump[j];
                    if i.min(j) == 3 && i != j {
                        self.across.push(Entry { row, column, value });
                    } else {
                        let slot = self.matrix.pattern.entry(row, column) as usize;
                        for k in 0..3 {
                            self.matrix.values[slot][k][k] += value;
                        }
                    }
                }
            }
        }
        // What is given of the column's node goes to the right-hand side, as in `constrain`.
        for &Entry { row, column, value } in &self.across {
            let x = self.x[column as usize];
            let free = self.constraints.nodes[column as usize].project([x[0], x[1], x[2]]);
            for k in 0..3 {
                self.rhs[row as usize][k] -= value * (x[k] - free[k]);
            }
        }
    }

    /// Nodes without fluid keep what they have.
    pub(super) fn fix_dry_nodes(&mut self, cut: &CutMesh) {
        let n_owned = self.matrix.n_rows();
        for i in cut.dry_nodes.iter().map(|&i| i as usize).take_while(|&i| i < n_owned) {
            let at = self.matrix.pattern.diagonals()[i] as usize;
            for k in 0..4 {
                self.matrix.values[at][k] = [0.0; 4];
                self.matrix.values[at][k][k] = 1.0;
            }
            self.pressure.values[at] = [[1.0]];
            self.rhs[i] = self.x[i];
        }
    }

    /// `A ← P A P + (I−P) D`, `b ← P (b − A g) + (I−P) D g`, `g` the given part of `x`.
    pub(super) fn constrain(&mut self) {
        let nodes = &self.constraints.nodes;
        for &(entry, i, j) in &self.constrained_entries {
            let (ci, cj) = (&nodes[i as usize], &nodes[j as usize]);
            let block = &mut self.matrix.values[entry as usize];
            let original = *block;
            if !cj.is_free() {
                let x = &self.x[j as usize];
                let free = cj.project([x[0], x[1], x[2]]);
                let mut given: [f64; 4] = [x[0] - free[0], x[1] - free[1], x[2] - free[2], 0.0];
                if cj.pressure_given == 1 {
                    given[3] = x[3];
                }
                let rhs = &mut self.rhs[i as usize];
                for r in 0..4 {
                    for c in 0..4 {
                        rhs[r] -= original[r][c] * given[c];
                    }
                }
                for row in block.iter_mut() {
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
        }
        // Rows that are given: P b + (I−P) D g, after all their columns have been moved to b.
        for i in 0..self.matrix.n_rows() {
            let c = &nodes[i];
            if c.is_free() {
                continue;
            }
            let diagonal = self.matrix.diagonal(i);
            let x = self.x[i];
            let free_x = c.project([x[0], x[1], x[2]]);
            let b = &mut self.rhs[i];
            let free_b = c.project([b[0], b[1], b[2]]);
            let given: [f64; 3] = std::array::from_fn(|k| x[k] - free_x[k]);
            for r in 0..3 {
                // D acts on (I−P)g alone: P A P g = 0.
                b[r] = free_b[r] + (0..3).map(|k| diagonal[r][k] * given[k]).sum::<f64>();
            }
            if c.pressure_given == 1 {
                b[3] = diagonal[3][3] * x[3];
            }
        }
    }
}
