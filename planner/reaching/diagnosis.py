"""Why there is no reach: which finger, and by how much, if the rules were wider.

An optimiser that fails has spread what is wrong over all its rows. Asked again with a wider cone,
it says whether the pads could be there at all, and how far their normals are off at best.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hand_models.collision import HandCollision
from hand_models.hand import Hand
from planner.reaching.certificate import at_limits, certify
from planner.reaching.reach_model import ReachModel
from planner.reaching.reach_task import ReachTask, Solution, solve_task
from planner.reaching.starts import Start

_WIDER = np.radians([3.0, 6.0, 10.0, 15.0, 20.0, 30.0, 45.0])  # cones that are tried
_SOLVED = 4e-3  # violation up to which a solution counts, as in a reach


def cone_fault(
    hand: Hand, collision: HandCollision, model: ReachModel, task: ReachTask, nearest: Solution
) -> str | None:
    """The finger whose pad is turned too far, where a wider cone alone would do; else None.

    Args:
        model: Of the contact alone, for the fingers of `nearest`.
        nearest: The attempt that came nearest.
    """
    start = Start(nearest.fingers, nearest.q, nearest.X_WB)
    told = task.options.cone
    for cone in np.minimum(told + _WIDER, np.pi / 2):
        wide = replace(task.options, cone=float(cone), off_contact_cone=np.pi / 2)
        found = solve_task(model, replace(task, options=wide), start, solver="sqp")
        if found.violation < _SOLVED:
            return _most_turned(hand, collision, task, found)
    return None


def _most_turned(
    hand: Hand, collision: HandCollision, task: ReachTask, found: Solution
) -> str | None:
    """The finger in words, e.g. "thumb: pad normal 41 deg off at best (cone 30)"."""
    angles = certify(
        hand, collision, found.q, found.X_WB, task.solid,
        fingers=found.fingers, points=task.points, normals=task.normals,
    ).pad_angles  # fmt: skip
    worst = int(np.argmax(angles))
    if angles[worst] <= task.options.cone + 1e-3:
        return None
    name = found.fingers[worst]
    return (
        f"{name}: pad normal {np.degrees(angles[worst]):.0f} deg off at best (cone"
        f" {np.degrees(task.options.cone):.0f}){at_limits(hand, found.q, name)}"
    )
