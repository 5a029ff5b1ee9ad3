//! One HDF5 file that all ranks write together: tables of rows that only grow at their end, each
//! rank's rows after those of the ranks before it.
//!
//! Every method is collective: all ranks call it, in the same order, and an error on one rank becomes
//! the same error on all. Writes carry a collective transfer list, and a rank with nothing to write
//! takes part with an empty selection.

use crate::Error;
use crate::error::reason;
use hdf5::{Dataset, Dataspace, Datatype, H5Type, Result as HdfResult};
use hdf5_sys::h5d::{H5Dread, H5Dwrite};
use hdf5_sys::h5p::{
    H5FD_mpio_xfer_t::H5FD_MPIO_COLLECTIVE, H5Pclose, H5Pcreate, H5Pset_dxpl_mpio,
};
use hdf5_sys::h5s::{H5S_seloper_t::H5S_SELECT_SET, H5Sselect_hyperslab, H5Sselect_none};
use partition::Communicator;
use std::mem::ManuallyDrop;
use std::path::Path;

/// Rows per chunk of a large table: 64 Ki rows of one f32 are 256 KiB, of a tetrahedron 2 MiB.
const CHUNK_ROWS: u64 = 1 << 16;

/// An open file. Without MPI it is written with HDF5's serial driver, by the one rank there is.
pub(crate) struct SharedFile<'a> {
    comm: &'a Communicator,
    path: &'a Path,
    /// Not closed after an error: it is collective, and the ranks may no longer be at the same place.
    file: ManuallyDrop<hdf5::File>,
}

/// How `SharedFile` opens.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Open {
    /// A new file, in place of any that is there.
    Create,
    /// A file that is there.
    Change,
}

impl<'a> SharedFile<'a> {
    /// Opens the file.
    pub fn open(comm: &'a Communicator, path: &'a Path, open: Open) -> Result<Self, Error> {
        let mut options = hdf5::File::with_options();
        options.with_fapl(|access| match comm.raw_mpi() {
            Some(mpi) => access.mpio(mpi, None),
            None => access,
        });
        let file = match open {
            Open::Create => options.create(path),
            Open::Change => options.open_rw(path),
        };
        let file = agree(comm, path, "open for writing", file)?;
        Ok(Self { comm, path, file: ManuallyDrop::new(file) })
    }

    /// Closes the file; all that was written is then on disk.
    pub fn close(self) -> Result<(), Error> {
        agree(self.comm, self.path, "close", ManuallyDrop::into_inner(self.file).close())
    }

    /// Hands what was written so far to the operating system.
    pub fn flush(&self) -> Result<(), Error> {
        self.agree("write", self.file.flush())
    }

    /// The open file, for attributes and groups.
    pub fn root(&self) -> &hdf5::File {
        &self.file
    }

    /// The same outcome on every rank.
    pub fn agree<T>(&self, what: &str, result: HdfResult<T>) -> Result<T, Error> {
        agree(self.comm, self.path, what, result)
    }

    /// A new empty table of `T` with `columns` columns (0: one-dimensional), expected to grow by
    /// about `rows` at a time.
    pub fn create_table<T: H5Type>(
        &self,
        name: &str,
        columns: usize,
        rows: u64,
    ) -> Result<(), Error> {
        let chunk = rows.clamp(1, CHUNK_ROWS) as usize;
        let builder = self
            .file
            .new_dataset::<T>()
            .fill_time(hdf5::dataset::FillTime::Never)
            .obj_track_times(false);
        let created = match columns {
            0 => builder.chunk(chunk).shape(0..).create(name),
            _ => builder.chunk((chunk, columns)).shape((0.., columns)).create(name),
        };
        self.agree(&format!("create {name}"), created).map(drop)
    }

    /// Number of rows of a table.
    pub fn rows(&self, name: &str) -> Result<u64, Error> {
        Ok(self.agree(&format!("read {name}"), self.file.dataset(name))?.shape()[0] as u64)
    }

    /// Drops all rows of a table but the first ones.
    pub fn truncate(&self, name: &str, rows: u64) -> Result<(), Error> {
        let resized = self.file.dataset(name).and_then(|dataset| {
            let mut shape = dataset.shape();
            shape[0] = rows as usize;
            dataset.resize(shape)
        });
        self.agree(&format!("truncate {name}"), resized)
    }

