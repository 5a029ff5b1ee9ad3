"""Free surfaces: a cylinder carried round, waves in a tank, water at rest."""

import numpy as np

from checks import at_least, at_most, check, near
from norms import volumes
from program import figure, reference, variant

EXACT = "exact solution"
TURN = 2 * np.pi


def masses(points, tets):
    """∫N_i of each node."""
    mass = np.zeros(len(points))
    np.add.at(mass, tets.ravel(), np.repeat(volumes(points, tets) / 4, 4))
    return mass


def cylinder(work, label, turns, changes):
    """Runs the rotating cylinder; returns its run, the mesh's points, φ after each turn, and its L1 error."""
    case = variant("rotating_cylinder", {"time.end": turns * TURN, "output.fields_every": TURN, **changes})
    run = work.run(case, label)
    fields = run.fields()
    points, tets, _ = fields.at(0)
    phi = [fields.at(turn)[2]["phase"] for turn in range(turns + 1)]
    mass = masses(points, tets)
    return run, points, phi, [mass @ np.abs(end - phi[0]) / (mass @ phi[0]) for end in phi]


def drift(run, turns):
    """Relative change of volume a turn beyond what crossed the box's sides, where the profile's tails end."""
    h = run.history
    kept = h["volume"] - np.cumsum(h["inflow"])
    return abs(np.interp(turns * TURN, h["t"], kept) / kept[0] - 1) / turns


@check("rotating_cylinder", "paper's case 1: a cylinder of water carried round, 100 × 100 cells, 628 steps a turn")
def rotating_cylinder(work):
    limits = {1: 0.004} if work.quick else {1: 0.004, 5: 0.006}
    last = max(limits)
    runs = {}
    for mesh, jitter in (("regular", 0.0), ("jittered", 0.2)):
        runs[mesh], points, phi, l1 = cylinder(work, mesh, last, {"mesh.jitter": jitter})
        if mesh == "regular":
            shapes = [("start", phi[0]), ("conservative", phi[1])]
        away = np.hypot(points[:, 0] - 0.5, points[:, 1] - 0.75) > 0.15 + 0.1
        for turns, limit in limits.items():
            name = f"{mesh} mesh, {turns} turn{'s' if turns > 1 else ''}"
            yield at_most(work, f"L1 error, {name}", l1[turns], limit, EXACT)
            yield at_most(work, f"drift of volume a turn, {name}", drift(runs[mesh], turns), 1e-5, EXACT)
            yield at_least(work, f"least φ, {name}", phi[turns].min(), -0.01, EXACT, reference=0.0)
            yield at_most(work, f"largest φ, {name}", phi[turns].max(), 1.01, EXACT, reference=1.0)
            yield at_most(work, f"φ away from the cylinder, {name}", np.abs(phi[turns][away]).max(), 0.01, EXACT)
    changes = {"free_surface.volume_correction": "per_body"}
    runs["corrected"], *_ = cylinder(work, "corrected", last, changes)
    yield at_most(work, "drift of volume a turn, corrected", drift(runs["corrected"], last), 1e-10, EXACT)
    # At a tenth of the mobility: at the whole of it nothing is left to be drawn after half a turn.
    changes = {"free_surface.conservative": False, "free_surface.mobility": 0.1}
    run, points, phi, l1 = cylinder(work, "by_curvature", last, changes)
    source = "must be visibly worse"
    yield at_least(work, "L1 error without conservation, 1 turn", l1[1], 0.02, source, reference="> 0.02")
    draw_cylinders(work, points, [*shapes, ("by curvature", phi[1])])
    for turns in limits:
        histories = [("conservative", runs["regular"]), ("corrected", runs["corrected"]), ("by curvature", run)]
        draw_volumes(work, turns, histories)


def draw_cylinders(work, points, shapes):
    plot, axes = figure(figsize=(5, 5))
    front = np.isclose(points[:, 2], points[:, 2].min())
    for (name, phi), colour in zip(shapes, ("k", "C0", "C3")):
        x, y = points[front, 0], points[front, 1]
        axes.tricontour(x, y, phi[front], [0.5], colors=colour)
        axes.plot([], [], colour, label=name)
    axes.set(aspect="equal", xlabel="x", ylabel="y", xlim=(0, 1), ylim=(0, 1))
    axes.legend()
    plot.savefig(work.folder / "shape.png", dpi=150)


def draw_volumes(work, turns, runs):
    plot, axes = figure(figsize=(6, 4))
    for label, run in runs:
        t, volume = run.history["t"] / TURN, run.history["volume"]
        axes.plot(t[t <= turns], volume[t <= turns] / volume[0], label=label)
    axes.set(xlabel="turns", ylabel="volume / initial volume")
    axes.ticklabel_format(useOffset=False)
    axes.legend()
    plot.savefig(work.folder / f"volume_{turns}.png", dpi=150)


def amplitude(t, level, period, start, damping=0.0):
    """Amplitude of the fundamental over the period that begins at `start`."""
    inside = (t >= start) & (t < start + period)
    phase = 2 * np.pi * t[inside] / period
    decay = np.exp(-damping * t[inside])
    basis = np.stack([decay * np.cos(phase), decay * np.sin(phase), np.ones_like(phase)], axis=1)
    c, s, _ = np.linalg.lstsq(basis, level[inside], rcond=None)[0]
    return np.hypot(c, s)


