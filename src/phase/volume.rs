//! Volume correction [16, 17]: `V = ∫φ*` is brought to its target by a shift `ψ ← ψ − L`, `L = (V − V_t)/A`.
//!
//! `A = dV/dψ = ∫φ(1−φ)/δ`, which is ∫|∇φ| for the equilibrium profile and makes the iteration Newton's.
//! The shift acts on nodes of the band only (φ(1−φ) above its outer limit), at most 0.1 h a step.
//!
//! `Global` (the paper): one target, the initial volume plus what came in. `PerBody`: every connected body
//! of water (`phase::water`) has its own. From step to step a body's target goes to the bodies its
//! nodes now belong to, in proportion to their present volume: merging adds targets, splitting divides
//! them. Bodies below 50 h³ keep theirs, but are not moved until they merge. Water in no body
//! (spray nowhere wetter than ½, and the profile's last tails) is an account whose target is its present volume; what
//! it gains or loses between steps beyond its share is settled with the bodies in proportion to their
//! volume. The sum of all targets is the initial volume plus inflow at all times.

use super::Phase;
use super::profile::{OUTER, logit, moments, profile_weight, sigmoid};
use super::water::{NONE, bodies_of_water, contacts};
use crate::case::VolumeCorrection;
use crate::cut::{Cell, CutMesh};
use crate::mesh::MeshPart;
use crate::mesh::connected::root;
use std::collections::BTreeMap;

/// Bodies smaller than this many h³ are left alone.
const SMALLEST: f64 = 50.0;
/// Largest shift of a step, in h.
const LARGEST_SHIFT: f64 = 0.1;
/// Volume error at which a body is done, relative to the target.
const TOLERANCE: f64 = 1e-13;
const ITERATIONS: u32 = 8;

/// A body of water and its account.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Smallest global node number with φ > ½ in it when last seen.
    pub name: u64,
    /// Volume it should have [m³].
    pub target: f64,
}

/// Who owns how much water; the same on every rank but for `names`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ledger {
    /// By name, ascending. One nameless body if the correction is global, none if it is off.
    pub bodies: Vec<Body>,
    /// Target of the water in no body [m³].
    pub spray: f64,
    /// Initial volume plus all inflow [m³].
    pub target: f64,
    /// Sum of all corrections, signed [m³].
    pub corrected: f64,
    /// Sum of their sizes [m³].
    pub moved: f64,
    /// Body of each local node.
    pub(super) names: Vec<u64>,
}

/// The volume's account of one step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VolumeReport {
    /// ∫φ* after the correction [m³].
    pub volume: f64,
    /// Initial volume plus inflow [m³].
    pub target: f64,
    /// Liquid that came in over the step [m³].
    pub inflow: f64,
    /// ∫φ* − target before the correction [m³].
    pub error: f64,
    /// Liquid added this step, signed [m³].
    pub correction: f64,
    /// Liquid added since the start, signed [m³].
    pub corrected: f64,
    /// Sum of the sizes of all corrections since the start [m³].
    pub moved: f64,
    /// Largest shift [m].
    pub shift: f64,
    /// Bodies of water (0 unless accounted per body).
    pub bodies: u32,
}

/// Liquid volume of each owned node, `m_i φ_i + ∫N_i(φ*−φ_h)`, from `phase.profile`; its profile part is
/// left in `phase.solver.excess`.
fn nodal_volume(phase: &mut Phase, part: &MeshPart, cut: &CutMesh, out: &mut Vec<f64>) {
    let n_owned = part.n_owned();
    phase.profile.set(&phase.phi, phase.profile_correction);
    let excess = &mut phase.solver.excess;
    excess.fill(0.0);
    if phase.profile_correction {
        for (e, tet) in part.assembled().iter().enumerate() {
            let Some(nodes) = phase.profile.in_band(tet) else { continue };
            if !matches!(cut.cell(e), Cell::Whole) {
                continue;
            }
            let p = moments(nodes, profile_weight(nodes));
            let volume = crate::mesh::tetrahedron::Tetrahedron::of(&part.mesh, e).volume;
            for i in 0..4 {
                excess[tet[i] as usize] += volume * p.excess[i];
            }
        }
    }
    out.clear();
    out.extend((0..n_owned).map(|i| phase.lumped[i] * phase.phi[i] + excess[i]));
}

