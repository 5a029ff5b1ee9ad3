"""How fast a level box can rise in a tank at most: potential flow, by finite differences.

Of all flows of an incompressible fluid past walls that move with a given velocity, potential flow has the least kinetic
energy (Kelvin 1849). A box that buoyancy drives from rest is thus no faster than where all energy set free is in its own
motion and the potential flow that goes with it.
"""

import numpy as np


def added_mass(tank, box, level, middle, cell=0.002):
    """Added mass over displaced mass of a box, `middle` high, that moves up amid a tank with a free surface at rest.

    `tank` length and width, `box` length, width and height, `level` height of the water [m]; cells of about `cell` [m]. A
    quarter is solved: Laplace's equation, by conjugate gradients; no pressure on the surface.
    """

    def lines(*edges):
        parts = [np.linspace(a, b, round((b - a) / cell) + 1)[1:] for a, b in zip(edges, edges[1:])]
        return np.diff(np.concatenate([edges[:1], *parts]))

    length, width, height = box
    low, high = middle - height / 2, middle + height / 2
    h = [lines(0, length / 2, tank[0] / 2), lines(0, width / 2, tank[1] / 2), lines(0, low, high, level)]
    middles = np.meshgrid(*[np.cumsum(d) - d / 2 for d in h], indexing="ij")
    inside = (middles[0] < length / 2) & (middles[1] < width / 2) & (middles[2] > low) & (middles[2] < high)
    h = np.meshgrid(*h, indexing="ij")
    volume = h[0] * h[1] * h[2]
    area = volume / h[2]

    # Area over distance of the faces between cells of water.
    cut = lambda a, axis: [np.delete(a, -1, axis), np.delete(a, 0, axis)]
    faces = []
    for axis in range(3):
        (v, _), wet, d = cut(volume / h[axis], axis), cut(~inside, axis), cut(h[axis], axis)
        faces.append(v * wet[0] * wet[1] / (d[0] + d[1]) * 2)
    surface = 2 * area[:, :, -1] / h[2][:, :, -1]

    def flow_out(phi):
        out = np.zeros_like(phi)
        for axis, face in enumerate(faces):
            flux = -face * np.diff(phi, axis=axis)
            at = [slice(None)] * 3
            at[axis] = slice(None, -1)
            out[tuple(at)] += flux
            at[axis] = slice(1, None)
            out[tuple(at)] -= flux
        out[:, :, -1] += surface * phi[:, :, -1]
        return np.where(inside, phi, out)

    # What the box, rising with 1 m/s, sends into the cells over it and takes from those under it.
    given = np.zeros_like(volume)
    given[:, :, 1:] += np.where(inside[:, :, :-1] & ~inside[:, :, 1:], area[:, :, 1:], 0)
    given[:, :, :-1] -= np.where(inside[:, :, 1:] & ~inside[:, :, :-1], area[:, :, :-1], 0)
    phi, r = np.zeros_like(given), given.copy()
    p, rr = r.copy(), (r * r).sum()
    start = rr
    while rr > 1e-16 * start:
        q = flow_out(p)
        step = rr / (p * q).sum()
        phi, r = phi + step * p, r - step * q
        rr, last = (r * r).sum(), rr
        p = r + rr / last * p
    # ½ m V² = ½ρ∫|∇φ|² = ½ρ∮φ ∂ₙφ
    return (phi * given).sum() / volume[inside].sum()


def fastest_rise(tank, box, density, level, start, cell=0.002, gravity=9.81):
    """Heights [m] of a box's middle, on its way from `start` to where its top is a cell below the surface, and how fast it
    is there at most [m/s]; densities over the water's."""
    z = np.arange(start, level - box[2] / 2 - cell / 2, cell)
    mass = np.array([density + added_mass(tank, box, level, at, cell) for at in z])
    return z, np.sqrt(2 * (1 - density) * gravity * (z - start) / mass)
