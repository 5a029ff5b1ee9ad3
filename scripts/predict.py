"""scripts/scaling --predict: what many more ranks would do with the paper's mesh, and where they would stop gaining.

Three things go in: cuts of that mesh into so many parts (examples/cuts, the cuts that the program would make), work and
messages of a step as measured here (target/scaling.json), and a network, which is assumed (`Network`). Out come times of
a step, strong and weak efficiency, target/prediction.json and target/prediction.png. scripts/SCALING.md explains.
"""

import json
import math
import sys
from dataclasses import dataclass
from pathlib import Path

from series import EXAMPLES, ROOT, lines

sys.path.insert(0, str(ROOT / "scripts/validation"))

PARTS = (16, 64, 256, 1024, 4096)
WEAK = (50_000, 12_500)  # nodes a rank
TETS_PER_NODE = 18.84 / 3.21
CUTS = ROOT / "target/cuts.json"
# Free surface: work of an element in the band of the surface, and of one on the paper's mesh in the mean, over the mean
# of the tank that is measured. (A tall tank with interfaces of one and two cells tells the band from the rest: 1.45 and
# 0.36 µs; the paper's mesh has 0.94, the tank 1.02.)
IN_BAND, PAPER_MEAN = 1.42, 0.92


@dataclass
class Network:
    """A cluster that is not here."""

    latency: float = 1.5e-6  # of a message [s]
    overhead: float = 0.3e-6  # more for each further neighbour [s]
    bandwidth: float = 10e9  # of a node's link [bytes/s]
    ranks: int = 64  # of a node
    memory: float = 400e9  # of a node, all its ranks together [bytes/s]

    def exchange(self, level, width):
        """One halo exchange, so many bytes a ghost: of the rank that has most to do within its node, and of the node
        that has most to send to others, all of whose ranks share its link."""
        own = width * level["ghosts"]["max"] / (self.memory / self.ranks)
        return self.latency + self.overhead * level["neighbours"]["max"] + own + width * level["far"]["max"] / self.bandwidth

    def reduction(self, parts, nbytes):
        """A sum over all ranks: within nodes through memory, then a tree over nodes there and back."""
        nodes = math.ceil(parts / self.ranks)
        depth = 2 * math.log2(max(nodes, 1)) + math.log2(min(parts, self.ranks)) / 2
        return depth * self.latency + 2 * nbytes * (self.ranks / self.memory + (1 / self.bandwidth if nodes > 1 else 0))

    def gather(self, parts, nbytes):
        """`nbytes` in all, on every rank."""
        return self.reduction(parts, 0) + nbytes * (self.ranks / self.memory + 1 / self.bandwidth)


@dataclass
class Rates:
    """What a step takes on one rank, of work alone, and how often it talks: from runs here."""

    assembled: float  # [s] an assembled element
    held: float  # [s] a held element: free surface and the like
    solve: float  # [s] an owned node: preconditioner and Krylov method, every grid
    rest: float  # [s] an owned node
    cycle: float  # [s] a node of a grid that every rank holds, one cycle
    triad: float  # of one core here [bytes/s]
    iterations: int
    again: float  # cycles of a grid over cycles of the next finer one
    exchanges: float  # of nodal values on the mesh, a step
    width: float  # bytes a ghost in these, mean
    collectives: float  # a step, those of Krylov iterations and multigrid left out


def stage(row, name):
    return next((s for s in row["stages"] if s["name"] == name), None)


def work(row, *names):
    found = [stage(row, name) for name in names]
    return sum(s["work"]["mean"] * row["ranks"] for s in found if s)


def cut_tank(cells, parts):
    """Cuts of the tank of `step`."""
    return lines(1, EXAMPLES / "cuts", tank(cells), *parts)


