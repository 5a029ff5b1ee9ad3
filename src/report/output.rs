//! The files of a run: fields, gauges, history, and when each is due.

use super::gauges::Gauges;
use crate::case::{Case, MeshSource};
use crate::flow::BodyLoad;
use crate::mesh::MeshPart;
use io::table::TableWriter;
use io::vtkhdf::{FieldsFile, FieldsMesh};
use std::path::Path;

/// Columns of history.csv.
const HISTORY: [(&str, &str); 18] = [
    ("step", ""),
    ("t", "s"),
    ("dt", "s"),
    ("courant", ""),
    ("passes", ""),
    ("flow_iterations", ""),
    ("flow_residual", ""),
    ("phase_iterations", ""),
    ("volume", "m3"),
    ("volume_error", "m3"),
    ("inflow", "m3"),
    ("correction", "m3"),
    ("correction_sum", "m3"),
    ("water_bodies", ""),
    ("sealed_pockets", ""),
    ("squeezed", "m3"),
    ("kinetic", "J"),
    ("potential", "J"),
];

/// The state as it is written: nodal values of local nodes; empty where the case has no such field.
#[derive(Clone, Debug)]
pub struct Snapshot<'a> {
    /// Time of the velocity [s]; the pressure is half a step older, the phase field too.
    pub t: f64,
    /// u [m/s].
    pub u: &'a [[f64; 3]],
    /// p [Pa].
    pub p: &'a [f64],
    /// φ.
    pub phi: &'a [f64],
    /// Distance to the structures [m], positive in the fluid.
    pub distance: &'a [f64],
    /// Nodes without fluid, ascending.
    pub dry: &'a [u32],
    /// What the fluid does to each obstacle, then to each entry of bodies.
    pub loads: Vec<BodyLoad>,
    /// Gauges that ride on structures: place and outward normal.
    pub riding: Vec<[[f64; 3]; 2]>,
}

/// The open files of a run.
pub struct Output {
    fields: Option<(FieldsFile, Schedule)>,
    gauges: Gauges,
    gauge_table: Option<TableWriter>,
    gauge_schedule: Schedule,
    history: Option<TableWriter>,
    bodies: Option<TableWriter>,
}

/// Columns of loads.csv for each obstacle and each entry of bodies: the weak form's reaction, with what bears where a
/// body rests on something, then its traction alone.
const BODY: [(&str, &str); 13] = [
    ("force_x", "N"),
    ("force_y", "N"),
    ("force_z", "N"),
    ("torque_x", "Nm"),
    ("torque_y", "Nm"),
    ("torque_z", "Nm"),
    ("traction_x", "N"),
    ("traction_y", "N"),
    ("traction_z", "N"),
    ("traction_torque_x", "Nm"),
    ("traction_torque_y", "Nm"),
    ("traction_torque_z", "Nm"),
    ("area", "m2"),
];

/// When something is due: every so often, the first time at zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Schedule {
    every: f64,
    next: u64,
}

impl Schedule {
    /// Every `every` seconds (zero: always), after the time `after` if given.
    pub fn new(every: f64, after: Option<f64>) -> Self {
        Self { every, next: after.map_or(0, |t| Self::passed(t, every) + 1) }
    }

    /// When it is next due [s].
    pub fn next_time(&self) -> f64 {
        self.next as f64 * self.every
    }

    /// Whether it is due at `t`; if so, it is done.
    pub fn take(&mut self, t: f64) -> bool {
        let passed = Self::passed(t, self.every);
        let due = self.every == 0.0 || passed >= self.next;
        self.next = self.next.max(passed + 1);
        due
    }

    /// The last multiple of `every` up to `t`, rounding apart.
    fn passed(t: f64, every: f64) -> u64 {
        if every == 0.0 { 0 } else { (t / every * (1.0 + 1e-12) + 1e-9).floor() as u64 }
    }
}

