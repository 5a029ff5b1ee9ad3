//! Whether there is room on the disk, asked before HDF5 writes: a write that fails on one rank leaves the others waiting
//! inside HDF5, and may leave the file half changed.

use crate::Error;
use partition::Communicator;
use std::ffi::CString;
use std::mem::MaybeUninit;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;

/// What is to be left beside: HDF5 grows its tables by whole chunks [bytes].
const SPARE: u64 = 16 << 20;

/// An error if the disk of `path` (a file, there or not, in a directory that is) has no room for all ranks' `mine` bytes.
/// Collective.
pub(crate) fn room(comm: &Communicator, path: &Path, mine: u64) -> Result<(), Error> {
    let needed = comm.sum_u64(mine) + SPARE;
    let left = if comm.rank() == 0 { left(path.parent().unwrap_or(path)) } else { None };
    let enough = match left {
        Some(left) if left < needed => {
            let [needed, left] = [needed, left].map(|bytes| bytes as f64 / 1e6);
            Err(Error::file(
                path,
                format!("needs {needed:.1} MB, {left:.1} MB are left on the disk"),
            ))
        }
        _ => Ok(()),
    };
    Error::agree(comm, enough)
}

/// Bytes that this user may still write, where the system knows.
fn left(folder: &Path) -> Option<u64> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let name = CString::new(folder.as_os_str().as_bytes()).ok()?;
    let mut system = MaybeUninit::<libc::statvfs>::uninit();
    // SAFETY: a name that ends with 0 and room for the answer, which is set if the call returns 0.
    unsafe {
        (libc::statvfs(name.as_ptr(), system.as_mut_ptr()) == 0).then(|| {
            let system = system.assume_init();
            system.f_bavail * system.f_frsize
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_larger_than_any_disk_has_no_room() {
        let (comm, path) = (Communicator::single(), std::env::temp_dir().join("any.h5"));
        room(&comm, &path, 1).unwrap();
        let said = room(&comm, &path, 1 << 60).unwrap_err().to_string();
        assert!(said.contains("any.h5: needs 1152921504623.6 MB, "), "{said}");
    }
}