def tank(cells):
    path = ROOT / f"target/tank-{cells}.toml"
    path.write_text(
        f'[mesh]\nbox = {{ x = [0, 4], y = [0, 1], z = [0, 1], cells = [{4 * cells}, {cells}, {cells}] }}\n'
        '[boundaries]\ndefault = "slip"\n[time]\nend = 1\n'
    )
    return path


def cut_paper():
    """Cuts of the paper's mesh: minutes and 4 GB, so they are kept."""
    if not CUTS.exists():
        from program import toml
        from scale import paper_size

        path = ROOT / "target/paper_size.toml"
        path.write_text("".join(f"{key} = {toml(value)}\n" for key, value in paper_size().table.items()))
        CUTS.write_text(json.dumps(lines(1, EXAMPLES / "cuts", path, *PARTS), indent=1))
    return json.loads(CUTS.read_text())


def distributed(levels):
    """Levels of a run whose halos were used."""
    return [level for level in levels if level["exchanges"] > 0]


def measured_rates(rows, tank_cuts, cycle):
    one = rows[0]
    assert one["ranks"] == 1, "the first run of target/scaling.json is of one rank"
    tets, nodes = one["tets"], one["nodes"]
    flow = work(one, "flow: assembly"), work(one, "flow: solve")
    surface = work(one, "free surface", "volume", "cut")
    visits = [level["visits"] for level in one["levels"]]
    talk = next(row for row in rows if row["ranks"] == 2 and row["series"] == "strong")
    cut = tank_cuts[2]["levels"]
    # What the multigrid's coarser grids send is known; the rest goes through the mesh's halo.
    coarse = distributed(talk["levels"])[1:]
    total = stage(talk, "step")
    messages = total["messages"] - sum(level["messages"] for level in coarse)
    nbytes = total["bytes"] - sum(level["bytes"] for level in coarse)
    exchanges = messages / (2 * cut[0]["neighbours"]["mean"])
    its = talk["iterations"][0]
    return Rates(
        assembled=flow[0] / tets,
        held=surface / tets,
        solve=flow[1] / nodes,
        rest=(work(one, "step") - sum(flow) - surface) / nodes,
        cycle=cycle,
        triad=one["triad"] * 1e9,
        iterations=its,
        again=visits[1] / visits[0] if len(visits) > 1 else 1.0,
        exchanges=exchanges,
        width=nbytes / (exchanges * 2 * cut[0]["ghosts"]["mean"]),
        collectives=total["collectives"] - krylov_collectives(its, talk["levels"]),
    )


def krylov_collectives(iterations, levels):
    """One a Krylov iteration; one for each cycle of a coarser grid that is distributed, and one to gather the next."""
    return iterations + sum(level["visits"] for level in distributed(levels)[1:]) + distributed(levels)[-1]["visits"]


def step_time(cut, rates, network):
    """Parts of the time of a step [s] for the rank that has most to do."""
    parts, levels = cut["parts"], cut["levels"]
    # Kernels that stream the matrix share the memory of their node.
    slower = max(1.0, rates.triad / (network.memory / network.ranks))
    top = levels[0]
    time = {
        "assembly": rates.assembled * cut["assembled"]["max"],
        # Some rank is in the band with all it has.
        "free surface": rates.held * IN_BAND * cut["held"]["max"],
        "solve": (rates.solve * slower + rates.rest) * top["owned"]["max"],
    }
    time["halo"] = rates.exchanges * network.exchange(top, rates.width)
    visits = rates.iterations
    gathered = levels[-1]["nodes"]
    time["coarse halos"], reductions = 0.0, 0.0
    for level in levels[1:-1]:
        visits *= rates.again
        # Ghosts of x in the cycle and before the product with the matrix; its dots are one reduction.
        time["coarse halos"] += 2 * visits * network.exchange(level, 4)
        reductions += visits
    # The first grid that every rank holds: its right-hand side is summed, its cycles are everyone's.
    time["coarse grid"] = visits * (network.reduction(parts, 8 * gathered) + rates.again * rates.cycle * gathered)
    entries = levels[-1]["entries"]
    time["coarse grid"] += network.gather(parts, 12 * entries)
    reductions += rates.iterations + rates.collectives
    time["reductions"] = reductions * network.reduction(parts, 8)
    return time


