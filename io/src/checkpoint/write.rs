//! Writing: each rank its file, then the manifest, then the name that makes it a checkpoint.

use super::manifest::{self, Manifest};
use super::{Group, State, UNFINISHED, Values, is_checkpoint, named, rank_file};
use crate::Error;
use crate::error::reason;
use crate::room::room;
use hdf5::H5Type;
use partition::Communicator;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

/// Checkpoints that are kept.
const KEPT: usize = 2;

/// Values per chunk of a file: 512 KiB.
const CHUNK: usize = 1 << 16;

/// Writes a checkpoint into the directory `dir`; returns its path. Of the checkpoints that are there
/// the newest earlier one is kept. Later ones go: this run, restarted before them, replaces what came
/// then. Collective.
pub fn write(comm: &Communicator, dir: &Path, state: &State) -> Result<PathBuf, Error> {
    let path = dir.join(format!("checkpoint-{:08}", state.step));
    let components =
        |group: &Group<'_>| group.arrays.iter().map(|array| array.1).sum::<usize>() + 1;
    let values: usize = state.groups.iter().map(|group| group.ids.len() * components(group)).sum();
    room(comm, &path, 8 * values as u64)?;
    let unfinished = path.with_extension(UNFINISHED);
    let begun = if comm.rank() == 0 { begin(&unfinished) } else { Ok(()) };
    Error::agree(comm, begun)?;

    let bytes = Error::agree(comm, write_rank(&unfinished.join(rank_file(comm.rank())), state))?;
    let manifest = Manifest::new(
        state,
        comm.all_gather(&[bytes]).concat(),
        (state.groups.iter())
            .map(|group| (group.name.into(), comm.sum_u64(group.ids.len() as u64)))
            .collect(),
    );
    let finished =
        if comm.rank() == 0 { finish(dir, &unfinished, &path, &manifest) } else { Ok(()) };
    Error::agree(comm, finished)?;
    Ok(path)
}

/// Makes an empty directory.
fn begin(unfinished: &Path) -> Result<(), Error> {
    remove(unfinished)?;
    fs::create_dir_all(unfinished).map_err(|e| Error::file(unfinished, e))
}

/// Adds the manifest, gives the directory its name, and removes what it supersedes.
fn finish(dir: &Path, unfinished: &Path, path: &Path, manifest: &Manifest) -> Result<(), Error> {
    let file = unfinished.join(manifest::NAME);
    fs::write(&file, manifest.to_text())
        .and_then(|()| File::open(&file)?.sync_all())
        .map_err(|e| Error::file(&file, e))?;
    remove(path)?;
    fs::rename(unfinished, path)
        .and_then(|()| File::open(dir)?.sync_all())
        .map_err(|e| Error::file(path, e))?;
    let (done, later): (Vec<_>, Vec<_>) =
        named(dir, is_checkpoint).into_iter().partition(|(step, _)| *step <= manifest.step);
    let superseded = &done[..done.len().saturating_sub(KEPT)];
    let given_up = named(dir, |path| path.extension().is_some_and(|e| e == UNFINISHED));
    superseded.iter().chain(&later).chain(&given_up).try_for_each(|(_, old)| remove(old))
}

/// Removes a directory if it is there.
fn remove(path: &Path) -> Result<(), Error> {
    if !path.exists() {
        return Ok(());
    }
    fs::remove_dir_all(path).map_err(|e| Error::file(path, format!("cannot remove: {e}")))
}

/// Writes one rank's file; returns its size in bytes.
fn write_rank(path: &Path, state: &State) -> Result<u64, Error> {
    let write = || -> hdf5::Result<()> {
        let file = hdf5::File::create(path)?;
        for group in state.groups {
            let target = file.create_group(group.name)?;
            let n = group.ids.len();
            write_array(&target, "id", 1, group.ids)?;
            for &(name, components, values) in group.arrays {
                match values {
                    Values::F64(values) => {
                        write_array(&target, name, components, &values[..n * components])?;
                    }
                    Values::U64(values) => {
                        write_array(&target, name, components, &values[..n * components])?;
                    }
                }
            }
        }
        file.close()
    };
    write().map_err(|e| Error::file(path, format!("cannot write: {}", reason(&e))))?;
    File::open(path)
        .and_then(|file| file.sync_all().and(file.metadata()))
        .map(|metadata| metadata.len())
        .map_err(|e| Error::file(path, e))
}

fn write_array<T: H5Type>(
    group: &hdf5::Group,
    name: &str,
    components: usize,
    values: &[T],
) -> hdf5::Result<()> {
    let rows = values.len() / components;
    let dataset = group.new_dataset::<T>().obj_track_times(false);
    if rows == 0 {
        return dataset.shape((0, components)).create(name).map(drop);
    }
    dataset
        .shape((rows, components))
        .chunk((rows.min((CHUNK / components).max(1)), components))
        .fletcher32()
        .create(name)?
        .write_raw(values)
}
