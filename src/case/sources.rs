//! Everything a case file refers to, read once: its text and its tables. One rank reads, all ranks
//! check the same text.

use super::error::{CaseError, Source};
use super::file::{BoundaryEntry, CaseFile, Expression};
use super::formula::TimeSeries;
use super::nearest::did_you_mean;
use super::reader::{Misfit, Tree};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The texts of a case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sources {
    /// The case file, as it was typed.
    pub file: String,
    /// Its folder; tables and meshes are found from there. Absolute.
    pub folder: PathBuf,
    /// What the case file holds.
    pub text: String,
    /// What the tables it names hold, by the names used in it.
    pub tables: BTreeMap<String, String>,
}

impl Sources {
    /// Reads a case file and the tables it names. A folder stands for the `case.toml` in it.
    ///
    /// # Errors
    /// A file that cannot be read, or a case file that does not parse.
    pub fn read(path: &Path) -> Result<Self, CaseError> {
        let path = if path.is_dir() { path.join("case.toml") } else { path.to_path_buf() };
        let file = path.display().to_string();
        let text = text_of(&path).map_err(|message| CaseError {
            file: file.clone(),
            line: None,
            key: String::new(),
            message,
        })?;
        let folder = std::path::absolute(&path).unwrap_or(path);
        let folder = folder.parent().map(Path::to_path_buf).unwrap_or_default();
        let mut sources = Self { file, folder, text, tables: BTreeMap::new() };
        let mut typed = sources.parse()?;
        let mut named = Vec::new();
        for_each_table(&mut typed, &mut |key, name| named.push((key.to_string(), name.clone())));
        for (key, name) in named {
            let text = text_of(&sources.folder.join(&name))
                .map_err(|message| sources.source().error(&key, format!("{name}: {message}")))?;
            sources.tables.insert(name, text);
        }
        let files = typed.mesh.file.iter().map(|name| ("mesh.file".into(), name));
        let bodies =
            (1..).zip(&typed.body).map(|(i, b)| (format!("body[{i}].surface"), &b.surface));
        let walls = (1..).zip(&typed.wall).map(|(i, w)| (format!("wall[{i}].surface"), &w.surface));
        let others = bodies.chain(walls).filter_map(|(key, name)| Some((key, name.as_ref()?)));
        for (key, name) in files.chain(others) {
            if let Err(error) = std::fs::File::open(sources.folder.join(name)) {
                let message = format!("{name}: {}", reason(&error));
                return Err(sources.source().error(&key, message));
            }
        }
        Ok(sources)
    }

    /// The case file as typed.
    ///
    /// # Errors
    /// The first thing in it that is not understood.
    pub fn parse(&self) -> Result<CaseFile, CaseError> {
        let refused = |misfit: Misfit| CaseError {
            file: self.file.clone(),
            line: misfit.line,
            key: misfit.key.unwrap_or_default(),
            message: misfit.message,
        };
        Tree::parse(&self.text).and_then(|tree| tree.read()).map_err(refused)
    }

    /// The case file, absolute.
    pub fn path(&self) -> PathBuf {
        let name = Path::new(&self.file).file_name();
        self.folder.join(name.expect("a case file that was read has a name"))
    }

    /// Makes the names of tables and mesh absolute, so that the file may be read from elsewhere.
    pub(super) fn make_absolute(&self, file: &mut CaseFile) {
        let absolute = |name: &mut String| *name = self.folder.join(&*name).display().to_string();
        for_each_table(file, &mut |_, name| absolute(name));
        file.mesh.file.iter_mut().for_each(absolute);
        for obstacle in &mut file.obstacle {
            obstacle.surface.iter_mut().chain(&mut obstacle.terrain).for_each(absolute);
        }
        file.body.iter_mut().filter_map(|b| b.surface.as_mut()).for_each(absolute);
        file.wall.iter_mut().filter_map(|w| w.surface.as_mut()).for_each(absolute);
    }

    /// For errors about keys.
    pub fn source(&self) -> Source {
        Source { file: self.file.clone(), text: self.text.clone() }
    }

