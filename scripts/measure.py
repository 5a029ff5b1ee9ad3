"""Command line of scripts/bench: what is measured, the table, target/bench.json."""

import argparse
import json
import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "target/release/examples"
STATE = ROOT / "target/bench-state.json"
# Cells over the height of the 4 × 1 × 1 m tank, for about so many nodes.
SIZES = {"15k": 15, "100k": 29, "400k": 46}


def mpirun(ranks, *command):
    """JSON lines the command prints."""
    command = ["mpirun", "-n", str(ranks), *map(str, command)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=dict(os.environ, OMP_NUM_THREADS="1"))
    return [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]


def step(nodes, courant=1, ranks=1):
    """One step of a dam break at a Courant number, on about so many nodes."""
    if not STATE.exists():
        subprocess.run([EXAMPLES / "step", "state", STATE], stdout=subprocess.DEVNULL, check=True)
    return mpirun(ranks, EXAMPLES / "step", "solve", STATE, SIZES[nodes], courant, "open")[0]


def kernels():
    return {line["name"]: (line["value"], line["unit"]) for line in mpirun(1, EXAMPLES / "kernels")}


def assembly():
    run = step("100k")
    return {"assembly": (run["tets"] / run["assembly"] * 1e-6, "M tetrahedra/s")}


def whole_step():
    values = {}
    for nodes in ("100k", "400k"):
        run = step(nodes)
        per_node = 1e6 / run["nodes"]
        values[f"step {nodes}"] = (run["step"] * per_node, "µs per node")
        values[f"solve {nodes}, Courant number 1"] = (run["seconds"][0] * per_node, "µs per node")
        values[f"memory {nodes}"] = (run["memory_mb"] * 1024 / run["nodes"], "kB per node")
        run = step(nodes, courant=11)
        values[f"solve {nodes}, Courant number 11"] = (run["seconds"][0] * per_node, "µs per node")
    return values


def iterations():
    return {f"iterations {nodes}, {ranks} ranks": (step(nodes, ranks=ranks)["iterations"][0], "to 1e-3") for nodes in ("15k", "400k") for ranks in (1, 16)}


def two_ranks():
    one, two = step("400k"), step("400k", ranks=2)
    return {"two_ranks": (one["step"] / two["step"], "× one rank")}


def spheres(name, *peer):
    """Sphere-steps per second of processor time."""
    done = subprocess.run([EXAMPLES / "clusters", name], capture_output=True, text=True, check=True)
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
    "matvec": kernels,
    "assembly": assembly,
    "step": whole_step,
    "iterations": iterations,
    "two_ranks": two_ranks,
    "dem_loose": loose,
    "dem_bonded": bonded,
}


def main():
    parser = argparse.ArgumentParser(prog="scripts/bench", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="what to measure (all)")
    parser.add_argument("--runs", type=int, default=3, metavar="N", help="runs of each (3)")
    parser.add_argument("--list", action="store_true", help="name what can be measured")
    arguments = parser.parse_args()
    if arguments.list:
        print("\n".join(MEASUREMENTS))
        return 0
    for name in arguments.names:
        if name not in MEASUREMENTS:
            parser.error(f"no measurement is called {name}; there are {', '.join(MEASUREMENTS)}")
    lines = []
    print(f"{'name':36} {'median':>10} {'least':>10} {'most':>10}  unit")
    for name in arguments.names or MEASUREMENTS:
        runs = [MEASUREMENTS[name]() for _ in range(arguments.runs)]
        for key, (_, unit, *peer) in runs[0].items():
            values = [run[key][0] for run in runs]
            line = {"name": key, "value": statistics.median(values), "unit": unit, "spread": [min(values), max(values)]}
            beside = ""
            if peer:
                line.update(peer=peer[0], peer_value=statistics.median(run[key][3] for run in runs))
                beside = f", {line['peer']} {line['peer_value']:.3f}"
            lines.append(line)
            print(f"{key:36} {line['value']:10.3f} {min(values):10.3f} {max(values):10.3f}  {unit}{beside}", flush=True)
    (ROOT / "target/bench.json").write_text(json.dumps(lines, indent=1, ensure_ascii=False) + "\n")
    return 0


sys.exit(main())
