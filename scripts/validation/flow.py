"""Flow of one fluid: a manufactured solution, the decay of a vortex, the lid-driven cavity."""

import numpy as np

from checks import at_least, at_most, check, near
from norms import integral, l2_error
from program import Variant, figure, reference, variant

PI = np.pi
GHIA = "Ghia, Ghia & Shin 1982"
EXACT = "exact solution"


def manufactured(cells, step, end, viscosity):
    """P-F1: u = π cos t (sin πx (cos πy − cos πz), …), p = sin πx sin πy sin πz cos t, ρ = 1, in a unit
    cube with the velocity given on its sides."""
    u, force = [], []
    for x, y, z in ("xyz", "yzx", "zxy"):
        velocity = f"pi*cos(t)*sin(pi*{x})*(cos(pi*{y})-cos(pi*{z}))"
        rates = [
            f"pi^2*cos(t)*cos(pi*{x})*(cos(pi*{y})-cos(pi*{z}))",
            f"(-pi^2*cos(t)*sin(pi*{x})*sin(pi*{y}))",
            f"pi^2*cos(t)*sin(pi*{x})*sin(pi*{z})",
        ]
        along = [f"pi*cos(t)*sin(pi*{a})*(cos(pi*{b})-cos(pi*{c}))" for a, b, c in (x + y + z, y + z + x, z + x + y)]
        convection = "+".join(f"{a}*{b}" for a, b in zip(along, rates))
        pressure = f"pi*cos(pi*{x})*sin(pi*{y})*sin(pi*{z})*cos(t)"
        change = f"pi*sin(t)*sin(pi*{x})*(cos(pi*{y})-cos(pi*{z}))"
        u.append(velocity)
        force.append(f"{convection}+{pressure}-{change}+{2 * viscosity!r}*pi^2*{velocity}")
    return Variant(
        {
            "gravity": [0, 0, 0],
            "body_force": force,
            "mesh": {"box": {"x": [0, 1], "y": [0, 1], "z": [0, 1], "cells": [cells] * 3}},
            "boundaries": {"default": {"velocity": u}},
            "initial": {"velocity": u},
            "water": {"density": 1, "viscosity": viscosity},
            "time": {"end": end, "step": step},
            "solver": {"tolerance": 1e-6},
            "output": {"fields_every": end},
        }
    )


def manufactured_errors(run, step):
    """L² errors of u at the end and of p half a step before."""
    fields = run.fields()
    t = fields.times[-1]
    points, tets, data = fields.at(-1)

    def u(x):
        s, c = np.sin(PI * x), np.cos(PI * x)
        return PI * np.cos(t) * np.stack([s[..., k] * (c[..., k - 2] - c[..., k - 1]) for k in range(3)], axis=-1)

    def p(x):
        return np.sin(PI * x).prod(axis=-1) * np.cos(t - step / 2)

    return l2_error(points, tets, data["velocity"], u), l2_error(points, tets, data["pressure"], p, shift=True)


def orders(errors):
    """Observed orders between successive halvings."""
    return np.log2(np.array(errors[:-1]) / np.array(errors[1:]))


@check("manufactured_space", "P-F1: orders in space of a manufactured flow in three dimensions")
def manufactured_space(work):
    cells = [4, 8, 16] if work.quick else [8, 16, 32]
    for viscosity in (0.01, 1.0):
        errors = []
        for n in cells:
            step = 0.2 / n
            run = work.run(manufactured(n, step, 0.4, viscosity), f"nu{viscosity:g}_{n}")
            errors.append(manufactured_errors(run, step))
        u, p = zip(*errors)
        print("   h = 1/" + ", 1/".join(map(str, cells)), f"ν = {viscosity:g}: u", u, "p", p)
        name = f"ν = {viscosity:g}, h = 1/{cells[-2]} → 1/{cells[-1]}"
        yield at_least(work, f"order of u, {name}", orders(u)[-1], 1.8, EXACT, reference=2.0)
        yield at_least(work, f"order of p, {name}", orders(p)[-1], 0.8, EXACT, reference=1.0)


