//! Reading: each rank its own file if nothing has moved, else items meet by id.

use super::manifest::{self, Manifest};
use super::rank_file;
use crate::Error;
use hdf5::H5Type;
use partition::Communicator;
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

/// A checkpoint that is there in full. Every method that reads is collective.
#[derive(Debug)]
pub struct Checkpoint {
    comm: Communicator,
    path: PathBuf,
    manifest: Manifest,
}

/// Numbers of eight bytes, carried between ranks as they are.
trait Word: H5Type + Copy {
    const KIND: &'static str;
    fn bits(self) -> u64;
    fn from_bits(bits: u64) -> Self;
}

impl Word for f64 {
    const KIND: &'static str = "f64";
    fn bits(self) -> u64 {
        self.to_bits()
    }
    fn from_bits(bits: u64) -> Self {
        f64::from_bits(bits)
    }
}

impl Word for u64 {
    const KIND: &'static str = "u64";
    fn bits(self) -> u64 {
        self
    }
    fn from_bits(bits: u64) -> Self {
        bits
    }
}

impl Checkpoint {
    /// Opens the checkpoint at `path` (see `find`), and checks that all of its files are there and
    /// have the length they were written with. Collective.
    pub fn open(comm: &Communicator, path: &Path) -> Result<Self, Error> {
        let file = path.join(manifest::NAME);
        let text = if comm.rank() == 0 { std::fs::read(&file) } else { Ok(Vec::new()) };
        let text = Error::agree(comm, text.map_err(|e| Error::file(&file, e)))?;
        let text = comm.broadcast(0, text);
        let manifest = Manifest::parse(&file, &String::from_utf8_lossy(&text))?;
        let this = Self { comm: comm.clone(), path: path.into(), manifest };
        Error::agree(comm, this.files().try_for_each(|rank| this.check_length(rank)))?;
        Ok(this)
    }

    /// The case's identity, as it was given to `write`.
    pub fn case(&self) -> &str {
        &self.manifest.case
    }

    /// Number of the last step that is done.
    pub fn step(&self) -> u64 {
        self.manifest.step
    }

    /// The time it ended at [s].
    pub fn time(&self) -> f64 {
        self.manifest.time
    }

    /// How many ranks wrote it.
    pub fn ranks(&self) -> usize {
        self.manifest.bytes.len()
    }

    /// A number that all ranks saved alike.
    pub fn scalar(&self, name: &str) -> Result<f64, Error> {
        self.manifest.scalars.get(name).copied().ok_or_else(|| {
            Error::file(&self.path.join(manifest::NAME), format!("has no scalar `{name}`"))
        })
    }

    /// All scalars by name.
    pub fn scalars(&self) -> &BTreeMap<String, f64> {
        &self.manifest.scalars
    }

    /// How many items of a group all ranks saved together, if it was saved.
    pub fn count(&self, group: &str) -> Option<u64> {
        self.manifest.items.get(group).copied()
    }

    /// Values of the items `ids`, which are any items, on any number of ranks. Collective.
    pub fn read_f64(
        &self,
        group: &str,
        array: &str,
        components: usize,
        ids: &[u64],
    ) -> Result<Vec<f64>, Error> {
        self.read(group, array, components, ids)
    }

    /// As `read_f64`, for counts, ids and flags. Collective.
    pub fn read_u64(
        &self,
        group: &str,
        array: &str,
        components: usize,
        ids: &[u64],
    ) -> Result<Vec<u64>, Error> {
        self.read(group, array, components, ids)
    }

    fn read<T: Word>(
        &self,
        group: &str,
        array: &str,
        components: usize,
        ids: &[u64],
    ) -> Result<Vec<T>, Error> {
        let files = self.files().map(|rank| {
            let saved: Vec<u64> = self.read_rank(rank, group, "id", 1)?;
            let values: Vec<T> = self.read_rank(rank, group, array, components)?;
            if values.len() != saved.len() * components {
                let message = format!("{group}/{array}: {} ids, other values", saved.len());
                return Err(Error::file(&self.path.join(rank_file(rank)), message));
            }
            Ok((saved, values))
        });
        let mut files = Error::agree(&self.comm, files.collect::<Result<Vec<_>, _>>())?;
        let nothing_moved = self.ranks() == self.comm.size() && files[0].0 == ids;
        if !self.comm.any(!nothing_moved) {
            return Ok(files.swap_remove(0).1);
        }
        self.meet(&files, components, ids).map_err(|Lost { count, first }| {
            let message =
                format!("{count} of the {group} asked for are missing, the first is {first}");
            Error::file(&self.path, message)
        })
    }

