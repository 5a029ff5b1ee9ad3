//! What several tests begin with.

use fcm_fsi::case::{Case, Sources};
use fcm_fsi::simulation::Simulation;
use partition::Communicator;

/// A case file's simulation at t = 0, on one rank; files are looked for in "/".
pub fn simulation(text: &str) -> Simulation {
    let sources = Sources {
        file: "case.toml".into(),
        folder: "/".into(),
        text: text.into(),
        tables: Default::default(),
    };
    let case = Case::new(&sources).unwrap_or_else(|error| panic!("{error}"));
    Simulation::new(case, &Communicator::single()).unwrap_or_else(|error| panic!("{error}"))
}
