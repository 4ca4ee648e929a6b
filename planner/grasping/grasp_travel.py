"""A grasp in time: to the way in, in with open fingers, and all fingers close."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from hand_models.hand import Hand
from planner.motions.motion import FORCE_GOAL
from planner.motions.motion_certificate import MotionCertificate, together
from planner.motions.timing import MotionLimits, timed
from planner.motions.trajectory import Array, Configuration, Guard, Trajectory
from planner.motions.transfer import Movable, plan_transfer
from planner.reaching.reach import Reach


@dataclass(frozen=True, eq=False)
class GraspMotion:
    """What the hand does for a grasp.

    Args:
        transfer: From where it was to the way in; None where it is there.
        enter: The way in, fingers open.
        close: All fingers together; each stops on its own when it touches.
        limits: What they keep.
        certificate: The worst over all waypoints.
        sampled: Whether the transfer had to go round something.
    """

    transfer: Trajectory | None
    enter: Trajectory | None
    close: Trajectory
    limits: MotionLimits
    certificate: MotionCertificate
    sampled: bool = False

    @property
    def trajectories(self) -> tuple[Trajectory, ...]:
        """All in order."""
        every = (self.transfer, self.enter, self.close)
        return tuple(one for one in every if one is not None)


def plan_grasp_motion(
    movable: Movable,
    reach: Reach,
    way_in: tuple[pin.SE3, ...],
    closing: Array,
    contact_index: int,
    start: Configuration,
    *,
    wanted: float,
) -> GraspMotion | str:
    """Certified motions for a grasp, or in words why there are none.

    Args:
        reach: Of the grasp.
        way_in: Base poses from afar to the pre-grasp, fingers open.
        closing: All fingers from the pre-grasp through the grasp, (K, nq).
        contact_index: The row that is the grasp.
        start: Where the hand is.
        wanted: How far to stay from the believed object on the way to it [m].
    """
    hand, limits = movable.hand, movable.limits
    q = np.repeat(reach.q_standoff[None], len(way_in), axis=0)
    close = closing_motion(hand, limits, reach, closing, contact_index)
    enter = timed(hand, "enter", q, way_in, limits)
    found = []
    for word, part in (("on the way in", enter), ("while closing", close)):
        if part is not None:
            found.append(movable.certify(part))
            if found[-1].faults:
                return f"{word}, {found[-1].faults[0]}"
    transfer = plan_transfer(movable, start, Configuration(q[0], way_in[0]), wanted=wanted)
    if isinstance(transfer, str):
        return f"on the way to the grasp, {transfer}"
    if transfer.certificate is not None:
        found.append(transfer.certificate)
    if enter is not None:
        enter = replace(enter, guard=Guard(tuple(f.name for f in hand.fingers), FORCE_GOAL))
    worst = together(found)
    return GraspMotion(transfer.trajectory, enter, close, limits, worst, transfer.sampled)


def closing_motion(
    hand: Hand, limits: MotionLimits, reach: Reach, path: Array, contact_index: int
) -> Trajectory:
    """Fingers along a path of closing, in time.

    Args:
        path: Of the grasp itself, or what became of it, (K, nq).
        contact_index: The row at which contact is expected.
    Raises:
        ValueError: Nothing moves.
    """
    rows = [hand.fingers.index(hand.finger(name)) for name in reach.fingers]
    tips = np.array([hand.at(q, reach.X_WB).pad_centres[rows] for q in path])
    bases = (reach.X_WB,) * len(path)
    made = timed(
        hand, "close", path, bases, limits, tips=tips, touching=reach.fingers, mark=contact_index
    )
    if made is None:
        raise ValueError("the fingers of a grasp do not move")
    return replace(made, guard=Guard(reach.fingers, FORCE_GOAL, made.time_of(contact_index)))
