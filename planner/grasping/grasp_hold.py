"""Whether fingers that close as planned hold the object they really meet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimator.vectors import Array, Mask
from planner.grasping.closing import Bodies, Closed, close_on
from planner.grasping.grasp_quality import contact_wrenches, ferrari_canny, gauge_margin

CLOSED = 1e-6  # of the gauge margin, beyond roundoff


@dataclass(frozen=True)
class Friction:
    """What a contact can hold, and in which units wrenches are weighed.

    Args:
        coefficient: Coulomb's.
        torsion: Torque about the normal over the normal force; 0 is a hard fingertip [m].
        torque_length: A torque counts as the force that makes it on this arm [m].
        edges: Of the pyramid in each cone.
    """

    coefficient: float = 0.5
    torsion: float = 0.0
    torque_length: float = 0.03
    edges: int = 8


@dataclass(frozen=True, eq=False)
class Closings:
    """N ways to close: m fingers, each along its planned normal.

    Args:
        points, normals: Planned contacts, (N, m, 3) [m], unit and outward.
        radii: Of the pads, (N, m) [m].
        before, behind: How far each finger moves before and behind its contact, (N, m) [m].
    """

    points: Array
    normals: Array
    radii: Array
    before: Array
    behind: Array

    def __len__(self) -> int:
        return len(self.points)

    def take(self, index: Array) -> Closings:
        return Closings(
            self.points[index], self.normals[index], self.radii[index],
            self.before[index], self.behind[index],
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Holds:
    """What N closings make of B bodies.

    Args:
        closed: Where the fingers come to rest, arrays (B, N * m).
        touched: Whether a finger meets the wall on its way, not before it starts, (B, N, m).
        wrenches: Primitive wrenches of the contacts, (B, N, rays, 6).
        gauge: Margin of force closure, at most one; -inf where a finger does not touch, (B, N).
    """

    closed: Closed
    touched: Mask
    wrenches: Array
    gauge: Array

    @property
    def closure(self) -> Mask:
        """Whether the object is held, (B, N)."""
        return np.asarray(self.gauge > CLOSED)

    @property
    def probability(self) -> Array:
        """Share of the bodies that are held, (N,)."""
        return np.asarray(self.closure.mean(axis=0))

    def margins(self, i: int = 0) -> Array:
        """Ferrari-Canny margin of closing i on each body, 0 where it does not hold, (B,)."""
        held = self.closure[:, i]
        return np.array(
            [ferrari_canny(w) if h else 0.0 for w, h in zip(self.wrenches[:, i], held, strict=True)]
        )


def holds(bodies: Bodies, closings: Closings, friction: Friction) -> Holds:
    """Close on each body, and weigh what the contacts can hold.

    Torques are taken about the point of the body's axis at the contacts' mean height.
    """
    N, m = closings.points.shape[:2]
    B = len(bodies)
    closed = close_on(
        bodies, closings.points.reshape(-1, 3), closings.normals.reshape(-1, 3),
        closings.radii.ravel(),
    )  # fmt: skip
    travel = closed.travel.reshape(B, N, m)
    touched = closed.wall.reshape(B, N, m) & (travel > -closings.before)
    touched &= travel < closings.behind
    height = closed.heights.reshape(B, N, m).mean(axis=2)
    middle = bodies.points[:, None] + height[..., None] * bodies.directions[:, None]
    wrenches = contact_wrenches(
        closed.points.reshape(B, N, m, 3),
        closed.normals.reshape(B, N, m, 3),
        friction=friction.coefficient,
        origin=middle,
        torque_length=friction.torque_length,
        torsion=friction.torsion,
        edges=friction.edges,
    )
    gauge = np.full((B, N), -np.inf)
    all_touch = touched.all(axis=2)
    if all_touch.any():
        gauge[all_touch] = gauge_margin(wrenches[all_touch])
    return Holds(closed, touched, wrenches, gauge)
