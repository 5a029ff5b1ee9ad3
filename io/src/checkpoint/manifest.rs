//! `checkpoint.toml`: what a checkpoint is of, and the size of every file of it.

use crate::Error;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// The manifest's file name; a directory that holds it is a checkpoint.
pub(super) const NAME: &str = "checkpoint.toml";

/// Files that another program version would read wrongly get another number.
const FORMAT: u32 = 1;

#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub(super) struct Manifest {
    format: u32,
    pub case: String,
    pub step: u64,
    pub time: f64,
    pub bytes: Vec<u64>,
    pub scalars: BTreeMap<String, f64>,
    pub items: BTreeMap<String, u64>,
}

impl Manifest {
    pub fn new(state: &super::State, bytes: Vec<u64>, items: BTreeMap<String, u64>) -> Self {
        Self {
            format: FORMAT,
            case: state.case.into(),
            step: state.step,
            time: state.time,
            bytes,
            scalars: state.scalars.iter().map(|&(name, x)| (name.into(), x)).collect(),
            items,
        }
    }

    pub fn to_text(&self) -> String {
        toml::to_string(self).expect("a manifest is made of numbers and names")
    }

    /// Reads `path`, whose text may be anything.
    pub fn parse(path: &Path, text: &str) -> Result<Self, Error> {
        let manifest: Self = toml::from_str(text).map_err(|e| {
            let line = e.span().map_or(1, |span| text[..span.start].matches('\n').count() + 1);
            Error::line(path, line, format!("this is no checkpoint: {}", e.message()))
        })?;
        if manifest.format != FORMAT {
            let found = manifest.format;
            return Err(Error::file(
                path,
                format!("has format {found}, this program reads format {FORMAT}"),
            ));
        }
        Ok(manifest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_back_to_the_last_bit() {
        let values =
            [0.1 + 0.2, 1e-310, -0.0, f64::MAX, f64::INFINITY, 1.0 / 3.0, 4503599627370497.5];
        for time in values {
            let state = super::super::State {
                case: "a",
                step: 3,
                time,
                scalars: &[("x", time)],
                groups: &[],
            };
            let manifest = Manifest::new(&state, vec![7], BTreeMap::new());
            let back = Manifest::parse(Path::new("m"), &manifest.to_text()).unwrap();
            assert_eq!(back.time.to_bits(), time.to_bits());
            assert_eq!(back.scalars["x"].to_bits(), time.to_bits());
        }
    }
}