impl Phase {
    /// ∫φ* over the domain (∫φ_h without profile correction) [m³]. Collective.
    pub fn volume(&mut self, part: &MeshPart, cut: &CutMesh) -> f64 {
        let mut volumes = std::mem::take(&mut self.nodal_volume);
        nodal_volume(self, part, cut, &mut volumes);
        let volume = part.sum(volumes.iter().sum());
        self.nodal_volume = volumes;
        volume
    }

    /// Opens the accounts for the present φ.
    pub(super) fn open_ledger(&mut self, part: &MeshPart, cut: &CutMesh) {
        let volume = self.volume(part, cut);
        self.ledger = Ledger { target: volume, ..Ledger::default() };
        match self.volume_correction {
            VolumeCorrection::Off => {}
            VolumeCorrection::Global => {
                self.ledger.bodies.push(Body { name: 0, target: volume });
                self.ledger.names = vec![0; part.n_local()];
            }
            VolumeCorrection::PerBody => {
                self.ledger.spray = volume;
                self.ledger.names = vec![NONE; part.n_local()];
                self.inflow.fill(0.0);
                self.follow_bodies(part, cut);
            }
        }
    }

    /// Books the inflow of the last `advance` and corrects the volume. Collective.
    pub fn restore_volume(&mut self, part: &MeshPart, cut: &CutMesh) -> VolumeReport {
        let before = self.volume(part, cut);
        let inflow = part.sum(self.inflow[..part.n_owned()].iter().sum());
        self.ledger.target += inflow;
        let mut report = VolumeReport {
            inflow,
            error: before - self.ledger.target,
            volume: before,
            ..VolumeReport::default()
        };
        match self.volume_correction {
            VolumeCorrection::Off => {}
            VolumeCorrection::Global => self.ledger.bodies[0].target += inflow,
            VolumeCorrection::PerBody => {
                self.follow_bodies(part, cut);
                report.bodies = self.ledger.bodies.len() as u32;
            }
        }
        self.inflow.fill(0.0);
        if !self.ledger.bodies.is_empty() {
            (report.volume, report.shift) = self.shift_bodies(part, cut);
            report.correction = report.volume - before;
            self.ledger.corrected += report.correction;
        }
        report.target = self.ledger.target;
        report.corrected = self.ledger.corrected;
        report.moved = self.ledger.moved;
        report
    }

    /// New bodies inherit the targets of the old ones their nodes belonged to; `nodal_volume` and
    /// `inflow` are those of the present φ and the last step.
    fn follow_bodies(&mut self, part: &MeshPart, cut: &CutMesh) {
        let names = bodies_of_water(part, cut, &self.solver.matrix.pattern, &self.phi);
        // (old, new) → present volume, its positive part (shares must be), inflow.
        let mut shared = BTreeMap::<(u64, u64), [f64; 3]>::new();
        for i in 0..part.n_owned() {
            let volume = self.nodal_volume[i];
            if volume != 0.0 || self.inflow[i] != 0.0 || names[i] != NONE {
                let entry = shared.entry((self.ledger.names[i], names[i])).or_default();
                entry[0] += volume;
                entry[1] += volume.max(0.0);
                entry[2] += self.inflow[i];
            }
        }
        let mine: Vec<_> = shared.iter().map(|(k, v)| (*k, *v)).collect();
        shared.clear();
        for (key, values) in part.comm.all_gather(&mine).into_iter().flatten() {
            let entry = shared.entry(key).or_default();
            for (sum, value) in entry.iter_mut().zip(values) {
                *sum += value;
            }
        }
        let mut left = BTreeMap::<u64, f64>::new();
        let mut present = BTreeMap::<u64, f64>::new();
        for (&(old, new), v) in &shared {
            *left.entry(old).or_default() += v[1];
            *present.entry(new).or_default() += v[0];
        }
        let mut old: BTreeMap<u64, f64> =
            self.ledger.bodies.iter().map(|b| (b.name, b.target)).collect();
        old.insert(NONE, self.ledger.spray);
        let mut target: BTreeMap<u64, f64> = present.keys().map(|&name| (name, 0.0)).collect();
        target.entry(NONE).or_default();
        for (&(from, to), v) in &shared {
            let share = if left[&from] > 0.0 { v[1] / left[&from] } else { 0.0 };
            let entry = target.get_mut(&to).expect("every new name has an account");
            *entry += v[2] + share * old.get(&from).copied().unwrap_or(0.0);
        }
        // What vanished without a trace is spray.
        for (from, volume) in old {
            if left.get(&from).copied().unwrap_or(0.0) <= 0.0 {
                *target.get_mut(&NONE).expect("spray has an account") += volume;
            }
        }
        let mut spray = target.remove(&NONE).expect("spray has an account");
        let spray_now = present.remove(&NONE).unwrap_or(0.0);
        let all: f64 = present.values().sum();
        if all > 0.0 {
            for (name, target) in &mut target {
                *target += (spray - spray_now) * present[name] / all;
            }
            spray = spray_now;
        }
        self.share_within_contacts(part, cut, &names, &present, &mut target);
        self.ledger.bodies =
            target.into_iter().map(|(name, target)| Body { name, target }).collect();
        self.ledger.spray = spray;
        self.ledger.names = names;
    }

