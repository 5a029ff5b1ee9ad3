"""What the flow's solver costs on any mesh and number of ranks: iterations, and memory per rank."""

import json
import os
import subprocess

from checks import at_most, check
from program import ROOT, variant

SOURCE = "independent of mesh and ranks"


@check("iterations", "iterations to 1e-3 and 1e-6 on a dam break: 15k to 400k nodes, 1 to 16 ranks, open and closed")
def iterations(work):
    subprocess.run(["cargo", "build", "--release", "--locked", "--quiet", "--example", "step"], cwd=ROOT, check=True)
    program = ROOT / "target/release/examples/step"
    state = work.folder / "state.json"
    subprocess.run([program, "state", state], stdout=subprocess.DEVNULL, check=True)
    sizes = {15: (1, 4, 16), 29: (1, 4, 16)} if work.quick else {15: (1, 2, 4, 16), 29: (1, 2, 4, 16), 46: (1, 16)}
    rows = []
    print("   top     CFL    nodes  ranks  to 1e-3  to 1e-6")
    for top in ("open", "closed"):
        for courant in (1, 10):
            for cells, all_ranks in sizes.items():
                for ranks in all_ranks:
                    command = ["mpirun", "-n", str(ranks), program, "solve", state, str(cells), str(courant), top]
                    environment = dict(os.environ, OMP_NUM_THREADS="1")
                    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
                    if done.returncode != 0:
                        raise RuntimeError(f"{top}, Courant number {courant}, {cells}, {ranks} ranks: {done.stderr[-300:]}")
                    row = {"cells": cells, **json.loads(done.stdout)}
                    rough, fine = row["iterations"]
                    line = f"   {row['top']:6} {row['courant']:4.0f} {row['nodes']:8} {row['ranks']:6} {rough:8} {fine:8}"
                    print(line, flush=True)
                    # At once: the last ones take long.
                    rows.append(row)
                    (work.folder / "table.json").write_text(json.dumps(rows, indent=1) + "\n")
    coarse, fine = min(sizes), max(sizes)
    for top in ("open", "closed"):
        for courant in (1, 10):
            for which, to in enumerate(("1e-3", "1e-6")):
                count = {
                    (row["cells"], row["ranks"]): row["iterations"][which]
                    for row in rows
                    if row["top"] == top and row["courant"] == courant
                }
                name = f"{top}, Courant number {courant}, to {to}"
                for ranks in (1, 16):
                    few, many = count[coarse, ranks], count[fine, ranks]
                    yield at_most(work, f"{name}, {ranks} ranks, finest mesh", many, 1.5 * few + 2, SOURCE, reference=few)
                for cells in sizes:
                    few, many = count[cells, 1], count[cells, 16]
                    name_of = f"{name}, {4 * cells} × {cells} × {cells} cells, 16 ranks"
                    yield at_most(work, name_of, many, 1.5 * few + 2, SOURCE, reference=few)


@check("memory", "peak memory per rank of a dam break on 1 and 2 ranks, about 100k nodes")
def memory(work):
    box = {"x": [0, 3.22], "y": [0, 1], "z": [0, 1], "cells": [92, 32, 32]}
    changes = {"mesh.box": box, "mesh.holes": None, "time.end": 0.02, "output.fields_every": 0.02}
    peaks = {}
    for ranks in (1, 2):
        run = work.run(variant("dam_break", changes), f"{ranks}", ranks=ranks)
        peaks[ranks] = run.summary["memory_peak_mb"]
        print(f"   {ranks} ranks, {run.summary['nodes']} nodes: {peaks[ranks]} MB")
    ratio = max(peaks[2]) / max(peaks[1])
    yield at_most(work, "peak memory of a rank, 2 ranks over 1", ratio, 0.6, "nothing of the mesh's size on all", reference=0.5)
