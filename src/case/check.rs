//! From the case file as typed to the case as checked. Every refusal names its key; what was left out is
//! filled in, so that the file written beside the results is the case that was run.

use super::error::{CaseError, Problem};
use super::file::{CaseFile, Every, EveryWord, FreeSurfaceTable, GaugeTable, InitialTable, Preset};
use super::nearest::did_you_mean;
use super::sources::Sources;
use super::{
    Carrier, Case, Flow, Fluid, FreeSurface, Gauge, GaugeKind, Gravity, Initial, MeshSource,
    Output, Regularisation, Solver, Time, VolumeCorrection,
};
use values::{Reader, at_least_one, between, finite_vector, not_negative, positive, refuse};

mod block;
mod bodies;
mod boundaries;
mod obstacles;
mod solid;
mod values;

impl Case {
    /// Checks the texts of a case. Reads no file.
    ///
    /// # Errors
    /// The first thing that is misspelt, impossible or contradictory, with file, line and key.
    pub fn new(sources: &Sources) -> Result<Self, CaseError> {
        let file = sources.parse()?;
        check(file, sources).map_err(|p| sources.source().error(&p.key, p.message))
    }
}

fn check(mut file: CaseFile, sources: &Sources) -> Result<Case, Problem> {
    let paper = file.preset == Some(Preset::Paper);
    finite_vector("gravity", &file.gravity)?;
    let mesh = mesh(&file, sources)?;
    let time = time(&mut file)?;
    let reader = Reader { sources, end: time.end };
    let (inside, always) = (block::points_inside(&mesh), [0.0, 0.5 * time.end, time.end]);
    let body_force = reader.vector("body_force", &file.body_force, &inside, &always)?;
    let prescribed = &file.prescribed_velocity;
    let prescribed_velocity = reader.vector("prescribed_velocity", prescribed, &inside, &always)?;
    if prescribed_velocity.is_some() {
        // The free surface alone: it needs air, of whatever density.
        file.air.get_or_insert_default();
    }
    let (liquid, gas) = fluids(&file)?;
    if gas.is_none() && file.free_surface.is_some() {
        return refuse("free_surface", "without the table [air] there is no free surface");
    }
    let initial = initial(&file, &reader, &inside)?;
    let (default_boundary, boundaries) = boundaries::check(&mut file, &mesh, &reader, &always)?;
    let obstacles = obstacles::check(&file, &reader, &sources.folder, &always, liquid.viscosity)?;
    let free_surface = match gas {
        Some(_) => free_surface(file.free_surface.get_or_insert_default(), paper)?,
        None => free_surface(&mut FreeSurfaceTable::default(), paper)?,
    };
    let flow = flow(&mut file, paper)?;
    let solver = solver(&mut file)?;
    let output = output(&mut file, &mesh, time.end)?;
    let gauges = (0..file.gauge.len()).map(|i| gauge(i, &file));
    let gauges = gauges.collect::<Result<_, _>>()?;
    let bodies = bodies::check(&mut file, paper, &reader, &sources.folder, &mesh, &obstacles)?;
    for (i, body) in (1..).zip(&file.body) {
        if obstacles.iter().any(|o| o.name == body.name) {
            let message = format!("an obstacle is called \"{}\" too", body.name);
            return refuse(format!("body[{i}].name"), message);
        }
    }
    sources.make_absolute(&mut file);
    let effective = toml::to_string(&file)
        .unwrap_or_else(|error| panic!("every case file can be written as TOML: {error}"));
    Ok(Case {
        title: file.title,
        path: sources.path(),
        mesh,
        refine: file.mesh.refine,
        obstacles,
        default_boundary,
        boundaries,
        liquid,
        gas,
        gravity: file.gravity,
        body_force,
        initial,
        prescribed_velocity,
        time,
        free_surface,
        flow,
        solver,
        output,
        gauges,
        bodies,
        effective,
        source: sources.source(),
    })
}

fn mesh(file: &CaseFile, sources: &Sources) -> Result<MeshSource, Problem> {
    let mesh = &file.mesh;
    // Eight times the elements each: beyond this, a slip of the finger.
    if mesh.refine > 6 {
        return refuse("mesh.refine", format!("must be at most 6, is {}", mesh.refine));
    }
    match (&mesh.block, &mesh.file) {
        (None, None) if file.bodies.is_some() => nothing(file),
        (None, None) => refuse("mesh", "needs a box or a file"),
        (Some(_), Some(_)) => refuse("mesh.file", "the mesh is a box or a file, not both"),
        (Some(_), None) => block::check(mesh).map(MeshSource::Box),
        (None, Some(name)) => {
            if !mesh.holes.is_empty() {
                return refuse("mesh.holes", "can only be left out of a box");
            }
            if mesh.jitter != 0.0 {
                return refuse("mesh.jitter", "moves the nodes of a box only");
            }
            Ok(MeshSource::Gmsh(sources.folder.join(name)))
        }
    }
}

