"""The check of a trajectory: limits, speeds and exact distances at every waypoint."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from hand_models.collision import LinkPair
from hand_models.hand import Hand
from planner.motions.surroundings import OBJECT, ROOM, Surroundings, smallest
from planner.motions.timing import MotionLimits
from planner.motions.trajectory import Array, Trajectory
from planner.reaching.certificate import gap_in_words
from planner.reaching.workspace import Workspace

TOUCHING = 3e-4  # depth below which coal's polygons cannot tell touching from entering [m]
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class MotionCertificate:
    """What was measured on a trajectory, or on several.

    Args:
        waypoints: How many were measured.
        limit_margin: Least distance of a joint from its limits [rad], and that joint.
        limit_joint: Its name.
        speed, acceleration: Largest share of a limit, joints and base [-].
        nearest: The smallest distance to each thing (`ITSELF`, table, boxes, `OBJECT`), with the
            names; the pad of a finger that touches does not count against the object.
        kept: How far from the believed object it had to keep [m].
        faults: What is wrong, in words.
    """

    waypoints: int
    limit_margin: float
    limit_joint: str
    speed: float
    acceleration: float
    nearest: Mapping[str, LinkPair]
    kept: float = 0.0
    faults: tuple[str, ...] = ()


def certify_motion(
    hand: Hand,
    around: Surroundings,
    trajectory: Trajectory,
    limits: MotionLimits,
    *,
    margin: float = 0.0,
    workspace: Workspace | None = None,
) -> MotionCertificate:
    """Measure every waypoint.

    Args:
        around: What must not be met.
        limits: Of speed and acceleration.
        margin: How far from the believed object to stay [m]. A motion that is to touch, up to
            the touch, only has to be outside; behind it the object is not where it is believed,
            and does not count.
        workspace: Where the base may be.
    """
    left = np.minimum(trajectory.q - hand.lower, hand.upper - trajectory.q)
    row, joint = np.unravel_index(int(np.argmin(left)), left.shape)
    speed, acceleration = _shares(hand, trajectory, limits)
    room = ROOM if trajectory.phase == "transfer" else 0.0
    allowed = {body.name: room for body in around.fixed}
    allowed[OBJECT] = -TOUCHING if trajectory.touching else margin
    found = MotionCertificate(
        len(trajectory), float(left[row, joint]), hand.joint_names[joint], speed, acceleration,
        _nearest(around, trajectory), margin,
    )  # fmt: skip
    said = list(_faults(found, allowed))
    if workspace is not None:
        said += _out_of_workspace(trajectory, workspace)
    return replace(found, faults=tuple(said))


def together(certificates: Iterable[MotionCertificate]) -> MotionCertificate:
    """The worst of several, each kind of pair for itself."""
    every = list(certificates)
    tight = min(every, key=lambda one: one.limit_margin)
    nearest = smallest(item for one in every for item in one.nearest.items())
    return MotionCertificate(
        sum(one.waypoints for one in every), tight.limit_margin, tight.limit_joint,
        max(one.speed for one in every), max(one.acceleration for one in every),
        nearest, min(one.kept for one in every),
        tuple(fault for one in every for fault in one.faults),
    )  # fmt: skip


def _nearest(around: Surroundings, trajectory: Trajectory) -> dict[str, LinkPair]:
    """The smallest distance to each thing over all waypoints."""
    guard = trajectory.guard
    last = np.inf if guard is None or guard.expected is None else guard.expected + _ROUNDING
    touching = [trajectory.touching if time <= last else None for time in trajectory.times]
    return around.nearest(trajectory.q, trajectory.bases, touching)


def _shares(hand: Hand, trajectory: Trajectory, limits: MotionLimits) -> tuple[float, float]:
    """Largest shares of the speed and acceleration limits, told and as the waypoints show."""
    most, dt = limits.joint_speeds(hand), np.diff(trajectory.times)[:, None]
    shown = np.abs(np.diff(trajectory.q, axis=0)) / dt
    speed = max(np.max(shown / most), np.max(np.abs(trajectory.velocities) / most))
    gone = np.linalg.norm(np.diff([X.translation for X in trajectory.bases], axis=0), axis=1)
    speed = max(speed, np.max(gone / dt[:, 0]) / limits.base_speed)
    gain = np.abs(np.diff(trajectory.velocities, axis=0)) / dt
    return float(speed), float(np.max(gain) / limits.joint_acceleration)


def _faults(found: MotionCertificate, allowed: dict[str, float]) -> Iterator[str]:
    if found.limit_margin < -_ROUNDING:
        yield f"{found.limit_joint} is {-found.limit_margin:.3f} rad beyond its limit"
    for word, share in (("speed", found.speed), ("acceleration", found.acceleration)):
        if share > 1.0 + 1e-6:
            yield f"a joint's {word} is {share:.2f} of its limit"
    for thing, pair in found.nearest.items():
        if pair.distance < allowed.get(thing, 0.0):
            yield gap_in_words(pair)


def _out_of_workspace(trajectory: Trajectory, workspace: Workspace) -> Iterator[str]:
    R: Array = np.array([X.rotation for X in trajectory.bases])
    out = workspace.violation(R, np.array([X.translation for X in trajectory.bases]))
    if out.max() > 1e-6:
        yield f"the base is {1e3 * out.max():.0f} mm out of its workspace"
