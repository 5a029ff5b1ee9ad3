//! Krylov methods, relaxation and multigrid against direct solves and theory.

#![allow(non_snake_case)]

#[path = "linear/systems.rs"]
mod systems;

use faer::prelude::*;
use fcm_fsi::linear::relaxation::{Jacobi, SymmetricGaussSeidel};
use fcm_fsi::linear::*;
use fcm_fsi::mesh::MeshPart;
use systems::*;

fn halo<const B: usize>(part: &MeshPart, graph: &BlockCsr<B>) -> Halo {
    Halo::new(&part.comm, &part.nodes, &part.exchange, &graph.pattern)
}

/// Dense LU.
fn direct<const B: usize>(a: &BlockCsr<B>, b: &[f64]) -> Vec<f64> {
    let n = b.len();
    let mut dense = faer::Mat::<f64>::zeros(n, n);
    for i in 0..a.n_rows() {
        for e in a.row(i) {
            let j = a.pattern.columns[e] as usize;
            for r in 0..B {
                for c in 0..B {
                    dense[(B * i + r, B * j + c)] = a.values[e][r][c];
                }
            }
        }
    }
    let mut x = faer::Mat::from_fn(n, 1, |i, _| b[i]);
    dense.partial_piv_lu().solve_in_place(&mut x);
    (0..n).map(|i| x[(i, 0)]).collect()
}

fn difference(a: &[f64], b: &[f64]) -> f64 {
    let largest = b.iter().fold(0.0, |m: f64, b| m.max(b.abs()));
    a.iter().zip(b).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs())) / largest
}

fn right_hand_side(n: usize) -> Vec<f64> {
    (0..n as u64).map(noise).collect()
}

#[test]
fn matvec_equals_the_dense_product() {
    let part = MeshPart::single(cells([3, 2, 2], 0.5, 0.2));
    let mut a = BlockCsr::<4>::zero(&graph(&part).pattern);
    for (e, block) in a.values.iter_mut().enumerate() {
        for k in 0..16 {
            block[k / 4][k % 4] = noise(16 * e as u64 + k as u64);
        }
    }
    let halo = halo(&part, &a);
    let n = 4 * part.n_local();
    let (mut x, mut y) = (right_hand_side(n), vec![0.0; n]);
    DistributedOperator::new(&a, &halo).apply(&mut x, &mut y);
    let back = direct(&a, &y);
    assert!(difference(&back, &x) < 1e-10);

    // In single precision and split.
    for block in a.values.as_flattened_mut().as_flattened_mut() {
        *block = f64::from(*block as f32);
    }
    let split = SaddleCsr::from(&a);
    let mut z = vec![0.0; n];
    DistributedOperator::new(&a, &halo).apply(&mut x, &mut y);
    DistributedOperator::new(&split, &halo).apply(&mut x, &mut z);
    assert!(difference(&z, &y) < 1e-14);
    for i in 0..a.n_rows() {
        assert!(a.row(i).all(|e| split.block(i, e) == a.values[e]));
    }
}

#[test]
fn krylov_methods_solve_what_a_direct_method_solves() {
    let part = MeshPart::single(cells([6, 5, 4], 0.2, 0.2));
    let n = part.n_local();
    let b = right_hand_side(n);
    let settings =
        KrylovSettings { relative: 1e-11, absolute: 0.0, max_iterations: 400, restart: 30 };
    let mut work = Workspace::default();

    let convected = scalar(&part, 10.0, |_| 0.1, [1.0, 0.5, -0.3], |x| x[0] < 0.1);
    let halo = halo(&part, &convected);
    let product = OwnedProduct::plain::<1>(&halo);
    let A = DistributedOperator::new(&convected, &halo);
    let expected = direct(&convected, &b);
    let (mut jacobi, mut gauss_seidel) = (Jacobi::default(), SymmetricGaussSeidel::default());
    jacobi.setup(&convected);
    gauss_seidel.setup(&convected);
    let mut x = vec![0.0; n];
    let plain = fgmres(&A, &mut Identity, &product, &b, &mut x, &settings, &mut work).unwrap();
    assert!(difference(&x, &expected) < 1e-8);
    x.fill(0.0);
    let diagonal = fgmres(&A, &mut jacobi, &product, &b, &mut x, &settings, &mut work).unwrap();
    assert!(difference(&x, &expected) < 1e-8);
    x.fill(0.0);
    let relaxed =
        fgmres(&A, &mut gauss_seidel.with(&convected), &product, &b, &mut x, &settings, &mut work)
            .unwrap();
    assert!(difference(&x, &expected) < 1e-8);
    println!("{plain:?} {diagonal:?} {relaxed:?}");
    assert!(relaxed.iterations < diagonal.iterations);
    assert!(relaxed.residual <= 1e-11 * relaxed.initial);

    let diffused =
        scalar(&part, 0.0, |x| if x[2] < 0.4 { 1.0 } else { 1e3 }, [0.0; 3], |x| x[0] < 0.1);
    let A = DistributedOperator::new(&diffused, &halo);
    let expected = direct(&diffused, &b);
    gauss_seidel.setup(&diffused);
    x.fill(0.0);
    let conjugate =
        cg(&A, &mut gauss_seidel.with(&diffused), &product, &b, &mut x, &settings, &mut work)
            .unwrap();
    println!("{conjugate:?}");
    assert!(difference(&x, &expected) < 1e-8);
    // A good initial guess is kept.
    let again = cg(
        &A,
        &mut gauss_seidel.with(&diffused),
        &product,
        &b,
        &mut x,
        &KrylovSettings { absolute: 1e-6, ..settings },
        &mut work,
    );
    assert_eq!(again.unwrap().iterations, 0);
}

