"""All motions of one placement: to the object, in, each finger there and back, and out again.

The hand goes in the way it will go out. What lies between placements is free space: there it stays
clear of wherever the object may be. Inside, it stays clear of where the object is believed, slowly,
and any finger that feels something ends the motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from hand_models.hand import Hand
from planner.motions.motion import FORCE_GOAL, Approach
from planner.motions.motion_certificate import MotionCertificate, together
from planner.motions.retreat import Retreat
from planner.motions.timing import MotionLimits, timed
from planner.motions.trajectory import Array, Configuration, Guard, Phase, Trajectory, between
from planner.motions.transfer import Movable, Transfer, plan_transfer

OUTSIDE = 0.015  # from the believed object, at least, ends a way out [m]

# The way out, and approaches with ways back, each with what was measured.
_Left = tuple[Trajectory | None, list[MotionCertificate]]
_Probes = tuple[tuple[tuple[Trajectory, Trajectory], ...], list[MotionCertificate]]


@dataclass(frozen=True, eq=False)
class RoundMotion:
    """What the hand does for the probes of one placement.

    Args:
        transfer: From where it was to the way in; None where that was not told, or it is there.
        enter: The way in.
        probes: Each finger's approach, and its way back from the expected contact.
        leave: The way out.
        retreat: What `leave` follows.
        certificate: The worst over all waypoints of all of them.
        sampled: Whether the transfer had to go round something.
    """

    transfer: Trajectory | None
    enter: Trajectory | None
    probes: tuple[tuple[Trajectory, Trajectory], ...]
    leave: Trajectory | None
    retreat: Retreat
    certificate: MotionCertificate
    sampled: bool = False

    @property
    def trajectories(self) -> tuple[Trajectory, ...]:
        """All in order."""
        touches = (trajectory for pair in self.probes for trajectory in pair)
        every = (self.transfer, self.enter, *touches, self.leave)
        return tuple(one for one in every if one is not None)


def plan_round(
    movable: Movable,
    approaches: Sequence[Approach],
    ways: Sequence[Retreat],
    start: Configuration | None,
) -> RoundMotion | str:
    """Certified motions for all approaches of a placement, or in words why there are none.

    Args:
        ways: Out of the placement, the best first; the first that is clear is taken.
        start: Where the hand is; None to begin at the way in.
    """
    reason, probes = "", None
    for way in _ways(movable, ways):
        left = _leave(movable, way)  # first: it costs least and is most often what is in the way
        if isinstance(left, str):
            reason = reason or left
            continue
        probes = probes or _probes(movable, approaches, ways[0].q)
        if isinstance(probes, str):
            return probes
        transfer = _come(movable, way, start)
        if isinstance(transfer, str):
            reason = reason or transfer
            continue
        return _round(movable, way, left, probes, transfer)
    return reason or "no straight way out leads away from the object"


def _round(
    movable: Movable, way: Retreat, left: _Left, probes: _Probes, transfer: Transfer
) -> RoundMotion:
    leave, found = left
    touches, certificates = probes
    came = [] if transfer.certificate is None else [transfer.certificate]
    return RoundMotion(
        transfer.trajectory, None if leave is None else _guarded_enter(movable, leave), touches,
        leave, way, together([*certificates, *found, *came]), transfer.sampled,
    )  # fmt: skip


def _probes(movable: Movable, approaches: Sequence[Approach], q_begin: Array) -> _Probes | str:
    """There and back along every approach, certified."""
    probes, certificates = [], []
    for approach in approaches:
        pair = probe_motion(movable.hand, movable.limits, approach, q_begin)
        found = [movable.certify(one) for one in pair]
        faults = [fault for one in found for fault in one.faults]
        if faults:
            return f"{approach.finger}'s approach: {faults[0]}"
        probes.append(pair)
        certificates += found
    return tuple(probes), certificates


def _ways(movable: Movable, ways: Sequence[Retreat]) -> list[Retreat]:
    """Those that lead away; where the base stays, joints may also go on from where they are."""
    away = [way for way in ways if way.clearance >= min(way.wanted, OUTSIDE)]
    if not movable.base_stays:
        return away
    first = ways[0]
    still = replace(first, path=first.path[:1], bases=first.bases[:1], clearance=first.nearest)
    return [*(away if movable.hand.arm is not None else []), still]


def probe_motion(
    hand: Hand, limits: MotionLimits, approach: Approach, q_begin: Array
) -> tuple[Trajectory, Trajectory]:
    """An approach in time, ended by its contact, and the way back from where that is expected.

    Raises:
        ValueError: The approach does not move.
    """
    forward = _along(
        hand, limits, approach, q_begin, np.arange(float(len(approach.path))), "approach"
    )
    back = withdrawal(hand, limits, approach, approach.contact_index, q_begin)
    if forward is None or back is None:
        raise ValueError(f"the approach of {approach.finger} does not move")
    expected = forward.time_of(approach.contact_index)
    guard = Guard((approach.finger,), approach.force_goal, expected)
    return replace(forward, guard=guard), back


def withdrawal(
    hand: Hand, limits: MotionLimits, approach: Approach, stop: float, q_begin: Array
) -> Trajectory | None:
    """Back along an approach from where its finger stopped; None where it did not move.

    Args:
        stop: Place on the approach's path, counted in its points with fractions.
        q_begin: Where the approach began.
    """
    places = np.append(stop, np.arange(int(np.ceil(stop)))[::-1])
    return _along(hand, limits, approach, q_begin, places, "withdraw")


def _along(
    hand: Hand,
    limits: MotionLimits,
    approach: Approach,
    q_begin: Array,
    places: Array,
    phase: Phase,
) -> Trajectory | None:
    """An approach's path in time, through places on it.

    Its first point is put where the hand is: a reach's stand-off is as exact as its solver, the
    approach is pulled onto its line.
    """
    path, rows = np.array(approach.path), np.arange(len(approach.path))
    path[0] = q_begin
    q = np.array([np.interp(places, rows, column) for column in path.T]).T
    tips = np.array([np.interp(places, rows, column) for column in approach.tip_centres.T]).T
    bases = tuple(_base_at(approach, float(place)) for place in places)
    made = timed(
        hand, phase, q, bases, limits, tips=tips[:, None], touching=(approach.finger,),
        mark=approach.contact_index if phase == "approach" else None,
    )  # fmt: skip
    if made is None:
        return None
    progress = np.interp(made.progress, np.arange(len(places)), places)
    return replace(made, progress=progress)


def _base_at(approach: Approach, place: float) -> pin.SE3:
    if len(approach.bases) == 1:
        return approach.bases[0]
    k = min(int(place), len(approach.bases) - 2)
    return between(approach.bases[k], approach.bases[k + 1], np.array([place - k]))[0]


def _leave(movable: Movable, way: Retreat) -> _Left | str:
    """The way out in time, certified; None where the hand stays."""
    leave = timed(
        movable.hand, "leave", way.path, way.bases, movable.limits, tips=_tips(movable.hand, way)
    )
    found = [] if leave is None else [movable.certify(leave)]
    if found and found[0].faults:
        return f"on the way out, {found[0].faults[0]}"
    return leave, found


def _come(movable: Movable, way: Retreat, start: Configuration | None) -> Transfer | str:
    """The way to the object, where the way in begins."""
    if start is None:
        return Transfer(None, None)
    outside = Configuration(way.path[-1], way.bases[-1])
    transfer = plan_transfer(movable, start, outside, wanted=way.wanted)
    return f"on the way to the object, {transfer}" if isinstance(transfer, str) else transfer


def _tips(hand: Hand, way: Retreat) -> Array | None:
    """Of all fingers along a way of an arm, (K, F, 3); a free hand's base tells enough."""
    if hand.arm is None:
        return None
    return np.array([hand.at(q, X).pad_centres for q, X in zip(way.path, way.bases, strict=True)])


def _guarded_enter(movable: Movable, leave: Trajectory) -> Trajectory:
    """The way out, backwards; no finger is to touch there, and what touches ends it."""
    fingers = tuple(finger.name for finger in movable.hand.fingers)
    return replace(leave.reversed("enter"), guard=Guard(fingers, FORCE_GOAL))
