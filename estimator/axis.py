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
    u0, u = reference.direction, axis.direction
    u = u if u @ u0 >= 0 else -u
    basis = basis_across(u0)
    sine = basis @ u
    norm = float(np.linalg.norm(sine))
    w = sine if norm < 1e-12 else sine * (np.arctan2(norm, u0 @ u) / norm)
    carried = _rotate_basis(basis, u0, w)
    return np.concatenate([carried @ (axis.foot(reference.point) - reference.point), w])


def from_chart(reference: Axis, coordinates: ArrayLike) -> Axis:
    """The axis at the given chart coordinates: the inverse of `to_chart`."""
    x = finite_array("chart coordinates", coordinates, (4,))
    u0 = reference.direction
    basis = basis_across(u0)
    angle = float(np.linalg.norm(x[2:]))
    u = np.cos(angle) * u0 + np.sinc(angle / np.pi) * (x[2:] @ basis)
    return Axis(reference.point + x[:2] @ _rotate_basis(basis, u0, x[2:]), u)


def _rotate_basis(basis: Array, u0: Array, w: Array) -> Array:
    """Carry (e1, e2) along the smallest rotation of u0 by angle |w| towards w."""
    angle = float(np.linalg.norm(w))
    if angle == 0.0:
        return basis
    towards = w / angle
    turned = (np.cos(angle) - 1.0) * (towards @ basis) - np.sin(angle) * u0
    return np.asarray(basis + np.multiply.outer(towards, turned))
