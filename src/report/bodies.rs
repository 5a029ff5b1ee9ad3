//! The files of bodies: `bodies.vtkhdf` (their surfaces), `bodies.csv` (energies, momentum, recorded points), `bonds.csv` (every
//! face that came off) and `left.csv` (every body that left the mesh).

use super::output::Schedule;
use crate::bodies::{Bodies, Tracked, cohesion_law::BROKEN};
use crate::case::Case;
use io::table::TableWriter;
use io::{Error, MovingFile};
use nalgebra::Vector3;
use std::path::Path;

/// Columns of bodies.csv before those of recorded points.
const COLUMNS: [(&str, &str); 19] = [
    ("t", "s"),
    ("kinetic", "J"),
    ("potential", "J"),
    ("contact", "J"),
    ("bonds", "J"),
    ("fracture", "J"),
    ("dashpots", "J"),
    ("friction", "J"),
    ("work", "J"),
    ("total", "J"),
    ("broken_faces", ""),
    ("broken_area", "m2"),
    ("deepest_overlap", ""),
    ("momentum_x", "kg m/s"),
    ("momentum_y", "kg m/s"),
    ("momentum_z", "kg m/s"),
    ("angular_momentum_x", "kg m2/s"),
    ("angular_momentum_y", "kg m2/s"),
    ("angular_momentum_z", "kg m2/s"),
];

/// Columns of bonds.csv.
const BONDS: [(&str, &str); 8] = [
    ("t", "s"),
    ("x", "m"),
    ("y", "m"),
    ("z", "m"),
    ("body_a", ""),
    ("body_b", ""),
    ("face", ""),
    ("area", "m2"),
];

/// Columns of left.csv.
const LEFT: [(&str, &str); 9] = [
    ("t", "s"),
    ("body", ""),
    ("entry", ""),
    ("x", "m"),
    ("y", "m"),
    ("z", "m"),
    ("u", "m/s"),
    ("v", "m/s"),
    ("w", "m/s"),
];

/// Fields at the points of surfaces.
const FIELDS: [(&str, usize); 4] = [("velocity", 3), ("damage", 1), ("body", 1), ("entry", 1)];

/// Facets of round bodies over their radius.
const FACET: f64 = 0.3;

/// The open files of bodies.
pub struct BodiesOutput {
    surfaces: MovingFile,
    table: Option<TableWriter>,
    bonds: Option<TableWriter>,
    left: Option<TableWriter>,
    schedule: Schedule,
    tracked: Vec<Tracked>,
    /// Breaks of this rank that are in bonds.csv already.
    written: usize,
    /// Bodies that are in left.csv already.
    gone: usize,
    /// Corners of each cluster's surface in its own frame, and their first id.
    corners: Vec<(Vec<Vector3<f64>>, u64)>,
}

