"""Water and bodies together: spheres and boxes that sink, rise and float, a cube in a dam break, where energy goes, the
paper's block, and its building, small."""

import tomllib

import numpy as np

from checks import at_least, at_most, between, check, near, reported
from potential import fastest_rise
from program import ROOT, columns, figure, reference, variant

QIU = "Qiu 2017, experiment"
PAPER = "Takase et al. 2015, case 4"
# Numbers of the clusters of the front wall of the ground floor, and of the walls behind it.
FRONT, REAR = range(88, 104), range(120, 136)


@check("tsunami_building", "a falling column breaks a building of 208 clusters, on a coarse mesh")
def tsunami_building(work):
    sizes = {
        "x": [2.4, 1.2, 0.2, 0.2, 0.8, 0.2, 0.2, 1.8, 4],
        "y": [2, 0.2, 0.2, 0.8, 0.2, 0.2, 2],
        "z": [0.4, 0.4, 0.8, 0.4, 0.4, 0.8, 0.4, 0.4, 1.6],
    }
    changes = {f"mesh.box.{axis}.sizes": list for axis, list in sizes.items()}
    changes |= {"free_surface.thickness": 0.4, "time.end": 1.5 if work.quick else 4, "output.checkpoint_every": None}
    run = work.run(variant("tsunami_building", changes))
    bonds = columns(run.folder / "bonds.csv")
    bodies = columns(run.folder / "bodies.csv")
    touches = lambda wall: [{int(a), int(b)} & set(wall) != set() for a, b in zip(bonds["body_a"], bonds["body_b"])]
    front, rear = np.array(touches(FRONT)), np.array(touches(REAR))
    yield at_least(work, "faces that come off", len(front), 20, PAPER)
    yield between(work, "of the first ten, in the front wall of the ground floor", front[:10].sum(), 8, 10, PAPER)
    yield at_least(work, "way of its middle downstream [m]", bodies["front_1_x"][-1] - bodies["front_1_x"][0], 1, PAPER)
    if not work.quick:
        yield at_least(work, "faces of the rear wall that come off", rear.sum(), 1, PAPER)
        delay = bonds["t"][rear].min() - bonds["t"][front].min() if rear.any() else np.nan
        yield at_least(work, "how much later [s]", delay, 0.0, PAPER)
    plot, axes = figure(figsize=(6, 4))
    for wall, name in ((front, "front wall, ground floor"), (rear, "rear wall, ground floor"), (~front & ~rear, "others")):
        axes.step(bonds["t"][wall], np.arange(wall.sum()) + 1, where="post", label=name)
    axes.set(xlabel="t [s]", ylabel="faces broken")
    axes.legend()
    plot.savefig(work.folder / "broken_faces.png", dpi=150)


@check("block_overturning", "a bore overturns a block, with three angles of friction")
def block_overturning(work):
    plot, (along, up) = figure(nrows=2, sharex=True, figsize=(6, 6))
    step = {"time.max_step": 4e-3 if work.quick else 1e-3}
    # Until the bore is there the block stands, whatever its friction.
    arrives = 1.2
    changes = step | {"time.end": arrives, "output.checkpoint_every": arrives}
    before = work.run(variant("block_overturning", changes), "before").bodies
    start = [before["block_1_x"][0], before["block_1_z"][0]]
    moved = np.hypot(before["block_1_x"] - start[0], before["block_1_z"] - start[1]).max()
    yield at_most(work, f"way of the block until {arrives} s [m]", moved, 1e-4, "it stands")
    ways = {}
    for angle in (30, 20, 15):
        changes = step | {"bodies.friction_angle": angle, "time.end": 2.0}
        arguments = ["--restart", work.folder / "before"]
        bodies = work.run(variant("block_overturning", changes), f"{angle}", arguments=arguments).bodies
        t, x, z = bodies["t"], bodies["block_1_x"] - start[0], bodies["block_1_z"] - start[1]
        ways[angle] = [np.interp(2.0, t, way) for way in (x, z)]
        # The point stands 0.12 m above the bed, and half the block's length when it lies down.
        yield near(work, f"way up, {angle}° [m]", ways[angle][1], 0.03 - 0.12, "it lies on its side", absolute=0.01)
        along.plot(t, x, label=f"{angle}°")
        up.plot(t, z, label=f"{angle}°")
    for more, less in ((30, 20), (20, 15)):
        further = ways[less][0] - ways[more][0]
        yield at_least(work, f"further along with {less}° than with {more}° [m]", further, 0, "Takase et al. 2015, case 3")
    apart = np.ptp([z for _, z in ways.values()])
    yield at_most(work, "ways up differ by [m]", apart, 0.01, "Takase et al. 2015, case 3")
    along.set(ylabel="way in x [m]")
    along.legend()
    up.set(xlabel="t [s]", ylabel="way up [m]")
    plot.savefig(work.folder / "ways.png", dpi=150)


