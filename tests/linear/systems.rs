//! Systems to solve: scalar diffusion and convection, and stabilised unsteady Oseen flow, on boxes.

#![allow(dead_code)] // each test program uses its part
#![allow(non_snake_case)]

use fcm_fsi::fem::tetrahedron::Tetrahedron;
use fcm_fsi::linear::{BlockCsr, NodeGraph};
use fcm_fsi::mesh::{Mesh, MeshPart, boxes::tensor_box};

/// A box of nx × ny × nz cells of size h, nodes moved by up to `jitter` h inside.
pub fn cells(n: [usize; 3], h: f64, jitter: f64) -> Mesh {
    let lines = n.map(|n| (0..=n).map(|i| i as f64 * h).collect::<Vec<_>>());
    let mut mesh = tensor_box([&lines[0], &lines[1], &lines[2]]);
    let top = n.map(|n| n as f64 * h);
    for (i, x) in mesh.nodes.iter_mut().enumerate() {
        for a in 0..3 {
            if x[a] > 0.5 * h && x[a] < top[a] - 0.5 * h {
                x[a] += jitter * h * noise(3 * i as u64 + a as u64);
            }
        }
    }
    mesh
}

/// Reproducible numbers in −1..1, by global id.
pub fn noise(i: u64) -> f64 {
    let mut x = i.wrapping_add(0x9e37_79b9_7f4a_7c15).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 29)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((x ^ (x >> 32)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

pub fn graph(part: &MeshPart) -> NodeGraph {
    NodeGraph::new(&part.comm, &part.nodes, &part.exchange, &part.mesh.tets)
}

/// ∫ mass q p + k ∇q·∇p + q a·∇p; rows and columns of `fixed` nodes are the identity.
pub fn scalar(
    part: &MeshPart,
    mass: f64,
    k: impl Fn([f64; 3]) -> f64,
    a: [f64; 3],
    fixed: impl Fn([f64; 3]) -> bool,
) -> BlockCsr<1> {
    let mesh = &part.mesh;
    let graph = graph(part);
    let mut matrix = BlockCsr::<1>::zero(&graph.pattern);
    for (e, tet) in mesh.tets.iter().enumerate() {
        let t = Tetrahedron::of(mesh, e);
        let k = k(centre(mesh, tet));
        for i in (0..4).filter(|&i| (tet[i] as usize) < part.n_owned()) {
            let at = graph.entries(e, tet, i);
            for j in 0..4 {
                let m = if i == j { 0.1 } else { 0.05 };
                matrix.values[at[j]][0][0] += t.volume
                    * (mass * m + k * dot(t.grad[i], t.grad[j]) + 0.25 * dot(a, t.grad[j]));
            }
        }
    }
    for i in 0..part.n_owned() {
        for e in matrix.row(i) {
            let j = matrix.pattern.columns[e] as usize;
            if fixed(mesh.nodes[i]) || fixed(mesh.nodes[j]) {
                matrix.values[e][0][0] = f64::from(u8::from(i == j));
            }
        }
    }
    matrix
}

/// One step of a two-phase flow in a tank.
pub struct Oseen {
    /// Time step [s].
    pub dt: f64,
    /// Convecting velocity [m/s], tangential at walls.
    pub a: fn([f64; 3]) -> [f64; 3],
    /// Density [kg/m³].
    pub rho: fn([f64; 3]) -> f64,
    /// Kinematic viscosity [m²/s].
    pub nu: f64,
    /// Open at the top; else closed, with the pressure pinned at global node 0.
    pub open: bool,
    /// Edge length of cells [m].
    pub h: f64,
    /// Extent of the box [m].
    pub size: [f64; 3],
}

impl Oseen {
    /// A unit tank of n × n × n/2 cells, half water, half air, turning about y at up to 1 m/s.
    pub fn tank(n: usize, courant: f64, open: bool) -> Self {
        use std::f64::consts::PI;
        let h = 1.0 / n as f64;
        Self {
            dt: courant * h,
            a: |x| {
                let (sx, cx) = (PI * x[0]).sin_cos();
                let (sz, cz) = (2.0 * PI * x[2]).sin_cos();
                [sx * cz, 0.0, -0.5 * cx * sz]
            },
            rho: |x| if x[2] < 0.25 + 0.05 * (PI * x[0]).cos() { 1000.0 } else { 1.0 },
            nu: 1e-6,
            open,
            h,
            size: [1.0, 1.0, h * (n / 2) as f64],
        }
    }

    /// A gust: a momentum source of noise and of gravity, and no source of mass; zero where
    /// unknowns are prescribed.
    pub fn right_hand_side(&self, part: &MeshPart) -> Vec<f64> {
        let mut b = vec![0.0; 4 * part.n_local()];
        for tet in &part.mesh.tets {
            let t = Tetrahedron::new(tet.map(|n| part.mesh.nodes[n as usize]));
            let rho = (self.rho)(centre(&part.mesh, tet));
            for &n in tet {
                let i = n as usize;
                for a in 0..3 {
                    let gravity = if a == 2 { -9.81 } else { 0.0 };
                    let gust = noise(3 * part.nodes.global[i] + a as u64);
                    b[4 * i + a] += rho * 0.25 * t.volume * (gust + gravity);
                }
            }
        }
        for i in 0..part.n_local() {
            let fixed = self.fixed(part, i);
            for a in 0..4 {
                if fixed[a] || i >= part.n_owned() {
                    b[4 * i + a] = 0.0;
                }
            }
        }
        b
    }

    /// The 4×4 system and the pressure operator L = ∫((Δt_eff + τ)/ρ)∇q·∇p.
    pub fn assemble(&self, part: &MeshPart) -> (BlockCsr<4>, BlockCsr<1>) {
        let mesh = &part.mesh;
        let graph = graph(part);
        let mut A = BlockCsr::<4>::zero(&graph.pattern);
        let mut L = BlockCsr::<1>::zero(&graph.pattern);
        let theta = 0.5;
        for (e, tet) in mesh.tets.iter().enumerate() {
            let t = Tetrahedron::of(mesh, e);
            let (V, h) = (t.volume, t.size());
            let x = centre(mesh, tet);
            let (a, rho) = ((self.a)(x), (self.rho)(x));
            let speed = dot(a, a).sqrt();
            let tau = ((2.0 / self.dt).powi(2)
                + (2.0 * speed / h).powi(2)
                + (4.0 * self.nu / (h * h)).powi(2))
            .powf(-0.5);
            let tau_c = 0.5 * h * speed;
            let dt_eff = 1.0 / (1.0 / self.dt + 2.0 * theta * speed / h);
            for i in (0..4).filter(|&i| (tet[i] as usize) < part.n_owned()) {
                let at = graph.entries(e, tet, i);
                for j in 0..4 {
                    let (gi, gj) = (t.grad[i], t.grad[j]);
                    let (ai, aj) = (dot(a, gi), dot(a, gj));
                    let m = if i == j { 0.1 } else { 0.05 };
                    // Strong inertia of u_j, mean and times N_i.
                    let inertia = 0.25 / self.dt + theta * aj;
                    let diagonal = rho
                        * V
                        * (m / self.dt
                            + theta * 0.25 * aj
                            + theta * self.nu * dot(gi, gj)
                            + tau * ai * inertia);
                    let block = &mut A.values[at[j]];
                    for r in 0..3 {
                        block[r][r] += diagonal;
                        for c in 0..3 {
                            block[r][c] +=
                                rho * V * (theta * self.nu * gi[c] * gj[r] + tau_c * gi[r] * gj[c]);
                        }
                        block[r][3] += V * (-0.25 * gi[r] + tau * ai * gj[r]);
                        block[3][r] += V * (0.25 * gj[r] + tau * gi[r] * inertia);
                    }
                    block[3][3] += V * tau / rho * dot(gi, gj);
                    L.values[at[j]][0][0] += V * (dt_eff + tau) / rho * dot(gi, gj);
                }
            }
        }
        self.constrain(part, &mut A, &mut L);
        (A, L)
    }

    /// Slip walls: the normal component is zero; the pressure at an open top, or of one node.
    fn fixed(&self, part: &MeshPart, i: usize) -> [bool; 4] {
        let x = part.mesh.nodes[i];
        let at = |a: usize, v: f64| (x[a] - v).abs() < 1e-9;
        let top = at(2, self.size[2]);
        [
            at(0, 0.0) || at(0, self.size[0]),
            at(1, 0.0) || at(1, self.size[1]),
            at(2, 0.0) || (top && !self.open),
            if self.open { top } else { part.nodes.global[i] == 0 },
        ]
    }

    fn constrain(&self, part: &MeshPart, A: &mut BlockCsr<4>, L: &mut BlockCsr<1>) {
        for i in 0..part.n_owned() {
            let fixed_i = self.fixed(part, i);
            for e in A.row(i) {
                let j = A.pattern.columns[e] as usize;
                let fixed_j = self.fixed(part, j);
                for r in 0..4 {
                    for c in 0..4 {
                        if (fixed_i[r] || fixed_j[c]) && !(i == j && r == c) {
                            A.values[e][r][c] = 0.0;
                        }
                    }
                }
                if fixed_i[3] || fixed_j[3] {
                    L.values[e][0][0] = f64::from(u8::from(i == j));
                    if i == j {
                        A.values[e][3][3] = 1.0;
                    }
                }
            }
        }
    }
}

fn centre(mesh: &Mesh, tet: &[u32; 4]) -> [f64; 3] {
    std::array::from_fn(|a| tet.iter().map(|&n| mesh.nodes[n as usize][a]).sum::<f64>() / 4.0)
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