    /// Items from the files and those who ask for them meet on the rank `id mod size`.
    fn meet<T: Word>(
        &self,
        files: &[(Vec<u64>, Vec<T>)],
        components: usize,
        ids: &[u64],
    ) -> Result<Vec<T>, Lost> {
        let size = self.comm.size();
        let home = |id: u64| (id % size as u64) as usize;
        let mut saved = vec![Vec::new(); size];
        let mut values = vec![Vec::new(); size];
        for (file_ids, file_values) in files {
            for (&id, item) in file_ids.iter().zip(file_values.chunks_exact(components)) {
                saved[home(id)].push(id);
                values[home(id)].extend(item.iter().map(|x| x.bits()));
            }
        }
        let saved = self.comm.exchange_lists(saved).concat();
        let values = self.comm.exchange_lists(values).concat();
        let place: HashMap<u64, usize> = saved.iter().zip(0..).map(|(&id, i)| (id, i)).collect();

        let mut asked = vec![Vec::new(); size];
        for &id in ids {
            asked[home(id)].push(id);
        }
        let asked = self.comm.exchange_lists(asked);
        let lost: Vec<u64> =
            asked.iter().flatten().copied().filter(|id| !place.contains_key(id)).collect();
        let count = self.comm.sum_u64(lost.len() as u64);
        if count > 0 {
            let first = self.comm.all_gather(lost.iter().copied().min().as_slice()).concat();
            let first = first.into_iter().min().expect("at least one is lost");
            return Err(Lost { count, first });
        }
        let answers = asked.iter().map(|list| {
            let items = list.iter().flat_map(|id| {
                let at = place[id] * components;
                &values[at..at + components]
            });
            items.copied().collect()
        });
        let answers = self.comm.exchange_lists(answers.collect::<Vec<Vec<u64>>>());
        let mut next = vec![0; size];
        let mut result = Vec::with_capacity(ids.len() * components);
        for &id in ids {
            let (from, at) = (home(id), next[home(id)]);
            result.extend(answers[from][at..at + components].iter().map(|&x| T::from_bits(x)));
            next[from] = at + components;
        }
        Ok(result)
    }

    /// The ranks whose files this rank reads: its own, and every size-th after it.
    fn files(&self) -> impl Iterator<Item = usize> + use<> {
        (self.comm.rank()..self.ranks()).step_by(self.comm.size())
    }

    fn check_length(&self, rank: usize) -> Result<(), Error> {
        let path = self.path.join(rank_file(rank));
        let found = std::fs::metadata(&path).map_err(|e| Error::file(&path, e))?.len();
        let written = self.manifest.bytes[rank];
        if found == written {
            return Ok(());
        }
        Err(Error::file(&path, format!("has {found} bytes, {written} were written")))
    }

    fn read_rank<T: Word>(
        &self,
        rank: usize,
        group: &str,
        array: &str,
        components: usize,
    ) -> Result<Vec<T>, Error> {
        let path = self.path.join(rank_file(rank));
        let fail = |message: String| Error::file(&path, format!("{group}/{array}: {message}"));
        let file = hdf5::File::open(&path).map_err(|e| fail(e.to_string()))?;
        let dataset = file.dataset(&format!("{group}/{array}")).map_err(|e| fail(e.to_string()))?;
        if dataset.shape().get(1) != Some(&components) {
            return Err(fail(format!("has shape {:?}, not (n, {components})", dataset.shape())));
        }
        if !dataset.dtype().is_ok_and(|kind| kind.is::<T>()) {
            return Err(fail(format!("holds no {}", T::KIND)));
        }
        dataset.read_raw().map_err(|e| fail(e.to_string()))
    }
}

/// Items that were asked for and are in no file.
struct Lost {
    count: u64,
    first: u64,
}