impl Output {
    /// Opens the files in `folder`, which exists; `after` a time [s], those of an interrupted run.
    /// Collective.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn open(
        case: &Case,
        part: &MeshPart,
        gauges: Gauges,
        folder: &Path,
        after: Option<f64>,
    ) -> Result<Self, io::Error> {
        let mut fields = None;
        if let Some(every) = case.output.fields_every {
            let path = folder.join("fields.vtkhdf");
            let owned = part.n_owned_elements;
            let mesh = FieldsMesh {
                nodes: &part.nodes,
                points: &part.mesh.nodes,
                tets: &part.mesh.tets[..owned],
                tet_ids: &part.element_global[..owned],
            };
            let names = field_names(case);
            let file = match after {
                None => FieldsFile::create(&part.comm, &path, mesh, &names)?,
                Some(t) => FieldsFile::resume(&part.comm, &path, t, mesh, &names)?,
            };
            fields = Some((file, Schedule::new(every, after)));
        }
        let table = |name: &str, columns: &[(&str, &str)]| {
            let path = folder.join(name);
            let opened = match (part.comm.rank(), after) {
                (0, None) => TableWriter::create(&path, columns).map(Some),
                (0, Some(t)) => TableWriter::resume(&path, t, columns).map(Some),
                _ => Ok(None),
            };
            io::Error::agree(&part.comm, opened)
        };
        let gauge_table = if gauges.columns.is_empty() {
            None
        } else {
            let mut columns = vec![("t", "s")];
            columns.extend(gauges.columns.iter().map(|(name, unit)| (name.as_str(), *unit)));
            table("gauges.csv", &columns)?
        };
        let bodies = case.bodies.iter().flat_map(|b| &b.bodies).map(|b| b.name.clone());
        let names: Vec<String> =
            case.obstacles.iter().map(|o| o.name.clone()).chain(bodies).collect();
        Ok(Self {
            fields,
            gauge_table,
            gauge_schedule: Schedule::new(case.output.gauges_every.unwrap_or(0.0), after),
            gauges,
            history: table("history.csv", &HISTORY)?,
            bodies: if case.mesh == MeshSource::Nothing || names.is_empty() {
                None
            } else {
                let named = |name: &String| {
                    let name = name.clone();
                    BODY.map(move |(column, unit)| (format!("{name}_{column}"), unit))
                };
                let columns: Vec<_> = names.iter().flat_map(named).collect();
                let columns = columns.iter().map(|(name, unit)| (name.as_str(), *unit));
                let columns: Vec<_> = std::iter::once(("t", "s")).chain(columns).collect();
                table("loads.csv", &columns)?
            },
        })
    }

    /// The time that the next field output is due [s].
    pub fn next_time(&self) -> Option<f64> {
        self.fields.as_ref().map(|(_, schedule)| schedule.next_time())
    }

    /// Writes what is due. Collective.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_if_due(&mut self, part: &MeshPart, now: &Snapshot) -> Result<(), io::Error> {
        if let Some((file, schedule)) = &mut self.fields
            && schedule.take(now.t)
        {
            let mut values: Vec<(&str, &[f64])> = vec![("velocity", now.u.as_flattened())];
            let scalars =
                [("pressure", now.p), ("phase", now.phi), ("structure_distance", now.distance)];
            for (name, field) in scalars {
                if !field.is_empty() {
                    values.push((name, field));
                }
            }
            file.append(now.t, &values)?;
        }
        if self.gauge_schedule.take(now.t) {
            self.write_bodies(part, now)?;
            if self.gauges.columns.is_empty() {
                return Ok(());
            }
            let values = self.gauges.values(part, now.dry, now.phi, now.p, now.u, &now.riding);
            let row: Vec<f64> = std::iter::once(now.t).chain(values).collect();
            let written = self.gauge_table.as_mut().map_or(Ok(()), |table| table.row(&row));
            io::Error::agree(&part.comm, written)?;
        }
        Ok(())
    }

    fn write_bodies(&mut self, part: &MeshPart, now: &Snapshot) -> Result<(), io::Error> {
        if now.loads.is_empty() {
            return Ok(());
        }
        let mut row = vec![now.t];
        for l in &now.loads {
            for load in [&l.reaction, &l.traction] {
                row.extend(load.force);
                row.extend(load.torque);
            }
            row.push(l.area);
        }
        let written = self.bodies.as_mut().map_or(Ok(()), |table| table.row(&row));
        io::Error::agree(&part.comm, written)
    }

    /// Adds a line to the history: values in the order of its columns. Collective.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write_history(
        &mut self,
        part: &MeshPart,
        values: [f64; HISTORY.len()],
    ) -> Result<(), io::Error> {
        let written = self.history.as_mut().map_or(Ok(()), |table| table.row(&values));
        io::Error::agree(&part.comm, written)
    }
}

/// Names and components of the fields of a case.
fn field_names(case: &Case) -> Vec<(&'static str, usize)> {
    let mut names = vec![("velocity", 3)];
    if case.prescribed_velocity.is_none() {
        names.push(("pressure", 1));
    }
    if case.gas.is_some() {
        names.push(("phase", 1));
    }
    if !case.obstacles.is_empty() || case.bodies.is_some() {
        names.push(("structure_distance", 1));
    }
    names
}

#[cfg(test)]
mod tests {
    use super::Schedule;

    #[test]
    fn a_schedule_is_kept_through_rounding_and_restarts() {
        let mut schedule = Schedule::new(0.1, None);
        assert!(schedule.take(0.0));
        assert!(!schedule.take(0.05));
        assert!(schedule.take(0.1 - 1e-13));
        assert!(!schedule.take(0.15));
        assert!((schedule.next_time() - 0.2).abs() < 1e-15);
        // Late by more than a period: once.
        assert!(schedule.take(0.55));
        assert!(!schedule.take(0.56));
        let restarted = Schedule::new(0.1, Some(0.55));
        assert_eq!(restarted, schedule);
        assert!(Schedule::new(0.0, Some(3.0)).take(3.0));
    }
}