def crests(t, z):
    """Times and heights of the extrema of a curve, parabolas through three points."""
    found = []
    for i in range(1, len(z) - 1):
        left, right = z[i] - z[i - 1], z[i + 1] - z[i]
        if left * right < 0:
            shift = (left + right) / (left - right) / 2
            found.append((t[i] + shift * (t[i + 1] - t[i]), z[i] + shift * (right + left) / 4))
    return found


@check("sphere", "acceleration of a sphere let go in water, heavy and light")
def sphere(work):
    for density in (2500, 500, 50):
        case = variant("sphere")
        case.table["body"][0]["density"] = density
        run = work.run(case, f"{density}")
        t, z = run.bodies["t"], run.bodies["sphere_1_z"]
        v = np.diff(z) / np.diff(t)
        # Steps 4 to 10: coupled loosely, the first ones feel no added mass yet.
        measured = (v[9] - v[3]) / (6 * (t[2] - t[1]))
        exact = 9.81 * (1000 - density) / (density + 500)
        yield near(work, f"acceleration, {density} kg/m³ [m/s²]", measured, exact, "added mass ½ρV", relative=0.05)


@check("floating_box", "draft and stability of a floating box")
def floating_box(work):
    run = work.run(variant("floating_box"))
    bodies = run.bodies
    t, z = bodies["t"], bodies["box_1_z"]
    # The two points are level at first, in a box that is tilted by 8°.
    tilt = 8 + np.degrees(np.arctan2(z - bodies["box_2_z"], bodies["box_2_x"] - bodies["box_1_x"]))
    # Beside the box, which is 19.94 mm deep at first, the water stands 50.44 mm high in a tank of 150 mm.
    draft = 0.80052 * 0.024
    level = 0.05044 - 0.049 * (0.01994 - draft) / 0.15
    late = t > t[-1] - 0.4
    measured = level - (z[late].mean() - 0.012)
    yield near(work, "draft [m]", measured, draft, "Archimedes", absolute=0.0025)
    yield at_most(work, "tilt at the end over 8°", np.abs(tilt[late]).max() / 8, 0.2, "GM = 8.0 mm > 0: it comes back")
    yield at_most(work, "least tilt over 8°", tilt.min() / 8, 0.0, "and swings to the other side", reference=-1)


@check("rising_box", "a box rises from the floor of a tank (Qiu 2017)")
def rising_box(work):
    run = work.run(variant("rising_box"))
    t, z = run.bodies["t"], run.bodies["box_1_z"]
    seen = reference("rising_box", "qiu2017_floating_box_exp.csv")
    seen_t, seen_z = seen["t_s"], seen["y_m"]
    # It is let go 2 mm above the floor: the curves are shifted to pass 20 mm together.
    shift = np.interp(0.02, seen_z[:20], seen_t[:20]) - np.interp(0.02, z[: z.argmax()], t[: z.argmax()])
    ours, theirs = crests(t, z), [(0.376, 0.0512), (0.558, 0.0352), (0.733, 0.0493), (0.931, 0.0373)]
    yield near(work, "first crest [m]", ours[0][1], theirs[0][1], QIU, relative=0.1)
    yield near(work, "its time, curves shifted to pass 20 mm together [s]", ours[0][0] + shift, 0.376, QIU, relative=0.1)
    periods = [b[0] - a[0] for a, b in zip(ours, ours[2:])]
    yield near(work, "period [s]", np.mean(periods[:2]), 0.36, QIU, relative=0.1)
    # The tank is 0.15 × 0.14 m².
    draft = 0.80052 * 0.024
    level = 0.052 - 0.049 * 0.048 * (0.024 - draft) / (0.15 * 0.14)
    middle = np.mean([(a[1] + 2 * b[1] + c[1]) / 4 for a, b, c in zip(ours, ours[1:], ours[2:])])
    yield near(work, "middle of the motion [m]", middle, level - draft + 0.012, "Archimedes", absolute=0.001)
    # No level box rises from rest faster than potential flow lets it; the experiment's did.
    height, speed = fastest_rise((0.15, 0.14), (0.049, 0.048, 0.024), 0.80052, 0.052, z[0])
    way = np.linspace(0.02, 0.035, 151)
    least = np.trapezoid(1 / np.interp(way, height, speed), way)
    rise = lambda t, z: np.subtract(*np.interp([0.035, 0.02], z, t))
    yield at_least(work, "time from 20 to 35 mm [s]", rise(t[: z.argmax()], z[: z.argmax()]), least, "potential flow")
    told = {
        "the same, experiment [s]": (f"≥ {least:.3g}", rise(seen_t[:30], seen_z[:30])),
        "first trough [m]": ("0.0352", ours[1][1]),
        "second crest [m]": ("0.0493", ours[2][1]),
    }
    for name, (expected, value) in told.items():
        yield reported(work, name, value, expected, QIU)
    plot, axes = figure(figsize=(6, 4))
    axes.plot(seen_t, 1000 * seen_z, "k.", label="experiment")
    axes.plot(t + shift, 1000 * z, label="computed")
    axes.set(xlabel="t [s]", ylabel="height of the middle [mm]")
    axes.legend()
    plot.savefig(work.folder / "height.png", dpi=150)


