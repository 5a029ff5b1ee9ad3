//! The `[boundaries]` table.

use super::super::error::Problem;
use super::super::file::{BoundaryEntry, BoundaryTable, BoundaryWord, CaseFile};
use super::super::formula::Formula;
use super::super::nearest::did_you_mean;
use super::super::{Boundary, MeshSource};
use super::block;
use super::values::{Reader, finite_vector, refuse};

/// The default and the named conditions.
pub fn check(
    file: &mut CaseFile,
    mesh: &MeshSource,
    reader: &Reader,
    times: &[f64],
) -> Result<(Boundary, Vec<(String, Boundary)>), Problem> {
    if file.prescribed_velocity.is_some() {
        // Nothing but inflow matters then.
        file.boundaries.entry("default".into()).or_insert(BoundaryEntry::Word(BoundaryWord::Slip));
    }
    let mut default = None;
    let mut named = Vec::new();
    for (name, entry) in &file.boundaries {
        let key = format!("boundaries.{name}");
        if let MeshSource::Box(mesh) = mesh
            && name != "default"
        {
            let names = block::boundary_names(mesh);
            if !names.contains(&&**name) {
                let hint = did_you_mean(name, &names, "names");
                return refuse(key, format!("the mesh has no boundary of this name; {hint}"));
            }
        }
        let points = block::points_on(mesh, name);
        let boundary = match entry {
            BoundaryEntry::Word(BoundaryWord::NoSlip) => Boundary::NoSlip,
            BoundaryEntry::Word(BoundaryWord::Slip) => Boundary::Slip,
            BoundaryEntry::Word(BoundaryWord::Open) => {
                Boundary::Pressure { pressure: Formula::constant(0.0), water: None }
            }
            BoundaryEntry::Table(table) => {
                with_values(&key, table, file.air.is_some(), reader, &points, times)?
            }
        };
        if name == "default" {
            default = Some(boundary);
        } else {
            named.push((name.clone(), boundary));
        }
    }
    match default {
        Some(default) => Ok((default, named)),
        None if *mesh == MeshSource::Nothing => Ok((Boundary::Slip, named)),
        None => {
            let message = "the key \"default\" is missing: the condition of boundaries not named";
            refuse("boundaries", message)
        }
    }
}

fn with_values(
    key: &str,
    table: &BoundaryTable,
    air: bool,
    reader: &Reader,
    points: &[[f64; 3]],
    times: &[f64],
) -> Result<Boundary, Problem> {
    let sub = |name: &str| format!("{key}.{name}");
    if table.water.is_some() && !air {
        return refuse(sub("water"), "without the table [air] water is everywhere; add [air]");
    }
    if table.wave_maker.is_none() {
        let given = [("column", table.column.is_some()), ("direction", table.direction.is_some())];
        if let Some((name, _)) = given.iter().find(|g| g.1) {
            return refuse(sub(name), "belongs to a wave_maker");
        }
    }
    let water = table.water.as_ref();
    let water = water.map(|w| reader.condition(&sub("water"), w, points, times)).transpose()?;
    match (&table.velocity, &table.pressure, &table.wave_maker) {
        (Some(velocity), None, None) => {
            let velocity = reader.three(&sub("velocity"), velocity, points, times)?;
            Ok(Boundary::Velocity { velocity, water })
        }
        (None, Some(pressure), None) => {
            let pressure = reader.value(&sub("pressure"), pressure, points, times)?;
            Ok(Boundary::Pressure { pressure, water })
        }
        (None, None, Some(csv)) => {
            let velocity = wave_maker(key, csv, table, reader)?;
            Ok(Boundary::Velocity { velocity, water })
        }
        _ => refuse(key, "needs one of velocity, pressure, wave_maker"),
    }
}

/// A column of speeds along a direction.
fn wave_maker(
    key: &str,
    csv: &str,
    table: &BoundaryTable,
    reader: &Reader,
) -> Result<[Formula; 3], Problem> {
    let Some(column) = &table.column else {
        return refuse(key, "the key \"column\" is missing: the wave_maker's column of speeds");
    };
    let Some(direction) = &table.direction else {
        return refuse(key, "the key \"direction\" is missing: where positive speeds point");
    };
    let key_of = |name: &str| format!("{key}.{name}");
    finite_vector(&key_of("direction"), direction)?;
    let length = direction.iter().map(|d| d * d).sum::<f64>().sqrt();
    if length == 0.0 {
        return refuse(key_of("direction"), "must not be zero");
    }
    let along =
        |d: f64| reader.series(&key_of("wave_maker"), &key_of("column"), csv, column, d / length);
    Ok([along(direction[0])?, along(direction[1])?, along(direction[2])?])
}