/// Bodies alone: no fluid, so nothing about one.
fn nothing(file: &CaseFile) -> Result<MeshSource, Problem> {
    let fluid = [
        ("air", file.air.is_some()),
        ("boundaries", !file.boundaries.is_empty()),
        ("free_surface", file.free_surface.is_some()),
        ("prescribed_velocity", file.prescribed_velocity.is_some()),
        ("gauge", !file.gauge.is_empty()),
        ("mesh", !file.mesh.holes.is_empty()),
    ];
    match fluid.iter().find(|(_, there)| *there) {
        Some((key, _)) => refuse(*key, "has no effect without a mesh"),
        None => Ok(MeshSource::Nothing),
    }
}

fn time(file: &mut CaseFile) -> Result<Time, Problem> {
    let time = &mut file.time;
    let end = positive("time.end", time.end)?;
    if let Some(step) = time.step {
        let others = [
            ("max_cfl", time.max_cfl),
            ("max_step", time.max_step),
            ("first_step", time.first_step),
        ];
        for (key, other) in others {
            if other.is_some() {
                return refuse(format!("time.{key}"), "has no effect beside a fixed time.step");
            }
        }
        positive("time.step", step)?;
        return Ok(Time { end, step: Some(step), max_cfl: 1.0, max_step: step, first_step: None });
    }
    let max_cfl = positive("time.max_cfl", *time.max_cfl.get_or_insert(1.0))?;
    let max_step = positive("time.max_step", *time.max_step.get_or_insert(end))?;
    if let Some(first_step) = time.first_step {
        positive("time.first_step", first_step)?;
        if first_step > max_step {
            let message = format!("{first_step} s is longer than time.max_step, {max_step} s");
            return refuse("time.first_step", message);
        }
    }
    Ok(Time { end, step: None, max_cfl, max_step, first_step: time.first_step })
}

fn fluids(file: &CaseFile) -> Result<(Fluid, Option<Fluid>), Problem> {
    let fluid = |table: &str, density: f64, viscosity: f64| {
        positive(&format!("{table}.density"), density)?;
        not_negative(&format!("{table}.viscosity"), viscosity)?;
        Ok(Fluid { density, viscosity })
    };
    let water = fluid("water", file.water.density, file.water.viscosity)?;
    let air = file.air.as_ref().map(|a| fluid("air", a.density, a.viscosity)).transpose()?;
    Ok((water, air))
}

fn initial(file: &CaseFile, reader: &Reader, inside: &[[f64; 3]]) -> Result<Initial, Problem> {
    let initial = &file.initial;
    let noise = not_negative("initial.noise", initial.noise)?;
    if file.air.is_none() {
        let message = "without the table [air] water is everywhere; add [air]";
        if initial.water.is_some() {
            return refuse("initial.water", message);
        }
        if noise > 0.0 {
            return refuse("initial.noise", message);
        }
    }
    if file.prescribed_velocity.is_some() && initial.velocity != InitialTable::default().velocity {
        return refuse("initial.velocity", "has no effect beside prescribed_velocity");
    }
    let water = initial.water.as_ref();
    let water = water.map(|w| reader.condition("initial.water", w, inside, &[0.0])).transpose()?;
    let velocity = reader.three("initial.velocity", &initial.velocity, inside, &[0.0])?;
    let noise = (noise > 0.0).then_some((noise, initial.noise_seed));
    Ok(Initial { water, velocity, noise })
}

fn free_surface(table: &mut FreeSurfaceTable, paper: bool) -> Result<FreeSurface, Problem> {
    let key = |name: &str| format!("free_surface.{name}");
    let (regularisation, volume_correction) = if paper {
        (Regularisation::Plain, VolumeCorrection::Global)
    } else {
        (Regularisation::Psi, VolumeCorrection::PerBody)
    };
    Ok(FreeSurface {
        thickness: table.thickness.map(|d| positive(&key("thickness"), d)).transpose()?,
        thickness_cells: positive(&key("thickness_cells"), table.thickness_cells)?,
        conservative: table.conservative,
        regularisation: *table.regularisation.get_or_insert(regularisation),
        mobility: not_negative(&key("mobility"), table.mobility)?,
        profile_correction: *table.profile_correction.get_or_insert(!paper),
        volume_correction: *table.volume_correction.get_or_insert(volume_correction),
    })
}

fn flow(file: &mut CaseFile, paper: bool) -> Result<Flow, Problem> {
    let gravity = if paper { Gravity::Quadrature } else { Gravity::Edge };
    Ok(Flow {
        gravity: *file.flow.gravity.get_or_insert(gravity),
        iterations: at_least_one("flow.iterations", file.flow.iterations)?,
        wall_penalty: file
            .flow
            .wall_penalty
            .map(|p| positive("flow.wall_penalty", p))
            .transpose()?,
    })
}