def period_of(t, level, guess, damping=0.0):
    """Period that fits the whole record best."""
    def misfit(period):
        phase = 2 * np.pi * t / period
        decay = np.exp(-damping * t)
        basis = np.stack([decay * np.cos(phase), decay * np.sin(phase), np.ones_like(t)], axis=1)
        solution = np.linalg.lstsq(basis, level, rcond=None)[0]
        return np.sum((basis @ solution - level) ** 2)

    for width in (0.05, 0.001, 0.00002):
        tried = guess * np.linspace(1 - width, 1 + width, 101)
        guess = tried[np.argmin([misfit(period) for period in tried])]
    return guess


@check("sloshing", "paper's case 2: waves of two inviscid fluids, ten periods")
def sloshing(work):
    thicknesses = [0.0025] if work.quick else [0.0025, 0.005]
    periods = []
    for delta in thicknesses:
        # Linear theory for the profile of thickness δ: linear in δ, sharp limit 3.9417.
        theory = 3.9417 + (3.9575 - 3.9417) * delta / 0.0025
        gauges = work.run(variant("sloshing", {"free_surface.thickness": delta}), f"delta{delta:g}").gauges
        t = gauges["t"]
        period = period_of(t, gauges["left"], theory)
        periods.append(period)
        yield near(work, f"period, δ = {delta:g}", period, theory, "linear theory of the tanh profile", relative=0.002)
        first, last = (amplitude(t, gauges["left"], theory, k * theory) for k in (0, 9))
        yield near(work, f"amplitude of period 10 over period 1, δ = {delta:g}", last / first, 1.0, EXACT, absolute=0.02)
        draw_walls(work, gauges, theory, delta)
    if len(periods) == 2:
        sharp = 2 * periods[0] - periods[1]
        yield near(work, "period at δ → 0, extrapolated", sharp, 3.9417, "linear theory of two layers", relative=0.002)


def draw_walls(work, gauges, period, delta):
    plot, axes = figure(figsize=(8, 3.5))
    for wall in ("left", "right"):
        axes.plot(gauges["t"] / period, gauges[wall] - 1, label=f"{wall} wall")
    axes.set(xlabel="t / T", ylabel="elevation [m]")
    axes.legend(loc="upper right")
    plot.savefig(work.folder / f"walls_{delta:g}.png", dpi=150)


@check("standing_wave", "a viscous standing wave, Re 200")
def standing_wave(work):
    gauges = work.run(variant("standing_wave"), "run").gauges
    t, level = gauges["t"], gauges["middle"] - 1
    theory, damping = 2 * np.pi / np.sqrt(np.pi * np.tanh(np.pi)), 2 * 0.005 * np.pi**2
    period = period_of(t, level, theory, damping)
    yield near(work, "period", period, theory, "linear theory", relative=0.01)
    # The wave begins with no boundary layer: its damping is not yet that of the normal mode.
    exact = reference("standing_wave", "standing_wave_viscous_Re200.csv")
    time, elevation = list(exact.values())[:2]
    around = (time > 4.75 * theory) & (time < 5.25 * theory)
    crest = 0.01 * np.abs(elevation[around]).max()
    here = np.abs(level[(t > 4.75 * theory) & (t < 5.25 * theory)]).max()
    yield near(work, "crest after 5 periods [m]", here, crest, "viscous initial-value solution", relative=0.1)
    plot, axes = figure(figsize=(8, 3.5))
    axes.plot(t, level, label="here")
    axes.plot(time, -0.01 * elevation, "k.", label="reference")
    axes.set(xlabel="t", ylabel="elevation at x = 0")
    axes.legend()
    plot.savefig(work.folder / "elevation.png", dpi=150)


@check("still_water", "water at rest stays at rest: 1000 : 1, jittered and unstructured meshes, also tilted 20°")
def still_water(work):
    tilt = np.radians(20)
    down = np.array([np.sin(tilt), 0, np.cos(tilt)])
    tilted = {
        "gravity": (-9.81 * down).tolist(),
        "initial.water": f"{down[0]}*(x - 0.5) + {down[2]}*(z - 0.507) < 0",
        "boundaries.z_max": "slip",
    }
    gmsh = {"mesh": {"file": "tank.msh"}, "boundaries": {"default": "slip"}}
    scale, depth = np.sqrt(9.81 * 0.507), 0.507
    end = 30 * np.sqrt(depth / 9.81)
    cases = [("jittered", {}), ("jittered, tilted", tilted), ("unstructured, tilted", {**tilted, **gmsh})]
    for name, changes in cases:
        changes = {"time.end": end, "output.fields_every": end, **changes}
        if "mesh" in changes:
            changes.pop("boundaries.z_max", None)
        data = work.run(variant("still_water", changes), name.replace(", ", "_")).fields().at(-1)[2]
        speed = np.linalg.norm(data["velocity"], axis=1).max() / scale
        yield at_most(work, f"|u|/√(gH) at t√(g/H) = 30, {name}", speed, 1e-8, EXACT)
    # Finer: what of the noise is waves of eight cells and more, nothing damps where ν = 0.
    cells = 16 if work.quick else 24
    noise = {
        "mesh.box.cells": [cells] * 3,
        "time.end": end,
        "time.step": 0.32 / cells,
        "output.fields_every": end,
        "initial.noise": 0.1 / cells,
        "boundaries.z_max": "slip",
    }
    data = work.run(variant("still_water", noise), "noise").fields().at(-1)[2]
    speed, phi = np.linalg.norm(data["velocity"], axis=1) / scale, data["phase"]
    yield at_most(work, f"|u|/√(gH) in the water after ±0.1 h of noise, {cells}³ cells", speed[phi > 0.5].max(), 1e-3, EXACT)
    yield at_most(work, f"|u|/√(gH) in the air after ±0.1 h of noise, {cells}³ cells", speed[phi <= 0.5].max(), 2e-2, EXACT)
