//! `bodies.vtkhdf`: triangle surfaces that move, at many times in one file that ParaView (≥ 5.13) and the
//! `vtk` package (≥ 9.3) open.
//!
//! A temporal `UnstructuredGrid` of triangles of the VTKHDF format 2.0 whose points are written anew at each
//! time. Points stand in the order of their global ids, as one grid: the file does not depend on ranks.

use crate::Error;
use crate::blocks::ToBlocks;
use crate::room::room;
use crate::shared_file::{Open, SharedFile};
use hdf5::types::FixedAscii;
use partition::Communicator;
use std::path::{Path, PathBuf};

const KIND: &str = "UnstructuredGrid";
const TRIANGLE: u8 = 5; // VTK_TRIANGLE
const STEPS: u64 = 1024;

/// The file of one run's surfaces.
#[derive(Debug)]
pub struct MovingFile {
    comm: Communicator,
    path: PathBuf,
    /// Name and number of components.
    fields: Vec<(String, usize)>,
    n_points: u64,
}

impl MovingFile {
    /// A new file, in place of any that is there: `triangles` by global point id (the first rank's count)
    /// and `fields` of (name, number of components) at points. Collective.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn create(
        comm: &Communicator,
        path: &Path,
        n_points: u64,
        triangles: &[[u64; 3]],
        fields: &[(&str, usize)],
    ) -> Result<Self, Error> {
        let this = Self {
            comm: comm.clone(),
            path: path.into(),
            fields: fields.iter().map(|&(name, c)| (name.into(), c)).collect(),
            n_points,
        };
        let file = SharedFile::open(comm, path, Open::Create)?;
        this.create_tables(&file, triangles)?;
        file.close()?;
        Ok(this)
    }

    /// Continues a file: steps after the time `after` [s] are dropped. If there is none, it is created.
    /// Collective.
    ///
    /// # Errors
    /// It cannot be written, or is of other surfaces.
    pub fn resume(
        comm: &Communicator,
        path: &Path,
        after: f64,
        n_points: u64,
        triangles: &[[u64; 3]],
        fields: &[(&str, usize)],
    ) -> Result<Self, Error> {
        if !comm.any(path.exists()) {
            return Self::create(comm, path, n_points, triangles, fields);
        }
        let fields = fields.iter().map(|&(name, c)| (name.to_string(), c)).collect();
        let this = Self { comm: comm.clone(), path: path.into(), fields, n_points };
        let file = SharedFile::open(comm, path, Open::Change)?;
        if file.rows("VTKHDF/Types")? != triangles.len() as u64 {
            return Err(Error::file(path, "holds other surfaces: write to another directory"));
        }
        let all = file.rows("VTKHDF/Steps/Values")?;
        let times: Vec<f64> = file.read("VTKHDF/Steps/Values", 0, all)?;
        let steps = times.iter().take_while(|&&t| t <= after).count() as u64;
        this.set_steps(&file, steps)?;
        file.truncate("VTKHDF/Points", steps * n_points)?;
        for (name, _) in &this.fields {
            file.truncate(&point_data(name), steps * n_points)?;
            file.truncate(&offsets(name), steps)?;
        }
        file.truncate("VTKHDF/Steps/Values", steps)?;
        for name in STEP_TABLES {
            file.truncate(name, steps)?;
        }
        file.close()?;
        Ok(this)
    }

    /// Adds a time [s]: the points with these ids, all ranks' together each once, and their fields, in the
    /// order they were declared, components together. Collective.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn append(
        &mut self,
        time: f64,
        ids: &[u64],
        points: &[[f64; 3]],
        fields: &[&[f64]],
    ) -> Result<(), Error> {
        assert_eq!(fields.len(), self.fields.len(), "every declared field is given");
        let values: usize = fields.iter().map(|values| values.len()).sum();
        room(&self.comm, &self.path, 4 * (values + 3 * points.len()) as u64)?;
        let to_blocks = ToBlocks::new(&self.comm, ids);
        let file = SharedFile::open(&self.comm, &self.path, Open::Change)?;
        let step = file.rows("VTKHDF/Steps/Values")?;
        let first = (step * self.n_points) as i64;
        file.append("VTKHDF/Points", &to_blocks.rows(3, |i| points.as_flattened()[i] as f32))?;
        for ((name, components), values) in self.fields.iter().zip(fields) {
            let rows = to_blocks.rows(*components, |i| values[i] as f32);
            file.append(&point_data(name), &rows)?;
            file.append_row(&offsets(name), &[first])?;
        }
        file.append_row("VTKHDF/Steps/Values", &[time])?;
        for name in STEP_TABLES {
            let value = match name {
                "VTKHDF/Steps/NumberOfParts" => 1,
                "VTKHDF/Steps/PointOffsets" => first,
                _ => 0,
            };
            file.append_row(name, &[value])?;
        }
        // The number of steps counts, and comes last: until then a reader sees the file as it was.
        file.flush()?;
        self.set_steps(&file, step + 1)?;
        file.close()
    }

    fn create_tables(&self, file: &SharedFile, triangles: &[[u64; 3]]) -> Result<(), Error> {
        let groups =
            ["VTKHDF", "VTKHDF/PointData", "VTKHDF/Steps", "VTKHDF/Steps/PointDataOffsets"];
        for group in groups {
            file.agree("create groups", file.root().create_group(group))?;
        }
        let attributes = || {
            let root = file.root().group("VTKHDF")?;
            root.new_attr::<i64>().shape(2).create("Version")?.write_raw(&[2i64, 0])?;
            let kind = FixedAscii::<{ KIND.len() }>::from_ascii(KIND).expect("the name is ASCII");
            root.new_attr::<FixedAscii<{ KIND.len() }>>().create("Type")?.write_scalar(&kind)?;
            let steps = file.root().group("VTKHDF/Steps")?;
            steps.new_attr::<i64>().create("NSteps")?.write_scalar(&0i64)
        };
        file.agree("write attributes", attributes())?;
        let n = triangles.len() as u64;
        let counts = [
            ("NumberOfPoints", self.n_points),
            ("NumberOfCells", n),
            ("NumberOfConnectivityIds", 3 * n),
        ];
        for (name, count) in counts {
            let name = format!("VTKHDF/{name}");
            file.create_table::<i64>(&name, 0, 1)?;
            file.append_row(&name, &[count as i64])?;
        }
        file.create_table::<f32>("VTKHDF/Points", 3, self.n_points)?;
        file.create_table::<i64>("VTKHDF/Connectivity", 0, 3 * n)?;
        file.create_table::<i64>("VTKHDF/Offsets", 0, n + 1)?;
        file.create_table::<u8>("VTKHDF/Types", 0, n)?;
        file.create_table::<f64>("VTKHDF/Steps/Values", 0, STEPS)?;
        for name in STEP_TABLES {
            let columns = usize::from(name.contains("Cell") || name.contains("Connectivity"));
            file.create_table::<i64>(name, columns, STEPS)?;
        }
        for (name, components) in &self.fields {
            let columns = if *components == 1 { 0 } else { *components };
            file.create_table::<f32>(&point_data(name), columns, self.n_points)?;
            file.create_table::<i64>(&offsets(name), 0, STEPS)?;
        }
        let corners: Vec<i64> = triangles.as_flattened().iter().map(|&v| v as i64).collect();
        let ends: Vec<i64> = (0..=n as i64).map(|i| 3 * i).collect();
        file.append_row("VTKHDF/Connectivity", &corners)?;
        file.append_row("VTKHDF/Offsets", &ends)?;
        file.append_row("VTKHDF/Types", &vec![TRIANGLE; triangles.len()])
    }

    fn set_steps(&self, file: &SharedFile, steps: u64) -> Result<(), Error> {
        let attribute = || file.root().group("VTKHDF/Steps")?.attr("NSteps");
        file.agree("write NSteps", attribute().and_then(|a| a.write_scalar(&(steps as i64))))
    }
}

/// Where each step finds what: triangles always the same, points its own.
const STEP_TABLES: [&str; 5] = [
    "VTKHDF/Steps/PartOffsets",
    "VTKHDF/Steps/NumberOfParts",
    "VTKHDF/Steps/PointOffsets",
    "VTKHDF/Steps/CellOffsets",
    "VTKHDF/Steps/ConnectivityIdOffsets",
];

fn point_data(name: &str) -> String {
    format!("VTKHDF/PointData/{name}")
}

fn offsets(name: &str) -> String {
    format!("VTKHDF/Steps/PointDataOffsets/{name}")
}