fn solver(file: &mut CaseFile) -> Result<Solver, Problem> {
    let start = if file.air.is_some() { 1e-11 } else { 1e-6 };
    let solver = &mut file.solver;
    let start = *solver.start_tolerance.get_or_insert(start);
    Ok(Solver {
        tolerance: between("solver.tolerance", solver.tolerance, 0.0, 1.0)?,
        start_tolerance: between("solver.start_tolerance", start, 0.0, 1.0)?,
        phase_tolerance: between("solver.phase_tolerance", solver.phase_tolerance, 0.0, 1.0)?,
        max_iterations: at_least_one("solver.max_iterations", solver.max_iterations)?,
    })
}

fn output(file: &mut CaseFile, mesh: &MeshSource, end: f64) -> Result<Output, Problem> {
    let never = Every::Word(EveryWord::Never);
    let step = Every::Word(EveryWord::Step);
    // The one word each of them takes means "no time between".
    let time = |name: &str, every: &mut Option<Every>, default: Every, word: Every| {
        let key = format!("output.{name}");
        match *every.get_or_insert(default) {
            Every::Time(dt) => positive(&key, dt).map(Some),
            other if other == word => Ok(None),
            _ if word == never => refuse(key, "takes a time in seconds or \"never\""),
            _ => refuse(key, "takes a time in seconds or \"step\""),
        }
    };
    let output = &mut file.output;
    if output.energy && (*mesh == MeshSource::Nothing || file.prescribed_velocity.is_some()) {
        return refuse("output.energy", "is the account of a flow, and no flow is computed here");
    }
    let fields = if *mesh == MeshSource::Nothing { never } else { Every::Time(end / 50.0) };
    let bodies = if file.bodies.is_some() { Every::Time(end / 100.0) } else { never };
    Ok(Output {
        fields_every: time("fields_every", &mut output.fields_every, fields, never)?,
        bodies_every: time("bodies_every", &mut output.bodies_every, bodies, never)?,
        gauges_every: time("gauges_every", &mut output.gauges_every, step, step)?,
        checkpoint_every: time("checkpoint_every", &mut output.checkpoint_every, never, never)?,
        energy: output.energy,
    })
}

fn gauge(index: usize, file: &CaseFile) -> Result<Gauge, Problem> {
    let (before, typed) = (&file.gauge[..index], &file.gauge[index]);
    let key = format!("gauge[{}]", index + 1);
    let name = &typed.name;
    let plain = |c: char| c.is_alphanumeric() || "_-.+".contains(c);
    if name.is_empty() || name == "t" || !name.chars().all(plain) {
        let message = "is a column name: letters, digits, _ - . +, and not \"t\" alone";
        return refuse(format!("{key}.name"), format!("\"{name}\" {message}"));
    }
    if before.iter().any(|g| g.name == *name) {
        return refuse(format!("{key}.name"), format!("another gauge is called \"{name}\" too"));
    }
    let kind = match (typed.water_level, typed.pressure, typed.velocity) {
        (Some(line), None, None) => {
            for (i, end) in line.iter().enumerate() {
                finite_vector(&format!("{key}.water_level[{}]", i + 1), end)?;
            }
            if line[0] == line[1] {
                return refuse(
                    format!("{key}.water_level"),
                    "needs a line, both ends are the same",
                );
            }
            GaugeKind::WaterLevel { line }
        }
        (None, Some(at), None) => {
            GaugeKind::Pressure { at: finite_vector(&format!("{key}.pressure"), &at)? }
        }
        (None, None, Some(at)) => {
            GaugeKind::Velocity { at: finite_vector(&format!("{key}.velocity"), &at)? }
        }
        _ => return refuse(key, "needs one of water_level, pressure, velocity"),
    };
    let on = typed.on.as_ref().map(|on| carrier(&format!("{key}.on"), on, typed, file));
    Ok(Gauge { name: name.clone(), kind, on: on.transpose()? })
}

/// What a gauge rides on.
fn carrier(key: &str, on: &str, typed: &GaugeTable, file: &CaseFile) -> Result<Carrier, Problem> {
    if typed.water_level.is_some() {
        return refuse(key, "a line through the water rides on nothing");
    }
    let obstacles = file.obstacle.iter().map(|o| &*o.name);
    let bodies = file.body.iter().map(|b| &*b.name);
    let names: Vec<&str> = obstacles.chain(bodies).collect();
    if names.is_empty() {
        return refuse(key, "there is neither obstacle nor body to ride on");
    }
    match names.iter().position(|name| *name == on) {
        Some(i) if i < file.obstacle.len() => Ok(Carrier::Obstacle(i)),
        Some(i) => Ok(Carrier::Body(i - file.obstacle.len())),
        None => {
            let hint = did_you_mean(on, &names, "names");
            refuse(key, format!("no obstacle or body is called \"{on}\"; {hint}"))
        }
    }
}
