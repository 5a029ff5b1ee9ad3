//! `fields.vtkhdf`: tetrahedra and nodal fields at many times in one file that ParaView (≥ 5.13) and
//! the `vtk` package (≥ 9.3) open.
//!
//! The file is a temporal `UnstructuredGrid` of the VTKHDF format 2.0 with one part per rank: its own
//! tetrahedra and the nodes they touch (a node between ranks is written by each of them). All ranks
//! write their part together into the one file. Coordinates are f64; fields are f32, half the size and
//! more than a picture needs: checkpoints keep all digits.
//!
//! The file is closed between steps: a run that dies leaves a readable file, a viewer may open it
//! while the run goes on, and no handle outlives MPI.
//!
//! A restart (`FieldsFile::resume`) drops the steps after its time and continues in the same file. On
//! the same pieces of the mesh it uses the mesh that is there, on other pieces (another number of
//! ranks) it adds theirs: each step names the parts it is on.

use crate::Error;
use crate::shared_file::{Open, SharedFile};
use hdf5::types::FixedAscii;
use partition::Communicator;
use std::path::{Path, PathBuf};

const KIND: &str = "UnstructuredGrid";
const TETRAHEDRON: u8 = 10; // VTK_TETRA

/// A nodal field's name and number of components.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldSpec {
    /// As the viewer shows it.
    pub name: String,
    /// 1 for scalars, 3 for vectors.
    pub components: usize,
}

/// The file of one run's fields.
#[derive(Debug)]
pub struct FieldsFile {
    comm: Communicator,
    path: PathBuf,
    fields: Vec<FieldSpec>,
    /// The caller's node of each point of this rank's part.
    nodes: Vec<u32>,
    /// The mesh that new steps are on.
    mesh: MeshBlock,
    /// One field of this rank, as it is written.
    buffer: Vec<f32>,
}

/// Where in the file a mesh begins: the parts of all ranks, one after the other.
#[derive(Clone, Copy, Debug, Default)]
struct MeshBlock {
    part: u64,
    point: u64,
    cell: u64,
    connectivity: u64,
}

/// This rank's part, as it is written.
struct Part {
    points: Vec<f64>,
    connectivity: Vec<i64>,
}

impl FieldsFile {
    /// A new file, in place of any that is there. `nodes` are this rank's coordinates [m]; `tets` are
    /// the tetrahedra it owns, by index into `nodes`: nodes that none of them touches are left out.
    /// `fields` are (name, number of components). Collective.
    pub fn create(
        comm: &Communicator,
        path: &Path,
        nodes: &[[f64; 3]],
        tets: &[[u32; 4]],
        fields: &[(&str, usize)],
    ) -> Result<Self, Error> {
        let (mut this, part) = Self::new(comm, path, nodes, tets, fields);
        let file = SharedFile::open(comm, path, Open::Create)?;
        this.create_tables(&file, &part)?;
        this.append_mesh(&file, &part)?;
        file.close()?;
        Ok(this)
    }

    /// Continues a file: steps after the time `after` [s] are dropped, then new ones are added. If
    /// there is no file yet, it is created. The arguments are those of `create`; the fields must be
    /// those of the file. Collective.
    pub fn resume(
        comm: &Communicator,
        path: &Path,
        after: f64,
        nodes: &[[f64; 3]],
        tets: &[[u32; 4]],
        fields: &[(&str, usize)],
    ) -> Result<Self, Error> {
        if !comm.any(path.exists()) {
            return Self::create(comm, path, nodes, tets, fields);
        }
        let (mut this, part) = Self::new(comm, path, nodes, tets, fields);
        let file = SharedFile::open(comm, path, Open::Change)?;
        this.check_fields(&file)?;
        let steps = steps_until(&file, after)?;
        match this.keep_steps(&file, steps)? {
            Some(mesh) if mesh.is_on(&file, comm, &part)? => this.mesh = mesh,
            _ => this.append_mesh(&file, &part)?,
        }
        file.close()?;
        Ok(this)
    }

    /// Adds the fields (name, nodal values in the caller's numbering, components together) at the
    /// time [s], in the order they were declared. Collective.
    pub fn append(&mut self, time: f64, fields: &[(&str, &[f64])]) -> Result<(), Error> {
        assert_eq!(fields.len(), self.fields.len(), "every declared field is given");
        let file = SharedFile::open(&self.comm, &self.path, Open::Change)?;
        for (declared, (name, values)) in self.fields.iter().zip(fields) {
            assert_eq!(declared.name, *name, "fields are given in the declared order");
            let c = declared.components;
            self.buffer.clear();
            for &node in &self.nodes {
                let at = node as usize * c;
                self.buffer.extend(values[at..at + c].iter().map(|&x| x as f32));
            }
            let rows = file.rows(&point_data(name))?;
            file.append(&point_data(name), &self.buffer)?;
            file.append_row(&offsets(name), &[rows as i64])?;
        }
        let mesh = self.mesh;
        file.append_row("VTKHDF/Steps/Values", &[time])?;
        for (name, value) in [
            ("PartOffsets", mesh.part),
            ("NumberOfParts", self.comm.size() as u64),
            ("PointOffsets", mesh.point),
            ("CellOffsets", mesh.cell),
            ("ConnectivityIdOffsets", mesh.connectivity),
        ] {
            file.append_row(&format!("VTKHDF/Steps/{name}"), &[value as i64])?;
        }
        // The number of steps counts, and comes last: until then a reader sees the file as it was.
        file.flush()?;
        let steps = file.rows("VTKHDF/Steps/Values")?;
        set_steps(&file, steps)?;
        file.close()
    }

