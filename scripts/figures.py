"""Pictures (PNG) of one output directory, in its folder figures/.

water-K.png   the water at the K-th of the times, seen into the tank
water.png     all of them on one sheet
bodies-K.png, bodies.png   the same of a run without water
slices.png    phase and speed in the plane through the middle
bonds.png     glued faces that have come off, over time
gauges.png    every column of gauges.csv
history.png   every column of history.csv

Nothing here needs a screen: VTK draws with EGL or OSMesa, matplotlib with Agg.
"""

import argparse
import csv
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from vtkmodules import vtkRenderingOpenGL2  # noqa: F401  (registers the renderer)
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkLogger
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
from vtkmodules.vtkFiltersCore import (
    vtkClipPolyData,
    vtkContourFilter,
    vtkFeatureEdges,
    vtkPolyDataNormals,
    vtkProbeFilter,
    vtkTubeFilter,
)
from vtkmodules.vtkFiltersGeometry import vtkDataSetSurfaceFilter
from vtkmodules.vtkFiltersSources import vtkPlaneSource
from vtkmodules.vtkIOHDF import vtkHDFReader
from vtkmodules.vtkRenderingCore import (
    vtkActor,
    vtkLight,
    vtkPolyDataMapper,
    vtkRenderer,
    vtkRenderWindow,
    vtkWindowToImageFilter,
)

vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)  # it warns that there is no screen

WATER, TANK, OBSTACLE, EDGE = (0.22, 0.58, 0.90), (0.93, 0.94, 0.95), (0.68, 0.62, 0.55), (0.3,) * 3
SURFACE = 0.5  # value of phase at the free surface


def stamp(time):
    """A picture's title."""
    return "" if time is None else f"t = {time:.3g} s"


class Fields:
    """fields.vtkhdf: a grid and its fields at a step."""

    def __init__(self, path):
        self.reader = vtkHDFReader()
        if not self.reader.CanReadFile(str(path)):
            sys.exit(f"{path}: VTK cannot read it")
        self.reader.SetFileName(str(path))
        self.reader.UpdateInformation()
        self.count = max(self.reader.GetNumberOfSteps(), 1)
        # Of a single step the reader does not tell.
        known, key = self.reader.GetOutputInformation(0), vtkStreamingDemandDrivenPipeline.TIME_STEPS()
        self.times = known.Get(key) if known.Has(key) else [None] * self.count

    def at(self, step):
        """The grid with its fields, and the time."""
        self.reader.SetStep(step)
        self.reader.Update()
        return self.reader.GetOutputDataObject(0), self.times[step]

    def steps(self, number):
        """So many steps, evenly from the first to the last."""
        return np.unique(np.linspace(0, self.count - 1, number).round().astype(int))


class Tank:
    """What the pictures show: the mesh's boundary, the same at all times, or all places of the bodies."""

    def __init__(self, grids):
        bounds = np.array([grid.GetBounds() for grid in grids]).reshape(-1, 3, 2)
        self.bounds = np.stack([bounds[:, :, 0].min(axis=0), bounds[:, :, 1].max(axis=0)], axis=1)
        self.size = self.bounds[:, 1] - self.bounds[:, 0]
        thin = int(np.argmin(self.size))
        # A slab is a two-dimensional flow: looked at straight from its side.
        self.slab = thin if self.size[thin] < 0.15 * np.sort(self.size)[1] else None

    def sideways(self):
        """The axis that the slice through the middle, and the view of a slab, is normal to."""
        return 1 if self.slab is None else self.slab

    def up(self):
        return 1 if self.sideways() == 2 else 2

    def view(self):
        """From where one looks at it: a direction."""
        direction = np.zeros(3)
        direction[self.sideways()] = 1.0 if self.sideways() == 2 else -1.0
        if self.slab is None:
            direction[[0, 2]] = -0.5, 0.6
        return direction

    def is_wall(self, surface):
        """For each face whether it is on the bounding box: a wall of the tank, not an obstacle."""
        points = vtk_to_numpy(surface.GetPoints().GetData())
        faces = vtk_to_numpy(surface.GetPolys().GetConnectivityArray()).reshape(-1, 3)
        near = np.abs(points[:, :, None] - self.bounds[None]) < 1e-6 * self.size.max()
        return near[faces].all(axis=1).any(axis=(1, 2))


