"""Integrals of nodal fields and errors over tetrahedra, exact to degree 5 (Keast's 15 points)."""

import numpy as np


def _rule():
    """Barycentric points and weights (sum 1) of degree 5: centroid, two vertex orbits, one edge orbit."""
    points, weights = [[0.25] * 4], [0.118518518518519]
    s = np.sqrt(15)
    for a, w in (((7 - s) / 34, (2665 + 14 * s) / 37800), ((7 + s) / 34, (2665 - 14 * s) / 37800)):
        for k in range(4):
            point = [a] * 4
            point[k] = 1 - 3 * a
            points.append(point)
            weights.append(w)
    a = (10 - 2 * s) / 40
    for i in range(4):
        for j in range(i + 1, 4):
            point = [a] * 4
            point[i] = point[j] = 0.5 - a
            points.append(point)
            weights.append(20 / 378)
    return np.array(points), np.array(weights)


POINTS, WEIGHTS = _rule()


def volumes(points, tets):
    x = points[tets]
    return np.linalg.det(x[:, 1:] - x[:, :1]) / 6


def integral(points, tets, nodal):
    """∫ of a P1 field."""
    return float(volumes(points, tets) @ nodal[tets].mean(axis=1))


def l2_error(points, tets, nodal, exact, shift=None):
    """‖nodal − exact‖ in L²; exact(x) of points (..., 3). With `shift` the mean of the difference is
    taken out: a pressure is known up to a constant."""
    volume = volumes(points, tets)
    x = np.einsum("qi,eik->eqk", POINTS, points[tets])
    difference = np.einsum("qi,ei...->eq...", POINTS, nodal[tets]) - exact(x)
    if shift:
        difference = difference - np.einsum("e,q,eq->", volume, WEIGHTS, difference) / volume.sum()
    square = difference**2 if difference.ndim == 2 else (difference**2).sum(axis=2)
    return float(np.sqrt(np.einsum("e,q,eq->", volume, WEIGHTS, square)))


def norm(points, tets, nodal, shift=None):
    """‖nodal‖ in L², of what differs from its mean with `shift`."""
    return l2_error(points, tets, nodal, lambda x: 0.0, shift)


def gradients(points, tets):
    """Gradients of the four shape functions of each element, and its volume."""
    x = points[tets]
    inverse = np.linalg.inv(x[:, 1:] - x[:, :1]).transpose(0, 2, 1)
    return np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1), volumes(points, tets)
