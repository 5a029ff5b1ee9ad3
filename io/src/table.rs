//! Tables of numbers as CSV: `gauges.csv` and `history.csv` as they grow, and tables that a case
//! file names.
//!
//! A written table's first line names its columns with their units, `t [s],x_min [m]`; the column `t`
//! is the time. Numbers are written with as many digits as give them back to the last bit.

use crate::Error;
use std::fs::{File, OpenOptions};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// A table that grows by a line at a time. One rank writes it.
#[derive(Debug)]
pub struct TableWriter {
    path: PathBuf,
    file: BufWriter<File>,
    columns: usize,
    line: String,
}

impl TableWriter {
    /// A new table, in place of any that is there, with columns (name, unit); a unit may be empty.
    pub fn create(path: &Path, columns: &[(&str, &str)]) -> Result<Self, Error> {
        Self::start(path, header(columns) + "\n", columns.len())
    }

    /// Continues a table: lines after the time `after` are dropped, and the last line if it is not
    /// whole. If there is no table yet, it is created. The columns must be those of the table, and one
    /// of them `t`.
    pub fn resume(path: &Path, after: f64, columns: &[(&str, &str)]) -> Result<Self, Error> {
        if !path.exists() {
            return Self::create(path, columns);
        }
        let text = std::fs::read_to_string(path).map_err(|e| Error::file(path, e))?;
        let time_column = columns.iter().position(|(name, _)| *name == "t");
        let time_column = time_column.expect("a table that is continued has a column t");
        let header = header(columns);
        if text.lines().next() != Some(&header) {
            let message = "has other columns than this run writes: write to another directory";
            return Err(Error::line(path, 1, message));
        }
        let mut kept = header + "\n";
        for (number, line) in text.split_inclusive('\n').enumerate().skip(1) {
            let Some(line) = line.strip_suffix('\n') else { break };
            let time = line.split(',').nth(time_column).unwrap_or_default();
            let time: f64 = time
                .parse()
                .map_err(|_| Error::line(path, number + 1, format!("`{time}` is not a time")))?;
            if time <= after {
                kept += line;
                kept += "\n";
            }
        }
        Self::start(path, kept, columns.len())
    }

    /// Adds a line. It reaches the operating system at once: a run that dies loses none.
    pub fn row(&mut self, values: &[f64]) -> Result<(), Error> {
        assert_eq!(values.len(), self.columns, "{} has a value a column", self.path.display());
        self.line.clear();
        for (i, &x) in values.iter().enumerate() {
            use std::fmt::Write;
            let comma = if i > 0 { "," } else { "" };
            // Counts as counts; all else in the shortest form that reads back the same.
            let written = match x {
                _ if x == x.trunc() && x.abs() < 1e15 => write!(self.line, "{comma}{x}"),
                _ => write!(self.line, "{comma}{x:?}"),
            };
            written.expect("a string takes all that is written");
        }
        self.line.push('\n');
        self.file
            .write_all(self.line.as_bytes())
            .and_then(|()| self.file.flush())
            .map_err(|e| Error::file(&self.path, e))
    }

    /// Writes `text` under another name first, so that what was there is not lost half-way.
    fn start(path: &Path, text: String, columns: usize) -> Result<Self, Error> {
        let fresh = path.with_extension("csv.new");
        let open = || {
            std::fs::write(&fresh, text)?;
            std::fs::rename(&fresh, path)?;
            OpenOptions::new().append(true).open(path)
        };
        let file = BufWriter::new(open().map_err(|e| Error::file(path, e))?);
        Ok(Self { path: path.into(), file, columns, line: String::new() })
    }
}

fn header(columns: &[(&str, &str)]) -> String {
    let names = columns.iter().map(|(name, unit)| match *unit {
        "" => name.to_string(),
        unit => format!("{name} [{unit}]"),
    });
    names.collect::<Vec<_>>().join(",")
}

/// A table that was read: at least one row, every value finite.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Names of the columns, as the header line has them.
    pub columns: Vec<String>,
    /// One list a row, each with a value a column.
    pub rows: Vec<Vec<f64>>,
}