def surface_of(grid):
    surface = vtkDataSetSurfaceFilter()
    surface.SetInputData(grid)
    surface.Update()
    return surface.GetOutput()


def actor(polydata, colour, scalars=False):
    mapper = vtkPolyDataMapper()
    mapper.SetInputData(polydata)
    mapper.SetScalarVisibility(scalars)
    made = vtkActor()
    made.SetMapper(mapper)
    made.GetProperty().SetColor(colour)
    return made


def tank_actors(grid, tank):
    """The walls one sees from inside (those in front are left out), and all edges."""
    walls = surface_of(grid)
    colours = np.where(tank.is_wall(walls)[:, None], TANK, OBSTACLE) * 255
    colours = numpy_to_vtk(colours.astype(np.uint8), deep=True)
    edges = vtkFeatureEdges()
    edges.SetInputData(walls)
    edges.SetFeatureAngle(30)
    edges.BoundaryEdgesOff()
    edges.ManifoldEdgesOff()
    edges.NonManifoldEdgesOff()
    edges.ColoringOff()
    edges.Update()
    tubes = vtkTubeFilter()
    tubes.SetInputData(edges.GetOutput())
    tubes.SetRadius(0.0016 * np.linalg.norm(tank.size))
    tubes.SetNumberOfSides(8)
    tubes.Update()

    walls.GetPointData().Initialize()
    walls.GetCellData().SetScalars(colours)
    inside = actor(walls, TANK, scalars=True)
    # Normals point out of the fluid, so faces that look at the viewer stand in the way.
    inside.GetProperty().FrontfaceCullingOn()
    inside.GetProperty().SetInterpolationToFlat()
    inside.GetProperty().SetAmbient(0.75)
    inside.GetProperty().SetDiffuse(0.3)
    lines = actor(tubes.GetOutput(), EDGE)
    lines.GetProperty().LightingOff()
    return [inside, lines]


def water_actors(grid):
    """The free surface, and the water behind the walls."""
    grid.GetPointData().SetActiveScalars("phase")
    contour = vtkContourFilter()
    contour.SetInputData(grid)
    contour.SetValue(0, SURFACE)
    contour.ComputeScalarsOff()
    smooth = vtkPolyDataNormals()
    smooth.SetInputConnection(contour.GetOutputPort())
    smooth.SplittingOff()
    smooth.Update()
    wet = vtkClipPolyData()
    wet.SetInputData(surface_of(grid))
    wet.SetValue(SURFACE)
    wet.Update()
    actors = [actor(smooth.GetOutput(), WATER), actor(wet.GetOutput(), WATER)]
    for made in actors:
        made.GetProperty().SetAmbient(0.25)
        made.GetProperty().SetDiffuse(0.85)
        made.GetProperty().SetSpecular(0.5)
        made.GetProperty().SetSpecularPower(30)
        made.GetProperty().SetOpacity(0.8)
    # The far walls are drawn already; water on them would only darken them.
    actors[1].GetProperty().BackfaceCullingOn()
    actors[1].GetProperty().SetInterpolationToFlat()
    return actors


def structure_actors(grid, bodies, time):
    """Bodies where they are at this time; without a file of them, where structures cut the mesh."""
    if bodies is not None:
        step = bodies.count - 1
        if None not in (time, *bodies.times):
            step = int(np.argmin(np.abs(np.array(bodies.times) - time)))
        surface = surface_of(bodies.at(step)[0])
    elif grid.GetPointData().HasArray("structure_distance"):
        grid.GetPointData().SetActiveScalars("structure_distance")
        contour = vtkContourFilter()
        contour.SetInputData(grid)
        contour.SetValue(0, 0.0)
        contour.ComputeScalarsOff()
        contour.Update()
        surface = contour.GetOutput()
    else:
        return []
    made = actor(surface, OBSTACLE)
    made.GetProperty().SetInterpolationToFlat()
    return [made]


def light(direction, intensity):
    made = vtkLight()
    made.SetLightTypeToCameraLight()
    made.SetPosition(*direction)
    made.SetIntensity(intensity)
    return made


