//! `fields.vtkhdf` as VTK's own reader sees it (`read_fields.py`).

use crate::{mpirun, run_ranks, text};
use io::{FieldsFile, FieldsMesh};
use partition::{Communicator, IndexMap};
use std::path::Path;
use std::process::Command;

/// The writer's job: path, `new` or the time to go on from, times.
pub fn write(comm: &Communicator, arguments: &[String]) {
    let [path, after, times] = arguments else { panic!("three arguments") };
    let times: Vec<f64> = times.split(',').map(|x| x.parse().unwrap_or(f64::NAN)).collect();
    write_fields(comm, path, after.parse().ok(), &times);
}

pub fn test(directory: &Path) {
    fields_of_one_two_and_three_ranks(directory);
    fields_without_mpi(directory);
    restart_goes_on_in_the_same_file(directory);
    a_killed_run_leaves_a_readable_file(directory);
    other_fields_and_other_meshes_are_refused(directory);
}

fn fields_of_one_two_and_three_ranks(directory: &Path) {
    let mut files = Vec::new();
    for ranks in 1..=3 {
        let path = directory.join(format!("fields-{ranks}.vtkhdf"));
        run_ranks(ranks, &["write-fields", text(&path), "new", "0,0.5,1.25"]);
        read_fields(&path, &[0.0, 0.5, 1.25]);
        files.push(contents(&path));
    }
    assert!(files.iter().all(|file| *file == files[0]), "the file depends on the number of ranks");
}

fn fields_without_mpi(directory: &Path) {
    let path = directory.join("fields-serial.vtkhdf");
    write_fields(&Communicator::single(), text(&path), None, &[0.0, 1.0]);
    write_fields(&Communicator::single(), text(&path), Some(0.0), &[2.0]);
    read_fields(&path, &[0.0, 2.0]);
}

fn restart_goes_on_in_the_same_file(directory: &Path) {
    let path = directory.join("fields-restarted.vtkhdf");
    run_ranks(2, &["write-fields", text(&path), "new", "0,0.5,1.25"]);
    run_ranks(2, &["write-fields", text(&path), "0.5", "0.75,1,1.25"]);
    read_fields(&path, &[0.0, 0.5, 0.75, 1.0, 1.25]);
    run_ranks(3, &["write-fields", text(&path), "0.8", "2,3"]);
    run_ranks(1, &["write-fields", text(&path), "2.5", "4"]);
    read_fields(&path, &[0.0, 0.5, 0.75, 2.0, 4.0]);
    // Before its first step: all steps go.
    run_ranks(2, &["write-fields", text(&path), "-1", "5,6"]);
    read_fields(&path, &[5.0, 6.0]);
}

fn a_killed_run_leaves_a_readable_file(directory: &Path) {
    let path = directory.join("fields-killed.vtkhdf");
    // A time that is not a number kills the writer.
    let killed = mpirun(2, &["write-fields", text(&path), "new", "0,0.5,die"]).output();
    assert!(!killed.expect("mpirun starts").status.success());
    read_fields(&path, &[0.0, 0.5]);
}

fn other_fields_and_other_meshes_are_refused(directory: &Path) {
    let path = directory.join("fields-refused.vtkhdf");
    write_fields(&Communicator::single(), text(&path), None, &[0.0]);
    let comm = Communicator::single();
    let mut piece = Piece::new(0, 1);
    let error = FieldsFile::resume(&comm, &path, 0.0, piece.mesh(), &[("phase", 1)]).unwrap_err();
    assert_eq!(
        error.to_string(),
        format!(
            "{}: holds phase, velocity (3), but this run writes phase: write to another directory",
            path.display()
        )
    );
    piece.points[7][1] += 1e-12;
    let error = FieldsFile::resume(&comm, &path, 0.0, piece.mesh(), &FIELDS).unwrap_err();
    assert!(error.to_string().contains("another mesh"), "{error}");
    let nowhere = directory.join("no-such-directory/fields.vtkhdf");
    let error = FieldsFile::create(&comm, &nowhere, piece.mesh(), &FIELDS).unwrap_err();
    assert!(error.to_string().starts_with(text(&nowhere)), "{error}");
}

const FIELDS: [(&str, usize); 2] = [("phase", 1), ("velocity", 3)];

