"""Runs target/release/fcm-fsi on variants of the cases, and reads what it writes."""

import copy
import csv
import json
import os
import shutil
import subprocess
import tomllib
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = ROOT / "target/release/fcm-fsi"


class Variant:
    """A case as nested dictionaries, and the files beside it."""

    def __init__(self, table, files=()):
        self.table = table
        self.files = list(files)


def variant(name, changes=None):
    """cases/NAME with keys set, as in {"time.end": 2, "air": None}: None takes a key out."""
    folder = ROOT / "cases" / name
    table = copy.deepcopy(tomllib.loads((folder / "case.toml").read_text()))
    files = [path for path in folder.iterdir() if path.suffix in (".csv", ".msh", ".asc")]
    for key, value in (changes or {}).items():
        *tables, last = key.split(".")
        inner = table
        for step in tables:
            inner = inner.setdefault(step, {})
        if value is None:
            inner.pop(last, None)
        else:
            inner[last] = value
    return Variant(table, files)


class Work:
    """A check's folder target/validate/NAME, and how it runs the program."""

    def __init__(self, name, quick, ranks):
        self.name = name
        self.quick = quick
        self.ranks = ranks
        self.folder = ROOT / "target/validate" / name
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir(parents=True)

    def run(self, case, label="run", ranks=None, arguments=()):
        """Runs a variant in the folder's `label`; an error of the program is an exception."""
        folder = self.folder / label
        folder.mkdir()
        for path in case.files:
            shutil.copy(path, folder)
        path = folder / "case.toml"
        path.write_text("".join(f"{key} = {toml(value)}\n" for key, value in case.table.items()))
        ranks = ranks or self.ranks
        started = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
        command = [*started, str(PROGRAM), str(path), "--out", str(folder), "--quiet", *arguments]
        environment = dict(os.environ, OMP_NUM_THREADS="1")
        with open(folder / "log", "w") as out:
            done = subprocess.run(command, stdout=out, stderr=subprocess.STDOUT, env=environment, check=False)
        if done.returncode != 0:
            log = (folder / "log").read_text().splitlines()
            said = [line for line in log if line.startswith("error")] or log[-1:] or ["nothing"]
            raise RuntimeError(f"{label}: exit status {done.returncode}: {said[0]}")
        return Run(folder)


class Run:
    """The files of a finished run."""

    def __init__(self, folder):
        self.folder = folder

    @property
    def history(self):
        """Columns of history.csv by name, units left out."""
        return columns(self.folder / "history.csv")

    @property
    def gauges(self):
        """Columns of gauges.csv by name, units left out."""
        return columns(self.folder / "gauges.csv")

    @property
    def bodies(self):
        """Columns of bodies.csv by name, units left out."""
        return columns(self.folder / "bodies.csv")

    @property
    def loads(self):
        """Columns of loads.csv by name, units left out."""
        return columns(self.folder / "loads.csv")

    @property
    def summary(self):
        """summary.json."""
        return json.loads((self.folder / "summary.json").read_text())

    def fields(self):
        """fields.vtkhdf."""
        return Fields(self.folder / "fields.vtkhdf")


class Fields:
    """A file of fields, read with VTK's own reader."""

    def __init__(self, path):
        from vtkmodules.vtkIOHDF import vtkHDFReader

        self._reader = vtkHDFReader()
        self._reader.SetFileName(str(path))
        self._reader.UpdateInformation()
        n = self._reader.GetNumberOfSteps()
        self.times = np.array([self._at(step) for step in range(n)])

    def _at(self, step):
        self._reader.SetStep(step)
        self._reader.Update()
        return self._reader.GetTimeValue()

    def at(self, step):
        """(points, tets, {name: values}) of one step; −1 is the last."""
        from vtkmodules.util.numpy_support import vtk_to_numpy

        self._at(step % len(self.times))
        grid = self._reader.GetOutputDataObject(0)
        points = vtk_to_numpy(grid.GetPoints().GetData()).astype(float)
        tets = vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(-1, 4)
        data = grid.GetPointData()
        names = [data.GetArrayName(k) for k in range(data.GetNumberOfArrays())]
        return points, tets, {name: vtk_to_numpy(data.GetArray(name)).astype(float) for name in names}


def columns(path):
    """A CSV file as arrays by column name; comments and units left out."""
    with open(path) as file:
        rows = list(csv.reader(line for line in file if line.strip() and not line.startswith("#")))
    names = [name.split("[")[0].strip() for name in rows[0]]
    values = np.array([[float(x) if x.strip() else np.nan for x in row] for row in rows[1:]])
    return {name: values[:, k] for k, name in enumerate(names)}


def reference(case, file):
    """A reference table of cases/CASE."""
    return columns(ROOT / "cases" / case / file)


def toml(value):
    """A value in TOML, tables inline."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {toml(inner)}" for key, inner in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(toml(inner) for inner in value) + "]"
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return repr(value.item() if isinstance(value, np.generic) else value)


def figure(**size):
    """A matplotlib figure and its axes, drawn without a screen."""
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot

    return pyplot.subplots(constrained_layout=True, **size)
