"""A line without a sign, the distances between two lines, and the chart covariances live in.

Conventions
    The chart at an axis has its origin at `axis.point` and four coordinates (t1, t2, w1, w2):
    (w1, w2) [rad] is the smallest rotation that takes the reference direction u0 to the other
    direction u, written in the basis (e1, e2) = `basis_across(u0)`; (t1, t2) [m] is where the
    other line passes the origin at its closest, in that basis carried along by the rotation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from estimator.vectors import Array, basis_across, finite_array, frozen, unit


@dataclass(frozen=True, eq=False)
class Axis:
    """A line in space. Both signs of `direction` name the same axis.

    Args:
        point: A point on the line, world [m], shape (3,).
        direction: Along the line, any length but zero, shape (3,); stored as a unit vector.
    Raises:
        ValueError: Wrong shape, not finite, or a direction of length zero.
    """

    point: Array
    direction: Array

    def __post_init__(self) -> None:
        point = finite_array("axis point", self.point, (3,))
        direction = finite_array("axis direction", self.direction, (3,))
        if np.linalg.norm(direction) < 1e-12:
            raise ValueError("axis direction: length zero points nowhere")
        object.__setattr__(self, "point", point)
        object.__setattr__(self, "direction", frozen(unit(direction)))

    def foot(self, point_W: Array) -> Array:
        """Nearest point of the line to each of `point_W` (..., 3) [m]."""
        along = (point_W - self.point) @ self.direction
        return self.point + np.multiply.outer(along, self.direction)

    def based_near(self, point_W: Array) -> Axis:
        """The same line, its point moved to the foot of `point_W`."""
        return Axis(self.foot(point_W), self.direction)


def angle_between(a: Axis, b: Axis) -> float:
    """Angle phi between two lines, in [0, pi/2] [rad]; accurate also below 1e-8."""
    cross = np.linalg.norm(np.cross(a.direction, b.direction))
    return float(np.arctan2(cross, abs(a.direction @ b.direction)))


def distance_between(a: Axis, b: Axis) -> float:
    """Smallest distance delta between two lines [m]: the paper's position error (section 4).

    It says little for a wrong axis that happens to pass near: prefer `offset_at`.
    """
    normal = np.cross(a.direction, b.direction)
    length = np.linalg.norm(normal)
    gap = b.point - a.point
    if length < 1e-12:
        return float(np.linalg.norm(np.cross(gap, a.direction)))
    return float(abs(gap @ normal) / length)


def offset_at(a: Axis, b: Axis, point_W: Array) -> float:
    """Distance of two lines beside `point_W`: between their feet of that point [m]."""
    return float(np.linalg.norm(a.foot(point_W) - b.foot(point_W)))


def to_chart(reference: Axis, axis: Axis) -> Array:
    """Coordinates (t1, t2, w1, w2) of `axis` in the chart at `reference` [m, m, rad, rad].

    Degenerates at 90 degrees, where a line without a sign lies on both sides.
    """
    x = chart_coordinates(
        reference.point, reference.direction, axis.point[None], axis.direction[None]
    )
    return np.asarray(x[0])


def from_chart(reference: Axis, coordinates: ArrayLike) -> Axis:
    """The axis at the given chart coordinates: the inverse of `to_chart`."""
    x = finite_array("chart coordinates", coordinates, (4,))
    points, directions = chart_lines(reference.point, reference.direction, x[None])
    return Axis(points[0], directions[0])


def chart_coordinates(origin: Array, u0: Array, points: Array, directions: Array) -> Array:
    """Vectorised `to_chart`: lines (S, 3), (S, 3) to coordinates (S, 4)."""
    u = directions * np.where(directions @ u0 >= 0, 1.0, -1.0)[:, None]
    basis = basis_across(u0)
    sine = u @ basis.T
    norm = np.linalg.norm(sine, axis=1, keepdims=True)
    angle = np.arctan2(norm, (u @ u0)[:, None])
    w = sine * np.where(norm < 1e-12, 1.0, angle / np.maximum(norm, 1e-300))
    gap = points - origin
    foot = gap - np.sum(gap * u, axis=1, keepdims=True) * u
    t = np.einsum("sjx,sx->sj", _carried_basis(basis, u0, w), foot)
    return np.hstack([t, w])


def chart_lines(origin: Array, u0: Array, x: Array) -> tuple[Array, Array]:
    """Vectorised `from_chart`: coordinates (S, 4) to points and unit directions (S, 3)."""
    basis = basis_across(u0)
    angle = np.linalg.norm(x[:, 2:], axis=1, keepdims=True)
    u = np.cos(angle) * u0 + np.sinc(angle / np.pi) * (x[:, 2:] @ basis)
    carried = _carried_basis(basis, u0, x[:, 2:])
    return origin + np.einsum("sj,sjx->sx", x[:, :2], carried), u


def _carried_basis(basis: Array, u0: Array, w: Array) -> Array:
    """(e1, e2) carried along the smallest rotation of u0 by |w| towards w, (S, 2, 3)."""
    angle = np.linalg.norm(w, axis=1)[:, None]
    towards = np.where(angle > 0, w / np.maximum(angle, 1e-300), 0.0)
    turned = (np.cos(angle) - 1.0) * (towards @ basis) - np.sin(angle) * u0
    return np.asarray(basis + towards[:, :, None] * turned[:, None, :])
