"""Water and bodies together: the paper's building, small."""

import numpy as np

from checks import at_least, between, check
from program import columns, figure, variant

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
