//! Distributed solves against the same solve on one rank.

#![allow(non_snake_case)]

#[path = "../linear/systems.rs"]
mod systems;

use fcm_fsi::linear::relaxation::SymmetricGaussSeidel;
use fcm_fsi::linear::*;
use fcm_fsi::mesh::MeshPart;
use partition::Communicator;
use systems::*;

/// The box on all ranks, and whole on each.
fn boxes(comm: &Communicator, n: [usize; 3], h: f64) -> [MeshPart; 2] {
    let mesh = (comm.rank() == 0).then(|| cells(n, h, 0.2));
    let part = MeshPart::distribute(comm, mesh, 0).unwrap();
    [part, MeshPart::distribute(&Communicator::single(), Some(cells(n, h, 0.2)), 0).unwrap()]
}

fn halo<const B: usize>(part: &MeshPart, graph: &BlockCsr<B>) -> Halo {
    Halo::new(&part.comm, &part.nodes, &part.exchange, &graph.pattern)
}

/// Noise by global id; ghosts are NaN, as no one may read them.
fn vector<const B: usize>(part: &MeshPart) -> Vec<f64> {
    let mut x = vec![f64::NAN; B * part.n_local()];
    for i in 0..part.n_owned() {
        for a in 0..B {
            x[B * i + a] = noise((B as u64) * part.nodes.global[i] + a as u64);
        }
    }
    x
}

/// Largest difference over owned nodes of all ranks, relative to the largest value, for unknown `a`.
fn difference<const B: usize>(parts: &[MeshPart; 2], x: [&[f64]; 2], a: usize) -> f64 {
    let [part, whole] = parts;
    let mut by_global = vec![0.0; whole.n_owned()];
    for (i, &global) in whole.nodes.global.iter().enumerate() {
        by_global[global as usize] = x[1][B * i + a];
    }
    let largest = by_global.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let mine = (0..part.n_owned())
        .map(|i| (x[0][B * i + a] - by_global[part.nodes.global[i] as usize]).abs())
        .fold(0.0, f64::max);
    part.max(mine) / largest
}

/// A x and (a, b) are those of one rank.
pub fn operator_and_product(comm: &Communicator) {
    let parts = boxes(comm, [9, 7, 6], 0.1);
    let problem = Oseen { size: [0.9, 0.7, 0.6], ..Oseen::tank(10, 1.0, true) };
    let results = parts.each_ref().map(|part| {
        let (system, _) = problem.assemble(part);
        let halo = halo(part, &system);
        let mut x = vector::<4>(part);
        let mut y = x.clone();
        DistributedOperator::new(&system, &halo).apply(&mut x, &mut y);
        let product = OwnedProduct::plain::<4>(&halo);
        let weights: Vec<f64> = x.iter().map(|x| 2.0 + x).collect();
        let weighted = OwnedProduct::weighted::<4>(&halo, &weights);
        let mut pair = [0.0; 2];
        let both = [&x[..], &y[..]].concat();
        weighted.dots(&both, &y, &mut pair);
        assert_eq!(pair[1], weighted.dot(&y, &y));
        (y.clone(), [product.dot(&x, &y), product.dot(&y, &y), pair[0], pair[1]])
    });
    let [(y, products), (y_whole, products_whole)] = results;
    for a in 0..4 {
        assert!(difference::<4>(&parts, [&y, &y_whole], a) < 1e-13);
    }
    for (one, other) in products.iter().zip(products_whole) {
        assert!((one - other).abs() < 1e-11 * products_whole[1].max(other.abs()));
    }
}

/// Multigrid with gathered and with distributed coarse levels: nearly the counts of one rank.
pub fn multigrid_on_ranks(comm: &Communicator) {
    let parts = boxes(comm, [24, 18, 14], 1.0);
    for (gathered, pinned) in [(20_000, false), (20_000, true), (100, false), (100, true)] {
        let settings = MultigridSettings { gathered, ..MultigridSettings::default() };
        let results = parts.each_ref().map(|part| {
            let k = |x: [f64; 3]| if x[2] < 6.7 { 1.0 } else { 1e3 };
            let L =
                scalar(part, 0.0, k, [0.0; 3], |x| if pinned { x == [0.0; 3] } else { x[0] < 0.1 });
            let halo = halo(part, &L);
            let mut multigrid = Multigrid::with_settings(&halo, settings);
            multigrid.setup(&L);
            let A = DistributedOperator::new(&L, &halo);
            let mut b = vec![0.0; part.n_local()];
            A.apply(&mut vector::<1>(part), &mut b);
            let product = OwnedProduct::plain::<1>(&halo);
            let mut work = Workspace::default();
            let mut solve = |relative| {
                let settings = KrylovSettings { relative, ..KrylovSettings::default() };
                let mut x = vec![0.0; b.len()];
                let done =
                    cg(&A, &mut multigrid, &product, &b, &mut x, &settings, &mut work).unwrap();
                (done.iterations, x)
            };
            let counts = [solve(1e-3).0, solve(1e-6).0];
            let x = solve(1e-11).1;
            // The same set-up again gives the same bits.
            multigrid.setup(&L);
            let mut again = vec![0.0; b.len()];
            let settings = KrylovSettings { relative: 1e-11, ..KrylovSettings::default() };
            cg(&A, &mut multigrid, &product, &b, &mut again, &settings, &mut work).unwrap();
            assert!(x == again);
            (counts, x, multigrid.sizes().to_vec())
        });
        let [(counts, x, sizes), (whole, x_whole, sizes_whole)] = results;
        if comm.rank() == 0 {
            println!("  {counts:?} {sizes:?}, one rank: {whole:?} {sizes_whole:?}");
        }
        assert!(counts[0] <= whole[0] + 2 && counts[1] <= whole[1] + 2);
        assert!(difference::<1>(&parts, [&x, &x_whole], 0) < 1e-7);
    }
}

