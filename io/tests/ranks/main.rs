//! Files of 1, 2 and 3 ranks. The program starts itself under `mpirun` as the one that writes or
//! reads them.

mod checkpoints;
mod fields;

use std::path::{Path, PathBuf};
use std::process::Command;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let job = match arguments.first().map(String::as_str) {
        Some("write-fields") => fields::write,
        Some("write-checkpoint") => checkpoints::write,
        Some("read-checkpoint") => checkpoints::read,
        _ => return test(),
    };
    let ranks = partition::start();
    job(&ranks.world(), &arguments[1..]);
}

fn test() {
    let directory = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("ranks");
    if directory.exists() {
        std::fs::remove_dir_all(&directory).expect("the last test's files can be removed");
    }
    std::fs::create_dir_all(&directory).expect("the test's directory can be made");
    fields::test(&directory);
    checkpoints::test(&directory);
    println!("files of 1, 2 and 3 ranks: passed");
}

/// Runs a job of `main` on some ranks.
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
