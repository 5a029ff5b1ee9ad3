//! Orders of accuracy of the flow, and that its answer does not depend on the frame it is computed in.
//!
//! Manufactured solutions on small meshes; their errors are pinned to 1 %, so that a change of the
//! formulation shows. `scripts/validate` has the finer series.

use fcm_fsi::case::{Case, Sources};
use fcm_fsi::cut::CutMesh;
use fcm_fsi::fem::quadrature::TETRAHEDRON_CUBIC;
use fcm_fsi::flow::{Flow, Material};
use fcm_fsi::mesh::boxes::tensor_box;
use fcm_fsi::mesh::tetrahedron::Tetrahedron;
use fcm_fsi::mesh::{Mesh, MeshPart};
use fcm_fsi::setup;
use std::f64::consts::PI;

type Vector = [f64; 3];
type Matrix = [[f64; 3]; 3];
/// What stands for x, y, z in a formula.
type Places = [String; 3];

/// The flow of a case on a mesh of the test's own making, in place of the case's single cell.
struct Setting {
    part: MeshPart,
    flow: Flow,
    material: Material,
}

impl Setting {
    fn new(mesh: Mesh, case: &str) -> Self {
        let text = format!(
            "mesh.box = {{ x = [0, 1], y = [0, 1], z = [0, 1], cells = [1, 1, 1] }}\n\
             time = {{ end = 1, step = 1 }}\n{case}"
        );
        let sources = Sources {
            file: "case.toml".into(),
            folder: "/".into(),
            text,
            tables: Default::default(),
        };
        let case = Case::new(&sources).unwrap_or_else(|error| panic!("{error}\n{case}"));
        let part = MeshPart::single(mesh);
        let flow = setup::flow(&case, &part, &CutMesh::whole(), &setup::graph(&part))
            .expect("no velocity is given for all times");
        let material = setup::material(&case, &part, None);
        Self { part, flow, material }
    }

    /// Steps of these lengths from t = 0; returns the iterations of the last.
    fn run(&mut self, steps: impl IntoIterator<Item = f64>) -> u32 {
        let (mut t, mut iterations) = (0.0, 0);
        for dt in steps {
            let report = self
                .flow
                .advance(&self.part, &CutMesh::whole(), &[], &self.material, t, dt)
                .unwrap();
            iterations = report.iterations;
            t += dt;
        }
        iterations
    }

    /// L² errors of u, and of p but for a constant.
    fn errors(&self, u: impl Fn(Vector) -> Vector, p: impl Fn(Vector) -> f64) -> [f64; 2] {
        let mesh = &self.part.mesh;
        let (mut volume, mut of_u, mut of_p, mut mean) = (0.0, 0.0, 0.0, 0.0);
        for (e, tet) in mesh.tets.iter().enumerate() {
            let (x, v) = (mesh.corners(e), Tetrahedron::of(mesh, e).volume);
            let nodal = tet.map(|n| {
                let (u, p) = (self.flow.u[n as usize], self.flow.p[n as usize]);
                [u[0], u[1], u[2], p]
            });
            for (b, w) in TETRAHEDRON_CUBIC {
                for k in 0..4 {
                    let weight = |i: usize| if i == k { 1.0 - 3.0 * b } else { b };
                    let at: Vector =
                        std::array::from_fn(|c| (0..4).map(|i| weight(i) * x[i][c]).sum());
                    let here: [f64; 4] =
                        std::array::from_fn(|c| (0..4).map(|i| weight(i) * nodal[i][c]).sum());
                    let (u, p) = (u(at), p(at));
                    volume += w * v;
                    of_u += w * v * (0..3).map(|c| (here[c] - u[c]).powi(2)).sum::<f64>();
                    of_p += w * v * (here[3] - p).powi(2);
                    mean += w * v * (here[3] - p);
                }
            }
        }
        [of_u.sqrt(), (of_p - mean * mean / volume).sqrt()]
    }
}

/// The unit cube of n³ cells.
fn cube(n: usize) -> Mesh {
    let lines: Vec<f64> = (0..=n).map(|i| i as f64 / n as f64).collect();
    tensor_box([&lines; 3])
}

fn assert_pinned(found: [f64; 2], expected: [f64; 2]) {
    for k in 0..2 {
        assert!((found[k] / expected[k] - 1.0).abs() < 0.01, "{found:?}, pinned {expected:?}");
    }
}

