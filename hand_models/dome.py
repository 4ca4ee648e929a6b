"""The surface of a pad: a ball rolled over an ellipsoid, which makes spheres, cylinders and domes.

A convex body touches a plane of inward normal u where u . x is largest over it. Over the ellipsoid
with half axes a_i, and over a ball rolled over it, that is at

    e(u) = A u / sqrt(u . A u),   A = sum a_i a_i^T,          x(u) = c + e(u) + rho u.

No axis makes a sphere, one a cylinder with round ends, two a cushion, three a dome: closed forms,
smooth in u. So that a cylinder that lies on a plane touches somewhere, a least axis goes into A and
as much is taken off rho: across its axis it stays as thick, along it is a little barrelled.

A touch along u is then that of a ball of any radius r with its centre at

    b(u) = x(u) - r u,

so whoever plans with balls plans with domes, once the centre goes along with the direction:

    db/du = (A - e e^T) / sqrt(u . A u) + (rho - r) I      across u.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

LEAST_AXIS = 1e-3  # of every ellipsoid, added to the axes as a square [m]
SMALLEST, LARGEST = 3e-3, 25e-3  # radii of spheres that stand for pads [m]
CONE = float(np.radians(40.0))  # about a pad's normal, over which they do
CAP = float(np.radians(50.0))  # about it, over which a dome is a fingertip's
_KINDS = ("sphere", "cylinder", "cushion", "dome")
_AROUND = 1500  # directions that stand for all


@dataclass(frozen=True, eq=False)
class Dome:
    """A pad's surface in the frame T of its fingertip.

    Attributes:
        centre: (3,) its middle, c [m].
        radius: Of the sphere, else of the ball that is rolled over the axes, over `LEAST_AXIS` [m].
        axes: (k, 3) half axes of the ellipsoid, k <= 3; none for a sphere [m].
    """

    centre: Array
    radius: float
    axes: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", _frozen(self.centre))
        object.__setattr__(self, "axes", _frozen(np.reshape(self.axes, (-1, 3))))

    @property
    def ball(self) -> float:
        """rho, the radius of the ball that is rolled over the ellipsoid of A [m]."""
        return self.radius if self.is_sphere else self.radius - LEAST_AXIS

    @property
    def reach(self) -> float:
        """No point of it is farther than that from its middle [m]."""
        return self.ball + float(np.sqrt(np.linalg.eigvalsh(self.spread)[-1]))

    @property
    def is_sphere(self) -> bool:
        return len(self.axes) == 0

    @property
    def in_words(self) -> str:
        """E.g. "sphere of 12.0 mm", "dome of 4.1 mm over 27.3 x 13.3 x 6.6 mm"."""
        ball = f"of {1e3 * self.radius:.1f} mm"
        if self.is_sphere:
            return f"sphere {ball}"
        lengths = (f"{1e3 * length:.1f}" for length in np.linalg.norm(self.axes, axis=1))
        return f"{_KINDS[len(self.axes)]} {ball} over {' x '.join(lengths)} mm"

    @cached_property
    def spread(self) -> Array:
        """(3, 3) A [m^2], zero for a sphere; with a least axis, so that every touch has a place."""
        if self.is_sphere:
            return _frozen(np.zeros((3, 3)))
        return _frozen(self.axes.T @ self.axes + LEAST_AXIS**2 * np.eye(3))

    def heights(self, u: ArrayLike) -> Array:
        """u . x(u), how far the pad reaches along unit vectors (..., 3) [m]."""
        u = np.asarray(u, dtype=np.float64)
        return np.asarray(u @ self.centre + self.ball + self._stretch(u), dtype=np.float64)

    def touched(self, u: ArrayLike) -> Array:
        """x(u), where it touches along unit vectors (..., 3) out of it [m]."""
        u = np.asarray(u, dtype=np.float64)
        if self.is_sphere:
            return np.asarray(self.centre + self.radius * u)
        along = (u @ self.spread) / self._stretch(u)[..., None]
        return np.asarray(self.centre + along + self.ball * u)

    def turning(self, u: ArrayLike) -> Array:
        """(3, 3) dx/du for one unit vector (3,): the ellipsoid's and the ball's radii [m]."""
        u = np.asarray(u, dtype=np.float64)
        ball = self.ball * np.eye(3)
        if self.is_sphere:
            return ball
        stretch = self._stretch(u)
        e = self.spread @ u / stretch
        return np.asarray((self.spread - np.outer(e, e)) / stretch + ball)

    def sphere_about(self, normal: Array) -> tuple[Array, float]:
        """Centre and radius [m] of the sphere that is nearest within a cone about a normal."""
        if self.is_sphere:
            return self.centre, self.radius
        u = directions_about(normal, CONE, _AROUND)
        return nearest_sphere(u, self.heights(u))

    @cached_property
    def points(self) -> Array:
        """(N, 3) of its surface, evenly over all directions [m]."""
        return _frozen(self.touched(directions_about(np.array([0.0, 0.0, 1.0]), np.pi, _AROUND)))

    def cap(self, normal: Array) -> Array:
        """(N, 3) of its surface about a normal, a little beyond where it touches [m]: behind, a
        fingertip is not what its pad would be if it went on."""
        return self.touched(directions_about(normal, CAP, _AROUND))

    def fronts(self, points: Array, normal: Array, slack: float) -> NDArray[np.bool_]:
        """(N,) which points are in it, or out of it by no more than a slack, and nearest to what of
        its surface is about a normal, a little beyond where it touches [m]."""
        u = directions_about(np.array([0.0, 0.0, 1.0]), np.pi, _AROUND)
        heights, front = self.heights(u), u @ normal >= np.cos(CAP)
        out = np.zeros(len(points), dtype=bool)
        for some in np.array_split(np.arange(len(points)), 1 + len(points) // _AROUND):
            beyond = points[some] @ u.T - heights
            out[some] = (beyond.max(axis=1) <= slack) & front[np.argmax(beyond, axis=1)]
        return out

    def _stretch(self, u: Array) -> Array:
        return np.asarray(np.sqrt(np.einsum("...i,ij,...j->...", u, self.spread, u)))


def nearest_sphere(u: Array, heights: Array) -> tuple[Array, float]:
    """Centre and radius of the sphere whose heights c . u + r along (N, 3) come nearest to given
    ones (N,): a linear least squares problem."""
    rows = np.column_stack([u, np.ones(len(u))])
    best = np.linalg.lstsq(rows, heights, rcond=None)[0]
    radius = float(np.clip(best[3], SMALLEST, LARGEST))
    if radius == best[3]:
        return _frozen(best[:3]), radius
    # a flat or pointed tip: the best sphere of a radius that can be planned
    return _frozen(np.linalg.lstsq(u, heights - radius, rcond=None)[0]), radius


def directions_about(normal: Array, cone: float, count: int) -> Array:
    """(count, 3) unit vectors spread evenly over the cap within a cone about a unit vector."""
    k = np.arange(count) + 0.5
    z = 1.0 - (1.0 - np.cos(cone)) * k / count
    turn = np.pi * (1.0 + np.sqrt(5.0)) * k  # the golden angle
    across = np.linalg.svd(np.asarray(normal, dtype=np.float64)[None])[2][1:]
    circle = np.cos(turn)[:, None] * across[0] + np.sin(turn)[:, None] * across[1]
    return np.asarray(np.sqrt(1.0 - z**2)[:, None] * circle + z[:, None] * normal)


def _frozen(values: ArrayLike) -> Array:
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array
