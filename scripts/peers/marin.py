"""OpenFOAM's interFoam on the MARIN dam break (Debian package openfoam): 172k hexahedra, laminar, Courant number 0.5.

    marin.py FOLDER RANKS END

Prints one line of JSON: cells, steps, wall seconds of the solver.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

# Grid lines along each axis at which the tank is cut into blocks, so that box and water are met exactly, and the cells
# between them.
X, Y, Z = (0, 0.6635, 0.8245, 1.992, 3.22), (0, 0.295, 0.698, 1), (0, 0.161, 0.55, 1)
CELLS = (24, 6, 44, 46), (12, 16, 12), (6, 14, 16)
PRESSURES = [(0.8245, 0.471, z) for z in (0.021, 0.061, 0.101, 0.141)]

WALLS = '"(walls|box)"'
FILES = {
    "constant/g": ("uniformDimensionedVectorField", "dimensions [0 1 -2 0 0 0 0]; value (0 0 -9.81);"),
    "constant/turbulenceProperties": ("dictionary", "simulationType laminar;"),
    "constant/transportProperties": (
        "dictionary",
        "phases (water air); sigma 0;"
        " water { transportModel Newtonian; nu 1e-6; rho 1000; }"
        " air { transportModel Newtonian; nu 1.5e-5; rho 1.2; }",
    ),
    "0/alpha.water": (
        "volScalarField",
        f"dimensions [0 0 0 0 0 0 0]; internalField uniform 0; boundaryField {{ {WALLS} {{ type zeroGradient; }}"
        " top { type inletOutlet; inletValue uniform 0; value uniform 0; } }",
    ),
    "0/U": (
        "volVectorField",
        f"dimensions [0 1 -1 0 0 0 0]; internalField uniform (0 0 0); boundaryField {{ {WALLS} {{ type noSlip; }}"
        " top { type pressureInletOutletVelocity; value uniform (0 0 0); } }",
    ),
    "0/p_rgh": (
        "volScalarField",
        f"dimensions [1 -1 -2 0 0 0 0]; internalField uniform 0; boundaryField {{ {WALLS} {{ type fixedFluxPressure;"
        " value uniform 0; } top { type totalPressure; p0 uniform 0; } }",
    ),
    "system/setFieldsDict": (
        "dictionary",
        "defaultFieldValues ( volScalarFieldValue alpha.water 0 ); regions ( boxToCell { box (1.992 -1 -1) (4 2 0.55);"
        " fieldValues ( volScalarFieldValue alpha.water 1 ); } );",
    ),
    "system/fvSchemes": (
        "dictionary",
        "ddtSchemes { default Euler; } gradSchemes { default Gauss linear; } laplacianSchemes { default Gauss linear"
        " corrected; } interpolationSchemes { default linear; } snGradSchemes { default corrected; } divSchemes {"
        " div(rhoPhi,U) Gauss linearUpwind grad(U); div(phi,alpha) Gauss vanLeer; div(phirb,alpha) Gauss linear;"
        " div(((rho*nuEff)*dev2(T(grad(U))))) Gauss linear; }",
    ),
    "system/fvSolution": (
        "dictionary",
        'solvers { "alpha.water.*" { nAlphaCorr 1; nAlphaSubCycles 2; cAlpha 1; }'
        ' "pcorr.*" { solver GAMG; smoother DIC; tolerance 1e-5; relTol 0; }'
        " p_rgh { solver GAMG; smoother DIC; tolerance 1e-7; relTol 0.05; } p_rghFinal { $p_rgh; relTol 0; } }"
        " PIMPLE { momentumPredictor no; nOuterCorrectors 1; nCorrectors 3; nNonOrthogonalCorrectors 0; }",
    ),
}


def write(folder, name, kind, text):
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    header = f"FoamFile {{ version 2.0; format ascii; class {kind}; object {path.name}; }}\n"
    path.write_text(header + text + "\n")


def point(i, j, k):
    return i + len(X) * (j + len(Y) * k)


def block_mesh():
    points = " ".join(f"({x} {y} {z})" for z in Z for y in Y for x in X)
    is_box = lambda i, j, k: (i, j, k) == (1, 1, 0)
    blocks, top, box = [], [], []
    for k in range(len(Z) - 1):
        for j in range(len(Y) - 1):
            for i in range(len(X) - 1):
                # Corners, counted as blockMesh does: around the bottom, then around the top.
                ring = ((0, 0), (1, 0), (1, 1), (0, 1))
                corner = [point(i + a, j + b, k + c) for c in (0, 1) for a, b in ring]
                if is_box(i, j, k):
                    faces = ((0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7), (4, 5, 6, 7))
                    box = [[corner[n] for n in face] for face in faces]
                    continue
                if k == len(Z) - 2:
                    top.append(corner[4:])
                size = f"({CELLS[0][i]} {CELLS[1][j]} {CELLS[2][k]})"
                blocks.append(f"hex ({' '.join(map(str, corner))}) {size} simpleGrading (1 1 1)")
    patch = lambda faces: " ".join(f"({' '.join(map(str, face))})" for face in faces)
    return (
        f"scale 1; vertices ( {points} ); blocks ( {' '.join(blocks)} ); edges (); mergePatchPairs ();"
        f" defaultPatch {{ name walls; type wall; }} boundary ( top {{ type patch; faces ( {patch(top)} ); }}"
        f" box {{ type wall; faces ( {patch(box)} ); }} );"
    )


def control(end):
    probes = " ".join(f"({x} {y} {z})" for x, y, z in PRESSURES)
    return (
        f"application interFoam; startFrom startTime; startTime 0; stopAt endTime; endTime {end}; deltaT 0.001;"
        f" writeControl adjustable; writeInterval {end}; writeFormat binary; adjustTimeStep yes; maxCo 0.5;"
        " maxAlphaCo 0.5; maxDeltaT 0.01; functions { pressures { type patchProbes; libs (sampling); patches (box);"
        f" fields (p); probeLocations ( {probes} ); writeControl timeStep; writeInterval 1; }} }}"
    )


def run(folder, ranks, end):
    """Runs it in a new folder: {"cells", "steps", "seconds"}."""
    folder = Path(folder)
    shutil.rmtree(folder, ignore_errors=True)
    for name, (kind, text) in FILES.items():
        write(folder, name, kind, text)
    write(folder, "system/blockMeshDict", "dictionary", block_mesh())
    write(folder, "system/controlDict", "dictionary", control(end))
    split = f"numberOfSubdomains {ranks}; method hierarchical; hierarchicalCoeffs {{ n ({ranks} 1 1); delta 0.001; order xyz; }}"
    write(folder, "system/decomposeParDict", "dictionary", split)
    # Debian's etc/bashrc does not work; this is all that is needed.
    environment = dict(os.environ, WM_PROJECT_DIR="/usr/share/openfoam", OMP_NUM_THREADS="1")

    def call(*command):
        log = folder / f"log.{Path(command[-2] if command[-1] == '-parallel' else command[0]).name}"
        with open(log, "w") as out:
            subprocess.run(command, cwd=folder, stdout=out, stderr=subprocess.STDOUT, env=environment, check=True)
        return log.read_text()

    cells = int(re.search(r"nCells: (\d+)", call("blockMesh")).group(1))
    call("setFields")
    if ranks > 1:
        call("decomposePar")
    start = time.monotonic()
    log = call("mpirun", "-n", str(ranks), "interFoam", "-parallel") if ranks > 1 else call("interFoam")
    seconds = time.monotonic() - start
    return {"cells": cells, "steps": len(re.findall(r"^Time = ", log, re.M)), "seconds": seconds}


def pressures(folder):
    """[t, P1, P2, P3, P4] of every step [s, Pa]."""
    (path,) = Path(folder).glob("postProcessing/pressures/*/p")
    return [[float(x) for x in line.split()] for line in path.read_text().splitlines() if not line.startswith("#")]


if __name__ == "__main__":
    print(json.dumps(run(sys.argv[1], int(sys.argv[2]), float(sys.argv[3]))))
