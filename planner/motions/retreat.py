"""The way out after touching: straight, never nearer to the object, and clear of where it may be.

The fingers go back to their stand-offs first; then the base takes the hand away along one of a few
directions. A hand that holds an object on all sides gets out along its axis, one that touches from
one side goes back the way it came.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from estimator.belief import Belief
from estimator.estimate import CHI_95
from estimator.vectors import Array, frozen, unit
from hand_models.batch import batch_placements
from hand_models.hand import Hand
from hand_models.spheres import LinkSpheres

FARTHEST = 0.4  # way of the base [m]
STEP = 0.01
NEARER = 5e-4  # by how much a step may come nearer, spheres being no links [m]


@dataclass(frozen=True, eq=False)
class Retreat:
    """How the hand leaves an object it touched.

    Args:
        q: Joint positions at the beginning: the fingers at their stand-offs [rad].
        path: Joint positions on the way, (K, nq): q throughout, unless an arm moves the hand [rad].
        bases: K poses of the hand base, from the stand-off on (`X_WB`).
        clearance: Least distance of hand and believed object at the end [m].
        wanted: How far off the object's wall may be, with 95 % probability [m].
        nearest: Least distance on the way [m].
    """

    q: Array
    path: Array
    bases: tuple[pin.SE3, ...]
    clearance: float
    wanted: float
    nearest: float

    @property
    def is_clear(self) -> bool:
        """Whether it ends clear of wherever the object may be."""
        return self.clearance >= self.wanted


def plan_retreat(
    hand: Hand, spheres: LinkSpheres, belief: Belief, q: Array, X_WB: pin.SE3, normals: Array
) -> Retreat:
    """The first of the ways out."""
    return ways_out(hand, spheres, belief, q, X_WB, normals)[0]


def ways_out(
    hand: Hand, spheres: LinkSpheres, belief: Belief, q: Array, X_WB: pin.SE3, normals: Array
) -> tuple[Retreat, ...]:
    """Straight ways out of the base: those that end clear, the shortest first, then the clearest.

    Args:
        q: Joints with the fingers at their stand-offs, (nq,).
        X_WB: Pose of the hand base there.
        normals: Outward normals of the contacts, (k, 3).
    """
    wanted = wall_95(belief)
    centres = spheres.positions(batch_placements(hand, q[None]))[0] @ X_WB.rotation.T
    way = np.arange(0.0, FARTHEST + STEP, STEP)
    ways = []
    for direction in _directions(belief, X_WB, normals):
        moved = centres + X_WB.translation + way[:, None, None] * direction
        gaps = np.min(belief.surface.signed_distance(moved) - spheres.radii, axis=1)
        end = _end(gaps, wanted)
        bases = tuple(
            pin.SE3(X_WB.rotation, X_WB.translation + s * direction) for s in way[: end + 1]
        )
        path, nearest = np.repeat(q[None], len(bases), axis=0), float(gaps[: end + 1].min())
        ways.append(Retreat(frozen(q), frozen(path), bases, float(gaps[end]), wanted, nearest))
    return tuple(sorted(ways, key=lambda way: (-min(way.clearance, wanted), len(way.bases))))


def _end(gaps: Array, wanted: float) -> int:
    """Where to stop: clear, or just before a step that comes nearer again."""
    nearer = np.nonzero(np.diff(gaps) < -NEARER)[0]
    last = int(nearer[0]) if len(nearer) else len(gaps) - 1
    clear = np.nonzero(gaps[: last + 1] >= wanted)[0]
    return int(clear[0]) if len(clear) else last


def _directions(belief: Belief, X_WB: pin.SE3, normals: Array) -> list[Array]:
    """Back along the contacts' normals, out from the axis, and along it either way."""
    axis = belief.axis
    out = X_WB.translation - axis.foot(X_WB.translation)
    tried = [axis.direction, -axis.direction]
    for v, least in ((normals.sum(axis=0), 0.5), (out, 1e-3)):
        if np.linalg.norm(v) > least:
            tried.append(unit(v))
    return tried


def wall_95(belief: Belief) -> float:
    """How far the object's wall may be from where it is believed, with 95 % probability [m]."""
    C = belief.covariance
    arm = 0.5 * (belief.band.z[-1] - belief.band.z[0])
    shift, tilt = (np.linalg.eigvalsh(C[k : k + 2, k : k + 2])[-1] for k in (0, 2))
    tilt = min(tilt, (0.25 * np.pi) ** 2)
    return CHI_95 * float(np.sqrt(shift + arm**2 * tilt + np.max(belief.band.sd) ** 2))
