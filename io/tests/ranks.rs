//! Files written by 1, 2 and 3 ranks, which DESIGN's one test body for any rank count asks for:
//! `fields.vtkhdf` as VTK's own reader sees it.
//!
//! The program starts itself under `mpirun` as the writer, then runs `read_fields.py`.

use io::FieldsFile;
use partition::Communicator;
use std::path::{Path, PathBuf};
use std::process::Command;

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    if let [_, job, path, after, times] = &arguments[..]
        && job == "write-fields"
    {
        let ranks = partition::start();
        return write_fields(&ranks.world(), path, after.parse().ok(), &numbers(times));
    }
    let directory = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("ranks");
    std::fs::create_dir_all(&directory).expect("the test's directory can be made");
    fields_of_one_two_and_three_ranks(&directory);
    fields_without_mpi(&directory);
    restart_on_the_same_pieces_keeps_the_mesh(&directory);
    restart_on_other_pieces_adds_theirs(&directory);
    a_killed_run_leaves_a_readable_file(&directory);
}

fn fields_of_one_two_and_three_ranks(directory: &Path) {
    for ranks in 1..=3 {
        let path = directory.join(format!("fields-{ranks}.vtkhdf"));
        run_ranks(ranks, &["write-fields", text(&path), "new", "0,0.5,1.25"]);
        read_fields(&path, &[0.0, 0.5, 1.25], &[ranks; 3]);
    }
}

fn fields_without_mpi(directory: &Path) {
    let path = directory.join("fields-serial.vtkhdf");
    write_fields(&Communicator::single(), text(&path), None, &[0.0, 1.0]);
    write_fields(&Communicator::single(), text(&path), Some(0.0), &[2.0]);
    read_fields(&path, &[0.0, 2.0], &[1; 2]);
}

fn restart_on_the_same_pieces_keeps_the_mesh(directory: &Path) {
    let path = directory.join("fields-same.vtkhdf");
    run_ranks(2, &["write-fields", text(&path), "new", "0,0.5,1.25"]);
    run_ranks(2, &["write-fields", text(&path), "0.5", "0.75,1,1.25"]);
    read_fields(&path, &[0.0, 0.5, 0.75, 1.0, 1.25], &[2; 5]);
    assert_eq!(rows(&path, "VTKHDF/Types"), n_cells());
    // Before its first step: all steps go.
    run_ranks(2, &["write-fields", text(&path), "-1", "3,4"]);
    read_fields(&path, &[3.0, 4.0], &[2; 2]);
    assert_eq!(rows(&path, "VTKHDF/Types"), n_cells());
}

fn restart_on_other_pieces_adds_theirs(directory: &Path) {
    let path = directory.join("fields-other.vtkhdf");
    run_ranks(2, &["write-fields", text(&path), "new", "0,0.5,1.25"]);
    run_ranks(3, &["write-fields", text(&path), "0.5", "0.75,1"]);
    run_ranks(1, &["write-fields", text(&path), "0.75", "2,3"]);
    read_fields(&path, &[0.0, 0.5, 0.75, 2.0, 3.0], &[2, 2, 3, 1, 1]);
    // Back to before both: their meshes go as well.
    run_ranks(2, &["write-fields", text(&path), "0.5", "0.75"]);
    read_fields(&path, &[0.0, 0.5, 0.75], &[2; 3]);
    assert_eq!(rows(&path, "VTKHDF/Types"), n_cells());
}

fn a_killed_run_leaves_a_readable_file(directory: &Path) {
    let path = directory.join("fields-killed.vtkhdf");
    // A time that is not a number kills the writer.
    let status = mpirun(2, &["write-fields", text(&path), "new", "0,0.5,die"]).status();
    assert!(!status.expect("mpirun starts").success());
    read_fields(&path, &[0.0, 0.5], &[2; 2]);
}

