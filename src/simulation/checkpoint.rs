//! Checkpoints: everything a later step depends on, by global id, so that a run goes on on any number of
//! ranks; on the same number, bit for bit.

use super::{Clock, RunError, Simulation};
use crate::bodies::{Record, record};
use crate::cut::Extension;
use crate::phase::State;
use io::checkpoint::{self, Checkpoint, Group, Values};
use std::path::{Path, PathBuf};

impl Simulation {
    /// Writes a checkpoint into `folder`. Collective.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_checkpoint(&self, folder: &Path) -> Result<PathBuf, RunError> {
        let phase = self.phase.as_ref().map(|phase| phase.state()).unwrap_or_default();
        let mut nodal: Vec<(&str, usize, Values)> =
            phase.nodal.iter().map(|(name, v)| (*name, 1, Values::F64(v))).collect();
        let Clock { t_phase, dt, before, .. } = self.clock;
        let mut scalars = vec![("t_phase", t_phase), ("dt", dt), ("before", before)];
        let mut elements: Vec<(&str, usize, Values)> = Vec::new();
        if let Some(flow) = &self.flow {
            nodal.push(("u", 3, Values::F64(flow.u.as_flattened())));
            nodal.push(("u_old", 3, Values::F64(flow.u_old.as_flattened())));
            nodal.push(("p", 1, Values::F64(&flow.p)));
            elements.push(("fine_scale", 3, Values::F64(flow.fine_scale.as_flattened())));
            scalars.extend([("dt_old", flow.dt_old), ("dt_tau", flow.dt_tau)]);
        }
        let lists: Vec<(String, f64)> = phase
            .global
            .iter()
            .flat_map(|(name, list)| {
                let length = (format!("{name}.length"), list.len() as f64);
                let items = list.iter().enumerate().map(move |(i, &v)| (format!("{name}.{i}"), v));
                std::iter::once(length).chain(items)
            })
            .collect();
        scalars.extend(lists.iter().map(|(name, v)| (name.as_str(), *v)));
        let ledger = self.energy.as_ref().map(|ledger| ledger.state()).unwrap_or_default();
        let ledger: Vec<(String, f64)> =
            (0..).zip(ledger).map(|(i, v): (u32, _)| (format!("energy.{i}"), v)).collect();
        scalars.extend(ledger.iter().map(|(name, v)| (name.as_str(), *v)));
        let part = &self.part;
        let bodies = self.bodies.as_ref().map(|bodies| bodies.record()).unwrap_or_default();
        let shared: Vec<(String, f64)> =
            (0..).zip(bodies.shared).map(|(i, v): (u32, _)| (format!("bodies.{i}"), v)).collect();
        scalars.extend(shared.iter().map(|(name, v)| (name.as_str(), *v)));
        let first = part.comm.exclusive_sum(bodies.keys.len() as u64);
        let contacts: Vec<u64> = (first..).take(bodies.keys.len()).collect();
        let state = checkpoint::State {
            case: &self.identity(),
            step: self.clock.step,
            time: self.clock.t,
            scalars: &scalars,
            groups: &[
                Group { name: "nodes", ids: &part.nodes.global[..part.n_owned()], arrays: &nodal },
                Group {
                    name: "elements",
                    ids: &part.element_global[..part.n_owned_elements],
                    arrays: &elements,
                },
                Group {
                    name: "bodies",
                    ids: &bodies.clusters,
                    arrays: &[("state", record::CLUSTER, Values::F64(&bodies.states))],
                },
                Group {
                    name: "bonds",
                    ids: &bodies.points,
                    arrays: &[("largest", 1, Values::F64(&bodies.largest))],
                },
                Group {
                    name: "contacts",
                    ids: &contacts,
                    arrays: &[
                        ("key", 5, Values::U64(bodies.keys.as_flattened())),
                        ("memory", 5, Values::F64(bodies.memories.as_flattened())),
                    ],
                },
            ],
        };
        Ok(checkpoint::write(&part.comm, folder, &state)?)
    }

    /// Goes on from a checkpoint, or the newest one in a folder. Collective.
    ///
    /// # Errors
    /// No checkpoint there, a broken one, one of another mesh.
    pub fn restore(&mut self, path: &Path) -> Result<(), RunError> {
        let part = &self.part;
        let found = checkpoint::find(path);
        if part.comm.any(found.is_none()) {
            return Err(io::Error::file(
                path,
                "there is no checkpoint here (output.checkpoint_every writes them)",
            )
            .into());
        }
        let found = found.expect("every rank found it");
        let saved = Checkpoint::open(&part.comm, &found)?;
        if saved.case() != self.identity() {
            let message = format!("is of another case: {}, not {}", saved.case(), self.identity());
            return Err(io::Error::file(&found, message).into());
        }
        let nodes =
            |name: &str, components| saved.read_f64("nodes", name, components, &part.nodes.global);
        let scalar = |name: &str| saved.scalar(name);
        if let Some(phase) = &mut self.phase {
            let mut state: State = phase.state();
            for (name, values) in &mut state.nodal {
                *values = nodes(name, 1)?;
            }
            for (name, list) in &mut state.global {
                let length = scalar(&format!("{name}.length"))? as usize;
                *list = (0..length)
                    .map(|i| scalar(&format!("{name}.{i}")))
                    .collect::<Result<_, _>>()?;
            }
            phase.restore(part, &state);
            self.material.set_phase(&phase.phi);
        }
        if let Some(flow) = &mut self.flow {
            let vectors = |flat: Vec<f64>| flat.as_chunks::<3>().0.to_vec();
            flow.u = vectors(nodes("u", 3)?);
            flow.u_old = vectors(nodes("u_old", 3)?);
            flow.p = nodes("p", 1)?;
            let ids = &part.element_global;
            flow.fine_scale = vectors(saved.read_f64("elements", "fine_scale", 3, ids)?);
            (flow.dt_old, flow.dt_tau) = (scalar("dt_old")?, scalar("dt_tau")?);
            flow.steps = saved.step();
        }
        if let Some(ledger) = &mut self.energy {
            let mut state = ledger.state();
            for (i, v) in state.iter_mut().enumerate() {
                *v = scalar(&format!("energy.{i}"))?;
            }
            ledger.restore(&state);
        }
        if let Some(bodies) = &mut self.bodies {
            let all = |group: &str| (0..saved.count(group).unwrap_or(0)).collect::<Vec<u64>>();
            let (clusters, points, contacts) = (all("bodies"), all("bonds"), all("contacts"));
            let keys = saved.read_u64("contacts", "key", 5, &contacts)?;
            let memories = saved.read_f64("contacts", "memory", 5, &contacts)?;
            let mut shared = [0.0; record::SHARED];
            for (i, v) in shared.iter_mut().enumerate() {
                *v = scalar(&format!("bodies.{i}"))?;
            }
            bodies.resume(&Record {
                states: saved.read_f64("bodies", "state", record::CLUSTER, &clusters)?,
                largest: saved.read_f64("bonds", "largest", 1, &points)?,
                clusters,
                points,
                keys: keys.as_chunks::<5>().0.to_vec(),
                memories: memories.as_chunks::<5>().0.to_vec(),
                shared,
            });
        }
        self.clock = Clock {
            t: saved.time(),
            step: saved.step(),
            t_phase: scalar("t_phase")?,
            dt: scalar("dt")?,
            before: scalar("before")?,
        };
        if self.flow.is_some() && self.structures.move_at_all() {
            // As the last step left it: bodies have moved since.
            if let Some(bodies) = &self.bodies {
                self.structures.placed = bodies.placed_before();
            }
            self.cut = self.structures.cut(part, self.bodies.as_ref(), self.clock.t);
            if self.bodies.is_none() && self.clock.step > 0 {
                let before = self.structures.cut(part, None, self.clock.before);
                let going = Extension::new(part, &self.cut, &before, self.case.gravity);
                self.cut.compare(part, &before, &going);
            }
            let nothing = Extension::default();
            if let Some(phase) = &mut self.phase {
                phase.follow(part, &self.cut, &nothing, &nothing);
            }
            if let Some(flow) = &mut self.flow {
                flow.follow(part, &self.cut, &nothing, self.case.gravity);
            }
            if let Some(bodies) = &self.bodies {
                self.structures.placed = bodies.placed();
            }
        }
        Ok(())
    }

    /// What must agree for a state to fit: the mesh and what is computed on it.
    fn identity(&self) -> String {
        format!(
            "{} nodes, {} tetrahedra, flow {}, free surface {}, {} bodies, {} bonds",
            self.size.nodes,
            self.size.elements,
            self.flow.is_some(),
            self.phase.is_some(),
            self.bodies.as_ref().map_or(0, |bodies| bodies.state.len()),
            self.bodies.as_ref().map_or(0, |bodies| bodies.joints.places.len()),
        )
    }
}
