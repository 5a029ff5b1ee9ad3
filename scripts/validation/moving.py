"""Structures that hold water back or move through it: leaks, volume, noise of forces, a valley."""

import numpy as np

from checks import at_most, check, near, reported, show
from norms import volumes
from program import Variant, figure, variant

EXACT = "exact"


def tank(size, cells, level, obstacle, end, **settings):
    """A box of water and air around one obstacle; its volume is not corrected."""
    axes = {axis: [0, length] for axis, length in zip("xyz", size)}
    return {
        "mesh": {"box": axes | {"cells": cells}} | settings.pop("mesh", {}),
        "boundaries": {"default": "slip", "z_max": "open"},
        "initial": {"water": level},
        "air": {},
        "free_surface": {"volume_correction": "off"},
        "time": {"end": end} | settings.pop("time", {}),
        "obstacle": [obstacle],
    } | settings


def held(run, x_wall):
    """Water to the left of a wall in elements that are all fluid, at each time of the fields [m³]."""
    fields = run.fields()
    sums = []
    for step in range(len(fields.times)):
        points, tets, data = fields.at(step)
        wet = (data["structure_distance"][tets] > 0).all(axis=1) & (points[tets][:, :, 0].mean(axis=1) < x_wall)
        sums.append((volumes(points, tets) * data["phase"][tets].mean(axis=1))[wet].sum())
    return np.array(sums)


@check("leak", "a wall of two cells' thickness, wherever it stands, holds water at rest back for 10 s")
def leak(work):
    def lost(x_wall, label, **settings):
        wall = {"name": "wall", "cuboid": [0.1, 1, 2], "at": [x_wall, 0.05, 0.25], "wall": "slip"}
        table = tank([1, 0.1, 0.5], [20, 2, 10], f"z < 0.3 - 9*(x > {x_wall})", wall, 10, **settings)
        table["output"] = {"fields_every": 10}
        water = held(work.run(Variant(table), label), x_wall)
        return 1 - water[-1] / water[0]

    offsets = np.random.default_rng(7).uniform(0, 0.05, 3 if work.quick else 10)
    leaks = [lost(0.45 + float(offset), f"nitsche_{i}") for i, offset in enumerate(offsets)]
    worst = max(leaks, key=abs)
    yield at_most(work, f"water lost, worst of {len(leaks)} places, Nitsche", abs(worst), 1e-6, EXACT)
    for penalty in (1e6,) if work.quick else (1e5, 1e6, 1e7, 1e8):
        try:
            measured = show(lost(0.4731, f"penalty_{penalty:g}", flow={"wall_penalty": penalty}))
        except RuntimeError:
            measured = "no convergence"
        yield reported(work, f"the same, penalty of {penalty:g} Pa s/m", measured, "0", EXACT)


@check("plunger", "a plunger lowered into water and raised five times")
def plunger(work):
    cells = [16, 8, 14] if work.quick else [24, 12, 21]
    h, area, across = 1 / cells[0], 0.5, 0.3 * 0.25
    lines = [(x, y) for x in (0.08, 0.22, 0.78, 0.92) for y in (0.06, 0.25, 0.44)]
    gauges = [{"name": f"g{i}", "water_level": [[x, y, 0], [x, y, 0.8]]} for i, (x, y) in enumerate(lines)]
    changes = {"mesh.box.cells": cells, "gauge": gauges, "output.fields_every": "never"}
    off = {"free_surface.volume_correction": "off"}
    run = work.run(variant("plunger", changes | off), "off")
    h_off = run.history
    drift = (h_off["volume"] - np.cumsum(h_off["inflow"])) / h_off["volume"][0] - 1
    yield at_most(work, "volume, largest change, correction off", np.abs(drift).max(), 1e-3, EXACT)
    yield at_most(work, "the same after five strokes", abs(drift[-1]), 1e-3, EXACT)

    t, level = run.gauges["t"], np.mean([run.gauges[f"g{i}"] for i in range(len(lines))], axis=0)
    bottom = 0.45 - 0.1 * (1 - np.cos(2 * np.pi * t))
    still = 0.4 * area
    exact = np.maximum(still / area, (still - across * bottom) / (area - across))
    last = t > 4
    mean = lambda values: np.trapezoid(values[last], t[last]) / (t[last][-1] - t[last][0])
    above = (mean(level) - mean(exact)) / h
    yield near(work, "level in the fifth stroke, mean, off the exact one, in cells", above, 0, EXACT, absolute=0.25)

    corrected = work.run(variant("plunger", changes), "on").history
    share = np.abs(corrected["correction_sum"]).max() / corrected["volume"][0]
    yield at_most(work, "sum of corrections over the volume, correction on", share, 1e-3, EXACT)

    plot, (above, below) = figure(nrows=2, figsize=(6, 6), sharex=True)
    above.plot(h_off["t"], 100 * drift)
    above.set(ylabel="change of volume [%]")
    below.plot(t, level, label="mean of the gauges")
    below.plot(t, exact, "--", label="without waves")
    below.set(xlabel="t [s]", ylabel="level [m]")
    below.legend()
    plot.savefig(work.folder / "plunger.png", dpi=150)


def noise(t, values, half):
    """Trend (parabolas fitted over ±`half` s), and what is left."""
    trend = np.empty_like(values)
    for i, now in enumerate(t):
        near_by = np.abs(t - now) <= half
        trend[i] = np.polyfit(t[near_by] - now, values[near_by], 2)[-1]
    return trend, values - trend