    /// A column of a table against its column "t". Names may be followed by a unit: `t [s]`.
    ///
    /// # Errors
    /// One sentence that begins with the table's name and line.
    pub fn series(&self, table: &str, column: &str) -> Result<TimeSeries, String> {
        let text = self.tables.get(table).expect("every table named was read");
        let rows = io::Table::parse(Path::new(table), text).map_err(|e| e.to_string())?;
        let names: Vec<&str> = rows
            .columns
            .iter()
            .map(|name| name.split_once('[').map_or(&**name, |(name, _)| name.trim_end()))
            .collect();
        let find = |name: &str| {
            names.iter().position(|n| *n == name).ok_or_else(|| {
                let hint = did_you_mean(name, &names, "columns");
                format!("{table}: has no column \"{name}\"; {hint}")
            })
        };
        let (time, value) = (find("t")?, find(column)?);
        let of = |i: usize| rows.rows.iter().map(|row| row[i]).collect();
        let series = TimeSeries { times: of(time), values: of(value) };
        match series.times.windows(2).find(|t| t[1] <= t[0]) {
            Some(t) => Err(format!("{table}: time {} does not come after {}", t[1], t[0])),
            None => Ok(series),
        }
    }
}

/// Calls `f` with the key and the name of every table that a case file names.
fn for_each_table(file: &mut CaseFile, f: &mut dyn FnMut(&str, &mut String)) {
    fn look(key: &str, typed: &mut Expression, f: &mut dyn FnMut(&str, &mut String)) {
        if let Expression::Table(column) = typed {
            f(key, &mut column.table);
        }
    }
    let vector =
        |key: &str, typed: Option<&mut [Expression; 3]>, f: &mut dyn FnMut(&str, &mut String)| {
            for (i, expression) in typed.into_iter().flatten().enumerate() {
                look(&format!("{key}[{}]", i + 1), expression, f);
            }
        };
    vector("body_force", file.body_force.as_mut(), f);
    vector("prescribed_velocity", file.prescribed_velocity.as_mut(), f);
    for (i, body) in (1..).zip(&mut file.body) {
        let tables = [
            ("led_velocity", body.led_velocity.as_mut()),
            ("led_spin", body.led_spin.as_mut()),
            ("force", body.force.as_mut()),
            ("torque", body.torque.as_mut()),
        ];
        for (name, typed) in tables {
            vector(&format!("body[{i}].{name}"), typed, f);
        }
    }
    vector("initial.velocity", Some(&mut file.initial.velocity), f);
    for (i, obstacle) in file.obstacle.iter_mut().enumerate() {
        let key = |name: &str| format!("obstacle[{}].{name}", i + 1);
        vector(&key("displacement"), obstacle.displacement.as_mut(), f);
        vector(&key("rotation"), obstacle.rotation.as_mut(), f);
        vector(&key("velocity"), obstacle.velocity.as_mut(), f);
        vector(&key("spin"), obstacle.spin.as_mut(), f);
    }
    for (name, entry) in &mut file.boundaries {
        let BoundaryEntry::Table(table) = entry else { continue };
        vector(&format!("boundaries.{name}.velocity"), table.velocity.as_mut(), f);
        if let Some(pressure) = &mut table.pressure {
            look(&format!("boundaries.{name}.pressure"), pressure, f);
        }
        if let Some(csv) = &mut table.wave_maker {
            f(&format!("boundaries.{name}.wave_maker"), csv);
        }
    }
}

fn reason(error: &std::io::Error) -> String {
    match error.kind() {
        std::io::ErrorKind::NotFound => "no such file".into(),
        std::io::ErrorKind::PermissionDenied => "may not be read".into(),
        std::io::ErrorKind::IsADirectory => "is a folder".into(),
        _ => error.to_string(),
    }
}

fn text_of(path: &Path) -> Result<String, String> {
    let bytes = std::fs::read(path).map_err(|error| reason(&error))?;
    String::from_utf8(bytes).map_err(|_| "is not text (UTF-8)".into())
}
