//! `energy.csv`: where the energy of water, air and bodies is after each step, and where it went since t = 0.

use crate::bodies::Account;
use crate::mesh::MeshPart;
use io::Error;
use io::table::TableWriter;
use std::path::Path;

/// Columns of energy.csv after the time.
const COLUMNS: [&str; 30] = [
    // The fluids: what they have; work they did and got.
    "kinetic",
    "potential",
    "to_bodies",
    "to_obstacles",
    "to_boundaries",
    "from_forces",
    // Lost.
    "viscous",
    "streamline",
    "pressure",
    "divergence",
    "walls",
    "ghost",
    "convection",
    "transport",
    "regularisation",
    "volume",
    "recut",
    "fluid_total",
    // Between fluids and bodies: what the fluids gave and bodies did not get; what these got elsewhere.
    "coupling",
    "from_hidden",
    "from_applied",
    // The bodies, as in bodies.csv.
    "bodies_kinetic",
    "bodies_potential",
    "contact",
    "bonds",
    "fracture",
    "dashpots",
    "friction",
    "bodies_total",
    "total",
];

/// Energies [J]. The first two are there; the rest went since t = 0, losses and work done being positive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// ∫½ρu² of the fluids.
    pub kinetic: f64,
    /// −∫ρ g·x of the fluids.
    pub potential: f64,
    /// Work on bodies, as their walls moved for the flow.
    pub bodies: f64,
    /// Work on obstacles.
    pub obstacles: f64,
    /// Work on boundaries, and what left through them.
    pub boundaries: f64,
    /// What forces besides gravity did.
    pub forces: f64,
    /// Viscosity.
    pub viscous: f64,
    /// SUPG.
    pub streamline: f64,
    /// PSPG.
    pub pressure: f64,
    /// LSIC.
    pub divergence: f64,
    /// Walls of structures, beyond their work.
    pub walls: f64,
    /// Ghost penalty.
    pub ghost: f64,
    /// Kinetic energy that the transport of momentum and of φ did not keep between them.
    pub convection: f64,
    /// Potential energy that the transport of φ gained short of gravity's work.
    pub transport: f64,
    /// Potential energy, as φ was regularised.
    pub regularisation: f64,
    /// Potential energy, as its volume was corrected.
    pub volume: f64,
    /// Both energies, as the mesh was cut anew beyond what the walls swept.
    pub recut: f64,
    /// Work that bodies received from what their walls bore.
    pub received: f64,
    /// Work that they received on their hidden surface.
    pub hidden: f64,
    /// Of the bodies.
    pub account: Account,
}

/// Entries of `Energy` before the bodies' account.
const SUMS: usize = 19;

impl Energy {
    /// All entries but the bodies' account, in order.
    pub fn sums(&self) -> [f64; SUMS] {
        [
            self.kinetic,
            self.potential,
            self.bodies,
            self.obstacles,
            self.boundaries,
            self.forces,
            self.viscous,
            self.streamline,
            self.pressure,
            self.divergence,
            self.walls,
            self.ghost,
            self.convection,
            self.transport,
            self.regularisation,
            self.volume,
            self.recut,
            self.received,
            self.hidden,
        ]
    }

    /// The other way round.
    pub fn set_sums(&mut self, sums: &[f64]) {
        let entries = [
            &mut self.kinetic,
            &mut self.potential,
            &mut self.bodies,
            &mut self.obstacles,
            &mut self.boundaries,
            &mut self.forces,
            &mut self.viscous,
            &mut self.streamline,
            &mut self.pressure,
            &mut self.divergence,
            &mut self.walls,
            &mut self.ghost,
            &mut self.convection,
            &mut self.transport,
            &mut self.regularisation,
            &mut self.volume,
            &mut self.recut,
            &mut self.received,
            &mut self.hidden,
        ];
        entries.into_iter().zip(sums).for_each(|(entry, sum)| *entry = *sum);
    }

    /// What the fluids have and what they lost, to bodies too: constant, but for the solver's tolerance [J].
    pub fn fluid_total(&self) -> f64 {
        // All are there or lost but for one, which was gained.
        let all: f64 = self.sums()[..SUMS - 2].iter().sum();
        all - 2.0 * self.forces
    }

    /// All of it, less what was given to bodies by others: constant, but for tolerances [J].
    pub fn total(&self) -> f64 {
        self.fluid_total() + self.account.total()
    }

    /// A line of energy.csv.
    pub fn line(&self) -> [f64; COLUMNS.len()] {
        let mut line = [0.0; COLUMNS.len()];
        let (fluid, rest) = line.split_at_mut(SUMS - 2);
        fluid.copy_from_slice(&self.sums()[..SUMS - 2]);
        let a = self.account;
        rest.copy_from_slice(&[
            self.fluid_total(),
            self.bodies - self.received,
            self.hidden,
            a.work - self.received - self.hidden,
            a.kinetic,
            a.potential,
            a.contact,
            a.bonds,
            a.fracture,
            a.dashpots,
            a.friction,
            a.total(),
            self.total(),
        ]);
        line
    }
}

/// The open file.
pub struct EnergyOutput(Option<TableWriter>);

impl EnergyOutput {
    /// Opens the file in `folder`; `after` a time [s], that of an interrupted run. Collective.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn open(part: &MeshPart, folder: &Path, after: Option<f64>) -> Result<Self, Error> {
        let path = folder.join("energy.csv");
        let columns: Vec<_> =
            std::iter::once(("t", "s")).chain(COLUMNS.map(|name| (name, "J"))).collect();
        let opened = match (part.comm.rank(), after) {
            (0, None) => TableWriter::create(&path, &columns).map(Some),
            (0, Some(t)) => TableWriter::resume(&path, t, &columns).map(Some),
            _ => Ok(None),
        };
        Error::agree(&part.comm, opened).map(Self)
    }

    /// Adds a line. Collective.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&mut self, part: &MeshPart, t: f64, energy: &Energy) -> Result<(), Error> {
        let row: Vec<f64> = std::iter::once(t).chain(energy.line()).collect();
        let written = self.0.as_mut().map_or(Ok(()), |table| table.row(&row));
        Error::agree(&part.comm, written)
    }
}
