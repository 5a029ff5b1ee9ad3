//! Case → this rank's part of the mesh and the initial state.

pub mod bodies;
pub mod solids;
mod terrain;
mod walls;

use crate::case::nearest::did_you_mean;
use crate::case::{Case, CaseError, MeshSource};
use crate::cut::CutMesh;
use crate::flow::{Flow, Material};
use crate::linear::NodeGraph;
use crate::mesh::quality::{self, Quality};
use crate::mesh::tetrahedron::Tetrahedron;
use crate::mesh::{Mesh, MeshError, MeshPart, boxes, import};
use crate::phase::{Phase, inflow::Inflow, initial};
use partition::Communicator;

/// Reads or generates the mesh on rank 0, splits and refines it. Collective.
///
/// # Errors
/// A mesh that cannot be read or is broken; a boundary of the case that the mesh does not have.
pub fn mesh(case: &Case, comm: &Communicator) -> Result<(MeshPart, Option<Quality>), SetupError> {
    if case.mesh == MeshSource::Nothing {
        return Ok((MeshPart::nothing(comm), None));
    }
    let built = if comm.rank() == 0 { read(case).map(Some) } else { Ok(None) };
    let (mesh, quality) = match comm.agree(built).map_err(SetupError::Elsewhere)? {
        Some((mesh, quality)) => (Some(mesh), Some(quality)),
        None => (None, None),
    };
    let part = MeshPart::distribute(comm, mesh, case.refine)?;
    for (name, _) in &case.boundaries {
        if !part.mesh.boundary_names.contains(name) {
            let names: Vec<&str> = part.mesh.boundary_names.iter().map(|n| &**n).collect();
            let hint = did_you_mean(name, &names, "names");
            let message = format!("the mesh has no boundary of this name; {hint}");
            return Err(case.source.error(&format!("boundaries.{name}"), message).into());
        }
    }
    Ok((part, quality))
}

/// The whole mesh, checked: rank 0 alone does this.
fn read(case: &Case) -> Result<(Mesh, Quality), CaseError> {
    let (key, mesh) = match &case.mesh {
        MeshSource::Box(block) => ("mesh.box", boxes::box_mesh(block)),
        MeshSource::Nothing => unreachable!("asked before"),
        MeshSource::Gmsh(path) => {
            let file = io::gmsh::read(path);
            let file = file.map_err(|e| case.source.error("mesh.file", e.to_string()))?;
            ("mesh.file", import::import(file.nodes, file.tets, &file.triangles, file.names))
        }
    };
    let broken = |e: MeshError| case.source.error(key, e.to_string());
    let mesh = mesh.map_err(broken)?;
    let quality = quality::check(&mesh).map_err(broken)?;
    Ok((mesh, quality))
}

/// Why a simulation cannot start.
#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    /// The case asks for what is not there.
    #[error(transparent)]
    Case(#[from] CaseError),
    /// The mesh is broken or cannot be distributed.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A file cannot be read.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// What another rank found wrong.
    #[error("{0}")]
    Elsewhere(String),
}

/// (6V)^(1/3) of the smallest element [m]: the cell size where the mesh is a grid. Collective.
pub fn smallest_cell(part: &MeshPart) -> f64 {
    let volume = |e: usize| Tetrahedron::of(&part.mesh, e).volume;
    let least = (0..part.n_owned_elements).map(volume).fold(f64::INFINITY, f64::min);
    (6.0 * part.comm.min(least)).cbrt()
}

/// Initial velocity at local nodes [m/s].
pub fn velocity(case: &Case, part: &MeshPart) -> Vec<[f64; 3]> {
    let formula = &case.initial.velocity;
    part.mesh.nodes.iter().map(|&x| std::array::from_fn(|k| formula[k].at(x, 0.0))).collect()
}

/// What all nodal matrices of a part share. Collective.
pub fn graph(part: &MeshPart) -> NodeGraph {
    NodeGraph::new(&part.comm, &part.nodes, &part.exchange, &part.mesh.tets)
}

/// The flow at t = 0, unless its velocity is given for all times or there is no fluid.
pub fn flow(case: &Case, part: &MeshPart, cut: &CutMesh, graph: &NodeGraph) -> Option<Flow> {
    let computed = case.prescribed_velocity.is_none() && case.mesh != MeshSource::Nothing;
    computed.then(|| Flow::new(case, part, cut, graph, velocity(case, part)))
}

/// The phase field at t = 0, unless there is only one fluid. Collective.
pub fn phase(
    case: &Case,
    part: &MeshPart,
    cut: &CutMesh,
    graph: &NodeGraph,
    inflow: &Inflow,
) -> Option<Phase> {
    case.gas?;
    let mut distance: Vec<f64> = match &case.initial.water {
        Some(formula) => part.mesh.nodes.iter().map(|&x| formula.at(x, 0.0)).collect(),
        None => vec![f64::MAX; part.n_local()],
    };
    let cell = initial::cell_size(part, &distance);
    if let Some((amplitude, seed)) = case.initial.noise {
        for (d, &id) in distance.iter_mut().zip(&part.nodes.global) {
            *d += amplitude * noise(seed, id);
        }
    }
    let delta = crate::phase::delta(&case.free_surface, cell);
    let phi = initial::profile(&distance, delta);
    let mut phase = Phase::new(
        part,
        cut,
        graph,
        &case.free_surface,
        &case.solver,
        cell,
        phi,
        inflow.faces.clone(),
    );
    if case.prescribed_velocity.is_none() {
        phase.feel(reduced_gravity(case));
    }
    Some(phase)
}

/// g (ρ_l − ρ_g)/(ρ_l + ρ_g) [m/s²].
fn reduced_gravity(case: &Case) -> f64 {
    let (liquid, gas) = (case.liquid.density, case.gas.map_or(0.0, |gas| gas.density));
    crate::fem::norm(case.gravity) * ((liquid - gas) / (liquid + gas)).abs()
}

/// The material at t = 0.
pub fn material(case: &Case, part: &MeshPart, phase: Option<&Phase>) -> Material {
    let mut material = Material::new(case, part.n_local());
    if let Some(phase) = phase {
        material.set_phase(&phase.phi);
    }
    material
}

/// Uniform in [−1, 1], the same for a node on any number of ranks (splitmix64).
fn noise(seed: u64, node: u64) -> f64 {
    let mut z = seed.wrapping_add(node.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^= z >> 31;
    (z >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}
