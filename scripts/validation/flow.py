"""Flow of one fluid: a manufactured solution, the decay of a vortex, the lid-driven cavity."""

import numpy as np

import gmsh
from checks import at_least, at_most, check, near
from norms import integral, l2_error, norm
from program import Variant, figure, reference, variant

PI = np.pi
GHIA = "Ghia, Ghia & Shin 1982"
EXACT = "exact solution"


def manufactured(cells, step, end, viscosity, tolerance=1e-6):
    """The manufactured flow in a unit cube, ρ = 1, with the velocity given on its sides."""
    u, force = formulas(viscosity, "xyz")
    return Variant(
        {
            "gravity": [0, 0, 0],
            "body_force": force,
            "mesh": {"box": {"x": [0, 1], "y": [0, 1], "z": [0, 1], "cells": [cells] * 3}},
            "boundaries": {"default": {"velocity": u}},
            "initial": {"velocity": u},
            "water": {"density": 1, "viscosity": viscosity},
            "time": {"end": end, "step": step},
            "solver": {"tolerance": tolerance},
            "output": {"fields_every": end},
        }
    )


def formulas(viscosity, places):
    """Velocity π cos t (sin πx (cos πy − cos πz), …) and the body force that keeps it, with the pressure
    sin πx sin πy sin πz cos t; `places` are what stands for x, y, z."""
    s = [f"sin(pi*{x})" for x in places]
    c = [f"cos(pi*{x})" for x in places]
    u = [f"pi*cos(t)*{s[k]}*({c[k - 2]}-{c[k - 1]})" for k in range(3)]
    force = []
    for k in range(3):
        j, i = k - 2, k - 1
        rates = {k: f"{c[k]}*({c[j]}-{c[i]})", j: f"(0-{s[k]}*{s[j]})", i: f"{s[k]}*{s[i]}"}
        convection = "+".join(f"pi^2*cos(t)*{u[b]}*{rate}" for b, rate in rates.items())
        pressure = f"pi*{c[k]}*{s[j]}*{s[i]}*cos(t)"
        change = f"pi*sin(t)*{s[k]}*({c[j]}-{c[i]})"
        force.append(f"{convection}+{pressure}-{change}+{2 * viscosity!r}*pi^2*{u[k]}")
    return u, force


def manufactured_errors(run, step):
    """L² errors of u at the end and of p half a step before."""
    fields = run.fields()
    t = fields.times[-1]
    points, tets, data = fields.at(-1)
    u, p = data["velocity"], data["pressure"]
    return (
        l2_error(points, tets, u, lambda x: exact_velocity(x, t)),
        l2_error(points, tets, p, lambda x: exact_pressure(x, t - step / 2), shift=True),
    )


def exact_velocity(x, t):
    s, c = np.sin(PI * x), np.cos(PI * x)
    return PI * np.cos(t) * np.stack([s[..., k] * (c[..., k - 2] - c[..., k - 1]) for k in range(3)], axis=-1)


def exact_pressure(x, t):
    return np.sin(PI * x).prod(axis=-1) * np.cos(t)


def orders(errors):
    """Observed orders between successive halvings."""
    return np.log2(np.array(errors[:-1]) / np.array(errors[1:]))


@check("manufactured_space", "orders in space of a manufactured flow in three dimensions")
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


@check("manufactured_time", "order in time of a manufactured flow in three dimensions")
def manufactured_time(work):
    """On one fine mesh, whose own error is the same for all steps as long as τ is the viscous one: what
    the results of two steps differ by is the error in time."""
    cells, viscosity, steps = (8 if work.quick else 24), 1.0, [0.1, 0.05, 0.025]
    u, p = [], []
    for step in steps:
        case = manufactured(cells, step, 0.8, viscosity, 1e-7)
        case.table["solver"]["max_iterations"] = 2000
        fields = work.run(case, f"{step:g}").fields()
        points, tets, data = fields.at(-1)
        t = fields.times[-1]
        u.append(data["velocity"] - exact_velocity(points, t))
        p.append(data["pressure"] - exact_pressure(points, t - step / 2))
    for name, errors in (("u", u), ("p", p)):
        differences = [norm(points, tets, a - b, shift=name == "p") for a, b in zip(errors, errors[1:])]
        print(f"   h = 1/{cells}: {name} of successive halvings of Δt differ by", differences)
        quantity = f"order of {name}, ν = {viscosity:g}, Δt = {steps[0]:g} → {steps[-1]:g}"
        yield at_least(work, quantity, orders(differences)[-1], 1.8, EXACT, reference=2.0)


