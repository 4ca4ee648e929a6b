"""Hold a solution of the optimiser against the rules of its task: certificates and faults."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from hand_models.collision import HandCollision
from hand_models.hand import Hand
from planner.motions.surroundings import fixed_bodies
from planner.reaching.certificate import Certificate, Tolerances, certify, faults, gap_in_words
from planner.reaching.reach_task import ReachOptions, ReachTask, Solution

Array = NDArray[np.float64]

_RETREATED = (0.33, 0.67, 1.0)  # shares of an arm's retreat that are checked
_OUT_OF_RANGE = 1e-5  # of the base [m]
_ROUNDED = 1e-6  # of lengths [m]
_PRESSED = (0.0, 0.25, 0.5, 0.75, 1.0)  # shares of a finger's overshoot that are checked


@dataclass(frozen=True)
class Inspection:
    """What was found.

    Attributes:
        at: Certificate of the contact.
        before: Of the stand-off; `at` itself if nothing moves.
        faults: What is wrong, in words, the gravest first; none for a good solution.
    """

    at: Certificate
    before: Certificate
    faults: tuple[str, ...]


def inspect(
    hand: Hand, collision: HandCollision, task: ReachTask, found: Solution, *, by_fingers: bool
) -> Inspection:
    """Check contact, stand-off, the arm's way between them, and the fingers' overshoot.

    Args:
        by_fingers: Whether the fingers have stand-offs and overshoots of their own.
    """
    options, fingers = task.options, found.fingers
    allowed = _tolerances(options)
    at = _certificate(hand, collision, task, found, 0.0)
    before, said = at, list(faults(hand, at, found.q, fingers, allowed))
    said.extend(_base_faults(options, found))
    wide = replace(allowed, cone=max(options.cone, options.off_contact_cone))
    by_arm = bool(np.any(found.retreat))
    shares = _RETREATED if by_arm else (1.0,) if by_fingers else ()
    for share in shares:
        before = _certificate(hand, collision, task, found, share)
        wrong = faults(hand, before, found.q_standoff, fingers, wide)
        said.extend(f"at stand-off: {fault}" for fault in wrong)
    for share in (0.0, *shares):
        said.extend(_room_faults(hand, collision, options, found, share))
    if by_fingers:
        said.extend(_way_faults(options, found))
        said.extend(_pressing_faults(hand, collision, options, found))
    return Inspection(at, before, tuple(said))


def _base_faults(options: ReachOptions, found: Solution) -> Iterator[str]:
    """A base that is not where the arm can hold it at the contact."""
    X_WB = found.X_WB
    out = float(options.workspace.violation(X_WB.rotation[None], X_WB.translation[None])[0])
    if out > _OUT_OF_RANGE:
        yield f"the hand base is {1e3 * out:.1f} mm beyond its workspace, a turn as its arc"


def _tolerances(options: ReachOptions) -> Tolerances:
    return Tolerances(
        position=options.position_tolerance,
        cone=options.cone,
        self_clearance=options.self_clearance,
        object_clearance=options.clearance,
        pad_depth=options.pad_depth,
    )


def _certificate(
    hand: Hand, collision: HandCollision, task: ReachTask, found: Solution, share: float
) -> Certificate:
    """Of the contact (share 0), or of a share of the way to the stand-off."""
    by_arm = np.any(found.retreat)
    away = found.retreat if by_arm else found.standoff[:, None] * task.normals
    return certify(
        hand,
        collision,
        *_posture(found, share),
        task.solid,
        fingers=found.fingers,
        points=task.points + share * away,
        normals=task.normals,
    )


def _posture(found: Solution, share: float) -> tuple[Array, pin.SE3]:
    """Joints and base at the contact (share 0), or at a share of the way to the stand-off."""
    X_WB = pin.SE3(found.X_WB.rotation, found.X_WB.translation + share * found.retreat)
    return (found.q if share == 0.0 else found.q_standoff), X_WB


def _room_faults(
    hand: Hand, collision: HandCollision, options: ReachOptions, found: Solution, share: float
) -> Iterator[str]:
    """Links too near to table or boxes; pads may be as near as they like, but not in them."""
    pads, where = {finger.name for finger in hand.fingers}, _posture(found, share)
    for body in fixed_bodies(options.table, options.boxes):
        link, anything = (collision.nearest_to(*where, body, touching=t) for t in (pads, ()))
        if link.distance < options.clearance:
            yield gap_in_words(link)
        elif anything.distance < 0.0:
            yield gap_in_words(anything)


def _way_faults(options: ReachOptions, found: Solution) -> Iterator[str]:
    """Fingers whose straight way is too short, before the contact or behind it."""
    ends = (("before", found.standoff, options.least_standoff),
            ("behind", found.overshoot, options.least_overshoot))  # fmt: skip
    for where, lengths, least in ends:
        for name, length in zip(found.fingers, lengths.tolist(), strict=True):
            if length < least - _ROUNDED:
                short = f"{1e3 * (least - length):.1f} mm too short {where} its contact"
                yield f"{name}: its straight way is {short}"


def _pressing_faults(
    hand: Hand, collision: HandCollision, options: ReachOptions, found: Solution
) -> Iterator[str]:
    """One finger presses on behind its contact while the others wait at their stand-offs.

    The object is no obstacle then: were it where it is believed, the finger had stopped.
    """
    for name in found.fingers:
        joints = hand.finger(name).q_indices
        for share in _PRESSED:
            q = found.q_standoff.copy()
            q[joints] = (1.0 - share) * found.q[joints] + share * found.q_overshoot[joints]
            if options.self_clearance <= 0.0 and collision.is_self_free(q):
                continue  # fewer pairs than the nearest needs
            pair = collision.self_clearance(q)
            if pair.distance < options.self_clearance:
                yield f"{name} beyond its contact: {gap_in_words(pair)}"
                break
