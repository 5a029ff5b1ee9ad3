"""Collapsing columns: fronts, a bore on a wet bed, pressures on a wall, volume over a long time."""

import numpy as np

from checks import at_most, between, check, near
from norms import volumes
from program import figure, reference, variant


@check("dam_break_front", "front of a collapsing column against Martin & Moyce 1952 and Koshizuka & Oka 1996")
def dam_break_front(work):
    a, g = 0.05715, 9.81
    gauges = work.run(variant("dam_break_front"), "run").gauges
    T, Z = gauges["t"] * np.sqrt(2 * g / a), gauges["front"] / a
    experiments = ((2, 2.30, 2.39), (3, 3.47, 3.79), (4, 4.90, 5.12))
    # The experiments' gates take time to open, here there is none: one shift of T, the best for all three.
    at, low, high = np.array(experiments).T
    delays = np.linspace(0, 0.3, 61)
    delay = min(delays, key=lambda d: np.sum((np.interp(at - d, T, Z) - (low + high) / 2) ** 2))
    for at, low, high in experiments:
        source = "Martin & Moyce, Koshizuka & Oka, ±10 %"
        print(f"   front Z at T = {at} without a shift of T: {np.interp(at, T, Z):.3f}")
        quantity = f"front Z at T = {at}, gate's delay {delay:.2f}"
        yield between(work, quantity, np.interp(at - delay, T, Z), 0.9 * low, 1.1 * high, source)
    plot, axes = figure(figsize=(6, 4))
    axes.plot(T, Z, label="here")
    axes.plot(T + delay, Z, "C0:", label=f"here, {delay:.2f} later")
    for file in ("dambreak_martin_moyce_n2eq2_a2.25in.csv", "dambreak_martin_moyce_n2eq2_a1.125in.csv"):
        table = list(reference("dam_break_front", file).values())
        axes.plot(table[0], table[1], ".", label=file.removesuffix(".csv").replace("dambreak_", ""))
    axes.set(xlabel="T = t √(2g/a)", ylabel="Z = x/a", xlim=(0, 4.5), ylim=(1, 6))
    axes.legend()
    plot.savefig(work.folder / "front.png", dpi=150)


