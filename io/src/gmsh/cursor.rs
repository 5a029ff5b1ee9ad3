//! A place in the bytes of an MSH file: numbers as text or as raw little-endian values.

use crate::Error;
use std::path::Path;

/// Reads forward; every error names the place of what it was reading.
pub struct Cursor<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    at: usize,
    /// Where the last token began.
    token: usize,
    /// The section being read.
    section: String,
    /// Numbers in sections are raw (except where the format says text).
    pub binary: bool,
}

impl<'a> Cursor<'a> {
    pub fn new(path: &'a Path, bytes: &'a [u8]) -> Self {
        Self { path, bytes, at: 0, token: 0, section: String::new(), binary: false }
    }

    /// An error where the last thing was read.
    pub fn fail(&self, message: impl std::fmt::Display) -> Error {
        if self.binary {
            return Error::byte(self.path, self.token, message);
        }
        let newlines = self.bytes[..self.token].iter().filter(|&&b| b == b'\n').count();
        Error::line(self.path, newlines + 1, message)
    }

    fn ended(&mut self, what: &str) -> Error {
        self.token = self.bytes.len();
        self.fail(format!("the file ends inside ${}, where {what} should be", self.section))
    }

    /// Bytes not yet read.
    pub fn remaining(&self) -> usize {
        self.bytes.len() - self.at
    }

    fn skip_space(&mut self) {
        while self.bytes.get(self.at).is_some_and(u8::is_ascii_whitespace) {
            self.at += 1;
        }
        self.token = self.at;
    }

    /// The next word of text.
    pub fn word(&mut self, what: &str) -> Result<&'a str, Error> {
        self.skip_space();
        let rest = &self.bytes[self.at..];
        let length = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        if length == 0 {
            return Err(self.ended(what));
        }
        self.at += length;
        std::str::from_utf8(&rest[..length])
            .map_err(|_| self.fail(format!("{what} expected, not these bytes")))
    }

    /// The rest of the line, without the spaces around it.
    pub fn line(&mut self) -> Result<&'a str, Error> {
        let rest = &self.bytes[self.at..];
        let length = rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
        self.at += length;
        std::str::from_utf8(&rest[..length])
            .map(str::trim)
            .map_err(|_| self.fail("this line is not UTF-8 text"))
    }

    /// A number written as text, in binary files too.
    pub fn text<T: std::str::FromStr>(&mut self, what: &str) -> Result<T, Error> {
        let word = self.word(what)?;
        word.parse().map_err(|_| self.fail(format!("{what} expected, not \"{word}\"")))
    }

    fn raw<const N: usize>(&mut self, what: &str) -> Result<[u8; N], Error> {
        self.token = self.at;
        let Some(bytes) = self.bytes[self.at..].first_chunk() else {
            return Err(self.ended(what));
        };
        self.at += N;
        Ok(*bytes)
    }

    /// An integer of 4 bytes.
    pub fn int(&mut self, what: &str) -> Result<i32, Error> {
        if self.binary { self.raw(what).map(i32::from_le_bytes) } else { self.text(what) }
    }

    /// A count or tag of 8 bytes.
    pub fn size(&mut self, what: &str) -> Result<u64, Error> {
        if self.binary { self.raw(what).map(u64::from_le_bytes) } else { self.text(what) }
    }

    /// A floating-point number.
    pub fn double(&mut self, what: &str) -> Result<f64, Error> {
        if self.binary { self.raw(what).map(f64::from_le_bytes) } else { self.text(what) }
    }

    /// As many items as `count` says, each at least `bytes` long in a binary file: a count that
    /// cannot be true is an error before anything is allocated for it.
    pub fn count(&self, count: u64, bytes: usize, what: &str) -> Result<usize, Error> {
        let least = if self.binary { bytes } else { 2 };
        let fits = (self.remaining() / least + 1) as u64;
        if count > fits {
            return Err(self.fail(format!(
                "${} announces {count} {what}; the rest of the file has room for {fits} at most",
                self.section
            )));
        }
        Ok(count as usize)
    }

    /// The end of a text line that raw numbers follow.
    pub fn newline(&mut self) -> Result<(), Error> {
        if self.binary {
            self.token = self.at;
            while self.bytes.get(self.at).is_some_and(|&b| b == b' ' || b == b'\r') {
                self.at += 1;
            }
            if self.bytes.get(self.at) != Some(&b'\n') {
                return Err(self.fail("the end of the line expected"));
            }
            self.at += 1;
        }
        Ok(())
    }

    /// The name of the next section; `None` at the end of the file.
    pub fn section(&mut self) -> Result<Option<String>, Error> {
        self.skip_space();
        if self.remaining() == 0 {
            return Ok(None);
        }
        let line = self.line()?;
        let Some(name) = line.strip_prefix('$').filter(|n| !n.is_empty()) else {
            let start: String = line.chars().take(20).collect();
            return Err(self.fail(format!("a section such as $Nodes expected, not \"{start}\"")));
        };
        self.section = name.into();
        if self.binary && self.remaining() > 0 {
            self.at += 1;
        }
        Ok(Some(self.section.clone()))
    }

    /// The line `$EndName`.
    pub fn end_of(&mut self, name: &str) -> Result<(), Error> {
        self.skip_space();
        let wanted = format!("$End{name}");
        if !self.bytes[self.at..].starts_with(wanted.as_bytes()) {
            if self.remaining() == 0 {
                return Err(self.ended(&wanted));
            }
            return Err(self.fail(format!(
                "{wanted} expected: the section does not hold what its counts say"
            )));
        }
        self.at += wanted.len();
        Ok(())
    }

    /// Goes past the section's end.
    pub fn skip_section(&mut self, name: &str) -> Result<(), Error> {
        let wanted = format!("$End{name}");
        let rest = &self.bytes[self.at..];
        match rest.windows(wanted.len()).position(|w| w == wanted.as_bytes()) {
            Some(length) => {
                self.at += length + wanted.len();
                Ok(())
            }
            None => Err(self.fail(format!("section ${name} has no end ({wanted})"))),
        }
    }
}
