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
EXAMPLES = ROOT / "target/release/examples"
STATE = ROOT / "target/scaling-state.json"

JOB = """#!/bin/bash
#SBATCH --job-name=fcm-fsi-scaling
#SBATCH --ntasks={ranks}
#SBATCH --cpus-per-task=1
#SBATCH --exclusive
#SBATCH --time=01:00:00
#SBATCH --output=scaling-%j.log
# Build before, where there is a network: cargo build --release --locked --examples
# (and scripts/python --version, which makes Python's packages).
cd {root}
export FCM_FSI_NO_INSTALL=1 LAUNCH="srun --ntasks={{ranks}} --cpu-bind=cores"
scripts/scaling {arguments}
"""


def launch(ranks):
    """What starts so many ranks; LAUNCH="srun -n {ranks}" where there is no mpirun."""
    return shlex.split(os.environ.get("LAUNCH", "mpirun -n {ranks}").format(ranks=ranks))


def lines(ranks, *command):
    """JSON lines that an example prints on so many ranks."""
    command = [*launch(ranks), *map(str, command)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=dict(os.environ, OMP_NUM_THREADS="1"))
    return [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]


def measure(ranks, cells, runs):
    all_runs = [lines(ranks, EXAMPLES / "step", "solve", STATE, cells, 1, "open")[0] for _ in range(runs)]
    triad = [lines(ranks, EXAMPLES / "kernels", 0)[0]["value"] for _ in range(runs)]
    times = [run["step"] for run in all_runs]
    # The run in the middle stands for its stages.
    row = sorted(all_runs, key=lambda run: run["step"])[len(times) // 2]
    return row | {"step": statistics.median(times), "spread": [min(times), max(times)], "triad": statistics.median(triad)}


def series(kind, all_ranks, cells, runs):
    first, rows = None, []
    for ranks in all_ranks:
        # The tank has 4 cells³ cells: weak means as many nodes a rank as the first has.
        own = cells if kind == "strong" else round(cells * (ranks / all_ranks[0]) ** (1 / 3))
        if kind == "weak" and ranks == all_ranks[0]:
            continue
        row = measure(ranks, own, runs)
        rows.append({"series": kind, **row})
        show(rows[-1])
    return rows


def total(row):
    return next(stage for stage in row["stages"] if stage["name"] == "step")


def with_efficiencies(rows):
    """Node-steps per second and rank, and per second of work, over those of the first row."""
    rate = lambda row, time: row["nodes"] / time
    for row in rows:
        first = rows[0]
        of_wall = rate(row, row["step"]) / row["ranks"], rate(first, first["step"]) / first["ranks"]
        of_work = rate(row, total(row)["work"]["mean"]) / row["ranks"], rate(first, total(first)["work"]["mean"]) / first["ranks"]
        row["efficiency"], row["efficiency_of_work"] = of_wall[0] / of_wall[1], of_work[0] / of_work[1]


HEAD = ("series", "ranks", "nodes", "step [s]", "work [s]", "its", "messages", "MB", "collectives", "memory MB", "triad GB/s")
FORM = "{:7} {:>6} {:>9} {:>10} {:>10} {:>5} {:>9} {:>8} {:>12} {:>10} {:>11}"


def show(row):
    step = total(row)
    work = row["ranks"] * step["work"]["mean"]
    cells = (row["series"], row["ranks"], row["nodes"], f"{row['step']:.3f}", f"{work:.3f}", row["iterations"][0], step["messages"])
    print(FORM.format(*cells, f"{step['bytes'] * 1e-6:.2f}", step["collectives"], f"{row['memory_mb']:.0f}", f"{row['triad']:.1f}"), flush=True)


def plot(rows):
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(5, 3.5))
    for kind, colour in (("strong", "C0"), ("weak", "C1")):
        own = [rows[0]] + [row for row in rows[1:] if row["series"] == kind]
        ranks = [row["ranks"] for row in own]
        axes.plot(ranks, [row["efficiency"] for row in own], "o-", color=colour, label=kind)
        axes.plot(ranks, [row["efficiency_of_work"] for row in own], "x:", color=colour, label=f"{kind}, without waiting")
    axes.set(xlabel="ranks", ylabel="efficiency", xscale="log", ylim=(0, 1.1))
    shown = sorted({row["ranks"] for row in rows})
    axes.set_xticks(shown, labels=map(str, shown))
    axes.minorticks_off()
    axes.legend()
    figure.tight_layout()
    figure.savefig(ROOT / "target/scaling.png", dpi=150)


def main():
    parser = argparse.ArgumentParser(prog="scripts/scaling", description=__doc__)
    parser.add_argument("--ranks", default=None, help="1,2 (the cores there are)")
    parser.add_argument("--cells", type=int, default=29, help="cells over the tank's height: 29 is 105k nodes")
    parser.add_argument("--runs", type=int, default=3, help="runs of each")
    parser.add_argument("--slurm", metavar="JOB", help="write this job script instead")
    parser.add_argument("--predict", action="store_true", help="say what many more ranks would do, from what was measured here")
    arguments = parser.parse_args()
    if arguments.predict:
        import predict

        return predict.main()
    text = arguments.ranks or ",".join(str(n) for n in (1, 2, 4, 8, 16, 32, 64) if n <= (os.cpu_count() or 1))
    ranks = [int(n) for n in text.split(",")]
    if arguments.slurm:
        again = f"--ranks {text} --cells {arguments.cells} --runs {arguments.runs}"
        Path(arguments.slurm).write_text(JOB.format(ranks=max(ranks), root=ROOT, arguments=again))
        print(f"wrote {arguments.slurm}: sbatch {arguments.slurm}")
        return 0
    subprocess.run([*launch(1), str(EXAMPLES / "step"), "state", str(STATE)], stdout=subprocess.DEVNULL, check=True)
    print(FORM.format(*HEAD))
    rows = [row for kind in ("strong", "weak") for row in series(kind, ranks, arguments.cells, arguments.runs)]
    with_efficiencies(rows)
    print("\nseries   ranks  efficiency  of work  (work: processor time without waiting)")
    for row in rows:
        print(f"{row['series']:7} {row['ranks']:6} {row['efficiency']:11.2f} {row['efficiency_of_work']:8.2f}")
    (ROOT / "target/scaling.json").write_text(json.dumps(rows, indent=1) + "\n")
    plot(rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