    /// Bodies whose bands touch exchange water across the border of their labels: their targets are pooled and
    /// shared in proportion to their present volume.
    fn share_within_contacts(
        &self,
        part: &MeshPart,
        cut: &CutMesh,
        names: &[u64],
        present: &BTreeMap<u64, f64>,
        target: &mut BTreeMap<u64, f64>,
    ) {
        let bodies: Vec<u64> = target.keys().copied().collect();
        let index = |name| bodies.binary_search(&name).expect("every named body has an account");
        let mut parent: Vec<u32> = (0..bodies.len() as u32).collect();
        for (a, b) in contacts(part, cut, &self.solver.matrix.pattern, names) {
            let (a, b) = (root(&mut parent, index(a) as u32), root(&mut parent, index(b) as u32));
            parent[a.max(b) as usize] = a.min(b);
        }
        // Of each group: target, present volume, members.
        let mut sums = vec![[0.0; 3]; bodies.len()];
        for (i, name) in bodies.iter().enumerate() {
            let sum = &mut sums[root(&mut parent, i as u32) as usize];
            *sum = [sum[0] + target[name], sum[1] + present[name], sum[2] + 1.0];
        }
        for (i, name) in bodies.iter().enumerate() {
            let [all, volume, members] = sums[root(&mut parent, i as u32) as usize];
            if members > 1.0 && volume > 0.0 {
                target.insert(*name, all * present[name] / volume);
            }
        }
    }