#[test]
fn weights_change_the_norm_that_is_minimised_and_not_the_solution() {
    let part = MeshPart::single(cells([4, 4, 4], 0.2, 0.2));
    let a = scalar(&part, 1.0, |x| if x[2] < 0.4 { 1.0 } else { 1e3 }, [0.0; 3], |_| false);
    let halo = halo(&part, &a);
    let b = right_hand_side(part.n_local());
    let weights: Vec<f64> = (0..part.n_owned()).map(|i| 1.0 / a.diagonal(i)[0][0]).collect();
    let product = OwnedProduct::weighted::<1>(&halo, &weights);
    let expected: f64 = b.iter().zip(&weights).map(|(b, w)| b * b * w).sum::<f64>().sqrt();
    let mut x = vec![0.0; b.len()];
    let mut prec = SymmetricGaussSeidel::default();
    prec.setup(&a);
    let settings = KrylovSettings { relative: 1e-10, ..KrylovSettings::default() };
    let A = DistributedOperator::new(&a, &halo);
    let done =
        fgmres(&A, &mut prec.with(&a), &product, &b, &mut x, &settings, &mut Workspace::default())
            .unwrap();
    assert!((done.initial / expected - 1.0).abs() < 1e-12);
    assert!(difference(&x, &direct(&a, &b)) < 1e-7);
}

#[test]
fn a_solve_that_fails_says_how() {
    let part = MeshPart::single(cells([4, 4, 4], 0.2, 0.0));
    let mut a = scalar(&part, 0.0, |_| 1.0, [0.0; 3], |x| x[0] < 0.1);
    let halo = halo(&part, &a);
    let product = OwnedProduct::plain::<1>(&halo);
    let b = right_hand_side(part.n_local());
    let mut work = Workspace::default();
    let settings =
        KrylovSettings { relative: 1e-10, max_iterations: 5, ..KrylovSettings::default() };
    let mut solve = |a: &BlockCsr<1>, b: &[f64], settings: &KrylovSettings| {
        let A = DistributedOperator::new(a, &halo);
        let mut x = vec![0.0; b.len()];
        let one = fgmres(&A, &mut Identity, &product, b, &mut x, settings, &mut work).map(drop);
        x.fill(0.0);
        let other = cg(&A, &mut Identity, &product, b, &mut x, settings, &mut work).map(drop);
        [one, other]
    };
    for failed in solve(&a, &b, &settings) {
        let failed = failed.unwrap_err();
        assert_eq!((failed.reason, failed.iterations), (Reason::MaxIterations, 5));
        assert!(failed.residual > 0.0 && failed.residual.is_finite() && failed.initial > 0.0);
        println!("{failed}");
    }
    // Below rounding: a stall, not an endless loop and not a claim.
    let tight =
        KrylovSettings { relative: 1e-18, max_iterations: 10_000, restart: 30, absolute: 0.0 };
    for failed in solve(&a, &b, &tight) {
        assert_eq!(failed.unwrap_err().reason, Reason::Stagnated);
    }
    // Nothing to do.
    for done in solve(&a, &vec![0.0; b.len()], &settings) {
        done.unwrap();
    }
    let mut bad = b.clone();
    bad[7] = f64::NAN;
    for failed in solve(&a, &bad, &settings) {
        assert_eq!(failed.unwrap_err().reason, Reason::NotFinite);
    }
    for v in &mut a.values {
        v[0][0] = -v[0][0];
    }
    let [_, negative] = solve(&a, &b, &settings);
    assert_eq!(negative.unwrap_err().reason, Reason::NotPositive);
    a.clear();
    let [stuck, _] = solve(&a, &b, &settings);
    assert_eq!(stuck.unwrap_err().reason, Reason::NotFinite);
}

