//! What is said of a case before it runs: nothing is wrong with it, but it may not be what was meant.

use super::Simulation;
use crate::bodies::neighbours::Partner;
use crate::bodies::{Bodies, Cluster};
use crate::case::MeshSource;
use crate::coupling::thickness::Thin;
use crate::report::plan::Surface;

/// Overlap of bodies over the radius of their spheres that is said: what settled lies less deep.
const OVERLAP: f64 = 0.1;

impl Simulation {
    /// The free surface as it stands. Collective.
    pub fn surface(&mut self) -> Option<Surface> {
        let phase = self.phase.as_mut()?;
        let volume = phase.volume(&self.part, &self.cut);
        Some(Surface { delta: phase.delta(), cell: phase.cell(), volume })
    }

    /// Sentences, the same on all ranks. Collective.
    pub fn warnings(&self) -> Vec<String> {
        let mut said = Vec::from_iter(self.no_water());
        said.extend(self.outside());
        said.extend(self.thin());
        if let Some(bodies) = &self.bodies {
            said.extend(self.overlap(bodies));
            said.extend(nothing_below(bodies));
        }
        said
    }

    /// Of a mesh that no water is in.
    fn no_water(&self) -> Option<String> {
        let most = self.phase.as_ref()?.phi.iter().fold(0.0, |most: f64, &phi| most.max(phi));
        let dry = self.part.max(most) < 0.5;
        dry.then(|| "water:   none at first (initial.water)".into())
    }

    /// Of each obstacle that stays, and of each entry of bodies, whose parts all are outside the mesh.
    fn outside(&self) -> Vec<String> {
        if self.case.mesh == MeshSource::Nothing {
            return Vec::new();
        }
        let structures = &self.structures;
        let solids = structures.solids(self.bodies.as_ref(), self.clock.t);
        let seen = |i: usize| {
            let solid = &solids[i];
            solid.outside_in
                || structures.obstacle_moves(i)
                || solid.shape.bounds(&solid.pose).meets(&structures.mesh)
        };
        let name = |i: &usize| structures.name(&self.case, self.bodies.as_ref(), *i);
        let numbers: Vec<usize> = (0..solids.len()).collect();
        let unseen =
            numbers.chunk_by(|a, b| name(a) == name(b)).filter(|c| !c.iter().any(|&i| seen(i)));
        unseen.map(|alike| format!("outside: {} is nowhere in the mesh", name(&alike[0]))).collect()
    }

    /// Of each obstacle, and of each entry of bodies, that is too thin for the mesh somewhere.
    fn thin(&self) -> Vec<String> {
        let thin = self.structures.thin(&self.part, self.bodies.as_ref(), self.clock.t);
        let name = |t: &Thin| self.structures.name(&self.case, self.bodies.as_ref(), t.structure);
        let sentence = |alike: &[Thin]| {
            let by_elements = |a: &&Thin, b: &&Thin| a.elements.total_cmp(&b.elements);
            let thinnest = alike.iter().min_by(by_elements).expect("a chunk is not empty");
            let Thin { place: [x, y, z], thickness, elements, share, .. } = thinnest;
            let others = match alike.len() {
                1 => String::new(),
                n => format!("; {} more of its parts are too thin", n - 1),
            };
            format!(
                "thin:    {} is {thickness:.3} m or {elements:.1} elements thick at ({x:.3}, {y:.3}, {z:.3}), and less \
                 than 2 on {:.0} % of its surface: the flow may not see it as it is{others}",
                name(thinnest),
                100.0 * share
            )
        };
        thin.chunk_by(|a, b| name(a) == name(b)).map(sentence).collect()
    }

    /// Of the body that begins deepest inside another or a wall.
    fn overlap(&self, bodies: &Bodies) -> Option<String> {
        let worst = bodies.deepest_overlap().filter(|o| o.relative > OVERLAP)?;
        let name = |cluster: u32| {
            self.structures.name(
                &self.case,
                Some(bodies),
                self.structures.first_body() + cluster as usize,
            )
        };
        let other = match worst.partner {
            Partner::Cluster(other) => name(other),
            Partner::Wall(wall) => format!("wall \"{}\"", bodies.world.walls[wall as usize].name),
        };
        Some(format!(
            "overlap: {} begins inside {other}: contact spheres are {:.3} m or {:.1} radii deep and will be thrown apart",
            name(worst.cluster),
            worst.depth,
            worst.relative
        ))
    }
}

/// Of bodies that nothing holds up.
fn nothing_below(bodies: &Bodies) -> Option<String> {
    let world = &bodies.world;
    let held = !world.walls.is_empty() || !world.clusters.iter().all(Cluster::is_free);
    let falls = !held && world.gravity.norm() > 0.0;
    falls.then(|| {
        "walls:   none, and no fixed body: what sinks leaves the mesh (bodies.walls)".into()
    })
}
