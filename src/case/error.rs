//! The one error of this room: file, line, key and what is wrong, in one sentence.

use super::reader::Tree;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Why a case cannot be run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CaseError {
    /// The file, as it was typed.
    pub file: String,
    /// Line in it, from 1.
    pub line: Option<usize>,
    /// Dotted key, for example `boundaries.x_min.velocity` or `gauge[2].name` (counted from 1).
    pub key: String,
    /// What is wrong and what would be right.
    pub message: String,
}

impl fmt::Display for CaseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file)?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        if !self.key.is_empty() {
            write!(f, ": {}", self.key)?;
        }
        write!(f, ": {}", self.message)
    }
}

impl std::error::Error for CaseError {}

/// A case file's name and text: enough to say where a key stands.
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    /// The file, as it was typed.
    pub file: String,
    /// What it holds.
    pub text: String,
}

impl Source {
    /// What is wrong with a key; its line is found here. Where the key itself is not written (a default),
    /// the line is that of its table.
    pub fn error(&self, key: &str, message: impl Into<String>) -> CaseError {
        let line = Tree::parse(&self.text).ok().and_then(|t| t.line_of(key));
        CaseError { file: self.file.clone(), line, key: key.into(), message: message.into() }
    }
}

/// What is wrong with a key of the file being checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// Dotted key.
    pub key: String,
    /// What is wrong and what would be right.
    pub message: String,
}

impl Problem {
    /// A problem with a key.
    pub fn new(key: impl Into<String>, message: impl Into<String>) -> Self {
        Self { key: key.into(), message: message.into() }
    }
}