/// The writer: new file, or continued after a time. Field values are those `read_fields.py` expects.
fn write_fields(comm: &Communicator, path: &str, after: Option<f64>, times: &[f64]) {
    let piece = Piece::new(comm.rank(), comm.size());
    let path = Path::new(path);
    let mut file = match after {
        None => FieldsFile::create(comm, path, piece.mesh(), &FIELDS),
        Some(after) => FieldsFile::resume(comm, path, after, piece.mesh(), &FIELDS),
    }
    .unwrap_or_else(|e| panic!("{e}"));
    for &t in times {
        if t.is_nan() {
            std::process::abort();
        }
        let points = &piece.points;
        let phase: Vec<f64> = points.iter().map(|x| x[0] + 2.0 * x[1] + 3.0 * x[2] + t).collect();
        let velocity: Vec<[f64; 3]> = points.iter().map(|x| [x[0], x[1] * x[2], t]).collect();
        let fields = [("phase", &phase[..]), ("velocity", velocity.as_flattened())];
        file.append(t, &fields).unwrap_or_else(|e| panic!("{e}"));
    }
}

/// Cells along each edge of the unit cube, cut into six tetrahedra each.
const N: usize = 6;

fn n_cells() -> usize {
    6 * N.pow(3)
}

fn n_points() -> usize {
    (N + 1).pow(3)
}

/// A rank's slice of the cube along z; the second of three ranks owns nothing. A node between two
/// ranks is owned by the lower one.
struct Piece {
    nodes: IndexMap,
    points: Vec<[f64; 3]>,
    tets: Vec<[u32; 4]>,
    tet_ids: Vec<u64>,
}

impl Piece {
    fn new(rank: usize, size: usize) -> Self {
        let ends: &[usize] = match size {
            1 => &[0, N],
            2 => &[0, N / 2, N],
            _ => &[0, 2, 2, N],
        };
        let (from, to) = (ends[rank], ends[rank + 1]);
        let mut tets = Vec::new();
        let mut tet_ids = Vec::new();
        for cell in from * N * N..to * N * N {
            let corner = [cell % N, cell / N % N, cell / N / N];
            for (i, path) in PATHS.iter().enumerate() {
                let mut p = corner;
                let mut tet = [0; 4];
                for v in 0..4 {
                    if v > 0 {
                        p[path[v - 1]] += 1;
                    }
                    tet[v] = (p[0] + (N + 1) * (p[1] + (N + 1) * p[2])) as u64;
                }
                if i >= 3 {
                    tet.swap(2, 3);
                }
                tets.push(tet);
                tet_ids.push((6 * cell + i) as u64);
            }
        }
        // Owned nodes first; their order and that of the elements mean nothing, so mix them.
        let layer = |node: u64| node as usize / (N + 1).pow(2);
        let mut global: Vec<u64> = tets.as_flattened().to_vec();
        global.sort_by_key(|&node| (from > 0 && layer(node) == from, node * 1_000_003 % 9_973));
        global.dedup();
        tets.reverse();
        tet_ids.reverse();
        let n_owned = global.iter().filter(|&&node| from == 0 || layer(node) > from).count();
        let local = |node| global.iter().position(|&g| g == node).expect("the node is here") as u32;
        let at = |i: u64| (i % (N as u64 + 1)) as f64 / N as f64;
        let n = N as u64 + 1;
        Self {
            points: global.iter().map(|&g| [at(g), at(g / n), at(g / n / n)]).collect(),
            tets: tets.iter().map(|tet| tet.map(local)).collect(),
            tet_ids,
            nodes: IndexMap { n_owned, ghost_owner: vec![0; global.len() - n_owned], global },
        }
    }

    fn mesh(&self) -> FieldsMesh<'_> {
        let Self { nodes, points, tets, tet_ids } = self;
        FieldsMesh { nodes, points, tets, tet_ids }
    }
}

/// Kuhn's six tetrahedra of a cell: its corner 000 to 111 along the axes in each order.
const PATHS: [[usize; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [1, 0, 2], [0, 2, 1], [2, 1, 0]];

/// Checks all steps with VTK.
fn read_fields(path: &Path, times: &[f64]) {
    let times: Vec<String> = times.iter().map(f64::to_string).collect();
    let numbers = [n_points().to_string(), n_cells().to_string(), times.join(",")];
    let status = Command::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../scripts/python"))
        .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/ranks/read_fields.py"))
        .arg(path)
        .args(numbers)
        .status()
        .expect("scripts/python starts");
    assert!(status.success(), "VTK does not read {} as it was written", path.display());
}

/// Mesh and fields of a file.
fn contents(path: &Path) -> Vec<Vec<f64>> {
    let file = hdf5::File::open(path).expect("the file opens");
    ["Points", "Connectivity", "Offsets", "PointData/phase", "PointData/velocity"]
        .map(|name| file.dataset(&format!("VTKHDF/{name}")).and_then(|d| d.read_raw::<f64>()))
        .map(|values| values.expect("the table is there"))
        .to_vec()
}
