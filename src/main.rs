//! Command line → case → run → exit status: 0, 1 (the run failed) or 2 (bad input).

use clap::Parser;
use fcm_fsi::case::{Case, CaseError, CaseFile, Sources};
use fcm_fsi::report::{self, plan};
use fcm_fsi::simulation::{Options, Simulation};
use partition::Communicator;
use std::fmt::Display;
use std::io::Write;
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
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(message) => {
            if comm.rank() == 0 {
                message.print().expect("the terminal can be written to");
            }
            return ExitCode::from(message.exit_code() as u8);
        }
    };
    if arguments.schema {
        if comm.rank() == 0 {
            say(CaseFile::schema());
        }
        return ExitCode::SUCCESS;
    }
    match run(arguments, &comm) {
        Ok(()) => ExitCode::SUCCESS,
        Err((status, message)) => {
            if comm.rank() == 0 {
                eprintln!("error: {message}");
            }
            if status == RUN_FAILED {
                partition::leave(&comm, RUN_FAILED.into());
            }
            ExitCode::from(status)
        }
    }
}

/// All of it; an error comes with its exit status, and is the same on all ranks.
fn run(arguments: Arguments, comm: &Communicator) -> Result<(), (u8, String)> {
    fn bad_input(error: impl ToString) -> (u8, String) {
        (BAD_INPUT, error.to_string())
    }
    let path = arguments.case.expect("clap asks for a case unless --schema is given");
    let case = read(&path, comm).map_err(bad_input)?;
    let options = Options {
        out: arguments.out.unwrap_or_else(|| results_of(&case.path)),
        restart: arguments.restart,
        steps: arguments.steps,
        quiet: arguments.quiet,
    };
    let mut simulation = Simulation::new(case, comm).map_err(bad_input)?;
    if arguments.check {
        let surface = simulation.surface();
        let plan = plan::of(&simulation.case, &simulation.part, surface);
        let warnings = simulation.warnings();
        if comm.rank() == 0 {
            say(plan);
            if let Some(bodies) = &simulation.bodies {
                say(report::bodies::plan(bodies, simulation.case.time.end));
            }
            warnings.iter().for_each(say);
        }
        return Ok(());
    }
    let summary = simulation.run(&options).map_err(|error| (RUN_FAILED, error.to_string()))?;
    if comm.rank() == 0 && !options.quiet {
        say(format_args!("{}\nresults in {}", summary.table(), options.out.display()));
    }
    Ok(())
}

/// On standard output, if anyone still listens: `fcm-fsi case.toml | head` must not end a run.
fn say(what: impl Display) {
    let _ = writeln!(std::io::stdout(), "{what}");
}

/// `results/NAME` under the current folder: NAME is that of the file, or of its folder for a file called
/// `case.toml`.
fn results_of(case: &Path) -> PathBuf {
    let stem = case.file_stem();
    let folder = case.parent().and_then(Path::file_name);
    let name = if stem.is_some_and(|s| s == "case") { folder.or(stem) } else { stem };
    PathBuf::from("results").join(name.expect("a case file that was read has a name"))
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
