"""Guarded approaches: from a stand-off straight through the contact to an overshoot behind it.

The true object is not where it is believed to be, so a finger starts well before its contact and
goes on behind it until it touches. Either the finger moves, the hand held (`plan_approaches`), or
the arm moves the hand with its joints held (`approach_by_base`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from hand_models.collision import HandCollision
from hand_models.hand import Hand
from planner.reaching.pull import pulled
from planner.reaching.reach import Reach

Array = NDArray[np.float64]

SPACING = 2e-3  # between waypoints, at most [m]
FORCE_GOAL = 0.5  # a soft pad feels that, and hardly any object moves [N]
ARM_STROKE = 0.03  # before and behind the contact, where the arm moves [m]
_OFF_LINE = 1e-4  # of the pad's centre, where an overshoot ends [m]
_JUMP = 0.2  # of a joint between waypoints, likewise [rad]


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

    The finger follows the line through its contact along the normal by damped least squares from
    the reach's own stand-off, contact and overshoot postures; the others wait at their stand-offs.
    The overshoot ends early where the pad would leave the line, the joints would jump, or links
    would meet: `overshoot` says how far it goes.
    """
    collision = HandCollision(hand)
    return tuple(_finger_approach(hand, reach, i, collision) for i in range(len(reach.fingers)))


def approach_by_base(hand: Hand, reach: Reach, *, stroke: float = ARM_STROKE) -> Approach:
    """The arm brings the hand along the normal of a reach's first contact, its joints held.

    Args:
        stroke: Before and behind the contact [m].
    """
    finger = hand.finger(reach.fingers[0])
    along, contact = _stations(stroke, stroke)
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
    before, behind = float(reach.standoff[i]), float(reach.overshoot[i])
    along, contact = _stations(before, behind)
    on_contact = reach.points[i] + finger.pad_radius * reach.normals[i]
    line = on_contact + along[:, None] * reach.normals[i]
    knots = [x[finger.q_indices] for x in (reach.q_standoff, reach.q, reach.q_overshoot)]
    path = np.repeat(reach.q_standoff[None], len(along), axis=0)
    path[:, finger.q_indices] = [_between(knots, s, before, behind) for s in along]
    found = pulled(hand, finger, reach.X_WB, path, line, reach.normals[i])
    path, tips = found.path, found.centres
    off_line = np.linalg.norm(tips - line, axis=1)
    end = _end(path, off_line, contact, collision)
    return Approach(
        finger.name, _frozen(path[:end]), (reach.X_WB,), _frozen(tips[:end]), finger.pad_radius,
        contact, before, float(-along[end - 1]), float(off_line[:end].max()),
        hand.at(path[contact], reach.X_WB).link_axis(finger),
    )  # fmt: skip


def _end(path: Array, off_line: Array, contact: int, collision: HandCollision) -> int:
    """Number of waypoints to keep: all up to the contact, and those behind it that hold."""
    for k in range(contact + 1, len(path)):
        jump = np.abs(path[k] - path[k - 1]).max()
        if off_line[k] > _OFF_LINE or jump > _JUMP or not collision.is_self_free(path[k]):
            return k
    return len(path)


def _stations(before: float, behind: float) -> tuple[Array, int]:
    """Signed distances along the normal, `before` first, and the index of zero."""
    ahead = np.linspace(before, 0.0, max(2, 1 + int(np.ceil(before / SPACING))))
    beyond = np.linspace(0.0, -behind, max(2, 1 + int(np.ceil(behind / SPACING))))
    return np.concatenate([ahead, beyond[1:]]), len(ahead) - 1


def _between(knots: list[Array], s: float, before: float, behind: float) -> Array:
    """Joint positions between stand-off, contact and overshoot at distance s."""
    if s >= 0.0:
        share = s / max(before, 1e-9)
        return np.asarray(knots[1] + share * (knots[0] - knots[1]))
    share = -s / max(behind, 1e-9)
    return np.asarray(knots[1] + share * (knots[2] - knots[1]))


def _frozen(values: Array) -> Array:
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array
