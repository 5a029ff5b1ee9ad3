//! What a case would take, before anything is computed: mesh, steps, memory.

use crate::case::{Boundary, Case};
use crate::fem::{dot, norm, tetrahedron::Tetrahedron};
use crate::mesh::MeshPart;
use crate::report::summary::memory_peak_mb;
use std::fmt;

/// Sizes and estimates, the same on all ranks.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Nodes of the whole mesh.
    pub nodes: u64,
    /// Tetrahedra of the whole mesh.
    pub tets: u64,
    /// Smallest and largest number of tetrahedra owned by a rank.
    pub tets_per_rank: [u64; 2],
    /// Smallest and largest element size h_e [m].
    pub size: [f64; 2],
    /// The free surface, if there is one.
    pub surface: Option<Surface>,
    /// Fastest fluid to be expected [m/s]: given, initial, flowing in, or falling through the height
    /// of the mesh, √(2gH).
    pub speed: f64,
    /// Step [s] at that speed.
    pub step: f64,
    /// Courant number of that step.
    pub courant: f64,
    /// Steps to the end of the case.
    pub steps: f64,
    /// Peak memory so far of the rank that needs most [MB].
    pub memory: f64,
}

/// Of the free surface at first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Its thickness δ [m].
    pub delta: f64,
    /// The size of cells there [m].
    pub cell: f64,
    /// Water in the mesh [m³].
    pub volume: f64,
}

/// Measures the mesh and the free `surface` on it against the case. Collective.
pub fn of(case: &Case, part: &MeshPart, surface: Option<Surface>) -> Plan {
    let mesh = &part.mesh;
    let owned = part.n_owned_elements as f64;
    let gravity = norm(case.gravity);
    let given = case.prescribed_velocity.as_ref().unwrap_or(&case.initial.velocity);
    let mut speed = 0.0f64;
    let mut height = [f64::NEG_INFINITY; 2]; // of the top, minus that of the floor
    for x in &mesh.nodes {
        speed = speed.max(norm(given.each_ref().map(|f| f.at(*x, 0.0))));
        let up = -dot(case.gravity, *x) / gravity.max(f64::MIN_POSITIVE);
        height = [height[0].max(up), height[1].max(-up)];
    }
    for face in &mesh.boundary {
        let name = &mesh.boundary_names[face.name as usize];
        let Boundary::Velocity { velocity, .. } = case.boundary(name) else { continue };
        for share in [0.0, 0.25, 0.5, 0.75, 1.0] {
            let x = mesh.nodes[face.nodes[0] as usize];
            let u = velocity.each_ref().map(|f| f.at(x, share * case.time.end));
            speed = speed.max(norm(u));
        }
    }
    let fall = part.max(height[0]) + part.max(height[1]);
    let fall = if case.prescribed_velocity.is_some() { 0.0 } else { (2.0 * gravity * fall).sqrt() };
    let speed = part.max(speed).max(fall);
    let (mut smallest, mut largest, mut steepest) = (f64::INFINITY, 0.0f64, 0.0f64);
    for e in 0..part.n_owned_elements {
        let tet = Tetrahedron::of(mesh, e);
        let h = (6.0 * 2f64.sqrt() * tet.volume).cbrt();
        (smallest, largest) = (smallest.min(h), largest.max(h));
        steepest = tet.grad.iter().fold(steepest, |s, g| s.max(norm(*g)));
    }
    // Across the thinnest element, whichever way it lies.
    let rate = speed * part.max(steepest);
    let time = &case.time;
    let step = time.step.unwrap_or((time.max_cfl / rate).min(time.max_step));
    Plan {
        nodes: part.comm.sum_u64(part.n_owned() as u64),
        tets: part.comm.sum_u64(part.n_owned_elements as u64),
        tets_per_rank: [part.comm.min(owned) as u64, part.max(owned) as u64],
        size: [part.comm.min(smallest), part.max(largest)],
        surface,
        speed,
        step,
        courant: step * rate,
        steps: (time.end / step).ceil(),
        memory: part.max(memory_peak_mb()),
    }
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.nodes == 0 {
            return write!(f, "memory:  {:.0} MB so far on the rank that needs most", self.memory);
        }
        let [fewest, most] = self.tets_per_rank;
        writeln!(f, "mesh:    {} nodes, {} tetrahedra", self.nodes, self.tets)?;
        writeln!(f, "         {fewest} to {most} tetrahedra a rank")?;
        writeln!(f, "         element size {:.4} to {:.4} m", self.size[0], self.size[1])?;
        if let Some(Surface { delta, cell, volume }) = self.surface {
            writeln!(f, "water:   {volume:.5e} m3 at first")?;
            // φ = 1/(1 + e^(−distance/δ))
            let band = 2.0 * 9f64.ln() * delta;
            writeln!(
                f,
                "surface: from 10 to 90 % of water in {band:.2e} m (thickness {delta:.2e} m)"
            )?;
            writeln!(f, "         on cells of {cell:.2e} m, their mean at the initial surface")?;
        }
        let (steps, step, courant) = (self.steps, self.step, self.courant);
        writeln!(f, "steps:   about {steps} of {step:.3e} s, Courant number {courant:.2}")?;
        writeln!(f, "         with the fastest fluid to be expected, {:.2} m/s", self.speed)?;
        write!(f, "memory:  {:.0} MB so far on the rank that needs most", self.memory)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::case::Sources;
    use crate::mesh::boxes::tensor_box;
    use std::collections::BTreeMap;

    #[test]
    fn a_tank_is_measured() {
        let text = "[mesh]\nbox = { x = [0, 1], y = [0, 1], z = [0, 2], cells = [2, 2, 4] }\n\
                    [boundaries]\ndefault = \"slip\"\n[time]\nend = 1\nmax_step = 1";
        let sources = Sources {
            file: "case.toml".into(),
            folder: "/".into(),
            text: text.into(),
            tables: BTreeMap::new(),
        };
        let case = Case::new(&sources).unwrap();
        let lines = [0.0, 0.5, 1.0, 1.5, 2.0];
        let part = MeshPart::single(tensor_box([&lines[..3], &lines[..3], &lines]));
        let surface = Surface { delta: 0.1, cell: 0.2, volume: 1.0 };
        let plan = of(&case, &part, Some(surface));
        assert_eq!((plan.nodes, plan.tets, plan.tets_per_rank), (45, 96, [96, 96]));
        let h = (2f64.sqrt() * 0.125).cbrt();
        assert!(plan.size.iter().all(|size| (size / h - 1.0).abs() < 1e-14));
        assert!((plan.speed - (2.0f64 * 9.81 * 2.0).sqrt()).abs() < 1e-12);
        // The steepest shape functions of a cube's six tetrahedra: |∇N| = √2 / 0.5.
        let rate = plan.speed * 2f64.sqrt() / 0.5;
        assert!((plan.step * rate - 1.0).abs() < 1e-12 && (plan.courant - 1.0).abs() < 1e-12);
        assert!(plan.memory > 0.0);
        assert!(plan.to_string().contains("surface: from 10 to 90 % of water in 4.39e-1 m"));
    }
}
