//! `summary.json`: what was run, on what, and what it cost.

use super::stages::Stages;
use crate::case::Case;
use crate::mesh::MeshPart;
use crate::mesh::balance::Balance;
use crate::mesh::part::Cost;
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
    halo: HaloUse,
    steps: u64,
    t: f64,
    /// The whole run, without what came before its first step [s].
    wall_seconds: f64,
    flow_iterations: u64,
    /// Bodies that left the mesh.
    bodies_left: u64,
    /// Mesh and set-up are the time before the first step.
    stages: Vec<Stage>,
    /// All steps with their output.
    total: Stage,
    /// Peak memory of each rank [MB].
    memory_peak_mb: Vec<f64>,
}

/// The halo of nodal values on the mesh; those of coarser grids are in the stages.
#[derive(Clone, Debug, Serialize)]
struct HaloUse {
    /// Ranks that each rank sends to.
    neighbours: Vec<u64>,
    /// Nodes of others on each rank.
    ghost_nodes: Vec<u64>,
    /// Times that every rank has sent.
    exchanges: u64,
    /// Sent by all ranks.
    messages: u64,
    bytes: u64,
    /// The same of one exchange.
    messages_per_exchange: f64,
    bytes_per_exchange: f64,
}

/// What a stage cost.
#[derive(Clone, Debug, Serialize)]
pub struct Stage {
    /// What it is called.
    pub name: &'static str,
    /// How often it ran.
    pub calls: u64,
    /// Wall time on the ranks [s].
    pub seconds: Spread,
    /// Part of it: time for messages and collectives, most of it waiting for others [s].
    pub waiting: Spread,
    /// Processor time outside of these [s].
    pub work: Spread,
    /// Largest over mean work.
    pub imbalance: f64,
    /// Messages between two ranks, and their bytes, sent by all ranks.
    pub messages: u64,
    /// Bytes of these.
    pub bytes: u64,
    /// Calls in which all ranks take part, each counted once.
    pub collectives: u64,
    /// What all ranks put into those [bytes].
    pub collective_bytes: u64,
}

/// Of one value on each rank.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Spread {
    /// Smallest.
    pub min: f64,
    /// Mean.
    pub mean: f64,
    /// Largest.
    pub max: f64,
}

impl Spread {
    fn of(values: impl ExactSizeIterator<Item = f64> + Clone) -> Self {
        let n = values.len() as f64;
        Self {
            min: values.clone().fold(f64::INFINITY, f64::min),
            mean: values.clone().sum::<f64>() / n,
            max: values.fold(f64::NEG_INFINITY, f64::max),
        }
    }
}

impl Stage {
    /// From what every rank spent. Collective.
    pub fn new(part: &MeshPart, name: &'static str, mine: Cost, calls: u64) -> Self {
        let all = part.comm.all_gather(&[mine]).concat();
        let sum = |of: fn(&Cost) -> u64| all.iter().map(of).sum();
        let work = Spread::of(all.iter().map(|cost| cost.work));
        Self {
            name,
            calls,
            seconds: Spread::of(all.iter().map(|cost| cost.seconds)),
            waiting: Spread::of(all.iter().map(|cost| cost.waiting)),
            work,
            imbalance: if work.mean > 0.0 { work.max / work.mean } else { 1.0 },
            messages: sum(|cost| cost.messages),
            bytes: sum(|cost| cost.bytes),
            collectives: mine.collectives,
            collective_bytes: sum(|cost| cost.collective_bytes),
        }
    }
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
    /// All steps with their output.
    pub cost: Cost,
}

impl Summary {
    /// Of a finished run. Collective.
    pub fn new(case: &Case, part: &MeshPart, stages: &Stages, totals: Totals) -> Self {
        let comm = &part.comm;
        let balance = Balance::of(part);
        let digest = Sha256::digest(case.effective.as_bytes());
        let (steps, t, flow_iterations) = (totals.steps, totals.t, totals.flow_iterations);
        Self {
            title: case.title.clone(),
            version: env!("CARGO_PKG_VERSION"),
            case_hash: digest.iter().map(|byte| format!("{byte:02x}")).collect(),
            ranks: comm.size(),
            nodes: balance.nodes(),
            elements: balance.elements(),
            imbalance: balance.imbalance(),
            cut_faces: balance.edge_cut(),
            halo: HaloUse::new(part, &balance),
            steps,
            t,
            wall_seconds: comm.max(totals.wall_seconds),
            flow_iterations,
            bodies_left: totals.bodies_left,
            stages: stages
                .iter()
                .map(|(name, cost, calls)| Stage::new(part, name, cost, calls))
                .collect(),
            total: Stage::new(part, "steps", totals.cost, steps),
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
        let alone = self.ranks == 1;
        let mut text = format!("{:<16}{:>8}{:>10}", "stage", "calls", "seconds");
        if !alone {
            text += &format!(
                "{:>10}{:>10}{:>10}{:>11}{:>11}{:>10}{:>13}",
                "min", "max", "waiting", "imbalance", "messages", "MB", "collectives"
            );
        }
        for s in self.stages.iter().chain([&self.total]) {
            text += &format!("\n{:<16}{:>8}{:>10.2}", s.name, s.calls, s.seconds.mean);
            if !alone {
                text += &format!(
                    "{:>10.2}{:>10.2}{:>10.2}{:>11.2}{:>11}{:>10.1}{:>13}",
                    s.seconds.min,
                    s.seconds.max,
                    s.waiting.mean,
                    s.imbalance,
                    s.messages,
                    s.bytes as f64 * 1e-6,
                    s.collectives
                );
            }
        }
        let steps = self.steps.max(1) as f64;
        if !alone {
            let Stage { messages, bytes, collectives, .. } = self.total;
            text += &format!(
                "\na step: {:.0} messages, {:.2} MB, {:.0} collectives; an exchange of nodal values: \
                 {:.0} messages, {:.1} kB",
                messages as f64 / steps,
                bytes as f64 / steps * 1e-6,
                collectives as f64 / steps,
                self.halo.messages_per_exchange,
                self.halo.bytes_per_exchange * 1e-3
            );
        }
        let memory = Spread::of(self.memory_peak_mb.iter().copied());
        text +=
            &format!("\n{} steps in {:.1} s on {} rank", self.steps, self.wall_seconds, self.ranks);
        if alone {
            text + &format!(", {:.0} MB", memory.max)
        } else {
            text + &format!(
                "s, {:.0} to {:.0} MB a rank, {:.0} MB together",
                memory.min,
                memory.max,
                memory.mean * self.ranks as f64
            )
        }
    }
}

impl HaloUse {
    fn new(part: &MeshPart, balance: &Balance) -> Self {
        let traffic = part.exchange.traffic();
        let sum = |x: u64| part.comm.sum_u64(x);
        // Where nothing is shared, nothing is counted.
        let exchanges = part.comm.max(traffic.exchanges as f64) as u64;
        let (messages, bytes) = (sum(traffic.messages), sum(traffic.bytes));
        let per = |x: u64| x as f64 / exchanges.max(1) as f64;
        Self {
            neighbours: balance.ranks.iter().map(|share| share.neighbours).collect(),
            ghost_nodes: balance.ranks.iter().map(|share| share.ghost_nodes).collect(),
            exchanges,
            messages,
            bytes,
            messages_per_exchange: per(messages),
            bytes_per_exchange: per(bytes),
        }
    }
}

/// This process's peak resident memory [MB]; 0 where the system does not tell.
pub fn memory_peak_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kb = line.and_then(|rest| rest.split_whitespace().next()?.parse::<f64>().ok());
    kb.unwrap_or(0.0) / 1024.0
}
