"""Other ways to find an axis, for comparison: the textbook's line complex, and a public package.

Every peer is a plain function from contacts to a line, or None where it does not apply. The
stronger ones are `peers_ransac` and `peers_labels`.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from math import comb

import numpy as np

from estimator.axis import Axis
from estimator.contact import Contact
from estimator.vectors import Array, cross, unit

FEWEST_NORMALS = 5  # a linear complex up to scale has five unknowns
MOST_ITERATIONS = 1000
HULL_MM = 1.5  # inlier threshold of the cylinder


def linear_complex(contacts: Sequence[Contact]) -> Axis | None:
    """The line complex that the normals fit best, and its axis; curvatures are not used.

    Normals of a surface of revolution meet its axis, so they lie in a singular linear complex.
    Source: Pottmann and Randrup 1998, Rotational and helical surface approximation for reverse
    engineering. Needs five normals; a cylinder's leave the pitch free, which does no harm.
    """
    if len(contacts) < FEWEST_NORMALS:
        return None
    return Axis(*complex_axes(*stacked_normals(contacts)))


def stacked_normals(contacts: Sequence[Contact]) -> tuple[Array, Array]:
    """Positions and normals, (n, 3) each."""
    return np.array([c.position for c in contacts]), np.array([c.normal for c in contacts])


def complex_axes(p: Array, n: Array) -> tuple[Array, Array]:
    """Axes of the complexes fitted to sets of normals, vectorised.

    With m = p x n a normal in Pluecker coordinates, the complex (c, c') minimises
    sum (c' . n + c . m)^2 over |c| = 1: c is the smallest eigenvector of A - B C^+ B^T with
    A = sum m m^T, B = sum m n^T, C = sum n n^T, and c' = -C^+ B^T c. Its axis has direction c and
    passes c x c'. Points are centred and scaled first: the weights of the terms depend on both.

    Args:
        p, n: Positions [m] and unit normals, (..., k, 3), k >= 5.
    Returns:
        Points [m] and unit directions, (..., 3).
    """
    centre = p.mean(axis=-2, keepdims=True)
    size = np.sqrt(np.mean(np.sum((p - centre) ** 2, axis=-1), axis=-1))[..., None, None]
    m = cross((p - centre) / size, n)
    A, B, C = (np.einsum("...ki,...kj->...ij", x, y) for x, y in ((m, m), (m, n), (n, n)))
    from_c = -np.linalg.pinv(C, rcond=1e-10, hermitian=True) @ np.swapaxes(B, -1, -2)
    c = np.linalg.eigh(A + B @ from_c)[1][..., 0]
    moment = (from_c @ c[..., None])[..., 0]
    return centre[..., 0, :] + size[..., 0] * cross(c, moment), c


def cylinder_package(contacts: Sequence[Contact], *, rng: np.random.Generator) -> Axis | None:
    """The cylinder that pyransac3d finds on the positions alone.

    Its axis is the normal of the plane through three positions, so it is right only where three
    contacts share a parallel. The package draws from Python's global `random`, seeded here.
    """
    from pyransac3d import Cylinder

    if len(contacts) < 3:
        return None
    random.seed(int(rng.integers(2**32)))
    points_mm = 1e3 * np.array([c.position for c in contacts])
    iterations = min(MOST_ITERATIONS, 3 * comb(len(contacts), 3))
    with np.errstate(all="ignore"):
        found = Cylinder().fit(points_mm, thresh=HULL_MM, maxIteration=iterations)
    axis = np.array(found.axis, dtype=np.float64)
    centre = np.array(found.center, dtype=np.float64)
    if axis.shape != (3,) or not np.all(np.isfinite([axis, centre])):
        return None
    return Axis(1e-3 * centre, unit(axis))
