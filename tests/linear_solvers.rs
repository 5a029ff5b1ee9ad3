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
    Halo::new(&part.comm, &part.nodes, &part.exchange, graph)
}

/// Dense LU.
fn direct<const B: usize>(a: &BlockCsr<B>, b: &[f64]) -> Vec<f64> {
    let n = b.len();
    let mut dense = faer::Mat::<f64>::zeros(n, n);
    for i in 0..a.n_rows() {
        for e in a.row(i) {
            let j = a.columns[e] as usize;
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
    let (mut a, _) = BlockCsr::<4>::of_mesh(&part.mesh, part.n_owned());
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
        fgmres(&A, &mut gauss_seidel, &product, &b, &mut x, &settings, &mut work).unwrap();
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
    let conjugate = cg(&A, &mut gauss_seidel, &product, &b, &mut x, &settings, &mut work).unwrap();
    println!("{conjugate:?}");
    assert!(difference(&x, &expected) < 1e-8);
    // A good initial guess is kept.
    let again = cg(
        &A,
        &mut gauss_seidel,
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
    let weights: Vec<f64> =
        (0..part.n_owned()).map(|i| 1.0 / a.values[a.diagonal(i)][0][0]).collect();
    let product = OwnedProduct::weighted::<1>(&halo, &weights);
    let expected: f64 = b.iter().zip(&weights).map(|(b, w)| b * b * w).sum::<f64>().sqrt();
    let mut x = vec![0.0; b.len()];
    let mut prec = SymmetricGaussSeidel::default();
    prec.setup(&a);
    let settings = KrylovSettings { relative: 1e-10, ..KrylovSettings::default() };
    let A = DistributedOperator::new(&a, &halo);
    let done =
        fgmres(&A, &mut prec, &product, &b, &mut x, &settings, &mut Workspace::default()).unwrap();
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
