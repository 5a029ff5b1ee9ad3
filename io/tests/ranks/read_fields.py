"""Reads a file that fields.rs wrote with VTK's own reader and checks all that is in it.

    read_fields.py FILE POINTS CELLS TIMES

TIMES is comma-separated. The mesh is the unit cube, the fields are
phase = x + 2 y + 3 z + t and velocity = (x, y z, t), of which f32 keeps seven digits.
"""

import sys

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid
from vtkmodules.vtkFiltersVerdict import vtkCellSizeFilter
from vtkmodules.vtkIOHDF import vtkHDFReader


def check(what, found, expected, tolerance=0.0):
    if not np.all(np.abs(np.asarray(found) - np.asarray(expected)) <= tolerance):
        sys.exit(f"{sys.argv[1]}: {what}: found {found}, expected {expected}")


def volume(grid):
    sizes = vtkCellSizeFilter()
    sizes.SetInputData(grid)
    sizes.Update()
    return vtk_to_numpy(sizes.GetOutput().GetCellData().GetArray("Volume")).sum()


def main():
    path, points, cells = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    times = [float(t) for t in sys.argv[4].split(",")]
    reader = vtkHDFReader()
    if not reader.CanReadFile(path):
        sys.exit(f"{path}: VTK cannot read it")
    reader.SetFileName(path)
    reader.UpdateInformation()
    check("number of steps", reader.GetNumberOfSteps(), len(times))
    # Backwards as well: a viewer jumps between steps.
    for step in [*range(len(times)), *reversed(range(len(times)))]:
        t = times[step]
        reader.SetStep(step)
        reader.Update()
        grid = reader.GetOutputDataObject(0)
        if not isinstance(grid, vtkUnstructuredGrid):
            sys.exit(f"{path}: a {grid.GetClassName()}, not a vtkUnstructuredGrid")
        check("time", reader.GetTimeValue(), t)
        check("cells", grid.GetNumberOfCells(), cells)
        check("points", grid.GetNumberOfPoints(), points)
        check("volume", volume(grid), 1.0, 1e-12)
        x, y, z = vtk_to_numpy(grid.GetPoints().GetData()).T
        phase = vtk_to_numpy(grid.GetPointData().GetArray("phase"))
        check("phase", phase, x + 2 * y + 3 * z + t, 1e-6)
        velocity = vtk_to_numpy(grid.GetPointData().GetArray("velocity"))
        check("velocity", velocity, np.stack([x, y * z, 0 * x + t], axis=1), 1e-6)


main()