def look_at(tank, bounds, view, camera):
    """Places the camera so that these bounds fill the picture; returns width / height of it."""
    up = np.eye(3)[tank.up()]
    back = view / np.linalg.norm(view)
    right = np.cross(up, back) / np.linalg.norm(np.cross(up, back))
    above = np.cross(back, right)
    middle = bounds.mean(axis=1)
    corners = np.array(np.meshgrid(*bounds)).reshape(3, -1).T
    half = np.tan(np.radians(12.0))
    distance = np.linalg.norm(tank.size) / half
    for _ in range(20):
        depth = distance - (corners - middle) @ back
        seen = np.stack([(corners - middle) @ right, (corners - middle) @ above]) / depth
        low, high = seen.min(axis=1), seen.max(axis=1)
        ratio = np.clip((high - low)[0] / (high - low)[1], 0.6, 3.0)
        middle = middle + distance * ((low + high)[0] * right + (low + high)[1] * above) / 2
        distance *= 1.04 * max((high - low)[1], (high - low)[0] / ratio) / (2 * half)
    camera.SetViewAngle(24.0)
    camera.SetFocalPoint(*middle)
    camera.SetPosition(*(middle + distance * back))
    camera.SetViewUp(*up)
    return ratio


def floor_actors(tank):
    """A floor under bodies that are alone."""
    (x, y, z), (right, back, _) = tank.bounds[:, 0], tank.bounds[:, 1]
    floor = vtkPlaneSource()
    floor.SetOrigin(x, y, z)
    floor.SetPoint1(right, y, z)
    floor.SetPoint2(x, back, z)
    floor.Update()
    return [actor(floor.GetOutput(), TANK)]


