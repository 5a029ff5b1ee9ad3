//! `summary.json`: what was run, on what, and what it cost.

use super::stages::Stages;
use crate::case::Case;
use crate::mesh::MeshPart;
use crate::mesh::balance::Balance;
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::path::Path;

/// The summary of a run.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    title: String,
    version: &'static str,
    /// SHA-256 of the case as used.
    case_hash: String,
    ranks: usize,
    nodes: u64,
    elements: u64,
    /// Largest over mean number of elements on a rank.
    imbalance: f64,
    /// Faces between ranks.
    cut_faces: u64,
    /// Halo of each rank: neighbours, ghost nodes.
    neighbours: Vec<u64>,
    ghost_nodes: Vec<u64>,
    /// Halo exchanges of nodal values: messages and bytes sent by all ranks.
    halo_messages: f64,
    halo_bytes: f64,
    steps: u64,
    t: f64,
    /// The whole run [s].
    wall_seconds: f64,
    flow_iterations: u64,
    /// Bodies that left the mesh.
    bodies_left: u64,
    stages: Vec<Stage>,
    /// Peak memory of each rank [MB].
    memory_peak_mb: Vec<f64>,
}

/// Wall time of a stage [s].
#[derive(Clone, Debug, Serialize)]
struct Stage {
    name: &'static str,
    calls: u64,
    min: f64,
    mean: f64,
    max: f64,
}

/// What the run itself knows.
#[derive(Clone, Copy, Debug)]
pub struct Totals {
    /// Steps of this run.
    pub steps: u64,
    /// Where it ended [s].
    pub t: f64,
    /// Wall time [s].
    pub wall_seconds: f64,
    /// Iterations of the flow's solver.
    pub flow_iterations: u64,
    /// Bodies that left the mesh and were taken out.
    pub bodies_left: u64,
}

impl Summary {
    /// Of a finished run. Collective.
    pub fn new(case: &Case, part: &MeshPart, stages: &Stages, totals: Totals) -> Self {
        let comm = &part.comm;
        let ranks = comm.size() as f64;
        let balance = Balance::of(part);
        let traffic = part.exchange.traffic();
        let digest = Sha256::digest(case.effective.as_bytes());
        Self {
            title: case.title.clone(),
            version: env!("CARGO_PKG_VERSION"),
            case_hash: digest.iter().map(|byte| format!("{byte:02x}")).collect(),
            ranks: comm.size(),
            nodes: balance.nodes(),
            elements: balance.elements(),
            imbalance: balance.imbalance(),
            cut_faces: balance.edge_cut(),
            neighbours: balance.ranks.iter().map(|share| share.neighbours).collect(),
            ghost_nodes: balance.ranks.iter().map(|share| share.ghost_nodes).collect(),
            halo_messages: comm.sum(traffic.messages as f64),
            halo_bytes: comm.sum(traffic.bytes as f64),
            steps: totals.steps,
            t: totals.t,
            wall_seconds: comm.max(totals.wall_seconds),
            flow_iterations: totals.flow_iterations,
            bodies_left: totals.bodies_left,
            stages: stages
                .iter()
                .map(|(name, seconds, calls)| Stage {
                    name,
                    calls,
                    min: comm.min(seconds),
                    mean: comm.sum(seconds) / ranks,
                    max: comm.max(seconds),
                })
                .collect(),
            memory_peak_mb: comm.all_gather(&[memory_peak_mb()]).concat(),
        }
    }

    /// Writes `summary.json` into `folder`.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), io::Error> {
        let path = folder.join("summary.json");
        let text = serde_json::to_string_pretty(self).expect("a summary is made of plain values");
        std::fs::write(&path, text + "\n").map_err(|e| io::Error::file(&path, e))
    }

    /// The stages as a table for people.
    pub fn table(&self) -> String {
        let mut text = format!(
            "{:<16}{:>8}{:>10}{:>10}{:>10}\n",
            "stage", "calls", "min s", "mean s", "max s"
        );
        for s in &self.stages {
            text += &format!(
                "{:<16}{:>8}{:>10.2}{:>10.2}{:>10.2}\n",
                s.name, s.calls, s.min, s.mean, s.max
            );
        }
        let most = self.memory_peak_mb.iter().copied().fold(0.0, f64::max);
        text + &format!(
            "{} steps in {:.1} s on {} rank{}, at most {most:.0} MB a rank",
            self.steps,
            self.wall_seconds,
            self.ranks,
            if self.ranks == 1 { "" } else { "s" }
        )
    }
}

/// This process's peak resident memory [MB]; 0 where the system does not tell.
pub fn memory_peak_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kb = line.and_then(|rest| rest.split_whitespace().next()?.parse::<f64>().ok());
    kb.unwrap_or(0.0) / 1024.0
}