impl Table {
    /// Reads a file: lines that begin with `#` and empty ones aside, a line of names, then lines of
    /// numbers, separated by commas.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let text = std::fs::read_to_string(path).map_err(|e| Error::file(path, e))?;
        Self::parse(path, &text)
    }

    /// Reads text as `read` does; `path` is what errors name.
    pub fn parse(path: &Path, text: &str) -> Result<Self, Error> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let mut lines = (1..)
            .zip(text.lines().map(str::trim))
            .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
        let Some((at, names)) = lines.next() else {
            return Err(Error::file(path, "has no lines of numbers"));
        };
        let columns: Vec<String> = names.split(',').map(|name| name.trim().into()).collect();
        if columns.iter().all(|name| name.parse::<f64>().is_ok()) {
            let message =
                "the first line is numbers, it should name the columns, as in `t,velocity`";
            return Err(Error::line(path, at, message));
        }
        for (i, name) in columns.iter().enumerate() {
            if name.is_empty() {
                return Err(Error::line(path, at, format!("column {} has no name", i + 1)));
            }
            if columns[..i].contains(name) {
                return Err(Error::line(path, at, format!("two columns are called `{name}`")));
            }
        }
        let row = |(at, line): (usize, &str)| {
            let values: Vec<&str> = line.split(',').map(str::trim).collect();
            if values.len() != columns.len() {
                let (found, wanted) = (values.len(), columns.len());
                let message = format!("{found} values for {wanted} columns ({names})");
                return Err(Error::line(path, at, message));
            }
            let number = |(value, name): (&&str, &String)| match value.parse::<f64>() {
                Ok(x) if x.is_finite() => Ok(x),
                _ => {
                    Err(Error::line(path, at, format!("`{value}` in column `{name}` is no number")))
                }
            };
            values.iter().zip(&columns).map(number).collect()
        };
        let rows: Vec<Vec<f64>> = lines.map(row).collect::<Result<_, _>>()?;
        if rows.is_empty() {
            return Err(Error::file(path, "has no lines of numbers"));
        }
        Ok(Self { columns, rows })
    }

    /// The values of a column.
    pub fn column(&self, name: &str) -> Option<Vec<f64>> {
        let i = self.columns.iter().position(|column| column == name)?;
        Some(self.rows.iter().map(|row| row[i]).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(name: &str) -> PathBuf {
        let dir = std::env::temp_dir().join(format!("fcm-fsi-tables-{}", std::process::id()));
        std::fs::create_dir_all(&dir).unwrap();
        dir.join(name)
    }

    const COLUMNS: [(&str, &str); 3] = [("iterations", ""), ("t", "s"), ("volume", "m3")];

    #[test]
    fn numbers_come_back_to_the_last_bit() {
        let path = path("bits.csv");
        let mut table = TableWriter::create(&path, &COLUMNS).unwrap();
        let rows = [
            [12.0, 0.0, 0.1 + 0.2],
            [-3.0, 1e-7, 1.0 / 3.0],
            [1e15, 1e300, -0.0],
            [123456.0, f64::MIN_POSITIVE / 8.0, -1e-20],
        ];
        for row in rows {
            table.row(&row).unwrap();
        }
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(
            text.starts_with("iterations,t [s],volume [m3]\n12,0,0.30000000000000004\n"),
            "{text}"
        );
        let back = Table::read(&path).unwrap();
        assert_eq!(back.columns, ["iterations", "t [s]", "volume [m3]"]);
        assert_eq!(back.rows.concat().len(), 12);
        for (a, b) in back.rows.concat().iter().zip(rows.concat()) {
            assert_eq!(a.to_bits(), b.to_bits());
        }
        assert_eq!(back.column("iterations").unwrap()[1], -3.0);
        assert_eq!(back.column("t"), None);
    }

    #[test]
    fn a_restart_drops_what_came_later() {
        let path = path("restart.csv");
        let mut table = TableWriter::resume(&path, 5.0, &COLUMNS).unwrap();
        for t in [0.0, 0.1, 0.2, 0.3] {
            table.row(&[1000.0 * t, t, 2.0]).unwrap();
        }
        drop(table);
        // The run died within a line.
        let mut file = OpenOptions::new().append(true).open(&path).unwrap();
        file.write_all(b"150,0.15").unwrap();
        drop(file);
        let mut table = TableWriter::resume(&path, 0.2, &COLUMNS).unwrap();
        table.row(&[250.0, 0.25, 4.0]).unwrap();
        let back = Table::read(&path).unwrap();
        assert_eq!(back.column("t [s]").unwrap(), [0.0, 0.1, 0.2, 0.25]);
        let error = TableWriter::resume(&path, 0.2, &COLUMNS[..2]).unwrap_err().to_string();
        assert!(
            error.ends_with(
                "restart.csv:1: has other columns than this run writes: write to \
             another directory"
            ),
            "{error}"
        );
    }

    #[test]
    fn comments_and_empty_lines_are_skipped() {
        let text = "# digitised\n\nt_s, x_m\n0, 1\n # more\n  0.5 ,\t-2e-3\r\n";
        let table = Table::parse(Path::new("a.csv"), text).unwrap();
        assert_eq!(table.columns, ["t_s", "x_m"]);
        assert_eq!(table.rows, [[0.0, 1.0], [0.5, -2e-3]]);
    }

    #[test]
    fn errors_name_line_and_column() {
        for (text, error) in [
            ("", "a.csv: has no lines of numbers"),
            ("# only\nt,x\n", "a.csv: has no lines of numbers"),
            (
                "0,1\n2,3\n",
                "a.csv:1: the first line is numbers, it should name the columns, as in `t,velocity`",
            ),
            ("t,x\n0,1\n#\n1\n", "a.csv:4: 1 values for 2 columns (t,x)"),
            ("t,x\n0,one\n", "a.csv:2: `one` in column `x` is no number"),
            ("t,x\n0,nan\n", "a.csv:2: `nan` in column `x` is no number"),
            ("t,x\n0,\n", "a.csv:2: `` in column `x` is no number"),
            ("t,x,t\n0,1,2\n", "a.csv:1: two columns are called `t`"),
            ("t,,x\n0,1,2\n", "a.csv:1: column 2 has no name"),
        ] {
            assert_eq!(Table::parse(Path::new("a.csv"), text).unwrap_err().to_string(), error);
        }
        let error = Table::read(Path::new("/nowhere/a.csv")).unwrap_err().to_string();
        assert_eq!(error, "/nowhere/a.csv: No such file or directory (os error 2)");
    }
}