fn order(coarse: f64, fine: f64, ratio: f64) -> f64 {
    (coarse / fine).ln() / ratio.ln()
}

fn letters() -> Places {
    ["x", "y", "z"].map(String::from)
}

/// u = π cos t (sin πx (cos πy − cos πz), …) and the force that keeps it with the pressure
/// p = sin πx sin πy sin πz cos t, in the given letters.
fn manufactured(nu: f64, at: &Places) -> [Places; 2] {
    let s = at.each_ref().map(|x| format!("sin(pi*{x})"));
    let c = at.each_ref().map(|x| format!("cos(pi*{x})"));
    let cyclic = |k: usize| [k, (k + 1) % 3, (k + 2) % 3];
    let u: Places = std::array::from_fn(|k| {
        let [k, j, i] = cyclic(k);
        format!("pi*cos(t)*{}*({}-{})", s[k], c[j], c[i])
    });
    let force = std::array::from_fn(|k| {
        let [k, j, i] = cyclic(k);
        let (sk, sj, si, ck, cj, ci) = (&s[k], &s[j], &s[i], &c[k], &c[j], &c[i]);
        let (uk, uj, ui) = (&u[k], &u[j], &u[i]);
        let gradients = format!("{uk}*{ck}*({cj}-{ci})-{uj}*{sk}*{sj}+{ui}*{sk}*{si}");
        format!(
            "pi^2*cos(t)*({gradients})+pi*{ck}*{sj}*{si}*cos(t)-pi*sin(t)*{sk}*({cj}-{ci})\
             +{:?}*{uk}",
            2.0 * PI * PI * nu
        )
    });
    [u, force]
}

fn velocity(x: Vector, t: f64) -> Vector {
    let (s, c) = (x.map(|x| (PI * x).sin()), x.map(|x| (PI * x).cos()));
    std::array::from_fn(|k| PI * t.cos() * s[k] * (c[(k + 1) % 3] - c[(k + 2) % 3]))
}

fn pressure(x: Vector, t: f64) -> f64 {
    x.iter().map(|x| (PI * x).sin()).product::<f64>() * t.cos()
}

/// Three formulas as TOML.
fn list(f: &Places) -> String {
    format!("[\"{}\", \"{}\", \"{}\"]", f[0], f[1], f[2])
}

#[test]
fn second_order_in_space() {
    let pinned_at = [
        (0.01, [[0.1897, 0.2876], [0.04745, 0.06428]]),
        (1.0, [[0.1727, 0.4954], [0.04279, 0.1455]]),
    ];
    for (nu, pinned) in pinned_at {
        let [u, force] = manufactured(nu, &letters());
        let case = format!(
            "gravity = [0, 0, 0]\nbody_force = {}\nboundaries.default.velocity = {}\n\
             initial.velocity = {}\nwater = {{ density = 1, viscosity = {nu:?} }}\n\
             solver.tolerance = 1e-6",
            list(&force),
            list(&u),
            list(&u)
        );
        let errors = [7, 14].map(|n| {
            let (dt, steps) = (0.2 / n as f64, n);
            let mut setting = Setting::new(cube(n), &case);
            let iterations = setting.run((0..steps).map(|_| dt));
            assert!(iterations <= 25, "{iterations} iterations");
            setting.errors(|x| velocity(x, 0.2), |x| pressure(x, 0.2 - 0.5 * dt))
        });
        println!("ν = {nu}: u and p {errors:?}");
        let orders = [0, 1].map(|k| order(errors[0][k], errors[1][k], 2.0));
        assert!(orders[0] > 1.8 && orders[1] > 0.8, "{orders:?}");
        for (found, expected) in errors.into_iter().zip(pinned) {
            assert_pinned(found, expected);
        }
    }
}

