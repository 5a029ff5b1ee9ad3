//! Command line → case → run → exit status: 0, 1 (the run failed) or 2 (bad input).

use clap::Parser;
use fcm_fsi::case::{Case, CaseError, CaseFile, Sources};
use fcm_fsi::simulation::{Options, Simulation};
use partition::Communicator;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Free-surface flow that hits, moves and breaks structures.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Case file, or a folder with a case.toml.
    #[arg(required_unless_present = "schema")]
    case: Option<PathBuf>,
    /// Folder for the results [default: results/NAME, after the case's folder or file].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Go on from this checkpoint.
    #[arg(long, value_name = "PATH")]
    restart: Option<PathBuf>,
    /// Stop after this many steps.
    #[arg(long, value_name = "N")]
    steps: Option<u64>,
    /// Print nothing but errors.
    #[arg(long)]
    quiet: bool,
    /// Read and check everything, print what it would take, compute nothing.
    #[arg(long)]
    check: bool,
    /// Print the JSON schema of case files.
    #[arg(long)]
    schema: bool,
}

const RUN_FAILED: u8 = 1;
const BAD_INPUT: u8 = 2;

fn main() -> ExitCode {
    let ranks = partition::start();
    let comm = ranks.world();
    let first = comm.rank() == 0;
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(message) => {
            if first {
                message.print().expect("the terminal can be written to");
            }
            return ExitCode::from(message.exit_code() as u8);
        }
    };
    if arguments.schema {
        if first {
            println!("{}", CaseFile::schema());
        }
        return ExitCode::SUCCESS;
    }
    let path = arguments.case.as_ref().expect("clap asks for a case unless --schema is given");
    let case = match read(path, &comm) {
        Ok(case) => case,
        Err(error) => return fail(first, &error, BAD_INPUT),
    };
    let mut simulation = match Simulation::new(case, &comm) {
        Ok(simulation) => simulation,
        Err(error) => return fail(first, &error, BAD_INPUT),
    };
    let options = Options {
        out: arguments.out.unwrap_or_else(|| results_of(path)),
        restart: arguments.restart,
        steps: arguments.steps,
        quiet: arguments.quiet,
    };
    match simulation.run(&options) {
        Ok(summary) => {
            if first && !options.quiet {
                println!("{}\nresults in {}", summary.table(), options.out.display());
            }
            ExitCode::SUCCESS
        }
        Err(error) => fail(first, &error, RUN_FAILED),
    }
}

fn fail(first: bool, error: &dyn std::error::Error, status: u8) -> ExitCode {
    if first {
        eprintln!("error: {error}");
    }
    ExitCode::from(status)
}

/// `results/NAME`, after the case's folder (or its file, if that is not called case.toml).
fn results_of(path: &Path) -> PathBuf {
    let path = std::path::absolute(path).unwrap_or_else(|_| path.into());
    let own_name = path.is_dir() || path.file_name().is_some_and(|name| name != "case.toml");
    let named = if own_name { Some(path.as_path()) } else { path.parent() };
    let name = named.and_then(Path::file_stem).unwrap_or("case".as_ref());
    Path::new("results").join(name)
}
/// The first rank reads, every rank checks the same texts, so all agree.

fn read(path: &Path, comm: &Communicator) -> Result<Case, CaseError> {
    let mut message = Vec::new();
    if comm.rank() == 0 {
        let texts = Sources::read(path);
        message = serde_json::to_vec(&texts).expect("texts can be written as JSON");
    }
    let message = comm.broadcast(0, message);
    let texts: Result<Sources, CaseError> =
        serde_json::from_slice(&message).expect("what was written as JSON can be read");
    Case::new(&texts?)
}
