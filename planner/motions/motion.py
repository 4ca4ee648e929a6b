"""Guarded approaches: from a stand-off straight through the contact to an overshoot behind it.

The true object is not where it is believed to be, so a finger starts well before its contact and
goes on behind it until it touches. Either the finger moves, the hand held (`plan_approaches`), or
the arm moves the hand with its joints held (`approach_by_base`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from hand_models.collision import HandCollision
from hand_models.hand import Hand
from planner.reaching.reach import Reach
from planner.reaching.straight_way import Way, stations, straight_way

Array = NDArray[np.float64]

FORCE_GOAL = 0.5  # a soft pad feels that, and hardly any object moves [N]
_ROUNDED = 1e-6  # of lengths [m]
ARM_STROKE = 0.03  # before and behind the contact, where the arm moves [m]


@dataclass(frozen=True, eq=False)
class Approach:
    """One finger's way to its contact and beyond.

    Args:
        finger: Its name.
        path: Configurations of the whole hand, from stand-off to overshoot, (K, nq) [rad].
        bases: Pose of the hand base for each, or one for all (`X_WB`).
        tip_centres: Centres in the world of the ball that touches the believed surface where the
            pad does (`hand_models.dome`), (K, 3) [m].
        pad_radius: Of that ball [m].
        contact_index: The waypoint at which the believed object is touched.
        standoff, overshoot: Lengths before and behind the contact [m].
        straightness: Largest distance of a waypoint from the straight line [m].
        finger_axis: Along the finger's last link at the contact, world, unit, (3,).
        force_goal: At which the finger stops and goes back the way it came [N].
    """

    finger: str
    path: Array
    bases: tuple[pin.SE3, ...]
    tip_centres: Array
    pad_radius: float
    contact_index: int
    standoff: float
    overshoot: float
    straightness: float
    finger_axis: Array
    force_goal: float = FORCE_GOAL


def plan_approaches(hand: Hand, reach: Reach) -> tuple[Approach, ...]:
    """One approach for each finger of a reach, the base held.

    The finger follows the line through its contact along the normal (`straight_way`); the others
    wait at their stand-offs. The overshoot ends early where links would meet: `overshoot` says how
    far it goes.
    """
    collision = HandCollision(hand)
    return tuple(_finger_approach(hand, reach, i, collision) for i in range(len(reach.fingers)))


def approach_fault(
    collision: HandCollision, approaches: Iterable[Approach], least_overshoot: float
) -> str:
    """What is wrong with approaches of fingers, in words; empty for good ones.

    Args:
        least_overshoot: How far each has to go on behind its contact [m].
    """
    for way in approaches:
        if way.overshoot < least_overshoot - _ROUNDED:
            short = f"{1e3 * (least_overshoot - way.overshoot):.1f} mm too soon"
            return f"{way.finger}: links meet {short} behind its contact"
        if not all(collision.is_self_free(q) for q in way.path[: way.contact_index]):
            return f"{way.finger}: links meet on its way in"
    return ""


def approach_by_base(hand: Hand, reach: Reach, *, stroke: float = ARM_STROKE) -> Approach:
    """The arm brings the hand along the normal of a reach's first contact, its joints held.

    Args:
        stroke: Before and behind the contact [m].
    """
    finger = hand.finger(reach.fingers[0])
    along, contact = stations(stroke, stroke)
    bases = tuple(
        pin.SE3(reach.X_WB.rotation, reach.X_WB.translation + s * reach.normals[0]) for s in along
    )
    path = np.repeat(reach.q[None], len(along), axis=0)
    row, normals = hand.fingers.index(finger), reach.normals[:1]
    tips = np.vstack([hand.at(reach.q, X_WB).ball_centres([row], normals) for X_WB in bases])
    return Approach(
        finger.name, _frozen(path), bases, _frozen(tips), finger.pad_radius, contact,
        stroke, stroke, 0.0, hand.at(reach.q, reach.X_WB).link_axis(finger),
    )  # fmt: skip


def _finger_approach(hand: Hand, reach: Reach, i: int, collision: HandCollision) -> Approach:
    finger = hand.finger(reach.fingers[i])
    way = straight_way(hand, reach, i, reach.points[i], reach.normals[i])
    kept = slice(way.first, _end(way, collision))
    contact = way.contact - way.first
    path, along = way.path[kept], way.along[kept]
    return Approach(
        finger.name, _frozen(path), (reach.X_WB,), _frozen(way.centres[kept]), finger.pad_radius,
        contact, float(along[0]), float(-along[-1]), float(way.off_line[kept].max()),
        hand.at(path[contact], reach.X_WB).link_axis(finger),
    )  # fmt: skip


def _end(way: Way, collision: HandCollision) -> int:
    """Where the waypoints end: with the straight way, or where links meet behind the contact."""
    for k in range(way.contact + 1, way.last + 1):
        if not collision.is_self_free(way.path[k]):
            return k
    return way.last + 1


def _frozen(values: Array) -> Array:
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array
