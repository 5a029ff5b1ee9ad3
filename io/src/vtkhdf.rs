//! `fields.vtkhdf`: tetrahedra and nodal fields at many times in one file that ParaView (≥ 5.13) and
//! the `vtk` package (≥ 9.3) open.
//!
//! The file is a temporal `UnstructuredGrid` of the VTKHDF format 2.0. Nodes and tetrahedra stand in
//! the order of their global ids, as one grid, each once: the file does not depend on the number of
//! ranks, pictures have no seams, and a restart on any number of ranks goes on in the same file. (One
//! part per rank would change the mesh within the file at such a restart: VTK 9.7 then shows wrong or
//! empty parts when going back in time.) All ranks write together, a contiguous piece each.
//!
//! Coordinates are f64; fields are f32, half the size and more than a picture needs: checkpoints keep
//! all digits.
//!
//! The file is closed between steps: a run that dies leaves a readable file, a viewer may open it
//! while the run goes on, and no handle outlives MPI.

use crate::Error;
use crate::blocks::ToBlocks;
use crate::room::room;
use crate::shared_file::{Open, SharedFile};
use hdf5::types::FixedAscii;
use partition::{Communicator, IndexMap};
use std::path::{Path, PathBuf};

const KIND: &str = "UnstructuredGrid";
const TETRAHEDRON: u8 = 10; // VTK_TETRA

/// What a rank knows of the mesh. Global ids of nodes and of tetrahedra count from 0 without gaps and
/// do not depend on the number of ranks.
#[derive(Clone, Copy, Debug)]
pub struct FieldsMesh<'a> {
    /// Owned nodes first.
    pub nodes: &'a IndexMap,
    /// Coordinates of the nodes [m], owned ones at least.
    pub points: &'a [[f64; 3]],
    /// The tetrahedra that this rank owns, by local node.
    pub tets: &'a [[u32; 4]],
    /// Their global ids.
    pub tet_ids: &'a [u64],
}

/// The file of one run's fields.
#[derive(Debug)]
pub struct FieldsFile {
    comm: Communicator,
    path: PathBuf,
    /// Name and number of components.
    fields: Vec<(String, usize)>,
    nodes: ToBlocks,
}

impl FieldsFile {
    /// A new file, in place of any that is there, for `fields` of (name, number of components).
    /// Collective.
    pub fn create(
        comm: &Communicator,
        path: &Path,
        mesh: FieldsMesh,
        fields: &[(&str, usize)],
    ) -> Result<Self, Error> {
        room(comm, path, (24 * mesh.nodes.n_owned + 41 * mesh.tets.len()) as u64)?;
        let (this, tables) = Self::new(comm, path, mesh, fields);
        let file = SharedFile::open(comm, path, Open::Create)?;
        this.create_tables(&file, &tables)?;
        tables.write(&file)?;
        file.close()?;
        Ok(this)
    }

    /// Continues a file: steps after the time `after` [s] are dropped, then new ones are added. If
    /// there is no file yet, it is created. Mesh and fields must be those of the file. Collective.
    pub fn resume(
        comm: &Communicator,
        path: &Path,
        after: f64,
        mesh: FieldsMesh,
        fields: &[(&str, usize)],
    ) -> Result<Self, Error> {
        if !comm.any(path.exists()) {
            return Self::create(comm, path, mesh, fields);
        }
        let (this, tables) = Self::new(comm, path, mesh, fields);
        let file = SharedFile::open(comm, path, Open::Change)?;
        this.check_fields(&file)?;
        if !tables.are_in(&file, comm)? {
            return Err(Error::file(path, "holds another mesh: write to another directory"));
        }
        let steps = steps_until(&file, after)?;
        set_steps(&file, steps)?;
        for (name, _) in &this.fields {
            file.truncate(&point_data(name), steps * this.nodes.total())?;
            file.truncate(&offsets(name), steps)?;
        }
        file.truncate("VTKHDF/Steps/Values", steps)?;
        for (name, _) in STEP_TABLES {
            file.truncate(name, steps)?;
        }
        file.close()?;
        Ok(this)
    }

    /// Adds the fields (name, values of the local nodes, components together) at the time [s], in the
    /// order they were declared. Collective.
    pub fn append(&mut self, time: f64, fields: &[(&str, &[f64])]) -> Result<(), Error> {
        assert_eq!(fields.len(), self.fields.len(), "every declared field is given");
        let values: usize = fields.iter().map(|(_, values)| values.len()).sum();
        room(&self.comm, &self.path, 4 * values as u64)?;
        let file = SharedFile::open(&self.comm, &self.path, Open::Change)?;
        for ((declared, components), (name, values)) in self.fields.iter().zip(fields) {
            assert_eq!(declared, name, "fields are given in the declared order");
            let rows = self.nodes.rows(*components, |i| values[i] as f32);
            let before = file.rows(&point_data(name))?;
            file.append(&point_data(name), &rows)?;
            file.append_row(&offsets(name), &[before as i64])?;
        }
        file.append_row("VTKHDF/Steps/Values", &[time])?;
        for (name, value) in STEP_TABLES {
            file.append_row(name, &[value])?;
        }
        // The number of steps counts, and comes last: until then a reader sees the file as it was.
        file.flush()?;
        set_steps(&file, file.rows("VTKHDF/Steps/Values")?)?;
        file.close()
    }

    fn new(
        comm: &Communicator,
        path: &Path,
        mesh: FieldsMesh,
        fields: &[(&str, usize)],
    ) -> (Self, MeshTables) {
        let nodes = ToBlocks::new(comm, &mesh.nodes.global[..mesh.nodes.n_owned]);
        let tables = MeshTables::new(comm, mesh, &nodes);
        let fields = fields.iter().map(|&(name, c)| (name.to_string(), c)).collect();
        (Self { comm: comm.clone(), path: path.into(), fields, nodes }, tables)
    }

