"""One finger's straight way through its contact, walked.

A finger has few joints more than a line needs, or none: between two postures on the line there may
be no way along it, though both are fine. So ways are walked before anything is promised of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimator.vectors import Array, Mask
from hand_models.hand import Finger, Hand
from planner.reaching.pull import Pulled, pulled
from planner.reaching.reach_outcome import Reach
from planner.reaching.reach_task import Solution

SPACING = 2e-3  # between waypoints, at most [m]
OFF_LINE = 1e-4  # of the pad's centre, where a straight way ends [m]
JUMP = 0.2  # of a joint between waypoints, likewise [rad]


@dataclass(frozen=True, eq=False)
class Way:
    """One finger from its stand-off to its overshoot, the others at their stand-offs.

    Args:
        along: Signed distances from the contact, the first ones before it, (K,) [m].
        path: (K, nq).
        centres: Of the ball that touches as the pad does, (K, 3) [m].
        off_line: Their distances from the line, (K,) [m].
        turned: Of the pad from the line, (K,) [rad].
        contact: The waypoint at distance zero.
        first, last: Waypoints between which the finger keeps to its line without a jump.
    """

    along: Array
    path: Array
    centres: Array
    off_line: Array
    turned: Array
    contact: int
    first: int
    last: int

    @property
    def is_whole(self) -> bool:
        return self.first == 0 and self.last == len(self.along) - 1


def straight_way(hand: Hand, knots: Solution | Reach, i: int, point: Array, n: Array) -> Way:
    """Finger i along the line through its contact: by guesses between its knots, or where those
    lead astray, from one waypoint to the next, beginning at the contact."""
    finger = hand.finger(knots.fingers[i])
    before, behind = float(knots.standoff[i]), float(knots.overshoot[i])
    along, contact = stations(before, behind)
    line = point + (finger.pad_radius + along[:, None]) * n
    joints = [x[finger.q_indices] for x in (knots.q_standoff, knots.q, knots.q_overshoot)]
    guess = np.repeat(knots.q_standoff[None], len(along), axis=0)
    guess[:, finger.q_indices] = [_between(joints, s, before, behind) for s in along]
    found = pulled(hand, finger, knots.X_WB, guess, line, n)
    way = _way_of(finger, along, contact, found, line, n)
    if way.is_whole:
        return way
    back, on = (
        pulled(hand, finger, knots.X_WB, guess[part], line[part], n, marching=True)
        for part in (slice(contact, None, -1), slice(contact, None))
    )
    both = ((back.path, on.path), (back.centres, on.centres), (back.normals, on.normals))
    joined = Pulled(*(np.concatenate([one[:0:-1], other]) for one, other in both))
    return _way_of(finger, along, contact, joined, line, n)


def _way_of(
    finger: Finger, along: Array, contact: int, found: Pulled, line: Array, n: Array
) -> Way:
    off_line = np.linalg.norm(found.centres - line, axis=1)
    turned = np.arccos(np.clip(-found.normals @ n, -1.0, 1.0))
    jump = np.abs(np.diff(found.path[:, finger.q_indices], axis=0)).max(axis=1)
    bad = off_line > OFF_LINE
    first = _beyond(bad[contact::-1], jump[:contact][::-1] > JUMP)
    last = _beyond(bad[contact:], jump[contact:] > JUMP)
    first, last = contact - first, contact + last
    return Way(along, found.path, found.centres, off_line, turned, contact, first, last)


def _beyond(bad: Mask, jumps: Mask) -> int:
    """How many waypoints beyond the first one hold, one after another."""
    stops = np.flatnonzero(bad[1:] | jumps)
    return int(stops[0]) if len(stops) else len(jumps)


def stations(before: float, behind: float) -> tuple[Array, int]:
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