    fn new(
        comm: &Communicator,
        path: &Path,
        nodes: &[[f64; 3]],
        tets: &[[u32; 4]],
        fields: &[(&str, usize)],
    ) -> (Self, Part) {
        let mut index = vec![-1i64; nodes.len()];
        for &node in tets.as_flattened() {
            index[node as usize] = 0;
        }
        let used: Vec<u32> =
            (0..nodes.len() as u32).filter(|&node| index[node as usize] == 0).collect();
        for (i, &node) in used.iter().enumerate() {
            index[node as usize] = i as i64;
        }
        let part = Part {
            points: used.iter().flat_map(|&node| nodes[node as usize]).collect(),
            connectivity: tets.as_flattened().iter().map(|&node| index[node as usize]).collect(),
        };
        let fields = fields
            .iter()
            .map(|&(name, components)| FieldSpec { name: name.into(), components })
            .collect();
        let this = Self {
            comm: comm.clone(),
            path: path.into(),
            fields,
            nodes: used,
            mesh: MeshBlock::default(),
            buffer: Vec::new(),
        };
        (this, part)
    }

    fn create_tables(&self, file: &SharedFile, part: &Part) -> Result<(), Error> {
        let n_points = self.comm.sum_u64(part.n_points());
        let n_cells = self.comm.sum_u64(part.n_cells());
        let ranks = self.comm.size() as u64;
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
        for name in ["NumberOfPoints", "NumberOfCells", "NumberOfConnectivityIds"] {
            file.create_table::<i64>(&format!("VTKHDF/{name}"), 0, ranks)?;
        }
        file.create_table::<f64>("VTKHDF/Points", 3, n_points)?;
        file.create_table::<i64>("VTKHDF/Connectivity", 0, 4 * n_cells)?;
        file.create_table::<i64>("VTKHDF/Offsets", 0, n_cells + ranks)?;
        file.create_table::<u8>("VTKHDF/Types", 0, n_cells)?;
        file.create_table::<f64>("VTKHDF/Steps/Values", 0, STEPS)?;
        for (name, columns) in STEP_TABLES {
            file.create_table::<i64>(&format!("VTKHDF/Steps/{name}"), columns, STEPS)?;
        }
        for FieldSpec { name, components } in &self.fields {
            let columns = if *components == 1 { 0 } else { *components };
            file.create_table::<f32>(&point_data(name), columns, n_points)?;
            file.create_table::<i64>(&offsets(name), 0, STEPS)?;
        }
        Ok(())
    }

    /// Adds all ranks' parts; steps from now on are on them.
    fn append_mesh(&mut self, file: &SharedFile, part: &Part) -> Result<(), Error> {
        self.mesh = MeshBlock {
            part: file.rows("VTKHDF/NumberOfPoints")?,
            point: file.rows("VTKHDF/Points")?,
            cell: file.rows("VTKHDF/Types")?,
            connectivity: file.rows("VTKHDF/Connectivity")?,
        };
        let n_cells = part.n_cells() as i64;
        file.append("VTKHDF/NumberOfPoints", &[part.n_points() as i64])?;
        file.append("VTKHDF/NumberOfCells", &[n_cells])?;
        file.append("VTKHDF/NumberOfConnectivityIds", &[4 * n_cells])?;
        file.append("VTKHDF/Points", &part.points)?;
        file.append("VTKHDF/Connectivity", &part.connectivity)?;
        let offsets: Vec<i64> = (0..=n_cells).map(|cell| 4 * cell).collect();
        file.append("VTKHDF/Offsets", &offsets)?;
        file.append("VTKHDF/Types", &vec![TETRAHEDRON; n_cells as usize])
    }

    /// The file must be one of this program's, with the same fields.
    fn check_fields(&self, file: &SharedFile) -> Result<(), Error> {
        let describe = |name: &str, components: usize| match components {
            1 => name.to_string(),
            _ => format!("{name} ({components})"),
        };
        let found = || -> hdf5::Result<Vec<String>> {
            let group = file.root().group("VTKHDF/PointData")?;
            let components = |name: &String| -> hdf5::Result<usize> {
                Ok(group.dataset(name)?.shape().get(1).copied().unwrap_or(1))
            };
            let names = group.member_names()?;
            names.iter().map(|name| Ok(describe(name, components(name)?))).collect()
        };
        let mut found = file.agree("read the fields", found())?;
        let mut declared: Vec<String> =
            self.fields.iter().map(|field| describe(&field.name, field.components)).collect();
        found.sort();
        declared.sort();
        if found == declared {
            return Ok(());
        }
        let (found, declared) = (found.join(", "), declared.join(", "));
        Err(Error::file(
            &self.path,
            format!("holds {found}, but this run writes {declared}: write to another directory"),
        ))
    }

