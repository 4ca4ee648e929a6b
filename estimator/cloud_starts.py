"""Where to start fitting an axis to a point cloud: normals, and lines that they nearly meet.

Every normal of a surface of revolution meets its axis. That is linear in the axis' Pluecker
coordinates (u, m), so a first axis is an eigenvector (Pottmann & Wallner's line complex). Noise
bends it, and on a cylinder it is barely fixed: the principal axes of the normals and of the points
give further starts, and the fit decides.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh
from scipy.spatial import KDTree

from estimator.axis import Axis
from estimator.vectors import Array, cross, unit

PATCH = 25  # part of the cloud that one normal is fitted to
FEWEST_NEIGHBOURS, MOST_NEIGHBOURS = 10, 120
APART = 0.1  # cosines above 1 - this are one start


def cloud_normals(points: Array) -> Array:
    """Normals of a point cloud by local planes, signs unknown, (N, 3)."""
    k = int(np.clip(len(points) // PATCH, FEWEST_NEIGHBOURS, MOST_NEIGHBOURS))
    _, rows = KDTree(points).query(points, k=min(k, len(points)))
    patch = points[rows] - points[rows].mean(axis=1, keepdims=True)
    return np.asarray(np.linalg.eigh(np.swapaxes(patch, 1, 2) @ patch)[1][:, :, 0])


def starting_axes(points: Array, normals: Array) -> list[Axis]:
    """Distinct lines to start from: of the line complex, of the normals and of the points."""
    complex_axis = linear_complex_axis(points, normals)
    along_normals = np.linalg.eigh(normals.T @ normals)[1].T
    centred = points - points.mean(axis=0)
    along_points = np.linalg.eigh(centred.T @ centred)[1].T
    starts: list[Axis] = [] if complex_axis is None else [complex_axis]
    for direction in (*along_normals, *along_points):
        if all(abs(direction @ axis.direction) < 1.0 - APART for axis in starts[1:]):
            starts.append(Axis(_point_behind(points, normals, direction), direction))
    return starts


def linear_complex_axis(points: Array, normals: Array) -> Axis | None:
    """The line that all normal lines meet best; None where it is none.

    Minimises the sum of (u . (p x n) + m . n)^2 under |u| = 1, lengths in the cloud's size.
    """
    centre = points.mean(axis=0)
    size = float(np.sqrt(np.mean(np.sum((points - centre) ** 2, axis=1))))
    p = (points - centre) / size
    rows = np.hstack([cross(p, normals), normals])
    M = rows.T @ rows
    A, B, C = M[:3, :3], M[:3, 3:], M[3:, 3:]
    if np.linalg.eigvalsh(C)[0] < 1e-9 * len(p):
        C = C + 1e-9 * len(p) * np.eye(3)  # all normals across one direction: an exact cylinder
    to_m = -np.linalg.solve(C, B.T)
    u = eigh(A + B @ to_m)[1][:, 0]
    m = to_m @ u
    if not np.all(np.isfinite(m)):
        return None
    return Axis(centre + size * np.cross(u, m), u)


def _point_behind(points: Array, normals: Array, direction: Array) -> Array:
    """The point that the normals, seen along `direction`, pass nearest."""
    flat = unit(normals - np.outer(normals @ direction, direction) + 1e-12)
    centre = points.mean(axis=0)
    projectors = np.eye(3) - flat[:, :, None] * flat[:, None, :]
    pull = 1e-3 * len(points) * np.eye(3)
    moved = np.einsum("nij,nj->i", projectors, points - centre)
    return np.asarray(centre + np.linalg.solve(projectors.sum(axis=0) + pull, moved))
