"""Collapsing columns: fronts, a bore on a wet bed, pressures on a wall, volume over a long time."""

import numpy as np

from checks import at_most, between, check, near
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
    gauges = work.run(variant("stoker"), "run").gauges
    t = gauges["t"]
    arrivals = {}
    for x in (14, 15, 17, 19):
        level = gauges[f"x{x}"]
        above = np.nonzero(level > 0.25)[0]
        if len(above):
            i = above[0]
            arrivals[x] = np.interp(0.25, level[i - 1 : i + 1], t[i - 1 : i + 1])
    far = sorted(arrivals)[-2:]
    speed = (far[1] - far[0]) / (arrivals[far[1]] - arrivals[far[0]])
    yield near(work, f"speed of the bore [m/s], x = {far[0]} → {far[1]} m", speed, 3.105134, "Stoker 1957", relative=0.03)
    late = t > arrivals[15] + 0.5
    yield near(work, "depth behind it [m], x = 15 m", gauges["x15"][late].mean(), 0.396175, "Stoker 1957", relative=0.05)
    plot, axes = figure(figsize=(8, 4))
    for x in (10, 14, 15, 17, 19):
        axes.plot(t, gauges[f"x{x}"], label=f"x = {x} m")
    axes.axhline(0.396175, color="k", linestyle=":")
    axes.set(xlabel="t [s]", ylabel="depth [m]")
    axes.legend()
    plot.savefig(work.folder / "depth.png", dpi=150)


@check("lobovsky", "pressures of a dam break on a wall, Lobovsky et al. 2014")
def lobovsky(work):
    H, g, rho = 0.3, 9.81, 1000
    gauges = work.run(variant("lobovsky"), "run").gauges
    t, source = gauges["t"] * np.sqrt(g / H), "Lobovsky et al. 2014"
    p1 = gauges["P1"] / (rho * g * H)
    arrival = t[np.nonzero(p1 > 0.5)[0][0]]
    measured = list(reference("lobovsky", "dambreak_lobovsky_p1_exp.csv").values())
    reference_arrival = measured[0][np.nonzero(measured[1] > 0.5)[0][0]]
    yield near(work, "arrival of P1, t√(g/H)", arrival, reference_arrival, source, relative=0.05)
    yield between(work, "peak of P1, p/ρgH", p1.max(), 0.6 * 2.84, 1.5 * 2.84, source)
    for name, plateau in (("P1", 0.57), ("P3", 0.59), ("P4", 0.53)):
        p = gauges[name] / (rho * g * H)
        window = (t > 4) & (t < 5)
        yield near(work, f"plateau of {name}, p/ρgH", p[window].mean(), plateau, source, relative=0.1)
    first = (t > 2.3) & (t < 4)
    grid = np.linspace(2.3, 4, 400)
    impulse = np.trapezoid(np.interp(grid, t[first], p1[first]), grid)
    expected = np.trapezoid(np.interp(grid, measured[0], measured[1]), grid)
    yield near(work, "impulse of the first peak of P1", impulse, expected, source, relative=0.2)
    plot, axes = figure(figsize=(8, 4))
    for colour, name in zip(("C0", "C1", "C2"), ("P1", "P3", "P4")):
        table = list(reference("lobovsky", f"dambreak_lobovsky_{name.lower()}_exp.csv").values())
        axes.plot(t, gauges[name] / (rho * g * H), colour, label=name)
        axes.plot(table[0], table[1], colour + ".", markersize=3)
    axes.set(xlabel="t √(g/H)", ylabel="p / ρgH", ylim=(-0.2, 4.5))
    axes.legend()
    plot.savefig(work.folder / "pressures.png", dpi=150)


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