    /// Shifts ψ until every body has its target; returns the total volume and the largest shift.
    fn shift_bodies(&mut self, part: &MeshPart, cut: &CutMesh) -> (f64, f64) {
        let n = self.ledger.bodies.len();
        let largest = LARGEST_SHIFT * self.cell;
        // Owned nodes that may be shifted: (node, body, ψ/δ).
        let mut band = std::mem::take(&mut self.band);
        band.clear();
        let mut last = (NONE, 0);
        let mut body_of = vec![u32::MAX; part.n_owned()];
        for i in 0..part.n_owned() {
            let name = self.ledger.names[i];
            if name == NONE {
                continue;
            }
            if name != last.0 {
                let at = self.ledger.bodies.binary_search_by_key(&name, |b| b.name);
                last = (name, at.expect("every named node's body is in the ledger") as u32);
            }
            body_of[i] = last.1;
            if self.phi[i] * (1.0 - self.phi[i]) > OUTER {
                band.push((i as u32, last.1, logit(self.phi[i])));
            }
        }
        let excess_before = self.solver.excess[..part.n_owned()].to_vec();
        let mut volumes = std::mem::take(&mut self.nodal_volume);
        let (mut shift, mut first) = (vec![0.0; n], vec![0.0; n]);
        let mut sums = vec![0.0; 2 * n + 1];
        let mut iteration = 0;
        let total = loop {
            // Volume of each body, its derivative, and everything.
            sums.fill(0.0);
            for (i, v) in volumes.iter().enumerate() {
                if body_of[i] != u32::MAX {
                    sums[body_of[i] as usize] += v;
                }
                sums[2 * n] += v;
            }
            for &(i, body, _) in &band {
                let phi = self.phi[i as usize];
                sums[n + body as usize] += self.lumped[i as usize] * phi * (1.0 - phi) / self.delta;
            }
            part.comm.sum_all(&mut sums);
            if iteration == 0 {
                first.copy_from_slice(&sums[..n]);
            }
            let mut done = true;
            for (b, body) in self.ledger.bodies.iter().enumerate() {
                let (error, slope) = (sums[b] - body.target, sums[n + b]);
                let small = n > 1 && first[b] < SMALLEST * self.cell.powi(3);
                if small || slope <= 0.0 || error.abs() <= TOLERANCE * body.target.abs() {
                    continue;
                }
                let new = (shift[b] - error / slope).clamp(-largest, largest);
                done &= new == shift[b];
                shift[b] = new;
            }
            if done || iteration == ITERATIONS {
                break sums[2 * n];
            }
            for &(i, body, s) in &band {
                if shift[body as usize] != 0.0 {
                    self.phi[i as usize] = sigmoid(s + shift[body as usize] / self.delta);
                }
            }
            part.exchange.update_ghosts(&mut self.phi);
            nodal_volume(self, part, cut, &mut volumes);
            iteration += 1;
        };
        for i in 0..part.n_owned() {
            self.excess[i] += self.solver.excess[i] - excess_before[i];
        }
        self.ledger.moved += (0..n).map(|b| (sums[b] - first[b]).abs()).sum::<f64>();
        self.nodal_volume = volumes;
        self.band = band;
        (total, shift.iter().fold(0.0, |m, s: &f64| m.max(s.abs())))
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{SETTINGS, graph, solver};
    use super::*;
    use crate::case::FreeSurface;
    use crate::fem::norm;
    use crate::mesh::boxes::tensor_box;
    use crate::phase::initial;

    /// A box 2 × 1 × 1 of 24 × 12 × 12 cells.
    fn tank() -> MeshPart {
        let lines = |n: usize| -> Vec<f64> { (0..=n).map(|i| i as f64 / 12.0).collect() };
        MeshPart::single(tensor_box([&lines(24), &lines(12), &lines(12)]))
    }

    /// Spheres of water (x of the centre, radius) in the tank.
    fn field(part: &MeshPart, spheres: &[(f64, f64)]) -> Vec<f64> {
        let distance = |x: &[f64; 3]| {
            let d = |&(c, r)| r - norm([x[0] - c, x[1] - 0.5, x[2] - 0.5]);
            spheres.iter().map(d).fold(f64::NEG_INFINITY, f64::max)
        };
        let distance: Vec<f64> = part.mesh.nodes.iter().map(distance).collect();
        initial::profile(&distance, 0.025)
    }

    fn drops(correction: VolumeCorrection, spheres: &[(f64, f64)]) -> (MeshPart, Phase) {
        let part = tank();
        let settings =
            FreeSurface { volume_correction: correction, thickness: Some(0.025), ..SETTINGS };
        let phi = field(&part, spheres);
        let phase = Phase::new(
            &part,
            &CutMesh::whole(),
            &graph(&part),
            &settings,
            &solver(1e-6),
            1.0 / 12.0,
            phi,
            Vec::new(),
        );
        (part, phase)
    }

    fn targets(phase: &Phase) -> Vec<f64> {
        phase.ledger.bodies.iter().map(|b| b.target).collect()
    }

    #[test]
    fn a_lost_volume_is_restored_to_the_last_digit() {
        for correction in [VolumeCorrection::Global, VolumeCorrection::PerBody] {
            let (part, mut phase) = drops(correction, &[(0.35, 0.25), (1.65, 0.25)]);
            let target = phase.ledger.target;
            phase.phi = field(&part, &[(0.35, 0.247), (1.65, 0.25)]);
            let report = phase.restore_volume(&part, &CutMesh::whole());
            assert!(report.error < -1e-3 * target);
            assert!((report.volume / target - 1.0).abs() < 1e-12, "{report:?}");
            assert!((report.correction + report.error).abs() < 1e-12 * target);
            assert!((phase.volume(&part, &CutMesh::whole()) - report.volume).abs() < 1e-15);
            if correction == VolumeCorrection::PerBody {
                // The second drop lost nothing and gets nothing.
                let exact = field(&part, &[(0.35, 0.25), (1.65, 0.25)]);
                let moved = (part.mesh.nodes.iter().zip(&phase.phi).zip(&exact))
                    .filter(|((x, _), _)| x[0] > 1.1)
                    .map(|((_, a), b)| (a - b).abs())
                    .fold(0.0, f64::max);
                assert!(moved < 1e-4, "{moved}");
                assert_eq!(report.bodies, 2);
            }
        }
    }

    #[test]
    fn a_large_loss_is_restored_over_several_steps() {
        let (part, mut phase) = drops(VolumeCorrection::Global, &[(0.5, 0.3)]);
        phase.phi = field(&part, &[(0.5, 0.28)]);
        let h = phase.cell;
        let reports: Vec<_> =
            (0..4).map(|_| phase.restore_volume(&part, &CutMesh::whole())).collect();
        assert!((reports[0].shift - 0.1 * h).abs() < 1e-15);
        assert!(reports[0].volume < reports[0].target * 0.99);
        assert!((reports[3].volume / reports[3].target - 1.0).abs() < 1e-12);
        let sum: f64 = reports.iter().map(|r| r.correction).sum();
        assert!((sum - reports[3].corrected).abs() < 1e-15);
        assert!((sum - reports[3].moved).abs() < 1e-12);
    }

    #[test]
    fn merging_adds_targets_and_splitting_divides_them() {
        let apart = [(0.5, 0.3), (1.5, 0.2)];
        let (part, mut phase) = drops(VolumeCorrection::PerBody, &apart);
        let before = targets(&phase);
        assert_eq!(before.len(), 2);
        let sum: f64 = before.iter().sum();
        // The bridge is water that was not there: it will be taken away again.
        phase.phi = field(&part, &[(0.5, 0.3), (0.9, 0.15), (1.2, 0.15), (1.5, 0.2)]);
        phase.restore_volume(&part, &CutMesh::whole());
        let merged = targets(&phase);
        assert_eq!(merged.len(), 1);
        assert!((merged[0] / sum - 1.0).abs() < 1e-3);
        assert!((merged[0] + phase.ledger.spray - phase.ledger.target).abs() < 1e-14);
        phase.phi = field(&part, &apart);
        phase.restore_volume(&part, &CutMesh::whole());
        let parted = targets(&phase);
        assert_eq!(parted.len(), 2);
        assert!((parted[0] + parted[1] + phase.ledger.spray - phase.ledger.target).abs() < 1e-14);
        for (a, b) in parted.iter().zip(&before) {
            assert!((a / b - 1.0).abs() < 2e-3, "{parted:?} {before:?}");
        }
    }

    #[test]
    fn a_drop_below_50_cells_is_left_alone_and_spray_has_an_account() {
        let (part, mut phase) = drops(VolumeCorrection::PerBody, &[(0.5, 0.3), (1.5, 0.15)]);
        let before = targets(&phase);
        assert!(before[1] < SMALLEST * phase.cell.powi(3));
        let lost = field(&part, &[(0.5, 0.3), (1.5, 0.13)]);
        phase.phi.clone_from(&lost);
        let report = phase.restore_volume(&part, &CutMesh::whole());
        assert!(report.correction.abs() < 1e-4 * before[0], "{report:?}");
        assert!((targets(&phase)[1] / before[1] - 1.0).abs() < 1e-2, "its target is kept");
        // It disperses: what is left of it is spray, what is missing is owed by the body.
        for (phi, x) in phase.phi.iter_mut().zip(&part.mesh.nodes) {
            if x[0] > 1.1 {
                *phi *= 0.4;
            }
        }
        phase.restore_volume(&part, &CutMesh::whole());
        assert_eq!(phase.ledger.bodies.len(), 1);
        assert!(phase.ledger.spray > 0.1 * before[1]);
        let sum = phase.ledger.bodies[0].target + phase.ledger.spray;
        assert!((sum - phase.ledger.target).abs() < 1e-14);
    }
}
