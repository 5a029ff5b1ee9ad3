"""Structures cut through the mesh: forces on cylinders, a wave on a box."""

import numpy as np

from checks import at_most, check, near
from program import variant

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