@check("taylor_green", "P-F2: decay of the plane Taylor-Green vortex")
def taylor_green(work):
    exact = np.exp(-0.4)
    cells = [16, 32] if work.quick else [32, 64]
    errors = []
    for n in cells:
        case = variant(
            "taylor_green",
            {
                "mesh.box.x.cells": [n // 2],
                "mesh.box.z.cells": [n // 2],
                "mesh.box.y.edges": [0, 2 * PI / n],
                "time.step": 3.2 / n,
                "solver.tolerance": 1e-6,
                "output.fields_every": 10,
            },
        )
        fields = work.run(case, f"{n}").fields()
        energy = []
        for step in (0, -1):
            points, tets, data = fields.at(step)
            energy.append(l2_error(points, tets, data["velocity"], np.zeros_like) ** 2)
        ratio = energy[1] / energy[0]
        errors.append(abs(ratio / exact - 1))
        if n == 64:
            yield near(work, "kinetic energy at t = 10 over its start, 64 cells per 2π", ratio, exact, EXACT, relative=0.01)
    print("   relative errors", errors)
    yield at_least(work, f"order of that, {cells[0]} → {cells[1]} cells", orders(errors)[-1], 1.8, EXACT, reference=2.0)


@check("cavity", "P-F3: lid-driven cavity against Ghia, Ghia & Shin 1982")
def cavity(work):
    runs = [(100, 64, 20.0, 0.01)]
    if not work.quick:
        runs += [(400, 128, 40.0, 0.02), (1000, 128, 80.0, 0.02)]
    plot, axes = figure(ncols=2, figsize=(10, 4.5))
    for reynolds, n, end, allowed in runs:
        case = variant(
            "cavity",
            {
                "mesh.box.y": [0, 1 / n],
                "mesh.box.cells": [n, 1, n],
                "water.viscosity": 1 / reynolds,
                "time.end": end,
                "output.gauges_every": end / 20,
            },
        )
        gauges = work.run(case, f"Re{reynolds}").gauges
        # Ghia's printed v at Re 400, x = 0.9063 is a misprint.
        for k, (file, at, u, misprints) in enumerate(
            (
                ("cavity2d_ghia1982_u_vs_y.csv", "z", "x", {}),
                ("cavity2d_ghia1982_v_vs_x.csv", "x", "z", {400: 0.9063}),
            )
        ):
            table = reference("cavity", file)
            places = table["y" if at == "z" else "x"]
            values = table[("u" if u == "x" else "v") + f"_Re{reynolds}"]
            inner = (places > 0) & (places < 1) & (places != misprints.get(reynolds))
            places, values = places[inner], values[inner]
            series = [gauges[f"{at}{place:g}_{u}"] for place in places]
            found = np.array([s[-1] for s in series])
            steady = max(abs(s[-1] - s[-2]) for s in series)
            worst = np.abs(found - values).max()
            where = f"u(x = ½), Re {reynolds}" if u == "x" else f"v(y = ½), Re {reynolds}"
            yield at_most(work, f"largest error of {where}, {n}² cells", worst, allowed, GHIA)
            l2 = np.sqrt(((found - values) ** 2).sum() / (values**2).sum())
            yield at_most(work, f"relative l² error of {where}", l2, 0.05, GHIA)
            yield at_most(work, f"change of {where} in the last twentieth", steady, 1e-4, "steady state")
            axes[k].plot(places, found, "o-", markersize=3, label=f"Re {reynolds}")
            axes[k].plot(places, values, "k+")
            axes[k].set(xlabel=at, ylabel="u" if u == "x" else "w")
        if reynolds != 100:
            u = gauges
            lowest = {400: ("z0.2813_x", -0.32726), 1000: ("z0.1719_x", -0.38289)}[reynolds]
            yield near(work, f"smallest u, Re {reynolds}", u[lowest[0]][-1], lowest[1], GHIA, absolute=allowed)
        else:
            yield near(work, "smallest u, Re 100", gauges["z0.4531_x"][-1], -0.21090, GHIA, absolute=allowed)
    axes[0].legend()
    plot.suptitle("Lid-driven cavity on the centre lines; + Ghia, Ghia & Shin 1982")
    plot.savefig(work.folder / "cavity.png", dpi=150)
