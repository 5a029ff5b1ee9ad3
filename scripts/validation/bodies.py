"""Rigid clusters alone: a beam that is bent until it breaks, a wall that is hit, a pile that comes to rest."""

import numpy as np

from checks import at_least, at_most, check, near
from program import figure, variant

EXACT = "energy account"


def bend(work, changes=None, label="run"):
    """Force of the stamp [N] over the way of the middle [m] of the beam of `cases/three_point_bending`."""
    run = work.run(variant("three_point_bending", changes), label, ranks=1)
    t, done, way = (run.bodies[name] for name in ("t", "work", "beam_1_z"))
    return np.gradient(done, t) / 4e-3, way


@check("three_point_bending", "force that breaks a beam of glued cubes")
def three_point_bending(work):
    force, way = bend(work)
    # M_max = 0.286 σ_c b h² with linear compression in the joint; M = P/2 · 0.25 m beside the middle cube.
    strongest = 2 * 0.286 * 1e5 * 0.1 * 0.1**2 / 0.25
    yield near(work, "largest force [N]", force.max(), strongest, "0.286 σ_c b h²", relative=0.03)
    plot, axes = figure(figsize=(6, 4))
    axes.plot(-1e3 * way, force)
    axes.axhline(strongest, color="0.6", linestyle="--", label="2 · 0.286 σ_c b h² / 0.25 m")
    axes.set(xlabel="the middle has gone down by [mm]", ylabel="force of the stamp [N]")
    axes.legend()
    plot.savefig(work.folder / "curve.png", dpi=100)


@check("calibration", "the strength of the glue that gives a beam its bending strength")
def calibration(work):
    wanted = 2e5  # of a brick wall: M_max / (b h²/6) [Pa]
    bending = lambda force: force.max() * 0.25 / 2 / (0.1 * 0.1**2 / 6)
    # Any strength to begin with; the largest moment is proportional to it. δ_f = 16 G_f/(9 σ_c), G_f = 56.25 J/m².
    bond = lambda strength: {"bodies.bond.strength": strength, "bodies.bond.opening": 100 / strength}
    first = 1e5
    strength = first * wanted / bending(bend(work, bond(first), "first")[0])
    yield near(work, "σ_c found [Pa]", strength, wanted / 6 / 0.286, "f_b / (6 · 0.286)", relative=0.03)
    found = bending(bend(work, bond(strength), "found")[0])
    yield near(work, "bending strength with it [Pa]", found, wanted, "what was asked for", relative=0.01)


@check("wall_impact", "a wall of 240 blocks is hit, breaks and comes to rest")
def wall_impact(work):
    h = work.run(variant("wall_impact")).bodies
    yield at_least(work, "broken faces", h["broken_faces"][-1], 20, "of 434")
    lost = np.abs(h["total"] - h["total"][0]).max() / h["kinetic"][0]
    yield at_most(work, "change of all energy over the block's", lost, 0.01, EXACT)
    yield at_most(work, "kinetic energy left over the block's", h["kinetic"][-1] / h["kinetic"][0], 1e-3, "at rest")
    yield at_most(work, "deepest overlap over the radius", h["deepest_overlap"].max(), 0.5, "spheres keep apart")


@check("cairn", "a pile of stones comes to rest")
def cairn(work):
    h = work.run(variant("cairn")).bodies
    lost = np.abs(h["total"] - h["total"][0]).max() / h["kinetic"].max()
    yield at_most(work, "change of all energy over the largest kinetic", lost, 0.01, EXACT)
    yield at_most(work, "kinetic energy left over the largest", h["kinetic"][-1] / h["kinetic"].max(), 1e-3, "at rest")
    yield at_most(work, "deepest overlap over the radius", h["deepest_overlap"].max(), 0.5, "spheres keep apart")
