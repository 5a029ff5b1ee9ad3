"""The paper's own size."""

from checks import at_least, at_most, check
from program import variant

# Case 4 of the paper has 3.19 million nodes and 18.8 million tetrahedra. Sizes are those of the reader's mesh, which is
# refined once after it is distributed: walls, 0.2 m thick, have two cells then.
PAPER_MESH = {
    "refine": 1,
    "box": {
        "x": {"edges": [0, 21, 22, 22.2, 28.2, 28.4, 30, 60], "sizes": [0.72, 0.3, 0.2, 0.22, 0.2, 0.2, 0.3, 0.85]},
        "y": {"edges": [0, 5, 5.2, 11.2, 11.4, 16.4], "sizes": [0.6, 0.2, 0.2, 0.24, 0.2, 0.6]},
        "z": {"edges": [0, 9.2, 14], "sizes": [0.26, 0.26, 0.7]},
    },
}
STEPS = 5


def paper_size(quick=False):
    """cases/tsunami_building on the paper's mesh; an eighth of its nodes if quick."""
    mesh = PAPER_MESH | {"refine": 0 if quick else 1}
    return variant("tsunami_building", {"mesh": mesh, "output.checkpoint_every": None})


@check("paper_size", "five steps of the paper's building on a mesh as fine as the paper's: 3.2 million nodes, two ranks")
def paper_size_runs(work):
    run = work.run(paper_size(work.quick), arguments=("--steps", str(STEPS)))
    summary = run.summary
    share = 1 / 8 if work.quick else 1
    source = "Takase et al. 2015, case 4"
    # The quick mesh has not quite an eighth of the nodes, but an eighth of the tetrahedra.
    yield at_least(work, "tetrahedra", summary["elements"], 18.8e6 * share, source)
    yield at_least(work, "nodes", summary["nodes"], 3.19e6 * share, source)
    yield at_least(work, "steps", summary["steps"], STEPS, source)
    memory = sum(summary["memory_peak_mb"]) / 1024
    yield at_most(work, "peak memory of all ranks [GiB]", memory, 20 * share, "a machine of 24 GiB")
    for stage in summary["stages"] + [summary["total"]]:
        calls = max(stage["calls"], 1)
        print(f"   {stage['name']:16} {stage['seconds']['max'] / calls:8.2f} s a call, {stage['work']['mean'] / calls:8.2f} s of work a rank")
