"""Through free space: from one configuration of hand and base to another, past everything.

Straight first, joints and base together. Where something is in the way, RRT-Connect (Kuffner and
LaValle 2000, from OMPL) looks for a way round over joints and base, its path is shortened, and its
corners are rounded as far as the way stays clear.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pinocchio as pin

from hand_models.broadphase import Among
from hand_models.collision import HandCollision
from hand_models.hand import Hand
from planner.motions.motion_certificate import MotionCertificate, certify_motion
from planner.motions.sampled_path import sampled_path
from planner.motions.surroundings import ITSELF, OBJECT, ROOM, Surroundings, smallest, surroundings
from planner.motions.timing import MotionLimits, timed
from planner.motions.trajectory import Array, Configuration, Trajectory, between
from planner.reaching.certificate import gap_in_words
from planner.reaching.reach_task import ReachOptions
from planner.reaching.solid import RevolvedSolid
from planner.reaching.workspace import Workspace

POINTS = 25  # of a straight piece of the path
CHECKS = 2500  # of configurations, by the sampling planner, before it gives up
_WINDOWS = (0.4, 0.2, 0.1, 0.0)  # over which corners are rounded, shares of the path
_SLACK = 1e-3  # nearer than the ends' own distance may the way be [m]


@dataclass(frozen=True, eq=False)
class Movable:
    """A hand that is to be moved, and the rules.

    Args:
        hand: The hand.
        around: What must not be met.
        limits: Of speed and acceleration.
        workspace: Where the base may be.
        seed: Of the sampling planner.
    """

    hand: Hand
    around: Surroundings
    limits: MotionLimits
    workspace: Workspace
    seed: int = 0

    @property
    def base_stays(self) -> bool:
        """Whether only joints move: those of an arm, or of a hand whose base is fixed."""
        return self.hand.arm is not None or self.workspace.is_fixed

    def certify(self, trajectory: Trajectory, margin: float = 0.0) -> MotionCertificate:
        """Measure a trajectory by the rules."""
        return certify_motion(
            self.hand, self.around, trajectory, self.limits,
            margin=margin, workspace=self.workspace,
        )  # fmt: skip


def movable_among(
    hand: Hand,
    collision: HandCollision,
    solid: RevolvedSolid,
    rules: ReachOptions,
    limits: MotionLimits,
) -> Movable:
    """A hand about a believed object, by the rules of its reach."""
    around = surroundings(collision, solid, rules.table, rules.boxes)
    return Movable(hand, around, limits, rules.workspace)


@dataclass(frozen=True, eq=False)
class Transfer:
    """A certified way through free space.

    Args:
        trajectory: In time; None where there is nothing to move.
        certificate: Of it, or of the place where the hand stays.
        sampled: Whether it had to go round something.
    """

    trajectory: Trajectory | None
    certificate: MotionCertificate | None
    sampled: bool = False


def plan_transfer(
    movable: Movable, begin: Configuration, end: Configuration, *, wanted: float
) -> Transfer | str:
    """The way from one configuration to another, or in words why there is none.

    Args:
        wanted: How far to stay from the believed object; less where begin or end are nearer [m].
    """
    margin = wanted
    for word, place in (("where it starts", begin), ("where it ends", end)):
        near = smallest(movable.around.pairs(place.q, place.X_WB))
        margin = min(margin, near.pop(OBJECT).distance - _SLACK)
        for thing, pair in near.items():
            if pair.distance < (0.0 if thing == ITSELF else ROOM):
                return f"{gap_in_words(pair)} {word}"
    direct, free = _line(begin, end), movable.around.keeping(margin)
    straight = _blocked(movable, free, direct, margin) or _timed(movable, direct, margin)
    if not isinstance(straight, str):
        return straight
    found = sampled_path(movable, begin, end, free, checks=CHECKS)
    if found is None:
        return f"straight, {straight}, and no way round in {CHECKS} configurations"
    return _rounded(movable, found, margin)


def _rounded(movable: Movable, corners: list[Configuration], margin: float) -> Transfer | str:
    """The path through these, its corners rounded as far as it stays clear."""
    path = _line(*corners)
    fault = ""
    for window in _WINDOWS:
        made = _timed(movable, _smooth(*path, window), margin)
        if isinstance(made, Transfer):
            return Transfer(made.trajectory, made.certificate, sampled=True)
        fault = made
    return f"on the way round, {fault}"


def _blocked(
    movable: Movable, free: Among, path: tuple[Array, tuple[pin.SE3, ...]], margin: float
) -> str | None:
    """What is in the way at the first point of a path that is not free: cheaper than its times."""
    least = {body.name: ROOM for body in movable.around.fixed} | {ITSELF: 0.0, OBJECT: margin}
    for q, X_WB in zip(*path, strict=True):
        if free.is_free(q, X_WB):
            continue
        for thing, pair in movable.around.pairs(q, X_WB):
            if pair.distance < least[thing]:
                return gap_in_words(pair)
    return None


def _timed(
    movable: Movable, path: tuple[Array, tuple[pin.SE3, ...]], margin: float
) -> Transfer | str:
    """The path in time, certified, or its first fault."""
    try:
        trajectory = timed(movable.hand, "transfer", *path, movable.limits)
    except ArithmeticError as error:
        return str(error)
    if trajectory is None:
        return Transfer(None, None)
    certificate = movable.certify(trajectory, margin)
    if certificate.faults:
        return certificate.faults[0]
    return Transfer(trajectory, certificate)


def _line(*corners: Configuration) -> tuple[Array, tuple[pin.SE3, ...]]:
    """Points on straight pieces between configurations."""
    share = np.linspace(0.0, 1.0, POINTS)
    q, bases = [corners[0].q[None]], [corners[0].X_WB]
    for a, b in pairwise(corners):
        q.append(a.q + share[1:, None] * (b.q - a.q))
        bases += between(a.X_WB, b.X_WB, share[1:])
    return np.vstack(q), tuple(bases)


def _smooth(
    q: Array, bases: tuple[pin.SE3, ...], window: float
) -> tuple[Array, tuple[pin.SE3, ...]]:
    """A moving average along the path that narrows towards its ends, which stay."""
    width = int(window * len(q)) // 2
    if width == 0:
        return q, bases
    turns = np.array([pin.Quaternion(X.rotation).coeffs() for X in bases])
    for k in range(1, len(turns)):
        turns[k] *= 1.0 if turns[k] @ turns[k - 1] >= 0.0 else -1.0
    rows = np.hstack([q, [X.translation for X in bases], turns])
    mean = np.array([_mean_about(rows, k, width) for k in range(len(rows))])
    n = q.shape[1]
    poses = (pin.SE3(_rotation(row[n + 3 :]), row[n : n + 3]) for row in mean)
    return mean[:, :n], tuple(poses)


def _mean_about(rows: Array, k: int, width: int) -> Array:
    half = min(k, len(rows) - 1 - k, width)
    return np.asarray(rows[k - half : k + half + 1].mean(axis=0))


def _rotation(xyzw: Array) -> Array:
    return np.asarray(pin.Quaternion(xyzw / np.linalg.norm(xyzw)).matrix())
