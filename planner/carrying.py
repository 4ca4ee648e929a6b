"""Carry a plan out: its motions and probes in order, until a motion meets what it should not.

An object that is not where it is believed may stand in the hand's way. The motion ends there, the
hand goes back to where the motion began, and the plan is not gone on with. What a finger felt is a
touch like any other; where a link met the object, nothing was felt.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from estimator.contact import Contact, Miss
from planner.motions.trajectory import Trajectory
from planner.plan_types import Plan, Probe


@dataclass(frozen=True, eq=False)
class Stop:
    """A motion that something ended; the hand is back where the motion began.

    Args:
        trajectory: The motion.
        time: When it ended [s].
        finger: That met something; empty for a link, which feels nothing.
        felt: By the finger; None where nothing was.
    """

    trajectory: Trajectory
    time: float
    finger: str
    felt: Contact | None = None


Touch = Callable[[Probe], Contact | Miss]
Move = Callable[[Trajectory], Stop | None]


class Carried(NamedTuple):
    """What came of a plan.

    Args:
        outcomes: A contact or a miss for each probe; none where the hand was stopped before.
        stop: What stopped it.
    """

    outcomes: tuple[Contact | Miss, ...]
    stop: Stop | None = None


def carry_out(plan: Plan, touch: Touch, move: Move | None) -> Carried:
    """All of a plan, or as far as its way in is free.

    Args:
        touch: Makes a probe: along its approach until the finger feels something, and back.
        move: Makes a motion between probes; None where nobody does. What it says of the way out
            counts for nothing: that is gone to its end.
    """
    if move is None or plan.motion is None:
        return Carried(tuple(touch(probe) for probe in plan.probes))
    motion = plan.motion
    for way in (motion.transfer, motion.enter):
        stop = None if way is None else move(way)
        if stop is not None:
            return Carried((), stop)
    outcomes = tuple(touch(probe) for probe in plan.probes)
    if motion.leave is not None:
        move(motion.leave)
    return Carried(outcomes)
