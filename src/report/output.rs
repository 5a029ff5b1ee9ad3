//! The files of a run: fields, gauges, history.

use crate::case::Case;
use crate::flow::{Flow, Material};
use crate::mesh::MeshPart;
use crate::phase::Phase;
use io::{FieldsFile, vtkhdf::FieldsMesh};
use std::path::{Path, PathBuf};

/// Fields as the viewer shows them, with their components.
const FLOW_FIELDS: [(&str, usize); 2] = [("velocity", 3), ("pressure", 1)];
const PHASE_FIELDS: [(&str, usize); 1] = [("phase", 1)];

/// The field file of a run, and when it is next due.
pub struct Fields {
    file: FieldsFile,
    every: f64,
    next: u64,
}

impl Fields {
    /// Opens `fields.vtkhdf` in `folder`, if the case wants fields; after the time `resume` [s] of an
    /// interrupted run, if given. Collective.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn open(
        case: &Case,
        part: &MeshPart,
        folder: &Path,
        flow: bool,
        phase: bool,
        resume: Option<f64>,
    ) -> Result<Option<Self>, io::Error> {
        let Some(every) = case.output.fields_every else { return Ok(None) };
        let path: PathBuf = folder.join("fields.vtkhdf");
        let mut fields: Vec<(&str, usize)> = Vec::new();
        if flow {
            fields.extend(FLOW_FIELDS);
        }
        if phase {
            fields.extend(PHASE_FIELDS);
        }
        let owned = part.n_owned_elements;
        let mesh = FieldsMesh {
            nodes: &part.nodes,
            points: &part.mesh.nodes,
            tets: &part.mesh.tets[..owned],
            tet_ids: &part.element_global[..owned],
        };
        let file = match resume {
            None => FieldsFile::create(&part.comm, &path, mesh, &fields)?,
            Some(t) => FieldsFile::resume(&part.comm, &path, t, mesh, &fields)?,
        };
        let next = resume.map_or(0, |t| due(t, every));
        Ok(Some(Self { file, every, next }))
    }

    /// Time of the next output [s].
    pub fn next_time(&self) -> f64 {
        self.next as f64 * self.every
    }

    /// Writes the state at `t` if it is due. Collective.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write_if_due(
        &mut self,
        t: f64,
        flow: Option<&Flow>,
        phase: Option<&Phase>,
        _material: &Material,
    ) -> Result<(), io::Error> {
        if due(t, self.every) <= self.next && self.next_time() > t * (1.0 + 1e-9) {
            return Ok(());
        }
        self.next = due(t, self.every);
        let mut values: Vec<(&str, &[f64])> = Vec::new();
        if let Some(flow) = flow {
            values.push(("velocity", flow.u.as_flattened()));
            values.push(("pressure", &flow.p));
        }
        if let Some(phase) = phase {
            values.push(("phase", &phase.phi));
        }
        self.file.append(t, &values)
    }
}

/// Number of the first output after `t`.
fn due(t: f64, every: f64) -> u64 {
    (t / every * (1.0 + 1e-9)).floor() as u64 + 1
}