/// A diagonal matrix.
struct Diagonal(Vec<f64>);

impl Operator for Diagonal {
    fn apply<X: Value>(&self, x: &mut [X], y: &mut [f64]) {
        for ((y, x), d) in y.iter_mut().zip(x).zip(&self.0) {
            *y = d * (*x).into();
        }
    }
}

/// Minimal polynomials: what GMRES leaves after s + k steps is at most `2ρ^k Π|1 − λ/λ_b|` if all but the s eigenvalues
/// λ_b are in [1, 1.5] (Saad 2003, ch. 6.11). Begun anew every ten steps it needs 100.
#[test]
fn a_few_bad_cells_cost_a_few_directions() {
    let part = MeshPart::single(cells([9, 9, 9], 0.2, 0.0));
    let halo = halo(&part, &scalar(&part, 0.0, |_| 1.0, [0.0; 3], |_| false));
    let (n, bad) = (part.n_local(), [0.0005, 0.001, 0.0015, 0.002, 0.0025, 0.003]);
    let mut diagonal: Vec<f64> = (0..n).map(|i| 1.0 + 0.5 * i as f64 / (n - 1) as f64).collect();
    diagonal[..bad.len()].copy_from_slice(&bad);
    let settings =
        KrylovSettings { relative: 1e-6, absolute: 0.0, max_iterations: 500, restart: 10 };
    let (mut x, product) = (vec![0.0; n], OwnedProduct::plain::<1>(&halo));
    let (A, mut work) = (Diagonal(diagonal), Workspace::default());
    let ones = vec![1.0; n];
    let done = fgmres(&A, &mut Identity, &product, &ones, &mut x, &settings, &mut work).unwrap();
    let growth: f64 = bad.iter().map(|b| 1.5 / b).product();
    let rate = (1.5f64.sqrt() - 1.0) / (1.5f64.sqrt() + 1.0);
    let most = bad.len() as f64 + (settings.relative / (2.0 * growth)).ln() / rate.ln();
    assert!(f64::from(done.iterations) <= most.ceil(), "{} of {most}", done.iterations);
    let worst = x.iter().zip(&A.0).fold(0.0, |w: f64, (x, d)| w.max((x * d - 1.0).abs()));
    assert!(worst < 1e-6 * (n as f64).sqrt(), "{worst}");
}

/// Iterations of CG with multigrid to 1e-3 and 1e-6 on n × n × n/2 cells.
fn diffusion_counts(n: usize, jump: f64, fixed: fn([f64; 3]) -> bool, pinned: bool) -> [u32; 2] {
    let part = MeshPart::single(cells([n, n, n / 2], 1.0, 0.2));
    let half = 0.25 * n as f64 + 0.4;
    let fixed = |x: [f64; 3]| if pinned { x == [0.0; 3] } else { fixed(x) };
    let L = scalar(&part, 0.0, |x| if x[2] < half { 1.0 } else { jump }, [0.0; 3], fixed);
    let halo = halo(&part, &L);
    let mut multigrid = Multigrid::new(&halo);
    multigrid.setup(&L);
    // An image of A, so that the closed problem is compatible.
    let mut b = vec![0.0; part.n_local()];
    let A = DistributedOperator::new(&L, &halo);
    A.apply(&mut right_hand_side(part.n_local()), &mut b);
    let mut work = Workspace::default();
    [1e-3, 1e-6].map(|relative| {
        let settings = KrylovSettings { relative, ..KrylovSettings::default() };
        let mut x = vec![0.0; b.len()];
        let product = OwnedProduct::plain::<1>(&halo);
        let done = cg(&A, &mut multigrid, &product, &b, &mut x, &settings, &mut work).unwrap();
        assert!(done.residual <= relative * done.initial);
        done.iterations
    })
}

