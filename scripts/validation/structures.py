"""Structures cut through the mesh: forces on cylinders, a wave on a box."""

import numpy as np

from checks import at_most, check, near
from program import figure, reference, variant

DFG = "Schäfer & Turek 1996, FeatFlow"


def coefficients(run, name, area):
    """2F/(ρ U² A), drag and lift at the end, U = 0.2 m/s, ρ = 1."""
    loads = run.loads
    return [2 * loads[f"{name}_force_{axis}"][-1] / (0.04 * area) for axis in "xy"]


@check("cylinder", "drag and lift of a cylinder in a channel, Re 20 (DFG 2D-1)")
def cylinder(work):
    errors = []
    for across in (20,) if work.quick else (20, 40):
        f, thickness = across // 20, 0.2 / across
        box = {
            "x": {"edges": [0, 0.1, 0.35, 2.2], "cells": [8 * f, 50 * f, 60 * f], "ratio": [0.3, 1, 12]},
            "y": {"edges": [0, 0.41], "cells": [82 * f]},
            "z": {"edges": [0, thickness], "cells": [1]},
        }
        case = variant("cylinder", {"mesh.box": box})
        case.table["obstacle"][0]["at"] = [0.2, 0.2, thickness / 2]
        for gauge in case.table["gauge"]:
            gauge["pressure"][2] = thickness / 2
        run = work.run(case, f"{across}")
        drag, lift = coefficients(run, "cylinder", 0.1 * thickness)
        difference = run.gauges["front"][-1] - run.gauges["rear"][-1]
        at = f"D/h = {across}"
        yield near(work, f"drag coefficient, {at}", drag, 5.57953523384, DFG, relative=0.4 / across)
        yield near(work, f"lift coefficient, {at}", lift, 0.010618948146, DFG, absolute=0.005)
        yield near(work, f"pressure difference, {at}", difference, 0.11752016697, DFG, relative=0.02)
        errors.append(abs(drag / 5.57953523384 - 1))
    if len(errors) > 1:
        yield at_most(work, "error of drag, D/h = 40 over D/h = 20", errors[1] / errors[0], 1, "monotone")


@check("cylinder_3d", "drag and lift of a cylinder across a square channel, Re 20 (DFG 3D-1Z)")
def cylinder_3d(work):
    f = 0.5 if work.quick else 1
    box = {
        "x": {"edges": [0, 0.35, 0.75, 2.5], "cells": [int(n * f) for n in (20, 50, 36)], "ratio": [0.3, 1, 10]},
        "y": {"edges": [0, 0.1, 0.3, 0.41], "cells": [int(n * f) for n in (10, 26, 10)], "ratio": [0.5, 1, 2]},
        "z": {"edges": [0, 0.205, 0.41], "cells": [int(18 * f)] * 2, "ratio": [3, 1 / 3]},
    }
    profile = "16*0.45*y*z*(0.41-y)*(0.41-z)/0.41^4"
    case = variant(
        "cylinder",
        {
            "mesh.box": box,
            "boundaries": {"default": "no_slip", "x_min": {"velocity": [profile, 0, 0]}, "x_max": "open"},
            "gauge": None,
        },
    )
    case.table["obstacle"][0].update(at=[0.5, 0.2, 0.205], cylinder=[0.05, 0.5])
    run = work.run(case)
    drag, lift = coefficients(run, "cylinder", 0.1 * 0.41)
    yield near(work, "drag coefficient", drag, 6.18533, DFG, relative=0.015)
    yield near(work, "lift coefficient", lift, 0.0094, DFG, absolute=0.005)


@check("marin", "dam break on a box cut out of the mesh: Kleefsman et al. 2005, beside OpenFOAM's interFoam")
def marin(work):
    # Measured as OpenFOAM's were: on 172 000 cells of 2.7 cm P1 peaked with 10.7 kPa at 0.430 s, the fronts were at 0.233, 0.373 and
    # 0.937 s. Here the tolerance is OpenFOAM's distance from the experiment.
    end = 1 if work.quick else 2
    run = work.run(variant("marin", {"time.end": end}))
    gauges, source = run.gauges, "Kleefsman et al. 2005; OpenFOAM's distance"
    # Pressure and phase stand half a step before the time of their row.
    t = gauges["t"] - 0.5 * np.diff(gauges["t"], prepend=0)
    peak = np.nanargmax(np.where(t < 0.55, gauges["P1"], -np.inf))
    yield near(work, "P1's peak [kPa]", gauges["P1"][peak] / 1e3, 11.2, source, absolute=0.5)
    yield near(work, "its time [s]", t[peak], 0.415, source, absolute=0.015)
    for name, x, measured, theirs in (("H3", 1.488, 0.218, 0.233), ("H2", 0.992, 0.368, 0.373), ("H1", 0.496, 0.920, 0.937)):
        # 2 cm deep: so deep was the experiment's water at the times that are given for it.
        k = np.nonzero(gauges[name] > 0.02)[0][0]
        at = np.interp(0.02, gauges[name][k - 1 : k + 1], t[k - 1 : k + 1])
        yield near(work, f"water reaches x = {x} m [s]", at, measured, source, absolute=theirs - measured)
    source = "Kleefsman et al. 2005"
    table = reference("dam_break", "dambreak_kleefsman_p3_exp.csv")
    experiment = table["P"] * 5395.5  # ρgH
    p3 = np.nanmax(np.where(t < 0.55, gauges["P3"], -np.inf))
    yield near(work, "P3's peak [kPa]", p3 / 1e3, experiment.max() / 1e3, source, relative=0.2)
    heights = reference("marin", "heights_exp.csv")
    seen = heights["t"] <= end
    for name in ("H1", "H2", "H3", "H4"):
        error = np.abs(np.interp(heights["t"][seen], t, gauges[name]) - heights[name][seen])
        yield at_most(work, f"{name}: mean error over its largest", error.mean() / heights[name][seen].max(), 0.1, source)
    energy = run.history["kinetic"] + run.history["potential"]
    late = run.history["t"] > 0.1
    yield at_most(work, "energy that is made, over all", np.diff(energy[late]).clip(0).sum() / energy[0], 0.01, "exact")
    volume = run.history["volume"]
    yield at_most(work, "change of volume", np.abs(volume / volume[0] - 1).max(), 0.01, "exact")
    plot, axes = figure(nrows=3, figsize=(8, 9))
    for colour, name in zip(("C0", "C1", "C2", "C3"), ("P1", "P2", "P3", "P4")):
        axes[0].plot(t, gauges[name] / 1e3, colour, label=name)
    for colour, name in (("C0", "p1"), ("C2", "p3")):
        table = reference("dam_break", f"dambreak_kleefsman_{name}_exp.csv")
        axes[0].plot(table["T"] * np.sqrt(0.55 / 9.81), table["P"] * 5.3955, colour + ".")
    axes[0].set(ylabel="pressure [kPa]", ylim=(-1, 12), xlim=(0.3, end), title="dots: experiment")
    for colour, name in zip(("C0", "C1", "C2", "C3"), ("H1", "H2", "H3", "H4")):
        axes[1].plot(t, gauges[name], colour, label=name)
        axes[1].plot(heights["t"], heights[name], colour + ".")
    axes[1].set(ylabel="depth [m]", xlim=(0, end))
    axes[2].plot(run.history["t"], energy / energy[0], label="energy / energy at the start")
    axes[2].set(xlabel="t [s]", xlim=(0, end))
    for each in axes:
        each.legend()
    plot.savefig(work.folder / "marin.png", dpi=90)
