"""The DFG channel with a cylinder, one cell thick, meshed to fit: rings around the cylinder, rows behind them."""

import numpy as np

HEIGHT, LENGTH, CENTRE, RADIUS = 0.41, 2.2, np.array([0.2, 0.2]), 0.05


def fitted(around, rings, rows, thickness):
    """(nodes, tets, {side: triangles}): `around` cells (a multiple of 8) on the cylinder, in `rings` that widen
    to the square [0, HEIGHT]², and `rows` that widen from there to the end."""
    points, triangles = plane(around, rings, rows)
    return extruded(points, triangles, thickness)


def plane(around, rings, rows):
    """Points and triangles of the channel in the plane."""
    side = around // 4
    s = np.linspace(0, HEIGHT, side + 1)[:-1]
    zero, full = np.zeros(side), np.full(side, HEIGHT)
    square = np.concatenate([np.c_[full, s], np.c_[HEIGHT - s, full], np.c_[zero, HEIGHT - s], np.c_[s, zero]])
    angle = np.arctan2(*(square - CENTRE).T[::-1])
    circle = CENTRE + RADIUS * np.c_[np.cos(angle), np.sin(angle)]
    # Rings that begin as wide as the cells on the cylinder are long.
    growth = widening(2 * np.pi * RADIUS / around, HEIGHT / 2 - RADIUS, rings)
    points = np.concatenate([circle + g * (square - circle) for g in growth])
    number = np.arange((rings + 1) * around).reshape(rings + 1, around)
    quads = [np.stack([number[:-1], np.roll(number[:-1], -1, 1), np.roll(number[1:], -1, 1), number[1:]], -1)]
    # Behind: the square's right side, carried to the end.
    reach = HEIGHT + (LENGTH - HEIGHT) * widening(HEIGHT / side, LENGTH - HEIGHT, rows)
    y = np.linspace(0, HEIGHT, side + 1)
    behind = len(points) + np.arange(rows * (side + 1)).reshape(rows, side + 1)
    points = np.concatenate([points] + [np.c_[np.full(side + 1, x), y] for x in reach[1:]])
    behind = np.concatenate([number[-1:, : side + 1], behind])
    quads.append(np.stack([behind[:-1, :-1], behind[1:, :-1], behind[1:, 1:], behind[:-1, 1:]], -1))
    # Diagonals in turns, or the mesh itself has a sense of rotation: all turned one way, lift was 0.0217 on 96 cells
    # around, all the other way 0.0017; the exact one is 0.0106.
    turned = np.concatenate([(np.indices(q.shape[:2]).sum(0) % 2).ravel() for q in quads])
    quads = np.concatenate([q.reshape(-1, 4) for q in quads])
    quads = np.where(turned[:, None] == 1, np.roll(quads, -1, 1), quads)
    return points, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def widening(first, length, n):
    """n + 1 places in [0, 1], the first step `first`/`length`, each wider than the one before by the same factor."""
    low, high = 1.0, 3.0
    for _ in range(60):
        q = 0.5 * (low + high)
        low, high = (q, high) if first * (q**n - 1) / (q - 1) < length else (low, q)
    return (q ** np.arange(n + 1) - 1) / (q**n - 1)


def extruded(points, triangles, thickness):
    """Three tetrahedra over each triangle, split alike where triangles meet."""
    n = len(points)
    nodes = np.concatenate([np.c_[points, np.zeros(n)], np.c_[points, np.full(n, thickness)]])
    a, b, c = np.sort(triangles, axis=1).T
    tets = np.concatenate([np.stack(t, 1) for t in ((a, b, c, c + n), (a, b, b + n, c + n), (a, a + n, b + n, c + n))])
    x = nodes[tets]
    odd = np.linalg.det(x[:, 1:] - x[:, :1]) < 0
    tets[odd] = tets[odd][:, [1, 0, 2, 3]]
    faces = np.concatenate([tets[:, f] for f in ([1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1])])
    x = nodes[faces]
    on = lambda k, at: (np.abs(x[:, :, k] - at) < 1e-9).all(axis=1)
    ring = (np.abs(np.hypot(*(x[:, :, :2] - CENTRE).transpose(2, 0, 1)) - RADIUS) < 1e-9).all(axis=1)
    sides = {"x_min": on(0, 0), "x_max": on(0, LENGTH), "y_min": on(1, 0), "y_max": on(1, HEIGHT)}
    sides |= {"z_min": on(2, 0), "z_max": on(2, thickness), "cylinder": ring}
    return nodes, tets, {name: faces[at] for name, at in sides.items()}