def weak_cut(cuts, own, parts, network):
    """A mesh that grows with the ranks: halos as in the cut whose parts have as many nodes."""
    like = min(cuts, key=lambda cut: abs(math.log(cut["nodes"] / cut["parts"] / own)))
    # The part of all ghosts that is on other nodes: that of the finest cut, which fills most nodes.
    last = cuts[-1]["levels"][0]
    far = last["far"]["max"] / (network.ranks * last["ghosts"]["mean"]) if parts > network.ranks else 0.0
    n = own * parts
    scale = own / (like["nodes"] / like["parts"])
    surface = scale ** (2 / 3)
    grow = lambda spread, factor: {"mean": spread["mean"] * factor, "max": spread["max"] * factor}
    cut = {"parts": parts, "nodes": n, "assembled": grow(like["assembled"], scale), "held": grow(like["held"], scale)}
    levels, nodes, k = [], n, 0
    while True:
        known = like["levels"][min(k, len(like["levels"]) - 1)]
        # Beyond the levels of the cut, a ninth of the nodes and of the surface's square.
        more = max(0, k - len(like["levels"]) + 1)
        levels.append(
            {
                "nodes": nodes,
                "entries": nodes * known["entries"] / known["nodes"],
                "owned": grow(known["owned"], scale / 9**more),
                "ghosts": grow(known["ghosts"], surface / 9 ** (2 / 3 * more)),
                "far": grow(known["ghosts"], far * network.ranks * surface / 9 ** (2 / 3 * more)),
                "neighbours": known["neighbours"],
            }
        )
        if nodes <= 20_000:
            break
        nodes, k = nodes / 9, k + 1
    return cut | {"levels": levels}


def check(rows, tank_cuts, rates):
    """What the model says of the runs here beside what was measured: work, messages, bytes, collectives of a step."""
    print(f"\nRuns here: predicted / measured\n{'ranks':>6} {'work, most [s]':>20} {'messages':>16} {'MB':>16} {'collectives':>14}")
    result = []
    for row in rows:
        if row["ranks"] == 1 or row["series"] != "strong":
            continue
        cut, measured = tank_cuts[row["ranks"]], stage(row, "step")
        top = cut["levels"][0]
        t = rates.assembled * cut["assembled"]["max"] + rates.held * cut["held"]["max"]
        t += (rates.solve + rates.rest) * top["owned"]["max"]
        coarse = distributed(row["levels"])[1:]
        levels = cut["levels"][1 : len(coarse) + 1]
        messages = rates.exchanges * row["ranks"] * top["neighbours"]["mean"]
        messages += sum(2 * run["visits"] * row["ranks"] * level["neighbours"]["mean"] for run, level in zip(coarse, levels))
        nbytes = rates.exchanges * rates.width * row["ranks"] * top["ghosts"]["mean"]
        nbytes += sum(8 * run["visits"] * row["ranks"] * level["ghosts"]["mean"] for run, level in zip(coarse, levels))
        collectives = rates.collectives + krylov_collectives(row["iterations"][0], row["levels"])
        pairs = (t, measured["work"]["max"]), (messages, measured["messages"]), (nbytes * 1e-6, measured["bytes"] * 1e-6)
        result.append({"ranks": row["ranks"], "predicted": [p[0] for p in pairs] + [collectives], "measured": [p[1] for p in pairs] + [measured["collectives"]]})
        texts = [f"{pairs[0][0]:.3f} / {pairs[0][1]:.3f}", f"{messages:.0f} / {measured['messages']}", f"{pairs[2][0]:.2f} / {pairs[2][1]:.2f}"]
        print(f"{row['ranks']:6} {texts[0]:>20} {texts[1]:>16} {texts[2]:>16} {f'{collectives:.0f} / ' + str(measured['collectives']):>14}")
    return result