@check("dam_break_meshes", "front and kinetic energy of the column on three meshes")
def dam_break_meshes(work):
    end, values = 0.12, {"front": [], "kinetic energy": []}
    factors = (1, 2, 4) if work.quick else (2, 4, 8)
    for f in factors:
        box = {"x": [0, 0.4], "y": [0, 0.4 / (28 * f)], "z": [0, 0.15], "cells": [28 * f, 1, 21 * f // 2]}
        changes = {"mesh.box": box, "time.end": end, "output.fields_every": None}
        case = variant("dam_break_front", changes)
        y = 0.2 / (28 * f)
        for gauge in case.table["gauge"]:
            gauge["water_level"] = [[x, y, max(z, 0.002) if gauge["name"] == "front" else z] for x, _, z in gauge["water_level"]]
            if gauge["name"] == "front":
                gauge["water_level"] = [[0, y, 0.002], [0.4, y, 0.002]]
        run = work.run(case, f"{28 * f}")
        # The slab is as thick as a cell: energy per width.
        values["front"].append(np.interp(end, run.gauges["t"], run.gauges["front"]))
        values["kinetic energy"].append(run.history["kinetic"][-1] / (2 * y))
    for name, (coarse, middle, fine) in values.items():
        print(f"   {name} on {factors} × 28 cells:", coarse, middle, fine)
        ratio = abs(middle - coarse) / abs(fine - middle)
        source = "successive differences shrink"
        yield between(work, f"{name}: shrinking of differences", ratio, 1.5, np.inf, source)


@check("stoker", "bore on a wet bed against Stoker's solution of the shallow water equations")
def stoker(work):
    run = work.run(variant("stoker"), "run")
    fields, width, cell = run.fields(), 0.03, 0.25
    points, tets, _ = fields.at(0)
    # Depth over slices of the channel: the bore breaks, so that a gauge would see its air and its spray.
    edges = np.arange(0, 20 + cell / 2, cell)
    middle, slices = (edges[1:] + edges[:-1]) / 2, np.digitize(points[tets].mean(1)[:, 0], edges) - 1
    volume = volumes(points, tets)

    def depth(step):
        water = volume * fields.at(step)[2]["phase"][tets].mean(1)
        return np.bincount(slices, water, minlength=len(middle)) / (cell * width)

    depths = {0.2 * step: depth(step) for step in range(13, 19)}
    # Where a sharp bore of Stoker's height would stand for the water that has passed x = 13 m.
    position = [13 + (d[middle > 13] - 0.1).sum() * cell / (0.396175 - 0.1) for d in depths.values()]
    speed = np.polyfit(list(depths), position, 1)[0]
    yield near(work, "speed of the bore [m/s], t = 2.6 → 3.6 s", speed, 3.105134, "Stoker 1957", relative=0.03)
    behind = (middle > 12.5) & (middle < 15)
    plateau = np.mean([d[behind].mean() for t, d in depths.items() if t > 3.1])
    yield near(work, "depth behind it [m], x = 12.5 → 15 m", plateau, 0.396175, "Stoker 1957", relative=0.05)
    plot, axes = figure(figsize=(8, 4))
    for t, d in depths.items():
        axes.plot(middle, d, label=f"t = {t:.1f} s")
    axes.axhline(0.396175, color="k", linestyle=":")
    axes.set(xlabel="x [m]", ylabel="depth [m]")
    axes.legend()
    plot.savefig(work.folder / "depth.png", dpi=150)


@check("lobovsky", "pressures of a dam break on a wall: Lobovsky et al. 2014; without friction, De Courcy et al. 2024")
def lobovsky(work):
    scale, sensors = np.sqrt(9.81 / 0.3), ("P1", "P3", "P4")

    def pressures(run):
        gauges = run.gauges
        return gauges["t"] * scale, {name: gauges[name] / (1000 * 9.81 * 0.3) for name in sensors}

    def plateau(t, p):
        grid = np.linspace(4, 5, 101)
        return np.interp(grid, t, p).mean()

    def impulse(t, p, start):
        grid = np.linspace(start, 4, 400)
        return np.trapezoid(np.interp(grid, t, p), grid)

    source = "Lobovsky et al. 2014"
    t, p = pressures(work.run(variant("lobovsky"), "run"))
    tables = {name: list(reference("lobovsky", f"dambreak_lobovsky_{name.lower()}_exp.csv").values()) for name in sensors}
    arrivals = [time[np.nonzero(p1 > 0.5)[0][0]] for time, p1 in ((t, p["P1"]), tables["P1"])]
    yield near(work, "arrival of P1, t√(g/H)", *arrivals, source, relative=0.05)
    yield between(work, "peak of P1, p/ρgH", p["P1"].max(), 0.6 * 2.84, 1.5 * 2.84, source)
    for name, value in (("P1", 0.57), ("P3", 0.59), ("P4", 0.53)):
        yield near(work, f"plateau of {name}, p/ρgH", plateau(t, p[name]), value, source, relative=0.1)
    impulses = [impulse(time, p1, 2.3) for time, p1 in ((t, p["P1"]), tables["P1"])]
    yield near(work, "impulse of the first peak of P1", *impulses, source, relative=0.2)
    plot, axes = figure(nrows=2, figsize=(8, 7))
    for colour, name in zip(("C0", "C1", "C2"), sensors):
        axes[0].plot(t, p[name], colour, label=name)
        axes[0].plot(*tables[name][:2], colour + ".", markersize=3)
    axes[0].set(title="floor and wall hold the water; dots: experiment")

    # Without friction there is no experiment, but another method; and no boundary layer: a coarser mesh does.
    source = "De Courcy et al. 2024, SPH"
    table = reference("lobovsky", "dambreak_decourcy_sph.csv")
    changes = {
        "mesh.box.x.sizes": [0.01, 0.01, 0.004],
        "mesh.box.y.edges": [0, 0.005],
        "mesh.box.z.sizes": [0.004, 0.02],
        "boundaries": {"default": "slip", "z_max": "open"},
        "free_surface.thickness": None,
    }
    t, p = pressures(work.run(variant("lobovsky", changes), "frictionless"))
    for name in sensors:
        expected = plateau(table["T"], table[name])
        yield near(work, f"plateau of {name} without friction", plateau(t, p[name]), expected, source, relative=0.1)
    expected = impulse(table["T"], table["P1"], 2.6)
    yield near(work, "impulse of P1 after its peak without friction", impulse(t, p["P1"], 2.6), expected, source, relative=0.1)
    for colour, name in zip(("C0", "C1", "C2"), sensors):
        axes[1].plot(t, p[name], colour, label=name)
        axes[1].plot(table["T"], table[name], colour + "+", markersize=5)
    axes[1].set(title="without friction; +: De Courcy et al.")
    for at in axes:
        at.set(xlabel="t √(g/H)", ylabel="p / ρgH", xlim=(2, 7.2), ylim=(-0.2, 3))
        at.legend()
    plot.savefig(work.folder / "pressures.png", dpi=100)


@check("long_sloshing", "volume over twenty periods of a high standing wave, correction off and on")
def long_sloshing(work):
    box = {"x": [-1, 1], "y": [0, 0.05], "z": [0, 1.5], "cells": [40, 1, 30]}
    periods = 5 if work.quick else 20
    common = {
        "mesh.box": box,
        "initial.water": "z < 1 + 0.1*sin(pi*(x + 0.5))",
        "free_surface.thickness": None,
        "time.end": periods * 3.5515,
        "output.fields_every": periods * 3.5515,
    }
    for name, limit in (("off", 0.01), ("per_body", 0.001)):
        case = variant("standing_wave", {**common, "free_surface.volume_correction": name})
        case.table["gauge"][0]["water_level"] = [[0, 0.025, 0], [0, 0.025, 1.5]]
        run = work.run(case, name)
        history = run.history
        volume = history["volume"]
        yield at_most(work, f"drift of ∫φ*, correction {name}", np.abs(volume / volume[0] - 1).max(), limit, "exact solution")
        if name != "off":
            print("   sum of corrections / volume:", history["correction_sum"][-1] / volume[0])
