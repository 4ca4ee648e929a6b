"""Planes through the axis: labellings, [A d], and how three planes meet (Table 1).

A contact whose parallel has direction k_theta puts the axis into the plane a.x = d with a = k_theta
and d = k_theta.p, eq. (24). Which row of `directions` is the parallel's is not known: a `Labelling`
is one way to say so for all contacts, and each gives its own planes.

Nobody else forms d, because a rank means nothing before origin and unit are settled: moving the
origin by x rescales d against A by sqrt(1 + |x|^2). Here lengths are measured from the centroid of
the contacts, in units of their spread or of the object's radius, unless the caller says otherwise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimator.contact import Contact
from estimator.vectors import Array, frozen

Origin = Literal["centroid"] | ArrayLike
Unit = Literal["spread"] | float


@dataclass(frozen=True)
class Labelling:
    """For each contact, which row of `directions` is the parallel's (k_theta).

    Args:
        parallel_rows: One 0 or 1 a contact; the other row is the meridian's (k_z).
    Raises:
        ValueError: Empty, or an entry that is neither 0 nor 1.
    """

    parallel_rows: tuple[int, ...]

    def __post_init__(self) -> None:
        if not self.parallel_rows or any(row not in (0, 1) for row in self.parallel_rows):
            raise ValueError(
                f"labelling: expected one 0 or 1 for each contact, got {self.parallel_rows}"
            )

    @property
    def meridian_rows(self) -> tuple[int, ...]:
        """For each contact, which row of `directions` is the meridian's."""
        return tuple(1 - row for row in self.parallel_rows)

    def __str__(self) -> str:
        return "".join(map(str, self.parallel_rows))


@cache
def labellings(n: int) -> tuple[Labelling, ...]:
    """All 2^n labellings of n contacts, counting in binary: 000, 001, ..., 111.

    This is the order of every array with an axis over labellings.
    """
    return tuple(Labelling(rows) for rows in product((0, 1), repeat=n))


@dataclass(frozen=True, eq=False)
class PlaneStacks:
    """[A d] of n planes under every labelling, for any number of contact sets at once.

    Args:
        matrix: Rows (a_x, a_y, a_z, d), a a unit vector, d in units of `unit` from `origin`;
            shape (..., 2^n, n, 4), labellings in the order of `labellings(n)`.
        origin: Where d is measured from, world [m], shape (..., 3).
        unit: The length that d = 1 stands for [m], shape (...).
    """

    matrix: Array
    origin: Array
    unit: Array

    @property
    def A(self) -> Array:
        """Unit normals of the planes, shape (..., 2^n, n, 3)."""
        return self.matrix[..., :3]

    @property
    def d(self) -> Array:
        """Distances of the planes from the origin in units, shape (..., 2^n, n)."""
        return self.matrix[..., 3]

    def to_world(self, points: Array) -> Array:
        """Points (..., 2^n, 3) in units from the origin, as world points [m]."""
        return np.asarray(
            self.origin[..., None, :] + self.unit[..., None, None] * points, dtype=np.float64
        )


def plane_stacks(
    positions: Array, directions: Array, *, origin: Origin = "centroid", unit: Unit = "spread"
) -> PlaneStacks:
    """[A d] under every labelling, eqs (35), (36), for one set of contacts or many.

    Args:
        positions: Of the contacts, world [m], shape (..., n, 3).
        directions: Their principal directions as rows, unit, shape (..., n, 2, 3).
        origin: A world point [m], or the contacts' centroid.
        unit: A length [m], best the object's radius; or the contacts' rms distance from their
            centroid.
    Raises:
        ValueError: Shapes that do not match, or a unit that is not a positive length.
    """
    positions, directions = np.asarray(positions, float), np.asarray(directions, float)
    n = positions.shape[-2]
    if directions.shape != (*positions.shape[:-1], 2, 3):
        raise ValueError(
            f"directions: expected shape {(*positions.shape[:-1], 2, 3)} beside positions of "
            f"{positions.shape}, got {directions.shape}"
        )
    centre, length = _frame_of_reference(positions, origin, unit)
    rows = np.array([labelling.parallel_rows for labelling in labellings(n)])
    d = np.einsum("...nkx,...nx->...nk", directions, positions - centre[..., None, :])
    matrix = np.concatenate([directions, (d / length[..., None, None])[..., None]], axis=-1)
    return PlaneStacks(frozen(matrix[..., np.arange(n), rows, :]), frozen(centre), frozen(length))