@check("crossing", "a sphere crosses a tank from the air into the water: the noise of its forces")
def crossing(work):
    f = 1 if work.quick else 2
    ball = {"name": "ball", "sphere": 0.12, "at": [0.4, 0.3, 0.6], "wall": "slip"}
    speed = 0.4
    ball["velocity"] = [f"{speed}*min(t/0.3, 1)", 0, f"-{speed / 2}*min(t/0.3, 1)"]
    table = tank([1.6, 0.6, 0.8], [32 * f, 12 * f, 16 * f], "z < 0.4", ball, 2)
    table["output"] = {"fields_every": "never"}
    run = work.run(Variant(table))
    loads = run.loads
    t = loads["t"]
    # The ramp at the start is left out.
    kept = t > 0.35
    h = 0.05 / f
    forces = {axis: loads[f"ball_force_{axis}"] for axis in "xyz"}
    trends, rests = {}, {}
    for axis, force in forces.items():
        trends[axis], rests[axis] = noise(t[kept], force[kept], 2 * h / speed)
    length = lambda parts: np.sqrt(sum(parts[axis] ** 2 for axis in "xyz"))
    half_range = lambda values: 0.5 * (values.max() - values.min())
    amplitude, rest = half_range(length(trends)), length(rests)
    yield at_most(work, "force, noise (rms) over amplitude", np.sqrt((rest**2).mean()) / amplitude, 0.05, EXACT)
    yield at_most(work, "upward force, noise (rms) over its amplitude", rests["z"].std() / half_range(trends["z"]), 0.05, EXACT)
    told = {
        "force, largest spike over amplitude": rest.max() / amplitude,
        "force along, noise (rms) over its own small amplitude": rests["x"].std() / half_range(trends["x"]),
    }
    for name, value in told.items():
        yield reported(work, name, value, "0", EXACT)
    plot, axes = figure(nrows=2, figsize=(6, 6), sharex=True)
    for axis, ax in zip("xz", axes):
        ax.plot(t, forces[axis], ".-", label="reaction")
        ax.plot(t[kept], trends[axis], label="trend")
        ax.set(ylabel=f"force along {axis} [N]")
        ax.legend()
    axes[-1].set(xlabel="t [s]")
    plot.savefig(work.folder / "forces.png", dpi=150)


@check("valley", "a wave runs up a valley given as a grid of heights")
def valley(work):
    changes = {"output.fields_every": 0.5}
    if work.quick:
        changes |= {"time.end": 2}
        for axis, cells in {"x": [30], "y": [15], "z": [6, 4]}.items():
            changes[f"mesh.box.{axis}.cells"] = cells
    run = work.run(variant("valley", changes))
    h = run.history
    kept = h["volume"] - np.cumsum(h["inflow"])
    change = np.abs(kept / kept[0] - 1).max()
    yield at_most(work, "change of volume, what leaves through the top counted", change, 1e-4, EXACT)
    moved = np.abs(h["correction_sum"]).max() / kept[0]
    yield at_most(work, "sum of corrections over the volume", moved, 1e-2, EXACT)
    # The front is at x = 12 after 1.9 s: before 1 s nothing happens beyond it, wet or dry.
    fields = run.fields()
    away = []
    for step in (0, int(np.searchsorted(fields.times, 1 - 1e-9))):
        points, tets, data = fields.at(step)
        far = points[tets][:, :, 0].min(axis=1) > 14
        phase = np.where(data["structure_distance"] > 0, data["phase"], 0)
        away.append((volumes(points, tets) * phase[tets].mean(axis=1))[far].sum())
        # Distances end an edge's length away from the ground's surface: no element there has fluid.
        distance = data["structure_distance"]
        wet = data["phase"][distance < 0.999 * distance.min()]
    yield near(work, "water beyond x = 14 m after 1 s, over that at first", away[1] / away[0], 1, EXACT, absolute=0.01)
    yield at_most(work, "φ deeper in the ground than an element", np.abs(wet).max(), 0, EXACT)


@check("cost_of_cutting", "200 blocks that all move and turn: what cutting the mesh costs of a step")
def cost_of_cutting(work):
    places = [(0.1 + 0.2 * i, 0.1 + 0.2 * j, 0.3 + 0.35 * k) for k in range(2) for j in range(10) for i in range(10)]
    motion = {"displacement": [0, 0, "0.05*sin(6*t)"], "rotation": [0, 0, "30*t"]}
    block = {"cuboid": [0.1, 0.1, 0.12], "wall": "slip"} | motion
    table = tank([2, 2, 1], [44, 44, 22], "z < 0.5", {}, 1)
    table["obstacle"] = [{"name": f"b{i}", "at": list(place)} | block for i, place in enumerate(places)]
    table["output"] = {"fields_every": "never"}
    # The first steps are solved to 1e-11: they do not count.
    seconds = []
    for steps in (4, 14):
        run = work.run(Variant(table), f"{steps}", arguments=["--steps", str(steps)])
        seconds.append({stage["name"]: stage["seconds"]["mean"] for stage in run.summary["stages"]})
    spent = {name: seconds[1][name] - seconds[0][name] for name in seconds[1] if name != "output"}
    yield at_most(work, "distances, cutting and what follows, share of a step", spent["cut"] / sum(spent.values()), 0.1, "asked for")
