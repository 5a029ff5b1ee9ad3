//! Points and lines are answered once over all ranks, and alike on any number of them.

use fcm_fsi::case::{BoxMesh, Hole};
use fcm_fsi::mesh::boxes::box_mesh;
use fcm_fsi::mesh::{MeshError, MeshPart, chord::Stretch, locate::Locator};
use partition::Communicator;

/// A jittered tank with a hole, refined once: cells of 1/12.
fn part_on(comm: &Communicator) -> MeshPart {
    let mesh = (comm.rank() == 0).then(|| {
        let line = |n: usize| (0..=n).map(|i| i as f64 / 6.0).collect::<Vec<_>>();
        let lines = [line(12), line(4), line(6)];
        let (third, half) = (lines[0][2], lines[0][3]);
        let range = [[third, half], [0.0, third], [0.0, half]];
        let holes = vec![Hole { range, name: "block".into() }];
        box_mesh(&BoxMesh { lines, holes, jitter: Some((0.2, 1)) }).unwrap()
    });
    MeshPart::distribute(comm, mesh, 1).unwrap()
}

/// Every node of the mesh, also those on partition borders: each point has one answer, the right one.
pub fn points_have_one_answer(comm: &Communicator) {
    let part = part_on(comm);
    let locator = Locator::owned(&part);
    let owned = &part.mesh.nodes[..part.n_owned()];
    let points: Vec<[f64; 3]> = comm.all_gather(owned).concat();
    let places = locator.places(&part, &points).unwrap();
    let mut wrong = 0.0f64;
    for (place, x) in places.iter().zip(&points) {
        if let Some(p) = place {
            assert!((p.element as usize) < part.n_owned_elements);
            for k in 0..3 {
                let found = p.value(&part.mesh, |n| part.mesh.nodes[n][k]);
                wrong = wrong.max((found - x[k]).abs());
            }
        }
    }
    assert!(part.max(wrong) < 1e-14);
    let answers = comm.sum_u64(places.iter().flatten().count() as u64);
    assert_eq!(answers, points.len() as u64);
    let error = locator.places(&part, &[[0.5, 0.5, 0.5], [-1e-9, 0.5, 0.5]]).unwrap_err();
    assert_eq!(error, MeshError::Outside { at: [-1e-9, 0.5, 0.5] });
}

/// Lines through walls, edges, nodes, faces and the inside: chords and integrals as computed by hand.
pub fn lines_are_covered_once(comm: &Communicator) {
    let part = part_on(comm);
    let locator = Locator::owned(&part);
    let sixth = 1.0 / 6.0;
    let lines = [
        ([[0.0, 0.3, 0.0], [0.0, 0.3, 1.0]], 1.0),
        ([[2.0, 4.0 * sixth, 0.0], [2.0, 4.0 * sixth, 1.0]], 1.0),
        ([[0.0, 0.0, 1.0], [2.0, 0.0, 1.0]], 2.0),
        ([[0.0, 0.25, 0.25], [2.0, 0.25, 0.25]], 2.0 - sixth),
        ([[2.0 * sixth, 0.0, 0.1], [2.0 * sixth, 2.0 * sixth, 0.1]], 2.0 * sixth),
        ([[0.0, 0.0, 0.0], [1.0, 0.5, 1.0]], 1.5 - hole_part()),
        ([[0.9, 0.2, -3.0], [0.9, 0.2, 3.0]], 1.0),
    ];
    let only: Vec<_> = lines.iter().map(|l| l.0).collect();
    let stretches = locator.stretches(&part, &only).unwrap();
    let whole = part_on(&Communicator::single());
    let alone = Locator::owned(&whole).stretches(&whole, &only).unwrap();
    for (((line, chord), mine), alone) in lines.iter().zip(&stretches).zip(&alone) {
        let length = part.sum(mine.iter().map(|s| s.length).sum());
        assert!((length - chord).abs() < 1e-12, "{line:?}: {length} of {chord}");
        assert!(mine.iter().all(|s| (s.element as usize) < part.n_owned_elements));
        // The cover itself: as on one rank, to the bit.
        let mut all = comm.all_gather(&named(&part, mine)).concat();
        all.sort_by(|a, b| a.0[0].total_cmp(&b.0[0]));
        assert_eq!(all, named(&whole, alone));
    }
    let outside = [[9.0, 0.0, 0.0], [9.0, 1.0, 0.0]];
    let error = locator.stretches(&part, &[only[0], outside]).unwrap_err();
    assert_eq!(error, MeshError::LineOutside { ends: outside });
}

/// Stretches with the global numbers of their elements.
fn named(part: &MeshPart, stretches: &[Stretch]) -> Vec<([f64; 2], u64)> {
    stretches.iter().map(|s| (s.range, part.element_global[s.element as usize])).collect()
}

/// Length of the diagonal from 0 to (1, 1/2, 1), 1.5 long, in the hole: x from 1/3 to 1/2.
fn hole_part() -> f64 {
    1.5 * (0.5 - 1.0 / 3.0)
}
