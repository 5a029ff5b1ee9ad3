//! Bodies of case files, for tests on one rank and on many.

use fcm_fsi::bodies::{Bodies, Load, Tracked};
use fcm_fsi::case::{Case, Sources};
use fcm_fsi::obstacles::Obstacles;
use fcm_fsi::setup;
use partition::Communicator;
use std::collections::BTreeMap;
use std::path::Path;

/// The bodies of a case in `folder` at t = 0, and the points that are recorded. Collective.
pub fn start(
    folder: &Path,
    text: &str,
    comm: &Communicator,
) -> Result<(Bodies, Vec<Tracked>), String> {
    let sources = Sources {
        file: "case.toml".into(),
        folder: folder.into(),
        text: text.into(),
        tables: BTreeMap::new(),
    };
    let case = Case::new(&sources).map_err(|e| e.to_string())?;
    let (part, _) = setup::mesh(&case, comm).map_err(|e| e.to_string())?;
    let shapes = setup::solids::obstacles(&case, comm).map_err(|e| e.to_string())?;
    let obstacles = Obstacles::new(&case, shapes);
    let started = setup::bodies::bodies(&case, &part, &obstacles.solids(0.0));
    Ok(started.map_err(|e| e.to_string())?.expect("the case has bodies"))
}

/// Bodies alone for `dt` [s]. Collective.
pub fn advance(bodies: &mut Bodies, dt: f64) {
    let loads = vec![Load::default(); bodies.state.len()];
    bodies.advance(dt, &loads);
}
