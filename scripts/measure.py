"""Command line of scripts/bench: what is measured, the table, target/bench.json."""

import argparse
import functools
import json
import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
RELEASE = ROOT / "target/release"
STATE = ROOT / "target/bench-state.json"
# Cells over the height of the 4 × 1 × 1 m tank, for about so many nodes.
SIZES = {"15k": 15, "100k": 29, "400k": 46}
# Peers that are not run here, with what was measured of them once.
KRATOS = "Kratos (not run here)"
HYPRE = "PETSc + hypre (not run here)"

sys.path.insert(0, str(ROOT / "scripts/peers"))
sys.path.insert(0, str(ROOT / "scripts/validation"))


def mpirun(ranks, *command):
    """JSON lines the command prints."""
    command = ["mpirun", "-n", str(ranks), *map(str, command)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=dict(os.environ, OMP_NUM_THREADS="1"))
    return [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]


@functools.cache
def step(nodes, courant=1, ranks=1):
    """One step of a dam break at a Courant number, on about so many nodes: once in a round of measurements."""
    if not STATE.exists():
        subprocess.run([RELEASE / "examples/step", "state", STATE], stdout=subprocess.DEVNULL, check=True)
    run = mpirun(ranks, RELEASE / "examples/step", "solve", STATE, SIZES[nodes], courant, "open")[0]
    # Processor time of all ranks, without what they wait.
    run["work"] = {stage["name"]: stage["work"]["mean"] * ranks for stage in run["stages"]}
    return run


def triad(ranks):
    return mpirun(ranks, RELEASE / "examples/kernels", 0)[0]["value"]


# Each gives {name: (value, unit, peer, peer's value)}; the first has the name of the measurement.


def assembly():
    run = step("100k")
    return {"assembly": (run["tets"] / run["work"]["flow: assembly"] * 1e-6, "M tetrahedra/s", KRATOS, 0.20)}


def kernels():
    lines = {line["name"]: (line["value"], line["unit"]) for line in mpirun(1, RELEASE / "examples/kernels")}
    triad = lines.pop("triad")
    return {"matvec": (*lines.pop("matvec"), f"triad of the same run [{triad[1]}]", triad[0]), **lines}


def whole_step():
    values = {}
    for nodes in ("400k", "100k"):
        run, fast = step(nodes), step(nodes, courant=11)
        per_node = 1e6 / run["nodes"]
        name = "step" if nodes == "400k" else f"step, {nodes}"
        values[name] = (run["work"]["step"] * per_node, "µs per node", KRATOS, 180.0)
        values[f"solve, {nodes}, Courant number 1"] = (run["solve"][0] * per_node, "µs per node", HYPRE, 18.0)
        values[f"solve, {nodes}, Courant number 11"] = (fast["solve"][0] * per_node, "µs per node", HYPRE, 20.0)
    return values


def iterations():
    count = {(nodes, ranks): step(nodes, ranks=ranks)["iterations"][0] for nodes in ("400k", "15k") for ranks in (1, 16)}
    values = {"iterations": (count["400k", 1], "to 1e-3, 400k nodes", HYPRE, 5.0)}
    for nodes, ranks in (("400k", 16), ("15k", 1), ("15k", 16)):
        values[f"iterations, {nodes}, {ranks} ranks"] = (count[nodes, ranks], "to 1e-3")
    return values


def memory():
    values = {}
    for nodes in ("400k", "100k"):
        run = step(nodes)
        name = "memory" if nodes == "400k" else f"memory, {nodes}"
        values[name] = (run["memory_mb"] * 1024 / run["nodes"], "kB per node", KRATOS, 28.0)
    return values


def two_ranks():
    bandwidth = triad(1), triad(2)
    one, two = step("400k"), step("400k", ranks=2)
    values = {"two_ranks": (one["step"] / two["step"], "× one rank", "triad", bandwidth[1] / bandwidth[0])}
    values["two_ranks, work"] = (two["work"]["step"] / one["work"]["step"], "of one rank's")
    return values


def marin():
    """Wall time to t = 1 s on two ranks, beside interFoam's if it is installed; and how far the pressures P1 and P3 on
    the box are from the measured ones, in the mean from 0.3 s to 1 s."""
    import marin as foam
    import numpy as np
    from program import columns

    with tempfile.TemporaryDirectory() as folder:
        text = (ROOT / "cases/marin/case.toml").read_text()
        case = Path(folder) / "case.toml"
        case.write_text(re.sub(r"(?m)^end = .*$", "end = 1", text))
        start = time.monotonic()
        command = ["mpirun", "-n", "2", RELEASE / "fcm-fsi", case, "--out", folder, "--quiet"]
        subprocess.run(command, check=True, env=dict(os.environ, OMP_NUM_THREADS="1"))
        seconds = time.monotonic() - start
        gauges = columns(Path(folder) / "gauges.csv")
        # The pressure stands half a step before the time of its row.
        t = gauges["t"] - 0.5 * np.diff(gauges["t"], prepend=0)
        ours = {name: pressure_error(name, t, gauges[name]) for name in ("P1", "P3")}
        if not shutil.which("interFoam"):
            return {"marin": (seconds, "s"), **{f"marin, {name}": (error, "kPa off") for name, error in ours.items()}}
        run = foam.run(Path(folder) / "foam", 2, 1)
        rows = list(zip(*foam.pressures(Path(folder) / "foam")))
        theirs = {name: pressure_error(name, rows[0], rows[int(name[1])]) for name in ours}
    values = {"marin": (seconds, "s", "interFoam", run["seconds"])}
    values |= {f"marin, {name}": (ours[name], "kPa off", "interFoam", theirs[name]) for name in ours}
    return values