    fn create_tables(&self, file: &SharedFile, mesh: &MeshTables) -> Result<(), Error> {
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
        for name in COUNTS {
            file.create_table::<i64>(name, 0, 1)?;
        }
        file.create_table::<f64>("VTKHDF/Points", 3, mesh.n_points)?;
        file.create_table::<i64>("VTKHDF/Connectivity", 0, 4 * mesh.n_tets)?;
        file.create_table::<i64>("VTKHDF/Offsets", 0, mesh.n_tets + 1)?;
        file.create_table::<u8>("VTKHDF/Types", 0, mesh.n_tets)?;
        file.create_table::<f64>("VTKHDF/Steps/Values", 0, STEPS)?;
        for (name, _) in STEP_TABLES {
            let columns = usize::from(name.contains("Cell") || name.contains("Connectivity"));
            file.create_table::<i64>(name, columns, STEPS)?;
        }
        for (name, components) in &self.fields {
            let columns = if *components == 1 { 0 } else { *components };
            file.create_table::<f32>(&point_data(name), columns, mesh.n_points)?;
            file.create_table::<i64>(&offsets(name), 0, STEPS)?;
        }
        Ok(())
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
            self.fields.iter().map(|(name, components)| describe(name, *components)).collect();
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
}

/// The rows of the mesh that this rank writes.
struct MeshTables {
    n_points: u64,
    n_tets: u64,
    first_point: u64,
    points: Vec<f64>,
    first_tet: u64,
    connectivity: Vec<i64>,
}

impl MeshTables {
    fn new(comm: &Communicator, mesh: FieldsMesh, nodes: &ToBlocks) -> Self {
        let tets = ToBlocks::new(comm, mesh.tet_ids);
        let corners = mesh.tets.as_flattened();
        Self {
            n_points: nodes.total(),
            n_tets: tets.total(),
            first_point: nodes.mine().start,
            points: nodes.rows(3, |i| mesh.points.as_flattened()[i]),
            first_tet: tets.mine().start,
            connectivity: tets.rows(4, |i| mesh.nodes.global[corners[i] as usize] as i64),
        }
    }

    fn write(&self, file: &SharedFile) -> Result<(), Error> {
        for (name, count) in COUNTS.into_iter().zip([self.n_points, self.n_tets, 4 * self.n_tets]) {
            file.append_row(name, &[count as i64])?;
        }
        file.append("VTKHDF/Points", &self.points)?;
        file.append("VTKHDF/Connectivity", &self.connectivity)?;
        let n = self.connectivity.len() / 4;
        let ends: Vec<i64> = (1..=n as i64).map(|i| 4 * (self.first_tet as i64 + i)).collect();
        file.append_row("VTKHDF/Offsets", &[0i64])?;
        file.append("VTKHDF/Offsets", &ends)?;
        file.append("VTKHDF/Types", &vec![TETRAHEDRON; n])
    }

    /// Whether the file's mesh is this one, to the last bit.
    fn are_in(&self, file: &SharedFile, comm: &Communicator) -> Result<bool, Error> {
        if file.rows("VTKHDF/Points")? != self.n_points || file.rows("VTKHDF/Types")? != self.n_tets
        {
            return Ok(false);
        }
        let n = self.points.len() as u64 / 3;
        let points: Vec<f64> = file.read("VTKHDF/Points", self.first_point, n)?;
        let n = self.connectivity.len() as u64;
        let connectivity: Vec<i64> = file.read("VTKHDF/Connectivity", 4 * self.first_tet, n)?;
        Ok(!comm.any(points != self.points || connectivity != self.connectivity))
    }
}

/// Sizes of the one part.
const COUNTS: [&str; 3] =
    ["VTKHDF/NumberOfPoints", "VTKHDF/NumberOfCells", "VTKHDF/NumberOfConnectivityIds"];

/// Rows per chunk of the tables with a row per step.
const STEPS: u64 = 1024;

/// Where each step finds its mesh: always the same one.
const STEP_TABLES: [(&str, i64); 5] = [
    ("VTKHDF/Steps/PartOffsets", 0),
    ("VTKHDF/Steps/NumberOfParts", 1),
    ("VTKHDF/Steps/PointOffsets", 0),
    ("VTKHDF/Steps/CellOffsets", 0),
    ("VTKHDF/Steps/ConnectivityIdOffsets", 0),
];

fn point_data(name: &str) -> String {
    format!("VTKHDF/PointData/{name}")
}

fn offsets(name: &str) -> String {
    format!("VTKHDF/Steps/PointDataOffsets/{name}")
}

fn set_steps(file: &SharedFile, steps: u64) -> Result<(), Error> {
    let attribute = || file.root().group("VTKHDF/Steps")?.attr("NSteps");
    file.agree("write NSteps", attribute().and_then(|a| a.write_scalar(&(steps as i64))))
}

/// Number of leading steps up to and including the time.
fn steps_until(file: &SharedFile, time: f64) -> Result<u64, Error> {
    let attribute = || file.root().group("VTKHDF/Steps")?.attr("NSteps");
    let steps = file.agree("read NSteps", attribute().and_then(|a| a.read_scalar::<i64>()))?;
    let times: Vec<f64> = file.read("VTKHDF/Steps/Values", 0, steps as u64)?;
    Ok(times.iter().take_while(|&&t| t <= time).count() as u64)
}