impl BodiesOutput {
    /// Opens the files in `folder`; `after` a time [s], those of an interrupted run. `None` if the case asks
    /// for none. Collective.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn open(
        case: &Case,
        bodies: &Bodies,
        tracked: &[Tracked],
        folder: &Path,
        after: Option<f64>,
    ) -> Result<Option<Self>, Error> {
        let Some(every) = case.output.bodies_every else { return Ok(None) };
        let comm = bodies.ranks.comm();
        let mut corners = Vec::new();
        let mut triangles: Vec<[u64; 3]> = Vec::new();
        let mut n = 0;
        for cluster in &bodies.world.clusters {
            let surface = cluster.form.shape.surface(FACET * cluster.form.radius);
            let global = |t: &[u32; 3]| t.map(|v| n + u64::from(v));
            triangles.extend(surface.triangles.iter().map(global));
            let first = n;
            n += surface.vertices.len() as u64;
            corners.push((surface.vertices, first));
        }
        let path = folder.join("bodies.vtkhdf");
        let surfaces = match after {
            None => MovingFile::create(comm, &path, n, &triangles, &FIELDS)?,
            Some(t) => MovingFile::resume(comm, &path, t, n, &triangles, &FIELDS)?,
        };
        let open = |name: &str, columns: &[(&str, &str)]| {
            let path = folder.join(name);
            let opened = match (comm.rank(), after) {
                (0, None) => TableWriter::create(&path, columns).map(Some),
                (0, Some(t)) => TableWriter::resume(&path, t, columns).map(Some),
                _ => Ok(None),
            };
            Error::agree(comm, opened)
        };
        let names: Vec<(String, &str)> = tracked
            .iter()
            .flat_map(|p| ["x", "y", "z"].map(|axis| (format!("{}_{axis}", p.name), "m")))
            .collect();
        let mut columns = COLUMNS.to_vec();
        columns.extend(names.iter().map(|(name, unit)| (&**name, *unit)));
        Ok(Some(Self {
            surfaces,
            table: open("bodies.csv", &columns)?,
            bonds: open("bonds.csv", &BONDS)?,
            left: open("left.csv", &LEFT)?,
            schedule: Schedule::new(every, after),
            tracked: tracked.to_vec(),
            written: bodies.breaks.len(),
            gone: bodies.left.len(),
            corners,
        }))
    }

    /// When they are next due [s].
    pub fn next_time(&self) -> f64 {
        self.schedule.next_time()
    }

    /// Writes faces that came off, and the rest if it is due. Collective.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_if_due(&mut self, t: f64, bodies: &Bodies) -> Result<(), Error> {
        self.write_breaks(bodies)?;
        self.write_left(bodies)?;
        if !self.schedule.take(t) {
            return Ok(());
        }
        self.write_line(t, bodies)?;
        let damage = damage(bodies);
        let (mut ids, mut points) = (Vec::new(), Vec::new());
        let mut fields = [const { Vec::new() }; 4];
        for &c in bodies.ranks.owned() {
            let c = c as usize;
            let (corners, first) = &self.corners[c];
            let pose = &bodies.state.pose[c];
            let (velocity, spin) = (bodies.state.velocity[c], bodies.spin(c));
            for (id, &corner) in (*first..).zip(corners) {
                let x = pose.to_space(corner);
                ids.push(id);
                points.push(x.into());
                let v: [f64; 3] = (velocity + spin.cross(&(x - pose.position))).into();
                fields[0].extend(v);
                fields[1].push(damage[c]);
                fields[2].push(c as f64);
                fields[3].push(f64::from(bodies.world.clusters[c].group));
            }
        }
        self.surfaces.append(t, &ids, &points, &fields.each_ref().map(|f| &f[..]))
    }

    fn write_breaks(&mut self, bodies: &Bodies) -> Result<(), Error> {
        let mine: Vec<[f64; 5]> = bodies.breaks[self.written..]
            .iter()
            .map(|b| [b.t, b.place.x, b.place.y, b.place.z, f64::from(b.joint)])
            .collect();
        self.written = bodies.breaks.len();
        let mut all = bodies.ranks.comm().all_gather(&mine).concat();
        all.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[4].total_cmp(&b[4])));
        let mut written = Ok(());
        if let Some(table) = &mut self.bonds {
            for [t, x, y, z, face] in all {
                let joint = bodies.joints.joints[face as usize];
                // The sum of none is −0.
                let area = bodies.joints.areas(face as usize).0;
                let row = [t, x, y, z, joint.a.into(), joint.b.into(), face, area];
                written = written.and_then(|()| table.row(&row));
            }
        }
        Error::agree(bodies.ranks.comm(), written)
    }

    fn write_left(&mut self, bodies: &Bodies) -> Result<(), Error> {
        let mut written = Ok(());
        if let Some(table) = &mut self.left {
            for left in &bodies.left[self.gone..] {
                let entry = bodies.world.clusters[left.cluster as usize].group;
                let (x, v) = (left.place, left.velocity);
                let row = [left.t, left.cluster.into(), entry.into(), x.x, x.y, x.z, v.x, v.y, v.z];
                written = written.and_then(|()| table.row(&row));
            }
        }
        self.gone = bodies.left.len();
        Error::agree(bodies.ranks.comm(), written)
    }

    fn write_line(&mut self, t: f64, bodies: &Bodies) -> Result<(), Error> {
        let account = bodies.account();
        let mut values = vec![0.0; 2 + 3 * self.tracked.len()];
        for (j, joint) in bodies.joints.joints.iter().enumerate() {
            if bodies.ranks.is_owned()[joint.a as usize] {
                values[0] += f64::from(u8::from(bodies.joints.alive[j] == 0));
                values[1] += bodies.joints.areas(j).1;
            }
        }
        for (i, p) in self.tracked.iter().enumerate() {
            if bodies.ranks.is_owned()[p.cluster as usize] {
                let x: [f64; 3] = bodies.state.pose[p.cluster as usize].to_space(p.local).into();
                values[2 + 3 * i..5 + 3 * i].copy_from_slice(&x);
            }
        }
        bodies.ranks.comm().sum_all(&mut values);
        let mut row = vec![t];
        row.extend(account.to_array());
        row.push(account.total());
        row.extend(&values[..2]);
        row.push(bodies.ranks.comm().max(bodies.deepest()));
        let momentum = bodies.momentum();
        row.extend(momentum.linear.iter().chain(&momentum.angular));
        row.extend(&values[2..]);
        let written = self.table.as_mut().map_or(Ok(()), |table| table.row(&row));
        Error::agree(bodies.ranks.comm(), written)
    }
}