    /// Cuts the file after its first `steps` steps and the meshes they are on; returns the mesh of the
    /// last of them.
    fn keep_steps(&self, file: &SharedFile, steps: u64) -> Result<Option<MeshBlock>, Error> {
        set_steps(file, steps)?;
        let last = |name: &str| match steps {
            0 => Ok(0),
            _ => Ok(file.read::<i64>(&format!("VTKHDF/Steps/{name}"), steps - 1, 1)?[0] as u64),
        };
        let mesh = MeshBlock {
            part: last("PartOffsets")?,
            point: last("PointOffsets")?,
            cell: last("CellOffsets")?,
            connectivity: last("ConnectivityIdOffsets")?,
        };
        let parts = last("NumberOfParts")?;
        let sum = |name: &str| -> Result<u64, Error> {
            Ok(file.read::<i64>(name, mesh.part, parts)?.iter().sum::<i64>() as u64)
        };
        let points = sum("VTKHDF/NumberOfPoints")?;
        let cells = sum("VTKHDF/NumberOfCells")?;
        for FieldSpec { name, .. } in &self.fields {
            let rows = last(&format!("PointDataOffsets/{name}"))? + points;
            file.truncate(&point_data(name), rows)?;
            file.truncate(&offsets(name), steps)?;
        }
        file.truncate("VTKHDF/Steps/Values", steps)?;
        for (name, _) in STEP_TABLES {
            file.truncate(&format!("VTKHDF/Steps/{name}"), steps)?;
        }
        for name in ["NumberOfPoints", "NumberOfCells", "NumberOfConnectivityIds"] {
            file.truncate(&format!("VTKHDF/{name}"), mesh.part + parts)?;
        }
        file.truncate("VTKHDF/Points", mesh.point + points)?;
        file.truncate("VTKHDF/Types", mesh.cell + cells)?;
        file.truncate("VTKHDF/Connectivity", mesh.connectivity + 4 * cells)?;
        file.truncate("VTKHDF/Offsets", mesh.cell + cells + mesh.part + parts)?;
        Ok((steps > 0).then_some(mesh))
    }
}

impl MeshBlock {
    /// Whether the mesh in the file is, part by part, the ranks' mesh. It is the file's last one.
    fn is_on(&self, file: &SharedFile, comm: &Communicator, part: &Part) -> Result<bool, Error> {
        if file.rows("VTKHDF/NumberOfPoints")? - self.part != comm.size() as u64 {
            return Ok(false);
        }
        let my_part = self.part + comm.rank() as u64;
        let points = file.read::<i64>("VTKHDF/NumberOfPoints", my_part, 1)?[0] as u64;
        let cells = file.read::<i64>("VTKHDF/NumberOfCells", my_part, 1)?[0] as u64;
        if comm.any(points != part.n_points() || cells != part.n_cells()) {
            return Ok(false);
        }
        let first_point = self.point + comm.exclusive_sum(points);
        let first_id = self.connectivity + comm.exclusive_sum(4 * cells);
        let same = file.read::<f64>("VTKHDF/Points", first_point, points)? == part.points
            && file.read::<i64>("VTKHDF/Connectivity", first_id, 4 * cells)? == part.connectivity;
        Ok(!comm.any(!same))
    }
}

impl Part {
    fn n_points(&self) -> u64 {
        self.points.len() as u64 / 3
    }
    fn n_cells(&self) -> u64 {
        self.connectivity.len() as u64 / 4
    }
}

/// Rows per chunk of the tables with a row per step.
const STEPS: u64 = 1024;

/// Tables of `Steps` and their columns (0: one-dimensional), as the format wants them.
const STEP_TABLES: [(&str, usize); 5] = [
    ("PartOffsets", 0),
    ("NumberOfParts", 0),
    ("PointOffsets", 0),
    ("CellOffsets", 1),
    ("ConnectivityIdOffsets", 1),
];

fn point_data(name: &str) -> String {
    format!("VTKHDF/PointData/{name}")
}

fn offsets(name: &str) -> String {
    format!("VTKHDF/Steps/PointDataOffsets/{name}")
}

fn set_steps(file: &SharedFile, steps: u64) -> Result<(), Error> {
    let written =
        (|| file.root().group("VTKHDF/Steps")?.attr("NSteps")?.write_scalar(&(steps as i64)))();
    file.agree("write NSteps", written)
}

/// Number of leading steps up to and including the time.
fn steps_until(file: &SharedFile, time: f64) -> Result<u64, Error> {
    let steps = (|| file.root().group("VTKHDF/Steps")?.attr("NSteps")?.read_scalar::<i64>())();
    let steps = file.agree("read NSteps", steps)?;
    let times = file.read::<f64>("VTKHDF/Steps/Values", 0, steps as u64)?;
    Ok(times.iter().take_while(|&&t| t <= time).count() as u64)
}