    /// Adds every rank's rows (row-major) to the end of a table, in rank order.
    pub fn append<T: H5Type>(&self, name: &str, mine: &[T]) -> Result<(), Error> {
        let what = format!("write {name}");
        let dataset = self.agree(&what, self.file.dataset(name))?;
        let mut shape = dataset.shape();
        let columns = shape.get(1).copied().unwrap_or(1);
        assert_eq!(mine.len() % columns, 0, "{name} is given in whole rows of {columns}");
        let rows = (mine.len() / columns) as u64;
        let first = shape[0] as u64 + self.comm.exclusive_sum(rows);
        shape[0] += self.comm.sum_u64(rows) as usize;
        self.agree(&what, dataset.resize(shape))?;
        self.agree(&what, write_rows(&dataset, first, mine, self.comm.raw_mpi().is_some()))
    }

    /// Adds one row to the end of a table, written by rank 0.
    pub fn append_row<T: H5Type>(&self, name: &str, row: &[T]) -> Result<(), Error> {
        self.append(name, if self.comm.rank() == 0 { row } else { &[] })
    }

    /// `count` rows of a table from row `first` on; each rank its own.
    pub fn read<T: H5Type + Default + Copy>(
        &self,
        name: &str,
        first: u64,
        count: u64,
    ) -> Result<Vec<T>, Error> {
        let read = self.file.dataset(name).and_then(|dataset| read_rows(&dataset, first, count));
        self.agree(&format!("read {name}"), read)
    }
}

fn agree<T>(
    comm: &Communicator,
    path: &Path,
    what: &str,
    result: HdfResult<T>,
) -> Result<T, Error> {
    let said = |e| Error::file(path, format!("cannot {what}: {}", reason(&e)));
    Error::agree(comm, result.map_err(said))
}

/// Writes whole rows from row `first` on. With MPI all ranks call it, each with its own rows.
fn write_rows<T: H5Type>(
    dataset: &Dataset,
    first: u64,
    rows: &[T],
    collective: bool,
) -> HdfResult<()> {
    let (file_space, memory_space) = selection(dataset, first, rows.len())?;
    let memory_type = Datatype::from_type::<T>()?;
    hdf5::sync::sync(|| {
        // SAFETY: the identifiers are alive for the call, and the memory space has the length of
        // `rows`, whose type is `memory_type`.
        unsafe {
            let transfer = hdf5::h5check(H5Pcreate(*hdf5::globals::H5P_DATASET_XFER))?;
            let written = match collective {
                true => hdf5::h5check(H5Pset_dxpl_mpio(transfer, H5FD_MPIO_COLLECTIVE)),
                false => Ok(0),
            }
            .and_then(|_| {
                hdf5::h5check(H5Dwrite(
                    dataset.id(),
                    memory_type.id(),
                    memory_space.id(),
                    file_space.id(),
                    transfer,
                    rows.as_ptr().cast(),
                ))
            });
            H5Pclose(transfer);
            written.map(drop)
        }
    })
}

/// Reads `count` whole rows from row `first` on, by this rank alone.
fn read_rows<T: H5Type + Default + Copy>(
    dataset: &Dataset,
    first: u64,
    count: u64,
) -> HdfResult<Vec<T>> {
    let columns = dataset.shape().get(1).copied().unwrap_or(1);
    let mut rows = vec![T::default(); count as usize * columns];
    if first + count > dataset.shape()[0] as u64 {
        return Err(format!("{count} rows from {first} on are wanted").into());
    }
    let (file_space, memory_space) = selection(dataset, first, rows.len())?;
    let memory_type = Datatype::from_type::<T>()?;
    // SAFETY: as in `write_rows`.
    hdf5::sync::sync(|| unsafe {
        hdf5::h5check(H5Dread(
            dataset.id(),
            memory_type.id(),
            memory_space.id(),
            file_space.id(),
            hdf5_sys::h5p::H5P_DEFAULT,
            rows.as_mut_ptr().cast(),
        ))
    })?;
    Ok(rows)
}

/// The part of the file and of memory that hold `len` values from row `first` on.
fn selection(dataset: &Dataset, first: u64, len: usize) -> HdfResult<(Dataspace, Dataspace)> {
    let file_space = dataset.space()?;
    let memory_space = Dataspace::try_new(len.max(1))?;
    let columns = dataset.shape().get(1).copied().unwrap_or(1) as u64;
    let (start, count) = ([first, 0], [len as u64 / columns, columns]);
    hdf5::sync::sync(|| -> HdfResult<()> {
        // SAFETY: `start` and `count` have an entry for each of the at most two dimensions.
        unsafe {
            if len == 0 {
                hdf5::h5check(H5Sselect_none(file_space.id()))?;
                hdf5::h5check(H5Sselect_none(memory_space.id()))?;
            } else {
                hdf5::h5check(H5Sselect_hyperslab(
                    file_space.id(),
                    H5S_SELECT_SET,
                    start.as_ptr(),
                    std::ptr::null(),
                    count.as_ptr(),
                    std::ptr::null(),
                ))?;
            }
        }
        Ok(())
    })?;
    Ok((file_space, memory_space))
}
