"""A grasp in time: to the way in, in with open fingers, and all fingers close."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hand_models.hand import Hand
from planner.grasp_outcome import Grasp
from planner.motion import FORCE_GOAL
from planner.motion_certificate import MotionCertificate, together
from planner.timing import timed
from planner.trajectory import Array, Configuration, Guard, Trajectory
from planner.transfer import Movable, plan_transfer


@dataclass(frozen=True, eq=False)
class GraspMotion:
    """What the hand does for a grasp.

    Args:
        transfer: From where it was to the way in; None where it is there.
        enter: The way in, fingers open.
        close: All fingers together; each stops on its own when it touches.
        certificate: The worst over all waypoints.
        sampled: Whether the transfer had to go round something.
    """

    transfer: Trajectory | None
    enter: Trajectory | None
    close: Trajectory
    certificate: MotionCertificate
    sampled: bool = False

    @property
    def trajectories(self) -> tuple[Trajectory, ...]:
        """All in order."""
        every = (self.transfer, self.enter, self.close)
        return tuple(one for one in every if one is not None)


def plan_grasp_motion(
    movable: Movable, grasp: Grasp, start: Configuration, *, wanted: float
) -> GraspMotion | str:
    """Certified motions for a planned grasp, or in words why there are none.

    Args:
        start: Where the hand is.
        wanted: How far to stay from the believed object on the way to it [m].
    """
    enter = timed(
        movable.hand, "enter", np.repeat(grasp.q_pregrasp[None], len(grasp.approach), axis=0),
        grasp.approach, movable.limits,
    )  # fmt: skip
    close = closing_motion(movable, grasp, grasp.path)
    parts = [one for one in (enter, close) if one is not None]
    found = [movable.certify(one) for one in parts]
    for word, one in zip(("on the way in", "while closing")[-len(parts) :], found, strict=True):
        if one.faults:
            return f"{word}, {one.faults[0]}"
    outside = Configuration(grasp.q_pregrasp, grasp.approach[0])
    transfer = plan_transfer(movable, start, outside, wanted=wanted)
    if isinstance(transfer, str):
        return f"on the way to the grasp, {transfer}"
    if transfer.certificate is not None:
        found.append(transfer.certificate)
    if enter is not None:
        every = tuple(finger.name for finger in movable.hand.fingers)
        enter = replace(enter, guard=Guard(every, FORCE_GOAL))
    return GraspMotion(transfer.trajectory, enter, close, together(found), transfer.sampled)


def closing_motion(movable: Movable, grasp: Grasp, path: Array) -> Trajectory:
    """Fingers along a path of closing, in time.

    Args:
        path: Of the grasp itself, or what became of it, (K, nq).
    Raises:
        ValueError: Nothing moves.
    """
    tips = _tips(movable.hand, grasp, path)
    bases = (grasp.X_WB,) * len(path)
    made = timed(
        movable.hand, "close", path, bases, movable.limits, tips=tips, touching=grasp.fingers
    )
    if made is None:
        raise ValueError("the fingers of a grasp do not move")
    expected = made.time_of(grasp.contact_index)
    return replace(made, guard=Guard(grasp.fingers, FORCE_GOAL, expected))


def _tips(hand: Hand, grasp: Grasp, path: Array) -> Array:
    """Places of the closing fingers' pads, (K, m, 3) [m]."""
    rows = [hand.fingers.index(hand.finger(name)) for name in grasp.fingers]
    return np.array([hand.at(q, grasp.X_WB).pad_centres[rows] for q in path])