def draw(fields, bodies, tank, steps, view, bounds, width, name):
    """One picture a step of `fields`, or of the bodies alone; returns the pictures and times."""
    renderer = vtkRenderer()
    renderer.SetBackground(1, 1, 1)
    renderer.SetUseDepthPeeling(True)
    renderer.SetMaximumNumberOfPeels(12)
    renderer.SetOcclusionRatio(0.0)
    renderer.AutomaticLightCreationOff()
    renderer.AddLight(light((0.8, 1.0, 0.2), 0.6))
    renderer.AddLight(light((-1.0, 0.1, 0.4), 0.3))
    renderer.AddLight(light((0.0, -0.2, 1.0), 0.4))
    window = vtkRenderWindow()
    window.SetOffScreenRendering(True)
    window.SetMultiSamples(0)  # depth peeling has none; the picture is drawn larger and averaged
    window.AddRenderer(renderer)

    ratio = look_at(tank, bounds, view, renderer.GetActiveCamera())
    window.SetSize(2 * width, 2 * int(width / ratio))

    drawn = []
    for k, step in enumerate(steps, 1):
        grid, time = (fields or bodies).at(step)
        if k == 1:
            for made in tank_actors(grid, tank) if fields else floor_actors(tank):
                renderer.AddActor(made)
            renderer.ResetCameraClippingRange()
        moving = structure_actors(grid, bodies, time) + (water_actors(grid) if fields else [])
        for made in moving:
            renderer.AddActor(made)
        window.Render()
        shot = vtkWindowToImageFilter()
        shot.SetInput(window)
        shot.ReadFrontBufferOff()
        shot.Update()
        image = shot.GetOutput()
        columns, rows, _ = image.GetDimensions()
        pixels = vtk_to_numpy(image.GetPointData().GetScalars()).reshape(rows, columns, -1)[::-1]
        pixels = pixels[: rows // 2 * 2, : columns // 2 * 2].astype(float)
        pixels = pixels.reshape(rows // 2, 2, columns // 2, 2, -1).mean(axis=(1, 3)) / 255
        plt.imsave(f"{name}-{k}.png", pixels)
        drawn.append((pixels, time))
        for made in moving:
            renderer.RemoveActor(made)
    return drawn


def draw_sheet(drawn, path):
    columns = 1 if len(drawn) == 1 else 2
    rows = -(-len(drawn) // columns)
    height, width = drawn[0][0].shape[:2]
    figure, axes = plt.subplots(
        rows, columns, squeeze=False, figsize=(6 * columns, rows * (6 * height / width + 0.35))
    )
    for axis in axes.flat:
        axis.axis("off")
    for axis, (pixels, time) in zip(axes.flat, drawn):
        axis.imshow(pixels)
        axis.set_title(stamp(time), fontsize=11)
    figure.tight_layout(pad=0.4)
    figure.savefig(path, dpi=150)
    plt.close(figure)


def sample(grid, tank, normal, pixels):
    """Phase and speed on a raster of the plane through the middle; NaN where there is no fluid."""
    counts = [
        1 if a == normal else max(int(pixels * tank.size[a] / tank.size.max()), 2) for a in range(3)
    ]
    raster = vtkImageData()
    raster.SetDimensions(*counts)
    spacing = tank.size / np.array(counts)
    raster.SetSpacing(*spacing)
    # A little off the middle: grid planes lie there.
    raster.SetOrigin(*(tank.bounds[:, 0] + (0.5 + 1e-4) * spacing))
    probe = vtkProbeFilter()
    probe.SetInputData(raster)
    probe.SetSourceData(grid)
    probe.Update()
    data = probe.GetOutput().GetPointData()
    fluid = vtk_to_numpy(data.GetArray("vtkValidPointMask")) > 0
    if data.HasArray("structure_distance"):
        fluid &= vtk_to_numpy(data.GetArray("structure_distance")) > 0
    found = {}
    if data.HasArray("phase"):
        found["phase"] = vtk_to_numpy(data.GetArray("phase"))
    if data.HasArray("velocity"):
        found["speed [m/s]"] = np.linalg.norm(vtk_to_numpy(data.GetArray("velocity")), axis=1)
    shape = [n for n in reversed(counts) if n > 1]
    return {name: np.where(fluid, values, np.nan).reshape(shape) for name, values in found.items()}


def draw_slices(fields, tank, steps, path):
    """Phase and speed, with the free surface as a line."""
    normal = tank.sideways()
    across, along = [axis for axis in range(3) if axis != normal]
    slices = []
    for step in steps:
        grid, time = fields.at(step)
        slices.append((time, sample(grid, tank, normal, 900)))
    names = list(slices[0][1])
    if not names:
        return False
    extent = (*tank.bounds[across], *tank.bounds[along])
    aspect = tank.size[along] / tank.size[across]
    width = 5.2 if aspect < 1.5 else 3.6
    figure, axes = plt.subplots(
        len(slices),
        len(names),
        squeeze=False,
        sharex=True,
        sharey=True,
        layout="constrained",
        figsize=(len(names) * (width + 0.8), len(slices) * (width * aspect + 0.4) + 0.4),
    )
    for column, name in zip(axes.T, names):
        top = 1.0 if name == "phase" else max(np.nanmax(found[name]) for _, found in slices) or 1.0
        for axis, (time, found) in zip(column, slices):
            axis.set_facecolor(OBSTACLE)
            shown = axis.imshow(
                found[name],
                origin="lower",
                extent=extent,
                vmin=0.0,
                vmax=top,
                cmap="Blues" if name == "phase" else "viridis",
            )
            if "phase" in found:
                line = "black" if name == "phase" else "white"
                axis.contour(
                    found["phase"], levels=[SURFACE], extent=extent, colors=line, linewidths=0.8
                )
            axis.set_title(f"{name.split(' ')[0]} {stamp(time)}", fontsize=10)
        column[-1].set_xlabel(f"{'xyz'[across]} [m]")
        figure.colorbar(shown, ax=list(column), label=name, shrink=0.6)
    for axis in axes[:, 0]:
        axis.set_ylabel(f"{'xyz'[along]} [m]")
    figure.savefig(path, dpi=150)
    plt.close(figure)
    return True


def read_table(path):
    """Columns by name; lines that are not whole are left out."""
    with open(path, newline="") as file:
        header, *lines = csv.reader(file)
    rows = [line for line in lines if len(line) == len(header)]
    if not rows:
        return {}
    values = np.array(rows, dtype=float).T
    return dict(zip(header, values))


def draw_table(path, picture):
    """Columns over time, those of one unit together; without a unit each for itself."""
    table = read_table(path)
    time = next((name for name in table if name in ("t [s]", "time [s]")), None)
    if time is None or len(table[time]) < 2:
        return False
    panels = {}
    for name in table:
        if name not in (time, "step"):
            unit = name[name.index("[") :] if "[" in name else name
            panels.setdefault(unit, []).append(name)
    columns = 1 if len(panels) == 1 else 2
    rows = -(-len(panels) // columns)
    figure, axes = plt.subplots(
        rows,
        columns,
        squeeze=False,
        sharex=True,
        layout="constrained",
        figsize=(6 * columns, 2.6 * rows),
    )
    for axis, (unit, names) in zip(axes.flat, panels.items()):
        for name in names:
            axis.plot(table[time], table[name], linewidth=1.1, label=name.split(" [")[0])
        sizes = np.concatenate([table[name] for name in names])
        if sizes.min() > 0 and sizes.max() > 1e3 * sizes.min():
            axis.set_yscale("log")
        axis.set_ylabel(unit)
        axis.grid(alpha=0.3)
        if len(names) > 1:
            axis.legend(fontsize=8, ncols=-(-len(names) // 8))
        elif names[0] != unit:
            axis.set_title(names[0].split(" [")[0], fontsize=10)
    for axis in axes.flat[len(panels) :]:
        axis.axis("off")
    for axis in axes.flat[max(len(panels) - columns, 0) : len(panels)]:
        axis.set_xlabel(time)
        axis.tick_params(labelbottom=True)
    figure.savefig(picture, dpi=150)
    plt.close(figure)
    return True


def draw_bonds(path, picture):
    """How many faces have come off, over time."""
    table = read_table(path)
    if not table:
        return False
    figure, axis = plt.subplots(figsize=(6, 3), layout="constrained")
    times = np.sort(table["t [s]"])
    axis.step(times, np.arange(len(times)) + 1, where="post")
    axis.set_xlabel("t [s]")
    axis.set_ylabel("broken faces")
    axis.grid(alpha=0.3)
    figure.savefig(picture, dpi=150)
    plt.close(figure)
    return True


def main():
    parser = argparse.ArgumentParser(prog="scripts/figures", description=__doc__.split("\n")[0])
    parser.add_argument("directory", type=Path, metavar="DIR", help="a run's output directory")
    parser.add_argument("--times", type=int, default=6, help="how many times to draw [6]")
    parser.add_argument("--view", help="direction to look from: x,y,z")
    parser.add_argument("--frame", help="what fills the picture [the tank]: x,x,y,y,z,z")
    parser.add_argument(
        "--width", type=int, default=1200, help="of each picture of the water [1200]"
    )
    arguments = parser.parse_args()
    directory = arguments.directory
    if not directory.is_dir():
        sys.exit(f"{directory}: no such directory")
    folder = directory / "figures"
    folder.mkdir(exist_ok=True)
    drawn = []

    files = [directory / name for name in ("fields.vtkhdf", "bodies.vtkhdf")]
    fields, bodies = (Fields(path) if path.exists() else None for path in files)
    if shown := fields or bodies:
        steps = shown.steps(arguments.times)
        grid, _ = shown.at(0)
        tank = Tank([grid] if fields else [shown.at(step)[0] for step in steps])
        view = tank.view()
        if arguments.view:
            view = np.array([float(x) for x in arguments.view.split(",")])
        if not fields or grid.GetPointData().HasArray("phase"):
            bounds = tank.bounds
            if arguments.frame:
                bounds = np.array([float(x) for x in arguments.frame.split(",")]).reshape(3, 2)
            name = "water" if fields else "bodies"
            path = folder / name
            pictures = draw(fields, bodies, tank, steps, view, bounds, arguments.width, path)
            draw_sheet(pictures, folder / f"{name}.png")
            drawn += [f"{name}-{k}.png" for k in range(1, len(steps) + 1)] + [f"{name}.png"]
    if fields:
        if draw_slices(fields, tank, fields.steps(min(arguments.times, 4)), folder / "slices.png"):
            drawn.append("slices.png")
    path = directory / "bonds.csv"
    if path.exists() and draw_bonds(path, folder / "bonds.png"):
        drawn.append("bonds.png")
    for name in ("gauges", "history"):
        path = directory / f"{name}.csv"
        if path.exists() and draw_table(path, folder / f"{name}.png"):
            drawn.append(f"{name}.png")
    if not drawn:
        sys.exit(f"{directory}: holds no fields.vtkhdf, bodies.vtkhdf, gauges.csv or history.csv to draw")
    print(*(folder / name for name in drawn), sep="\n")


main()
