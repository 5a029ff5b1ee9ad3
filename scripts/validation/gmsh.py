"""Boxes of tetrahedra written as Gmsh 2.2 files, for meshes that the case file cannot describe."""

from itertools import permutations

import numpy as np

SIDES = ("x_min", "x_max", "y_min", "y_max", "z_min", "z_max")


def box(cells, size):
    """(nodes, tets, {side: triangles}) of a box from the origin: six tetrahedra a cell, all alike."""
    n = np.array(cells)
    grid = np.stack(np.meshgrid(*(np.arange(k + 1) for k in n), indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(len(grid)).reshape(n + 1)
    corner = np.stack(np.meshgrid(*(np.arange(k) for k in n), indexing="ij"), axis=-1).reshape(-1, 3)
    tets, odd = [], []
    for order in permutations(range(3)):
        path = [corner]
        for axis in order:
            path.append(path[-1] + np.eye(3, dtype=int)[axis])
        tets.append(np.stack([number[tuple(p.T)] for p in path], axis=1))
        odd.append(np.linalg.det(np.eye(3)[list(order)]) < 0)
    for k, swapped in enumerate(odd):
        if swapped:
            tets[k] = tets[k][:, [0, 1, 3, 2]]
    tets = np.concatenate(tets)
    faces = np.concatenate([tets[:, f] for f in ([1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1])])
    sides = {}
    for k, name in enumerate(SIDES):
        at = n[k // 2] * (k % 2)
        sides[name] = faces[(grid[faces][:, :, k // 2] == at).all(axis=1)]
    return grid / n * np.array(size), tets, sides


def write(path, nodes, tets, sides):
    """MSH 2.2, ASCII, with the sides as named physical groups."""
    names = [f'2 {k} "{name}"' for k, name in enumerate(sides, 1)] + [f'3 {len(sides) + 1} "fluid"']
    elements = [
        f"2 2 {k} {k} " + " ".join(str(node + 1) for node in triangle)
        for k, triangles in enumerate(sides.values(), 1)
        for triangle in triangles
    ]
    volume = len(sides) + 1
    elements += [f"4 2 {volume} {volume} " + " ".join(str(node + 1) for node in tet) for tet in tets]
    places = [f"{k} " + " ".join(repr(float(x)) for x in node) for k, node in enumerate(nodes, 1)]
    numbered = [f"{k} {element}" for k, element in enumerate(elements, 1)]
    sections = [("PhysicalNames", names), ("Nodes", places), ("Elements", numbered)]
    text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"
    for name, lines in sections:
        text += f"${name}\n{len(lines)}\n" + "\n".join(lines) + f"\n$End{name}\n"
    path.write_text(text)
