"""Each finger alone, straight along its normal: how far it goes from where it stands."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from estimator.vectors import Array
from hand_models.hand import Hand
from planner.reaching.pull import pulled
from planner.reaching.reach_task import ReachTask, Solution
from planner.reaching.straight_way import Way, straight_way

_STEP = 2.5e-3  # along the normal [m]
_ON_LINE = 2e-5  # of the pad's centre [m]


def straightened(hand: Hand, task: ReachTask, found: Solution) -> Solution:
    """A solution whose fingers stand off and press on only as far as a straight way leads there,
    on which a pad turns no farther than it may off its contact."""
    wide = max(task.options.cone, task.options.off_contact_cone)
    ways = [
        straight_way(hand, found, i, task.points[i], task.normals[i])
        for i in range(len(found.fingers))
    ]
    if all(way.is_whole for way in ways):
        return found
    back = [_end(way, range(way.first, way.contact + 1), wide) for way in ways]
    on = [_end(way, range(way.last, way.contact - 1, -1), wide) for way in ways]
    return replace(
        found,
        q_standoff=_joined(hand, found, found.q_standoff, back),
        q_overshoot=_joined(hand, found, found.q_overshoot, on),
        standoff=np.array([length for length, _ in back]),
        overshoot=np.array([0.0 - length for length, _ in on]),
    )


def _end(way: Way, waypoints: range, wide: float) -> tuple[float, Array]:
    """The farthest of some waypoints at which the pad is not turned too far, else the contact."""
    k = next((k for k in waypoints if way.turned[k] <= wide), way.contact)
    return float(way.along[k]), way.path[k]


def extended(hand: Hand, task: ReachTask, found: Solution) -> Solution:
    """A solution whose fingers stand off and press on as far as asked, or as they can.

    Links are not looked at: the inspection of the whole does that.
    """
    options = task.options
    back = [
        _way(hand, task, found, i, found.q_standoff, found.standoff[i], options.standoff)
        for i in range(len(found.fingers))
    ]
    on = [
        _way(hand, task, found, i, found.q_overshoot, -found.overshoot[i], -options.overshoot)
        for i in range(len(found.fingers))
    ]
    return replace(
        found,
        q_standoff=_joined(hand, found, found.q_standoff, back),
        q_overshoot=_joined(hand, found, found.q_overshoot, on),
        standoff=np.array([length for length, _ in back]),
        overshoot=np.array([-length for length, _ in on]),
    )


def _way(
    hand: Hand, task: ReachTask, found: Solution, i: int, q: Array, near: float, far: float
) -> tuple[float, Array]:
    """How far finger i goes along its normal from `near` towards `far`, and how it ends."""
    finger, n = hand.finger(found.fingers[i]), task.normals[i]
    along = np.linspace(near, far, 1 + int(np.ceil(abs(far - near) / _STEP)))
    line = task.points[i] + (finger.pad_radius + along[:, None]) * n
    path = np.repeat(q[None], len(along), 0)
    way = pulled(hand, finger, found.X_WB, path, line, n, marching=True)
    off_line = np.linalg.norm(way.centres - line, axis=1)
    turned = np.arccos(np.clip(-way.normals @ n, -1.0, 1.0))
    wide = max(task.options.cone, task.options.off_contact_cone)
    good = (off_line < _ON_LINE) & (turned < wide)
    last = int(np.argmin(good)) - 1 if not good.all() else len(along) - 1
    return (near, q) if last < 0 else (float(along[last]), way.path[last])


def _joined(hand: Hand, found: Solution, q: Array, ways: list[tuple[float, Array]]) -> Array:
    """All touching fingers where their ways end."""
    q = q.copy()
    for name, (_, end) in zip(found.fingers, ways, strict=True):
        joints = hand.finger(name).q_indices
        q[joints] = end[joints]
    return np.asarray(q)
