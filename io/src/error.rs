//! What can be wrong with a file.

use partition::Communicator;
use std::path::{Path, PathBuf};

/// A file that cannot be read or written, and why.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Something about the file as a whole.
    #[error("{}: {message}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong, in words.
        message: String,
    },
    /// Something in one line of a text file.
    #[error("{}:{line}: {message}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong, in words.
        message: String,
    },
    /// Something in a binary file.
    #[error("{}: at byte {offset}: {message}", path.display())]
    Byte {
        /// The file.
        path: PathBuf,
        /// Bytes before it.
        offset: usize,
        /// What is wrong, in words.
        message: String,
    },
    /// What the lowest rank that failed says, on every rank.
    #[error("{0}")]
    Agreed(String),
}

impl Error {
    /// An error on one rank becomes an error on all. Collective.
    pub fn agree<T>(comm: &Communicator, mine: Result<T, Self>) -> Result<T, Self> {
        comm.agree(mine).map_err(Self::Agreed)
    }

    /// An error about a whole file.
    pub fn file(path: &Path, message: impl std::fmt::Display) -> Self {
        Self::File { path: path.into(), message: message.to_string() }
    }
    /// An error in one line (from 1) of a file.
    pub fn line(path: &Path, line: usize, message: impl std::fmt::Display) -> Self {
        Self::Line { path: path.into(), line, message: message.to_string() }
    }
    /// An error at some place of a binary file.
    pub fn byte(path: &Path, offset: usize, message: impl std::fmt::Display) -> Self {
        Self::Byte { path: path.into(), offset, message: message.to_string() }
    }
}

/// What an error of HDF5 comes to: where it quotes the system ("No space left on device"), that alone.
pub(crate) fn reason(error: &hdf5::Error) -> String {
    let text = error.to_string();
    let quoted = text.split_once("error message = '").and_then(|(_, rest)| rest.split_once('\''));
    quoted.map_or(text.clone(), |(message, _)| message.into())
}