def pressure_error(name, t, p):
    import numpy as np
    from program import reference

    # The table is in √(H/g) and ρ g H of the water's depth H = 0.55 m.
    t_exp, p_exp = reference("dam_break", f"dambreak_kleefsman_{name.lower()}_exp.csv").values()
    t_exp, p_exp = t_exp * (0.55 / 9.81) ** 0.5, p_exp * 1000 * 9.81 * 0.55
    inside = (t_exp >= 0.3) & (t_exp <= 1)
    return float(np.mean(np.abs(np.interp(t_exp[inside], t, p) - p_exp[inside])) * 1e-3)


def spheres(name, *peer):
    """Sphere-steps per second of processor time."""
    done = subprocess.run([RELEASE / "examples/clusters", name], capture_output=True, text=True, check=True)
    return {f"dem_{name}": (json.loads(done.stdout)["rate"] * 1e-6, "M sphere-steps/s", *peer)}


def loose():
    """10 000 spheres that have settled in a box, beside LIGGGHTS if it is installed; of both the processor time of the
    same 3000 steps."""
    if not shutil.which("liggghts"):
        return spheres("loose")
    with tempfile.TemporaryDirectory() as folder:
        script = ROOT / "scripts/peers/settle.in"
        subprocess.run(["liggghts", "-in", script], cwd=folder, stdout=subprocess.DEVNULL, check=True)
        begin, end = (int(line.split()[0]) for line in (Path(folder) / "processor_time").open())
    return spheres("loose", "LIGGGHTS", 10000 * 3000 / (end - begin) * 1e3)


def bonded():
    """Blocks of 8 spheres glued to one, beside Yade if it is installed."""
    if not shutil.which("yade"):
        return spheres("bonded")
    command = ["yade", "-x", "-n", "-j1", ROOT / "scripts/peers/bonded.py"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    (rate,) = re.findall(r"sphere-steps per second: (\S+)", done.stdout)
    return spheres("bonded", "Yade", float(rate) * 1e-6)


MEASUREMENTS = {
    "assembly": assembly,
    "matvec": kernels,
    "step": whole_step,
    "iterations": iterations,
    "memory": memory,
    "two_ranks": two_ranks,
    "marin": marin,
    "dem_loose": loose,
    "dem_bonded": bonded,
}


def lines_of(rounds):
    """Medians and spreads over the rounds."""
    lines = []
    for name, (_, unit, *peer) in rounds[0].items():
        values = [values[name][0] for values in rounds]
        line = {"name": name, "value": statistics.median(values), "unit": unit, "spread": [min(values), max(values)]}
        if peer:
            line |= {"peer": peer[0], "peer_value": statistics.median(values[name][3] for values in rounds)}
        lines.append(line)
    return lines


def table(lines, earlier):
    """The lines, and their values over those of an earlier bench.json."""
    print(f"{'name':34} {'median':>10} {'least':>10} {'most':>10} {'over then' if earlier else '':>10}  unit, peer")
    for line in lines:
        before = earlier.get(line["name"])
        ratio = f"{line['value'] / before:10.3f}" if before else " " * 10
        peer = f"; {line['peer']} {line['peer_value']:.3g}" if "peer" in line else ""
        low, high = line["spread"]
        print(f"{line['name']:34} {line['value']:10.3f} {low:10.3f} {high:10.3f} {ratio}  {line['unit']}{peer}")


def main():
    parser = argparse.ArgumentParser(prog="scripts/bench", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="what to measure (all)")
    parser.add_argument("--runs", type=int, default=3, metavar="N", help="rounds of measurements (3)")
    parser.add_argument("--against", metavar="FILE", help="an earlier bench.json to compare with")
    parser.add_argument("--list", action="store_true", help="name what can be measured")
    arguments = parser.parse_args()
    if arguments.list:
        print("\n".join(MEASUREMENTS))
        return 0
    for name in arguments.names:
        if name not in MEASUREMENTS:
            parser.error(f"no measurement is called {name}; there are {', '.join(MEASUREMENTS)}")
    then = json.loads(Path(arguments.against).read_text()) if arguments.against else []
    rounds = []
    for _ in range(arguments.runs):
        step.cache_clear()
        rounds.append({})
        for name in arguments.names or MEASUREMENTS:
            rounds[-1] |= MEASUREMENTS[name]()
    lines = lines_of(rounds)
    table(lines, {line["name"]: line["value"] for line in then})
    (ROOT / "target/bench.json").write_text(json.dumps(lines, indent=1, ensure_ascii=False) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