@check("settling_sphere", "a sphere settles in oil (ten Cate 2002, E4 and E1)")
def settling_sphere(work):
    plot, axes = figure(figsize=(6, 4))
    for name, density, viscosity, end, fastest in (("E4", 960, 0.058, 0.85, 0.1226), ("E1", 970, 0.373, 1.5, 0.0363)):
        changes = {"water": {"density": density, "viscosity": viscosity}, "time.end": end}
        run = work.run(variant("settling_sphere", changes), name)
        t, z = run.bodies["t"], run.bodies["sphere_1_z"]
        speed = -np.diff(z) / np.diff(t)
        yield near(work, f"top speed, {name} [m/s]", speed.max(), fastest, "ten Cate et al. 2002", relative=0.05)
        axes.plot((t[1:] + t[:-1]) / 2, speed, label=name)
        axes.axhline(fastest, color="k", ls=":", lw=0.8)
    axes.set(xlabel="t [s]", ylabel="speed [m/s]")
    axes.legend()
    plot.savefig(work.folder / "speed.png", dpi=150)


@check("cube", "a dam break carries a cube away (Canelas 2016)")
def cube(work):
    sizes = {"x": [0.2, 0.08, 0.025, 0.025, 0.06, 0.0375, 0.0375, 0.12], "y": [0.0375, 0.0375, 0.07], "z": [0.0375, 0.0375, 0.05, 0.12]}
    coarse = {f"mesh.box.{axis}.sizes": list for axis, list in sizes.items()}
    run = work.run(variant("cube", coarse if work.quick else None))
    t, x = run.bodies["t"], run.bodies["cube_1_x"]
    for time, place, allowed in ((1.0, 2.13, 0.1), (1.25, 2.61, 0.1), (1.5, 3.07, 0.2)):
        at = np.interp(time, t, x)
        yield near(work, f"place at {time} s [m]", at, place, "Canelas et al. 2016", absolute=allowed)
    seen = reference("cube", "canelas2016_one_cube_exp_x.csv")
    plot, axes = figure(figsize=(6, 4))
    axes.plot(seen["t_s"], seen["x_m"], "k.", label="experiment")
    axes.plot(t, x, label="computed")
    axes.set(xlabel="t [s]", ylabel="x of the middle [m]", xlim=(0, 1.6), ylim=(1.6, 3.5))
    axes.legend()
    plot.savefig(work.folder / "way.png", dpi=150)


@check("energy", "where the energy of a wave goes that breaks two glued boxes loose")
def energy(work):
    case = variant("house", {})
    case.table = tomllib.loads((ROOT / "tests/boxes_in_a_wave.toml").read_text())
    case.table["solver"] = {}
    case.table["output"] = {"energy": True, "fields_every": "never"}
    run = work.run(case, ranks=1)
    e = columns(run.folder / "energy.csv")
    exchanged = e["potential"][0] - e["potential"].min()
    source = "sum of all lines, over the potential energy released"
    yield at_most(work, "change of all energy", np.abs(e["total"] / exchanged - e["total"][0] / exchanged).max(), 0.02, source)
    fluids = np.abs(e["fluid_total"] - e["fluid_total"][0]).max() / exchanged
    yield at_most(work, "change of the fluids' energy", fluids, 0.02, source)
    for name in ("to_bodies", "viscous", "streamline", "pressure", "divergence", "walls", "ghost", "convection",
                 "transport", "regularisation", "volume", "recut", "coupling"):
        print(f"      {name:15} {e[name][-1] / exchanged:+.4f}")
