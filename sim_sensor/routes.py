"""How a pad moves along its approach, and how near it is to the object: balls and domes.

A ball's distance is that of its centre less its radius, a dome's that of the nearest ball in it
(`dome_distance`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np
import pinocchio as pin

from estimator.vectors import Array
from hand_models.dome import Dome
from hand_models.hand import Hand
from sim_sensor.dome_distance import Distance, nearest_centre

TOUCHING = 1e-10  # how far along the path a touch is known [m]


class TouchPath(Protocol):
    """What the world needs of an approach."""

    @property
    def tip_centres(self) -> Array:
        """Centres of the pad's ball in the world, in order, straight in between, (K, 3) [m]."""

    @property
    def pad_radius(self) -> float:
        """Radius of the pad's ball [m]."""


@runtime_checkable
class HandPath(TouchPath, Protocol):
    """An approach that says what the whole hand does."""

    @property
    def finger(self) -> str:
        """Whose pad touches."""

    @property
    def path(self) -> Array:
        """Configurations of the hand, (K, nq)."""

    @property
    def bases(self) -> tuple[pin.SE3, ...]:
        """Pose of the hand base for each, or one for all."""


class Route(Protocol):
    """A pad on its way, at places counted in the way's points with fractions."""

    @property
    def last(self) -> float:
        """The place where it ends."""

    def ball(self, at: float, distance: Distance) -> tuple[Array, float]:
        """Centre and radius of the ball in the pad that is nearest to the object [m]."""

    def moved(self, a: float, b: float) -> float:
        """No point of the pad moves farther than that between two places of one interval [m]."""

    @property
    def size(self) -> float:
        """No point of the pad is farther from its middle [m]."""

    def from_afar(self, away: Array) -> Route:
        """The same route, with one point more that is so far off its start (3,) [m]."""


@dataclass(frozen=True, eq=False)
class BallRoute:
    """A ball along a polyline.

    Args:
        centres: (K, 3) [m].
        radius: [m].
    """

    centres: Array
    radius: float

    @property
    def last(self) -> float:
        return len(self.centres) - 1.0

    def ball(self, at: float, distance: Distance) -> tuple[Array, float]:
        return self._centre(at), self.radius

    def moved(self, a: float, b: float) -> float:
        return float(np.linalg.norm(self._centre(b) - self._centre(a)))

    @property
    def size(self) -> float:
        return self.radius

    def from_afar(self, away: Array) -> BallRoute:
        return replace(self, centres=np.vstack([self.centres[0] + away, self.centres]))

    def _centre(self, at: float) -> Array:
        i, share = _between(at, len(self.centres))
        return np.asarray(self.centres[i] + share * (self.centres[i + 1] - self.centres[i]))


@dataclass(frozen=True, eq=False)
class DomeRoute:
    """A dome on a fingertip.

    Args:
        dome: In the tip's frame.
        tips: Poses of the tip, screws in between.
    """

    dome: Dome
    tips: tuple[pin.SE3, ...]

    @property
    def last(self) -> float:
        return len(self.tips) - 1.0

    def ball(self, at: float, distance: Distance) -> tuple[Array, float]:
        return nearest_centre(self.dome, self._tip(at), distance), self.dome.ball

    def moved(self, a: float, b: float) -> float:
        i = min(int(a), len(self.tips) - 2)  # a and b lie between the same two points
        twist = pin.log6(self.tips[i].actInv(self.tips[i + 1]))
        speed = np.linalg.norm(twist.linear + np.cross(twist.angular, self.dome.centre))
        return float((b - a) * (speed + self.dome.reach * np.linalg.norm(twist.angular)))

    @property
    def size(self) -> float:
        return self.dome.reach

    def from_afar(self, away: Array) -> DomeRoute:
        first = self.tips[0]
        return replace(self, tips=(pin.SE3(first.rotation, first.translation + away), *self.tips))

    def _tip(self, at: float) -> pin.SE3:
        i, share = _between(at, len(self.tips))
        return pin.SE3.Interpolate(self.tips[i], self.tips[i + 1], share)


def dome_route(hand: Hand, path: HandPath) -> DomeRoute:
    """The route of a domed pad, as the hand's own kinematics have it."""
    finger, bases = hand.finger(path.finger), path.bases
    every = bases if len(bases) > 1 else bases * len(path.path)
    tips = (
        hand.at(q, X_WB).transform_tip_to_world(finger)
        for q, X_WB in zip(path.path, every, strict=True)
    )
    return DomeRoute(finger.dome, tuple(tips))


def first_touch(route: Route, distance: Distance) -> float | None:
    """Where along a route the pad first touches, in its points with fractions.

    Clearance cannot change faster than the pad moves, so an interval whose end clearances add up
    to more than its length is free. What is left is halved, the earlier half first.

    Returns:
        To within `TOUCHING` of path length; None where the route ends clear.
    """

    def clearance(at: float) -> float:
        centre, radius = route.ball(at, distance)
        return distance(centre)[0] - radius

    gaps = [clearance(float(k)) for k in range(int(route.last) + 1)]
    open_intervals = [(float(i), gaps[i], i + 1.0, gaps[i + 1]) for i in range(len(gaps) - 1)][::-1]
    while open_intervals:
        a, gap_a, b, gap_b = open_intervals.pop()
        if gap_a <= 0:
            return a
        length = route.moved(a, b)
        if gap_b > 0 and gap_a + gap_b > length:
            continue
        if length <= TOUCHING:
            return b
        middle = 0.5 * (a + b)
        gap = clearance(middle)
        open_intervals += [(middle, gap, b, gap_b), (a, gap_a, middle, gap)]
    return None


def _between(at: float, count: int) -> tuple[int, float]:
    """The point before a place, and the share of the way to the next."""
    i = min(int(at), count - 2)
    return i, at - i
