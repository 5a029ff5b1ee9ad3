//! Checkpoints: the whole state, in all digits, from which a run goes on with any number of ranks.
//!
//! A checkpoint is a directory `checkpoint-00001200` (the step) with a file of each rank,
//! `rank-0000.h5` and so on, and `checkpoint.toml`, which names them all:
//! ```toml
//! format = 1
//! case = "9f3a…"            # what the run was, as the caller identifies it
//! step = 1200
//! time = 0.6125             # [s], to the last bit
//! bytes = [52216, 51904]    # size of each rank's file
//! [scalars]                 # what all ranks know alike
//! [items]                   # how many nodes, …, there are in all
//! ```
//! A rank's file holds groups of items (nodes, say) it owns: their global ids and, item by item, any
//! number of arrays. It is written to a directory of another name that is renamed when all ranks are
//! done, so that a checkpoint is whole or absent; the last two are kept. HDF5 checksums the arrays.
//!
//! On as many ranks as wrote it and with the same items each rank reads back its own file; otherwise
//! each reads some of the files and the items meet those who ask for them by their ids. No rank ever
//! holds all of them.

mod manifest;
mod read;
mod write;

pub use read::Checkpoint;
pub use write::write;

use std::path::{Path, PathBuf};

/// What is saved.
#[derive(Clone, Copy, Debug)]
pub struct State<'a> {
    /// Identifies the case, so that a restart can tell its own checkpoints from others'.
    pub case: &'a str,
    /// Number of the last step that is done.
    pub step: u64,
    /// The time it ended at [s].
    pub time: f64,
    /// Named numbers, the same on all ranks.
    pub scalars: &'a [(&'a str, f64)],
    /// What the ranks own.
    pub groups: &'a [Group<'a>],
}

/// Items of one kind.
#[derive(Clone, Copy, Debug)]
pub struct Group<'a> {
    /// For example `nodes`.
    pub name: &'a str,
    /// Global ids of the items this rank owns, each owned by one rank.
    pub ids: &'a [u64],
    /// Name, number of components and values, those of the owned items first (what comes after them
    /// is not saved).
    pub arrays: &'a [(&'a str, usize, Values<'a>)],
}

/// Values of an array, the components of an item together.
#[derive(Clone, Copy, Debug)]
pub enum Values<'a> {
    /// Measures.
    F64(&'a [f64]),
    /// Counts, ids, flags.
    U64(&'a [u64]),
}

/// What a checkpoint's directory is called until it is whole: `checkpoint-00001200.unfinished`.
const UNFINISHED: &str = "unfinished";

/// The newest checkpoint in `path`, or `path` itself if it is a checkpoint.
pub fn find(path: &Path) -> Option<PathBuf> {
    if is_checkpoint(path) {
        return Some(path.into());
    }
    named(path, is_checkpoint).pop().map(|(_, path)| path)
}

fn is_checkpoint(path: &Path) -> bool {
    path.extension().is_none() && path.join(manifest::NAME).is_file()
}

/// Everything in a directory that has a checkpoint's name and is `wanted`, with its step, in order.
fn named(dir: &Path, wanted: impl Fn(&Path) -> bool) -> Vec<(u64, PathBuf)> {
    let entries = std::fs::read_dir(dir).into_iter().flatten().flatten();
    let mut found: Vec<_> = entries
        .map(|entry| entry.path())
        .filter_map(|path| {
            let step = path.file_stem()?.to_str()?.strip_prefix("checkpoint-")?.parse().ok()?;
            Some((step, path))
        })
        .filter(|(_, path)| wanted(path))
        .collect();
    found.sort();
    found
}

fn rank_file(rank: usize) -> String {
    format!("rank-{rank:04}.h5")
}