/// The writer: new file, or continued after a time. Field values are those `read_fields.py` expects.
fn write_fields(comm: &Communicator, path: &str, after: Option<f64>, times: &[f64]) {
    let (nodes, tets) = piece(comm.rank(), comm.size());
    let path = Path::new(path);
    let fields = [("phase", 1), ("velocity", 3)];
    let mut file = match after {
        None => FieldsFile::create(comm, path, &nodes, &tets, &fields),
        Some(after) => FieldsFile::resume(comm, path, after, &nodes, &tets, &fields),
    }
    .unwrap_or_else(|e| panic!("{e}"));
    for &t in times {
        if t.is_nan() {
            std::process::abort();
        }
        let phase: Vec<f64> = nodes.iter().map(|x| x[0] + 2.0 * x[1] + 3.0 * x[2] + t).collect();
        let velocity: Vec<[f64; 3]> = nodes.iter().map(|x| [x[0], x[1] * x[2], t]).collect();
        let fields = [("phase", &phase[..]), ("velocity", velocity.as_flattened())];
        file.append(t, &fields).unwrap_or_else(|e| panic!("{e}"));
    }
}

/// Cells along each edge of the unit cube, cut into six tetrahedra each.
const N: usize = 6;

fn n_cells() -> usize {
    6 * N.pow(3)
}

/// A rank's nodes (some of them touched by no tetrahedron) and tetrahedra: slices along z, none for
/// the second of three ranks.
fn piece(rank: usize, size: usize) -> (Vec<[f64; 3]>, Vec<[u32; 4]>) {
    let (from, to) = match (rank, size) {
        (0, 3) => (0, 2),
        (1, 3) => (2, 2),
        (2, 3) => (2, N),
        _ => (rank * N / size, (rank + 1) * N / size),
    };
    let at = |i: usize| i as f64 / N as f64;
    let mut nodes = Vec::new();
    for n in 0..(N + 1).pow(3) {
        nodes.push([at(n % (N + 1)), at(n / (N + 1) % (N + 1)), at(n / (N + 1) / (N + 1))]);
    }
    let mut tets = Vec::new();
    for cell in from * N * N..to * N * N {
        let corner = [cell % N, cell / N % N, cell / N / N];
        for path in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [1, 0, 2], [0, 2, 1], [2, 1, 0]] {
            let mut p = corner;
            let mut tet = [0; 4];
            for v in 0..4 {
                if v > 0 {
                    p[path[v - 1]] += 1;
                }
                tet[v] = (p[0] + (N + 1) * (p[1] + (N + 1) * p[2])) as u32;
            }
            if path != [0, 1, 2] && path != [1, 2, 0] && path != [2, 0, 1] {
                tet.swap(2, 3);
            }
            tets.push(tet);
        }
    }
    (nodes, tets)
}

/// Points that all ranks write together.
fn n_points(size: usize) -> usize {
    let touched = |rank| {
        let mut touched = piece(rank, size).1.into_flattened();
        touched.sort();
        touched.dedup();
        touched.len()
    };
    (0..size).map(touched).sum()
}

/// Checks all steps with VTK; `ranks` wrote each of them.
fn read_fields(path: &Path, times: &[f64], ranks: &[usize]) {
    let points: Vec<usize> = ranks.iter().map(|&size| n_points(size)).collect();
    let status = Command::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../scripts/python"))
        .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/read_fields.py"))
        .args([text(path), &n_cells().to_string(), &list(times), &list(&points)])
        .status()
        .expect("scripts/python starts");
    assert!(status.success(), "VTK does not read {} as it was written", path.display());
}

fn rows(path: &Path, table: &str) -> usize {
    let file = hdf5::File::open(path).expect("the file opens");
    file.dataset(table).expect("the table is there").shape()[0]
}

fn run_ranks(ranks: usize, arguments: &[&str]) {
    let status = mpirun(ranks, arguments).status().expect("mpirun starts");
    assert!(status.success(), "{ranks} ranks: {arguments:?}: {status}");
}

fn mpirun(ranks: usize, arguments: &[&str]) -> Command {
    let mut command = Command::new("mpirun");
    command
        .envs([
            ("OMPI_ALLOW_RUN_AS_ROOT", "1"),
            ("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1"),
            ("OMPI_MCA_rmaps_base_oversubscribe", "1"),
            ("OMPI_MCA_mpi_yield_when_idle", "1"),
        ])
        .args(["-n", &ranks.to_string()])
        .arg(std::env::current_exe().expect("the test knows its program"))
        .args(arguments);
    command
}

fn text(path: &Path) -> &str {
    path.to_str().expect("the target directory's name is UTF-8")
}

fn list<T: ToString>(items: &[T]) -> String {
    items.iter().map(T::to_string).collect::<Vec<_>>().join(",")
}

fn numbers(list: &str) -> Vec<f64> {
    list.split(',').map(|x| x.parse().unwrap_or(f64::NAN)).collect()
}