#[test]
fn multigrid_counts_do_not_depend_on_mesh_or_coefficients() {
    let side = |x: [f64; 3]| x[0] < 0.1;
    for (jump, pinned) in [(1.0, false), (1e3, false), (1e-3, true), (1e3, true)] {
        let counts = [10, 20, 36].map(|n| diffusion_counts(n, jump, side, pinned));
        println!("jump {jump}, pinned {pinned}: {counts:?}");
        for count in counts {
            assert!(count[0] <= 9 && count[1] <= 17, "{counts:?}");
        }
    }
}

#[test]
fn multigrid_takes_rows_that_are_all_prescribed_and_lone_nodes() {
    let part = MeshPart::single(cells([6, 4, 4], 1.0, 0.2));
    let b = right_hand_side(part.n_local());
    // Nothing free; one free node; free nodes in two pieces apart.
    let cases: [fn([f64; 3]) -> bool; 3] = [
        |_| true,
        |x| (x[0] - 2.0).abs() + (x[1] - 2.0).abs() + (x[2] - 2.0).abs() > 0.7,
        |x| (x[0] - 3.0).abs() < 0.5,
    ];
    for fixed in cases {
        let L = scalar(&part, 0.0, |_| 1.0, [0.0; 3], fixed);
        let halo = halo(&part, &L);
        let mut multigrid = Multigrid::new(&halo);
        multigrid.setup(&L);
        let A = DistributedOperator::new(&L, &halo);
        let product = OwnedProduct::plain::<1>(&halo);
        let mut x = vec![0.0; b.len()];
        let settings = KrylovSettings { relative: 1e-10, ..KrylovSettings::default() };
        let work = &mut Workspace::default();
        let done = cg(&A, &mut multigrid, &product, &b, &mut x, &settings, work).unwrap();
        assert!(done.iterations <= 25, "{done:?}");
        assert!(difference(&x, &direct(&L, &b)) < 1e-8);
    }
}

fn solve_flow(problem: &Oseen, part: &MeshPart, relative: f64) -> (Converged, Vec<f64>) {
    let (system, L) = problem.assemble(part);
    let halo = halo(part, &system);
    let b = problem.right_hand_side(part);
    let mut weights = Vec::new();
    let split = SaddleCsr::from(&system);
    residual_weights(&split, &L, &mut weights);
    let product = OwnedProduct::weighted::<4>(&halo, &weights);
    let mut schur = SchurPreconditioner::new(&halo);
    schur.setup(&split, &L, None);
    let settings = KrylovSettings { relative, ..KrylovSettings::default() };
    let mut x = vec![0.0; b.len()];
    let A = DistributedOperator::new(&system, &halo);
    let work = &mut Workspace::default();
    let done = fgmres(&A, &mut schur.with(&split), &product, &b, &mut x, &settings, work).unwrap();
    (done, x)
}

#[test]
fn schur_solves_the_flow_system_a_direct_method_solves() {
    for open in [true, false] {
        let problem = Oseen::tank(6, 1.0, open);
        let part = MeshPart::single(cells([6, 6, 3], 1.0 / 6.0, 0.2));
        let (system, _) = problem.assemble(&part);
        let expected = direct(&system, &problem.right_hand_side(&part));
        let (done, x) = solve_flow(&problem, &part, 1e-12);
        for a in 0..4 {
            let pick = |x: &[f64]| x.iter().skip(a).step_by(4).copied().collect::<Vec<_>>();
            assert!(difference(&pick(&x), &pick(&expected)) < 1e-8, "{done:?}");
        }
    }
}

#[test]
fn schur_counts_do_not_depend_on_mesh_or_closure() {
    for (courant, limit) in [(1.0, [9, 18]), (10.0, [31, 80])] {
        for open in [true, false] {
            let counts = [8, 14, 24].map(|n| {
                let part = MeshPart::single(cells([n, n, n / 2], 1.0 / n as f64, 0.2));
                let problem = Oseen::tank(n, courant, open);
                [1e-3, 1e-6].map(|relative| solve_flow(&problem, &part, relative).0.iterations)
            });
            println!("CFL {courant}, open {open}: {counts:?}");
            for count in counts {
                assert!(count[0] <= limit[0] && count[1] <= limit[1], "{counts:?}");
            }
        }
    }
}