/// u = A(t) x, A = B cos t + C sin 2t without trace, p = ρ b·x cos t is in the finite element space,
/// so that all error is the time's; the viscous term is zero. Every other step is longer.
#[test]
fn second_order_in_time_with_uneven_steps() {
    const B: Matrix = [[0.5, -1.0, 0.2], [0.8, -0.2, 0.6], [-0.4, 0.3, -0.3]];
    const C: Matrix = [[-0.3, 0.4, 0.1], [-0.5, 0.1, -0.2], [0.6, 0.2, 0.2]];
    const SLOPE: Vector = [1.0, -2.0, 0.5];
    const RHO: f64 = 2.0;
    let product = |a: Matrix, b: Matrix| -> Matrix {
        a.map(|row| std::array::from_fn(|j| (0..3).map(|k| row[k] * b[k][j]).sum()))
    };
    let (bc, cb) = (product(B, C), product(C, B));
    let mixed: Matrix = std::array::from_fn(|i| std::array::from_fn(|j| bc[i][j] + cb[i][j]));
    // Component k of Σ factor · matrix · x.
    let sum = |terms: &[(&str, Matrix)], k: usize| {
        let term = |(f, m): &(&str, Matrix)| {
            format!("{f}*({:?}*x+{:?}*y+{:?}*z)", m[k][0], m[k][1], m[k][2])
        };
        terms.iter().map(term).collect::<Vec<_>>().join("+").replace("+-", "-")
    };
    let u = std::array::from_fn(|k| sum(&[("cos(t)", B), ("sin(2*t)", C)], k));
    let terms = [
        ("(0-sin(t))", B),
        ("2*cos(2*t)", C),
        ("cos(t)^2", product(B, B)),
        ("cos(t)*sin(2*t)", mixed),
        ("sin(2*t)^2", product(C, C)),
    ];
    let force = std::array::from_fn(|k| format!("{}+({:?})*cos(t)", sum(&terms, k), SLOPE[k]));
    let pinned_at = [
        (0.0, [[9.120e-5, 6.294e-4], [1.569e-5, 1.5065e-4]]),
        (0.1, [[2.786e-5, 5.701e-4], [5.518e-6, 1.3933e-4]]),
    ];
    for (mu, pinned) in pinned_at {
        let case = format!(
            "gravity = [0, 0, 0]\nbody_force = {}\nboundaries.default.velocity = {}\n\
             initial.velocity = {}\nwater = {{ density = {RHO}, viscosity = {mu:?} }}\n\
             solver.tolerance = 1e-8",
            list(&force),
            list(&u),
            list(&u)
        );
        let errors = [16, 32].map(|n| {
            let mean = 0.8 / n as f64;
            let mut setting = Setting::new(cube(4), &case);
            setting.run((0..n).map(|i| if i % 2 == 0 { 0.8 * mean } else { 1.2 * mean }));
            let at = |x: Vector, t: f64| -> Vector {
                let a = |i: usize, j: usize| B[i][j] * t.cos() + C[i][j] * (2.0 * t).sin();
                std::array::from_fn(|i| (0..3).map(|j| a(i, j) * x[j]).sum())
            };
            let p = |x: Vector| {
                RHO * (0..3).map(|k| SLOPE[k] * x[k]).sum::<f64>() * (0.8 - 0.6 * mean).cos()
            };
            setting.errors(|x| at(x, 0.8), p)
        });
        println!("μ = {mu}: u and p {errors:?}");
        let orders = [0, 1].map(|k| order(errors[0][k], errors[1][k], 2.0));
        assert!(orders.iter().all(|o| *o > 1.8), "{orders:?}");
        for (found, expected) in errors.into_iter().zip(pinned) {
            assert_pinned(found, expected);
        }
    }
}

/// R of an angle about an axis, by Rodrigues.
fn rotation(axis: Vector, angle: f64) -> Matrix {
    let length = axis.iter().map(|a| a * a).sum::<f64>().sqrt();
    let n = axis.map(|a| a / length);
    let cross = [[0.0, -n[2], n[1]], [n[2], 0.0, -n[0]], [-n[1], n[0], 0.0]];
    let (s, c) = angle.sin_cos();
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let unit = if i == j { c } else { 0.0 };
            unit + s * cross[i][j] + (1.0 - c) * n[i] * n[j]
        })
    })
}

fn turn(r: &Matrix, x: Vector) -> Vector {
    r.map(|row| row[0] * x[0] + row[1] * x[1] + row[2] * x[2])
}