/// The coupled system: counts within two of one rank's, and its solution.
pub fn flow_system_on_ranks(comm: &Communicator) {
    let n = 16;
    let parts = boxes(comm, [n, n, n / 2], 1.0 / n as f64);
    for (courant, open) in [(1.0, true), (1.0, false), (5.0, true)] {
        let problem = Oseen::tank(n, courant, open);
        let results = parts.each_ref().map(|part| {
            let (system, L) = problem.assemble(part);
            let halo = halo(part, &system);
            let b = problem.right_hand_side(part);
            let mut weights = Vec::new();
            let split = SaddleCsr::from(&system);
            residual_weights(&split, &L, &mut weights);
            let product = OwnedProduct::weighted::<4>(&halo, &weights);
            let mut schur = SchurPreconditioner::new(&halo);
            schur.setup(&split, &L, None);
            let A = DistributedOperator::new(&system, &halo);
            let mut work = Workspace::default();
            let mut solve = |relative| {
                let settings = KrylovSettings { relative, ..KrylovSettings::default() };
                let mut x = vec![0.0; b.len()];
                let done =
                    fgmres(&A, &mut schur.with(&split), &product, &b, &mut x, &settings, &mut work)
                        .unwrap();
                (done, x)
            };
            let (first, _) = solve(1e-3);
            let (second, _) = solve(1e-6);
            (first.initial, [first.iterations, second.iterations], solve(1e-10).1)
        });
        let [(initial, counts, x), (initial_whole, whole, x_whole)] = results;
        if comm.rank() == 0 {
            println!("  CFL {courant}, open {open}: {counts:?}, one rank: {whole:?}");
        }
        assert!((initial / initial_whole - 1.0).abs() < 1e-12);
        assert!(counts[0] <= whole[0] + 2 && counts[1] <= whole[1] + 2);
        for a in 0..4 {
            assert!(difference::<4>(&parts, [&x, &x_whole], a) < 1e-6);
        }
    }
}

/// Velocities that hang together within elements as firmly as by a ghost penalty, also across ranks: the counts of one
/// rank, where sweeps that took their neighbours' changes whole would be indefinite.
pub fn stiff_elements_on_ranks(comm: &Communicator) {
    let parts = boxes(comm, [12, 10, 8], 1.0);
    let results = parts.each_ref().map(|part| {
        let graph = graph(part);
        let mut A = BlockCsr::<4>::zero(&graph.pattern);
        let mut L = BlockCsr::<1>::zero(&graph.pattern);
        for (e, tet) in part.mesh.tets.iter().enumerate() {
            for i in (0..4).filter(|&i| (tet[i] as usize) < part.n_owned()) {
                for (j, at) in graph.entries(e, tet, i).into_iter().enumerate() {
                    let own = f64::from(u8::from(i == j));
                    (0..3).for_each(|k| A.values[at][k][k] += 1.0 + 0.1 * own);
                    A.values[at][3][3] += own;
                    L.values[at][0][0] += own;
                }
            }
        }
        let (b, halo) = (vector::<4>(part), halo(part, &A));
        let product = OwnedProduct::plain::<4>(&halo);
        let (split, mut schur) = (SaddleCsr::from(&A), SchurPreconditioner::new(&halo));
        schur.setup(&split, &L, None);
        let settings = KrylovSettings { relative: 1e-8, ..KrylovSettings::default() };
        let (mut x, mut work) = (vec![0.0; b.len()], Workspace::default());
        let A = DistributedOperator::new(&A, &halo);
        fgmres(&A, &mut schur.with(&split), &product, &b, &mut x, &settings, &mut work)
            .unwrap()
            .iterations
    });
    if comm.rank() == 0 {
        println!("  stiff elements: {}, one rank: {}", results[0], results[1]);
    }
    assert!(results[0] <= results[1] + results[1] / 4 + 2, "{results:?}");
}

/// A failure on one rank is the same failure on all.
pub fn failed_solves_on_ranks(comm: &Communicator) {
    let [part, _] = boxes(comm, [6, 5, 4], 1.0);
    let L = scalar(&part, 0.0, |_| 1.0, [0.0; 3], |x| x[0] < 0.1);
    let halo = halo(&part, &L);
    let A = DistributedOperator::new(&L, &halo);
    let product = OwnedProduct::plain::<1>(&halo);
    let mut b = vector::<1>(&part);
    let mut relaxation = SymmetricGaussSeidel::default();
    relaxation.setup(&L);
    let settings = KrylovSettings { relative: 1e-9, max_iterations: 3, ..Default::default() };
    let mut work = Workspace::default();
    let mut x = vec![0.0; b.len()];
    let failed = fgmres(&A, &mut relaxation.with(&L), &product, &b, &mut x, &settings, &mut work);
    let failed = failed.unwrap_err();
    assert_eq!((failed.reason, failed.iterations), (Reason::MaxIterations, 3));
    assert_eq!(comm.max(failed.residual), failed.residual);
    if comm.rank() == comm.size() - 1 {
        b[0] = f64::NAN;
    }
    let failed = cg(&A, &mut relaxation.with(&L), &product, &b, &mut x, &settings, &mut work);
    assert_eq!(failed.unwrap_err().reason, Reason::NotFinite);
}
