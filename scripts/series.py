"""Command line of scripts/scaling: how a step's time changes with the number of ranks."""

import argparse
import json
import os
import shlex
import statistics
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
STEP = ROOT / "target/release/examples/step"
STATE = ROOT / "target/scaling-state.json"

JOB = """#!/bin/bash
#SBATCH --job-name=fcm-fsi-scaling
#SBATCH --ntasks={ranks}
#SBATCH --cpus-per-task=1
#SBATCH --exclusive
#SBATCH --time=01:00:00
#SBATCH --output=scaling-%j.log
# Build before, where there is a network: cargo build --release --locked --example step
cd {root}
export FCM_FSI_NO_INSTALL=1 LAUNCH="srun -n {{ranks}}"
scripts/scaling {arguments}
"""


def launch(ranks):
    """What starts so many ranks; LAUNCH="srun -n {ranks}" where there is no mpirun."""
    return shlex.split(os.environ.get("LAUNCH", "mpirun -n {ranks}").format(ranks=ranks))


def measure(ranks, cells, runs):
    command = [*launch(ranks), str(STEP), "solve", str(STATE), str(cells), "1", "open"]
    lines = []
    for _ in range(runs):
        done = subprocess.run(command, capture_output=True, text=True, check=True, env=dict(os.environ, OMP_NUM_THREADS="1"))
        lines.append(json.loads(next(line for line in done.stdout.splitlines() if line.startswith("{"))))
    times = [line["step"] for line in lines]
    return {
        "ranks": ranks,
        "nodes": lines[0]["nodes"],
        "step": statistics.median(times),
        "spread": [min(times), max(times)],
        "iterations": lines[0]["iterations"][0],
        "memory_mb": lines[0]["memory_mb"],
    }


def series(kind, all_ranks, cells, runs):
    first, rows = None, []
    for ranks in all_ranks:
        # The tank has 4 cells³ cells: weak means as many nodes a rank as the first has.
        own = cells if kind == "strong" else round(cells * (ranks / all_ranks[0]) ** (1 / 3))
        row = measure(ranks, own, runs)
        first = first or row
        # Node-steps per second and rank, over those of the first.
        work = row["nodes"] / row["step"] / row["ranks"]
        row["efficiency"] = work / (first["nodes"] / first["step"] / first["ranks"])
        rows.append({"series": kind, **row})
        print(f"{kind:7} {ranks:6} {row['nodes']:9} {row['step']:10.3f} {row['efficiency']:11.2f} {row['iterations']:11} {row['memory_mb']:10.0f}", flush=True)
    return rows


def plot(rows):
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(5, 3.5))
    for kind in ("strong", "weak"):
        own = [row for row in rows if row["series"] == kind]
        axes.plot([row["ranks"] for row in own], [row["efficiency"] for row in own], "o-", label=kind)
    axes.set(xlabel="ranks", ylabel="efficiency", xscale="log", ylim=(0, 1.1))
    axes.legend()
    figure.tight_layout()
    figure.savefig(ROOT / "target/scaling.png", dpi=150)


def main():
    parser = argparse.ArgumentParser(prog="scripts/scaling", description=__doc__)
    parser.add_argument("--ranks", default=None, help="1,2 (the cores there are)")
    parser.add_argument("--cells", type=int, default=29, help="cells over the tank's height: 29 is 105k nodes")
    parser.add_argument("--runs", type=int, default=3, help="runs of each")
    parser.add_argument("--slurm", metavar="JOB", help="write this job script instead")
    arguments = parser.parse_args()
    text = arguments.ranks or ",".join(str(n) for n in (1, 2, 4, 8, 16, 32, 64) if n <= (os.cpu_count() or 1))
    ranks = [int(n) for n in text.split(",")]
    if arguments.slurm:
        again = f"--ranks {text} --cells {arguments.cells} --runs {arguments.runs}"
        Path(arguments.slurm).write_text(JOB.format(ranks=max(ranks), root=ROOT, arguments=again))
        print(f"wrote {arguments.slurm}: sbatch {arguments.slurm}")
        return 0
    subprocess.run([*launch(1), str(STEP), "state", str(STATE)], stdout=subprocess.DEVNULL, check=True)
    print(f"{'series':7} {'ranks':>6} {'nodes':>9} {'step [s]':>10} {'efficiency':>11} {'iterations':>11} {'memory MB':>10}")
    rows = [row for kind in ("strong", "weak") for row in series(kind, ranks, arguments.cells, arguments.runs)]
    (ROOT / "target/scaling.json").write_text(json.dumps(rows, indent=1) + "\n")
    plot(rows)
    return 0


sys.exit(main())