def planes_of(
    contacts: Sequence[Contact], *, origin: Origin = "centroid", unit: Unit = "spread"
) -> PlaneStacks:
    """`plane_stacks` of one set of contacts: matrix of shape (2^n, n, 4)."""
    return plane_stacks(
        np.array([c.position for c in contacts]),
        np.array([c.directions for c in contacts]),
        origin=origin,
        unit=unit,
    )


class Meeting(IntEnum):
    """The eight ways three planes can meet: the cases of Table 1 and Figure 2.

    The ranks of A and [A d] tell them apart but for 2 and 3, 4 and 5, 6 and 7; there it matters
    which planes are parallel or coincide.
    """

    COINCIDENT = 1
    TWO_COINCIDENT_ONE_PARALLEL = 2
    THREE_PARALLEL = 3
    TWO_COINCIDENT_ONE_CROSSING = 4
    COMMON_LINE = 5
    TWO_PARALLEL_ONE_CROSSING = 6
    PRISM = 7
    POINT = 8


def ranks(matrix: Array, *, tolerance: float) -> NDArray[np.int64]:
    """Number of singular values above an absolute tolerance, of shape (...) for (..., n, k)."""
    return np.asarray(np.sum(np.linalg.svd(matrix, compute_uv=False) > tolerance, axis=-1))


def meetings(matrix: Array, *, tolerance: float) -> NDArray[np.int64]:
    """How three planes meet, as values of `Meeting`, from ranks (Table 1).

    Args:
        matrix: [A d] of three planes, shape (..., 3, 4).
        tolerance: A singular value at most this large counts as zero [-].
    Returns:
        Values 1-8, shape (...).
    """
    A = matrix[..., :3]
    pairs = np.array([(0, 1), (1, 2), (2, 0)])
    parallel = np.any(ranks(A[..., pairs, :], tolerance=tolerance) == 1, axis=-1)
    coincident = np.any(ranks(matrix[..., pairs, :], tolerance=tolerance) == 1, axis=-1)
    rank_A, rank_Ad = ranks(A, tolerance=tolerance), ranks(matrix, tolerance=tolerance)
    rank_pairs = ((1, 1), (1, 2), (2, 2), (2, 3))
    return np.select(
        [(rank_A == a) & (rank_Ad == ad) for a, ad in rank_pairs],
        [
            np.full(rank_A.shape, Meeting.COINCIDENT),
            np.where(coincident, Meeting.TWO_COINCIDENT_ONE_PARALLEL, Meeting.THREE_PARALLEL),
            np.where(coincident, Meeting.TWO_COINCIDENT_ONE_CROSSING, Meeting.COMMON_LINE),
            np.where(parallel, Meeting.TWO_PARALLEL_ONE_CROSSING, Meeting.PRISM),
        ],
        default=Meeting.POINT,
    )


def _frame_of_reference(positions: Array, origin: Origin, unit: Unit) -> tuple[Array, Array]:
    """Origin (..., 3) and unit (...) as arrays, one for each set of contacts."""
    sets = positions.shape[:-2]
    centroid = positions.mean(axis=-2)
    if isinstance(origin, str):
        if origin != "centroid":
            raise ValueError(f"origin: expected 'centroid' or a point (3,), got {origin!r}")
        centre = centroid
    else:
        centre = np.broadcast_to(np.asarray(origin, float), (*sets, 3))
    if isinstance(unit, str):
        if unit != "spread":
            raise ValueError(f"unit: expected 'spread' or a length in metres, got {unit!r}")
        square = np.sum(np.square(positions - centroid[..., None, :]), axis=-1)
        length = np.sqrt(square.mean(axis=-1))
    else:
        length = np.broadcast_to(np.asarray(unit, float), sets)
    if not np.all(length > 0):
        raise ValueError(f"unit: expected a length greater than zero [m], got {length.min():g}")
    return centre, length