@check("linear_in_space", "order in time of a flow that the elements hold exactly")
def linear_in_space(work):
    """u = A(t) x, A = B cos t + C sin 2t without trace, p = b·x cos t: all error is the time's."""
    B = np.array([[0.5, -1.0, 0.2], [0.8, -0.2, 0.6], [-0.4, 0.3, -0.3]])
    C = np.array([[-0.3, 0.4, 0.1], [-0.5, 0.1, -0.2], [0.6, 0.2, 0.2]])
    b = np.array([1.0, -2.0, 0.5])

    def row(terms, k):
        """Component k of Σ factor · matrix · x."""
        entries = [f"{matrix[k, j].item()!r}*{factor}*{x}" for factor, matrix in terms for j, x in enumerate("xyz")]
        return "+".join(entries).replace("+-", "-")

    rate = [("sin(t)", -B), ("2*cos(2*t)", C)]
    square = [("cos(t)^2", B @ B), ("cos(t)*sin(2*t)", B @ C + C @ B), ("sin(2*t)^2", C @ C)]
    u = [row([("cos(t)", B), ("sin(2*t)", C)], k) for k in range(3)]
    force = [f"{row(rate + square, k)}+({b[k].item()!r})*cos(t)" for k in range(3)]
    steps = [0.1, 0.05, 0.025, 0.0125]
    for viscosity in (0.0, 0.1):
        errors = []
        for step in steps:
            case = Variant(
                {
                    "gravity": [0, 0, 0],
                    "body_force": force,
                    "mesh": {"box": {"x": [0, 1], "y": [0, 1], "z": [0, 1], "cells": [6] * 3}, "jitter": 0.2},
                    "boundaries": {"default": {"velocity": u}},
                    "initial": {"velocity": u},
                    "water": {"density": 2, "viscosity": viscosity},
                    "time": {"end": 0.8, "step": step},
                    "solver": {"tolerance": 1e-8},
                    "output": {"fields_every": 0.8},
                }
            )
            fields = work.run(case, f"nu{viscosity:g}_{step:g}").fields()
            points, tets, data = fields.at(-1)
            t = fields.times[-1]
            velocity = points @ (B * np.cos(t) + C * np.sin(2 * t)).T
            pressure = 2 * points @ b * np.cos(t - step / 2)
            errors.append(
                (
                    norm(points, tets, data["velocity"] - velocity),
                    norm(points, tets, data["pressure"] - pressure, shift=True),
                )
            )
        print(f"   μ = {viscosity:g}: errors of u and p at Δt = {steps}:", errors)
        for name, series in zip("up", zip(*errors)):
            quantity = f"order of {name}, μ = {viscosity:g}, Δt = {steps[-2]:g} → {steps[-1]:g}"
            yield at_least(work, quantity, orders(series)[-1], 1.8, EXACT, reference=2.0)


@check("rotated", "the manufactured flow between slip walls, gravity and mesh rotated by an arbitrary angle")
def rotated(work):
    cells, viscosity, gravity = (6 if work.quick else 12), 0.01, np.array([1.0, -3.0, 9.0])
    axis, angle = np.array([1.0, 2.0, -0.5]) / np.sqrt(5.25), 0.7
    cross = np.cross(np.eye(3), axis)
    turn = np.eye(3) - np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    letters = turn.tolist()
    assert np.allclose(turn @ turn.T, np.eye(3)) and np.allclose(turn @ axis, axis)
    nodes, tets, sides = gmsh.box([cells] * 3, [1, 1, 1])
    found = {}
    for name, matrix in (("upright", np.eye(3)), ("turned", turn)):
        mesh = work.folder / f"{name}.msh"
        gmsh.write(mesh, nodes @ matrix.T, tets, sides)
        # x = Rᵀ x', u' = R u, in the letters of the formulas.
        if name == "upright":
            u, force = formulas(viscosity, "xyz")
        else:
            places = ["(" + "+".join(f"({letters[b][k]!r})*{x}" for b, x in enumerate("xyz")) + ")" for k in range(3)]
            plain = formulas(viscosity, places)
            u, force = (
                ["+".join(f"({letters[k][b]!r})*({f[b]})" for b in range(3)) for k in range(3)] for f in plain
            )
        case = Variant(
            {
                "gravity": (matrix @ gravity).tolist(),
                "body_force": force,
                "mesh": {"file": mesh.name},
                "boundaries": {"default": "slip"},
                "initial": {"velocity": u},
                "water": {"density": 1, "viscosity": viscosity},
                "time": {"end": 0.5, "step": 0.025},
                "solver": {"tolerance": 1e-9},
                "output": {"fields_every": 0.5},
            },
            [mesh],
        )
        points, cells_of, data = work.run(case, name).fields().at(-1)
        # The same node for both: by where it stood before the turn.
        order = np.lexsort(np.round(points @ matrix * cells).T)
        pressure = data["pressure"] - integral(points, cells_of, data["pressure"])
        found[name] = data["velocity"][order] @ matrix, pressure[order]
    for k, name in enumerate(("u", "p")):
        a, b = found["upright"][k], found["turned"][k]
        difference = np.abs(a - b).max() / np.abs(a).max()
        yield at_most(work, f"largest change of {name} by the turn, over its largest value", difference, 2e-6, "frame invariance")


@check("taylor_green", "decay of the plane Taylor-Green vortex")
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


@check("cavity", "lid-driven cavity against Ghia, Ghia & Shin 1982")
def cavity(work):
    runs = [(100, 64, 30.0, 0.01)]
    if not work.quick:
        runs += [(400, 128, 50.0, 0.02), (1000, 128, 80.0, 0.02)]
    plot, axes = figure(ncols=2, figsize=(10, 4.5))
    for reynolds, n, end, allowed in runs:
        case = variant(
            "cavity",
            {
                "mesh.box.y": [0, 1 / n],
                "mesh.box.cells": [n, 1, n],
                "water.viscosity": 1 / reynolds,
                "time.end": end,
                "time.max_cfl": 4,
                "time.max_step": 0.1,
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
            yield at_most(work, f"change of {where} in the last twentieth", steady, allowed / 20, "steady state")
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