/// The same flow between slip walls under gravity, upright and with everything turned.
#[test]
fn a_turned_tank_has_the_turned_flow() {
    let gravity = [1.0, -3.0, 9.0];
    let unit = rotation([1.0, 0.0, 0.0], 0.0);
    let turned = rotation([1.0, 2.0, -0.5], 0.7);
    let fields = [unit, turned].map(|r| {
        // x = Rᵀ x', u' = R u, written in the letters of the formulas.
        let places = std::array::from_fn(|k| {
            format!("({:?}*x+{:?}*y+{:?}*z)", r[0][k], r[1][k], r[2][k]).replace("+-", "-")
        });
        let [u, force] = manufactured(0.01, &places).map(|f| {
            r.map(|row| {
                let [a, b, c] = row;
                format!("({a:?})*({})+({b:?})*({})+({c:?})*({})", f[0], f[1], f[2])
            })
        });
        let case = format!(
            "gravity = {:?}\nbody_force = {}\nboundaries.default = \"slip\"\n\
             initial.velocity = {}\nwater = {{ density = 1, viscosity = 0.01 }}\n\
             solver.tolerance = 1e-11",
            turn(&r, gravity),
            list(&force),
            list(&u)
        );
        let mut mesh = cube(5);
        mesh.nodes.iter_mut().for_each(|x| *x = turn(&r, *x));
        let mut setting = Setting::new(mesh, &case);
        setting.run([0.02, 0.03, 0.025, 0.025, 0.03]);
        let back: Matrix = std::array::from_fn(|i| std::array::from_fn(|j| r[j][i]));
        let u: Vec<Vector> = setting.flow.u.iter().map(|u| turn(&back, *u)).collect();
        let p = &setting.flow.p;
        let mean = p.iter().sum::<f64>() / p.len() as f64;
        (u, p.iter().map(|p| p - mean).collect::<Vec<f64>>())
    });
    let [(u, p), (u_turned, p_turned)] = &fields;
    let largest = u.iter().flatten().fold(0.0f64, |a, u| a.max(u.abs()));
    assert!(largest > 3.0);
    for (u, v) in u.iter().zip(u_turned) {
        assert!((0..3).all(|k| (u[k] - v[k]).abs() < 1e-8 * largest), "{u:?} {v:?}");
    }
    let largest = p.iter().fold(0.0f64, |a, p| a.max(p.abs()));
    for (p, q) in p.iter().zip(p_turned) {
        assert!((p - q).abs() < 1e-8 * largest, "{p} {q}");
    }
}

/// Where viscosity rules, Δt ν/h² up to 50, a finer mesh takes no more iterations, between walls of any
/// kind.
#[test]
fn iterations_do_not_grow_with_viscosity_or_mesh() {
    let [u, force] = manufactured(1.0, &letters());
    let given = format!("boundaries.default.velocity = {}", list(&u));
    let slip = "boundaries.default = \"slip\"".to_string();
    let mixed = "boundaries = { default = \"no_slip\", z_max = \"open\" }".to_string();
    for boundaries in [given, slip, mixed] {
        let counts = [6, 12, 16].map(|n| {
            let case = format!(
                "gravity = [0, 0, 0]\nbody_force = {}\n{boundaries}\ninitial.velocity = {}\n\
                 water = {{ density = 1, viscosity = 1 }}\nsolver.tolerance = 1e-6",
                list(&force),
                list(&u)
            );
            Setting::new(cube(n), &case).run([0.2; 4])
        });
        println!("{counts:?}");
        assert!(counts.iter().all(|n| *n <= 42), "{boundaries}: {counts:?}");
    }
}

/// A vortex in a slab between slip walls decays at its rate: kinetic energy e^(−4νt).
#[test]
fn taylor_green_energy_decays_at_second_order() {
    let errors = [8, 16].map(|n| {
        let line = |n: usize, h: f64| (0..=n).map(|i| i as f64 * h).collect::<Vec<_>>();
        let h = PI / n as f64;
        let mesh = tensor_box([&line(n, h), &line(1, h), &line(n, h)]);
        let case = "gravity = [0, 0, 0]\nboundaries.default = \"slip\"\n\
             initial.velocity = [\"sin(x)*cos(z)\", 0, \"-cos(x)*sin(z)\"]\n\
             water = { density = 1, viscosity = 0.05 }\nsolver.tolerance = 1e-6";
        let mut setting = Setting::new(mesh, case);
        let energy = |s: &Setting| s.errors(|_| [0.0; 3], |_| 0.0)[0].powi(2);
        let start = energy(&setting);
        let steps = 4 * n;
        setting.run((0..steps).map(|_| 2.0 / steps as f64));
        energy(&setting) / start / (-0.4f64).exp() - 1.0
    });
    println!("{errors:?}");
    assert!(order(errors[0].abs(), errors[1].abs(), 2.0) > 1.8, "{errors:?}");
    assert_pinned(errors, [-0.02133, -0.004527]);
}