/// Sizes, sub-step and cost of the bodies of a case that runs until `end` [s], as `--check` tells it.
pub fn plan(bodies: &Bodies, end: f64) -> String {
    let world = &bodies.world;
    let spheres: usize = world.clusters.iter().map(|c| c.form.spheres.len()).sum();
    let mass: f64 = world.clusters.iter().filter(|c| c.is_free()).map(|c| c.mass).sum();
    let (joints, points) = (bodies.joints.joints.len(), bodies.joints.places.len());
    // The sum of none is −0.
    let area = bodies.joints.area.iter().fold(0.0, |sum, area| sum + area);
    let (step, limit) = (bodies.time_step(), bodies.limit());
    let steps = (end / step).ceil();
    format!(
        "bodies:  {} with {spheres} contact spheres, {mass:.4e} kg free to move\n\
         bonds:   {joints} faces, {area:.4e} m2, {points} points\n\
         substep: {step:.3e} s, {limit:.3e} s would be the longest stable one\n\
         \x20        {steps:.3e} sub-steps, {:.1e} sphere-steps: about {:.0} s on one core if all touch",
        world.clusters.len(),
        steps * spheres as f64,
        steps * (spheres as f64 / SPHERE_STEPS + points as f64 / POINT_STEPS),
    )
}

/// The sub-step, as a run tells it.
pub fn sub_step(bodies: &Bodies) -> String {
    let (step, limit) = (bodies.time_step(), bodies.limit());
    format!("bodies: sub-steps of {step:.3e} s; the longest stable one is {limit:.3e} s")
}

/// Sphere-steps and point-steps of bonds a second of one core, roughly.
const SPHERE_STEPS: f64 = 5e6;
const POINT_STEPS: f64 = 5e7;

/// Broken over glued area of each cluster; 0 where nothing was glued.
fn damage(bodies: &Bodies) -> Vec<f64> {
    let mut areas = vec![[0.0; 2]; bodies.state.len()];
    let joints = &bodies.joints;
    for joint in &joints.joints {
        for p in joint.first as usize..joint.end as usize {
            for c in [joint.a, joint.b].map(|c| c as usize) {
                areas[c][0] += joints.area[p];
                if joints.largest[p] == BROKEN {
                    areas[c][1] += joints.area[p];
                }
            }
        }
    }
    areas.into_iter().map(|[all, broken]| if all > 0.0 { broken / all } else { 0.0 }).collect()
}