def table(name, rows):
    parts = list(rows[0]["time"])
    print(f"\n{name}: ms a step\n{'ranks':>6} {'nodes a rank':>12} {'step':>9} {'efficiency':>10}  " + " ".join(f"{p:>12}" for p in parts))
    for row in rows:
        cells = " ".join(f"{1e3 * row['time'][p]:12.3f}" for p in parts)
        print(f"{row['parts']:6} {row['nodes'] / row['parts']:12.0f} {1e3 * row['step']:9.2f} {row['efficiency']:10.2f}  {cells}")


def one_rank(cut, rates, network):
    """The same step's work on one rank, as fast as one of many on a node."""
    tets = cut["nodes"] * TETS_PER_NODE
    slower = max(1.0, rates.triad / (network.memory / network.ranks))
    return (rates.assembled + rates.held * PAPER_MEAN) * tets + (rates.solve * slower + rates.rest) * cut["nodes"]


def predicted(cuts, rates, network):
    """Each cut with its step and its efficiency, against one rank that had it all."""
    rows = []
    for cut in cuts:
        time = step_time(cut, rates, network)
        step = sum(time.values())
        rows.append(cut | {"time": time, "step": step, "efficiency": one_rank(cut, rates, network) / cut["parts"] / step})
    return rows


def plot(strong, weak):
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, (left, right) = pyplot.subplots(1, 2, figsize=(10, 4))
    left.plot([r["parts"] for r in strong], [r["efficiency"] for r in strong], "o-", label="strong, 3.2 M nodes")
    for own, rows in weak.items():
        left.plot([r["parts"] for r in rows], [r["efficiency"] for r in rows], "s--", label=f"weak, {own} nodes a rank")
    left.set(xlabel="ranks", ylabel="efficiency, predicted", xscale="log", ylim=(0, 1.1))
    left.legend()
    below = [0.0] * len(strong)
    for name in strong[0]["time"]:
        share = [row["time"][name] / row["step"] for row in strong]
        right.bar([str(row["parts"]) for row in strong], share, bottom=below, label=name)
        below = [b + s for b, s in zip(below, share)]
    right.set(xlabel="ranks", ylabel="share of a step, strong")
    right.legend(fontsize="small", loc="lower left", framealpha=0.9)
    figure.tight_layout()
    figure.savefig(ROOT / "target/prediction.png", dpi=120)


def main():
    rows = json.loads((ROOT / "target/scaling.json").read_text())
    cells = round((rows[0]["tets"] / 24) ** (1 / 3))
    ranks = sorted({row["ranks"] for row in rows if row["ranks"] > 1 and row["series"] == "strong"})
    tank_cuts = {cut["parts"]: cut for cut in cut_tank(cells, ranks)}
    # A grid of a few thousand nodes, in the cache.
    (cycle,) = (line["value"] for line in lines(1, EXAMPLES / "kernels", 20) if line["name"] == "multigrid cycle")
    rates, network = measured_rates(rows, tank_cuts, cycle * 1e-6), Network()
    print("\n".join(f"{key:12} {value:.3g}" for key, value in vars(rates).items()))
    checked = check(rows, tank_cuts, rates)
    cuts = cut_paper()
    strong = predicted(cuts, rates, network)
    table("Strong, the paper's mesh", strong)
    weak = {}
    for own in WEAK:
        weak[own] = predicted([weak_cut(cuts, own, parts, network) for parts in PARTS], rates, network)
        table(f"Weak, {own} nodes a rank", weak[own])
    found = {"rates": vars(rates), "network": vars(network), "check": checked, "strong": strong, "weak": weak}
    (ROOT / "target/prediction.json").write_text(json.dumps(found, indent=1) + "\n")
    plot(strong, weak)
    return 0
