"""How a grasp is carried out: the hand comes in with open fingers, then all fingers close."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from estimator.vectors import Array, Mask, frozen, unit
from hand_models.batch import batch_placements
from hand_models.collision import HandCollision
from hand_models.hand import Hand
from hand_models.spheres import LinkSpheres
from planner.grasping.closing import Bodies
from planner.grasping.grasp_outcome import Grasp
from planner.motions.motion import Approach
from planner.reaching.clear import INTRUSION
from planner.reaching.reach import Reach
from planner.reaching.reach_task import ReachOptions
from planner.reaching.solid import RevolvedSolid

STEPS = 6  # base poses of the way in
BEFORE, BEHIND = 16, 12  # waypoints from the pre-grasp to the grasp, and beyond it
_MET = 3e-4  # depth below which coal's polygons cannot tell touching from entering [m]


def closing_path(hand: Hand, reach: Reach, approaches: tuple[Approach, ...]) -> Array:
    """All fingers together from their stand-offs to the contacts and beyond, (K, nq) [rad].

    Each finger moves along its own approach, all at the same share of their ways; row `BEFORE` is
    the grasp.
    """
    path = np.repeat(reach.q_standoff[None], BEFORE + BEHIND + 1, axis=0)
    for approach in approaches:
        joints = hand.finger(approach.finger).q_indices
        last = len(approach.path) - 1
        ahead = np.linspace(0.0, approach.contact_index, BEFORE + 1)
        at = np.concatenate([ahead, np.linspace(approach.contact_index, last, BEHIND + 1)[1:]])
        for j in joints:
            path[:, j] = np.interp(at, np.arange(last + 1), approach.path[:, j])
    return frozen(path)


def closed_posture(hand: Hand, grasp: Grasp, travel: Array) -> Array:
    """Joint positions when each finger has stopped, (nq,) [rad].

    Args:
        travel: Of each finger beyond its planned contact, negative before it, (m,) [m].
    """
    q, rows = grasp.q_pregrasp.copy(), np.arange(len(grasp.path))
    before, behind = grasp.closings.before[0], grasp.closings.behind[0]
    last = len(rows) - 1
    for j, name in enumerate(grasp.fingers):
        ways, at = [-before[j], 0.0, behind[j]], [0.0, grasp.contact_index, last]
        row = np.interp(travel[j], ways, at)
        for i in hand.finger(name).q_indices:
            q[i] = np.interp(row, rows, grasp.path[:, i])
    return q


def closing_fault(
    collision: HandCollision, path: Array, reach: Reach, solid: RevolvedSolid
) -> str | None:
    """What is in the way between pre-grasp and grasp; None if nothing is."""
    for k in range(0, BEFORE + 1, 4):
        pair = collision.self_clearance(path[k])
        if pair.distance < 0.0:
            return f"{pair.first} and {pair.second} meet while closing"
        near = collision.object_clearance(path[k], reach.X_WB, solid.slices, solid.X_WO)
        link, distance = near.nearest()
        if distance < -_MET:
            return f"{link} meets the object while closing"
    return None


def way_in(
    hand: Hand,
    collision: HandCollision,
    spheres: LinkSpheres,
    reach: Reach,
    solid: RevolvedSolid,
    options: ReachOptions,
    *,
    length: float,
) -> tuple[pin.SE3, ...] | None:
    """Base poses from afar to the pre-grasp, straight, open fingers held, all of it clear.

    Of several directions (away from the axis, along it, between) the one that keeps the hand
    farthest from the believed object is taken; a direction counts when the exact check agrees.

    Args:
        length: Of the way [m].
    Returns:
        STEPS + 1 poses, the last the pre-grasp's; None if no direction is clear.
    """
    share = np.linspace(1.0, 0.0, STEPS + 1)
    directions = _directions(reach.X_WB.translation, solid.X_WO)
    offsets = length * share[:-1, None] * directions[:, None]  # (D, STEPS, 3)
    room = _room(hand, spheres, reach, solid, options, offsets)
    for i in np.argsort(-room, kind="stable"):
        bases = [pin.SE3(reach.X_WB.rotation, reach.X_WB.translation + x) for x in offsets[i]]
        far = bases[0]
        if not options.workspace.allows(far.rotation[None], far.translation[None])[0]:
            continue
        if all(_clear(collision, reach.q_standoff, X, solid, options.clearance) for X in bases):
            return (*bases, reach.X_WB)
    return None


def standing_clear(
    hand: Hand, spheres: LinkSpheres, bodies: Bodies, q: Array, X_WB: pin.SE3
) -> Mask:
    """Whether the hand in a posture is outside each body, by its spheres, (B,)."""
    local = spheres.positions(batch_placements(hand, q[None]))[0]
    world = local @ X_WB.rotation.T + X_WB.translation
    return np.asarray(np.all(bodies.signed_distance(world) - spheres.radii > -INTRUSION, axis=1))


def _directions(base: Array, X_WO: pin.SE3) -> Array:
    """Away from the axis, along it either way, between these, and the axis' other side."""
    u = X_WO.rotation[:, 2]
    away = base - X_WO.translation
    away = unit(away - (away @ u) * u)
    side = np.cross(u, away)
    ways = [away, u, -u, away + u, away - u, away + side, away - side]
    return np.array([unit(way) for way in ways])


def _room(
    hand: Hand,
    spheres: LinkSpheres,
    reach: Reach,
    solid: RevolvedSolid,
    options: ReachOptions,
    offsets: Array,
) -> Array:
    """(D,) mean over the way of the least distance of a link from object and table [m]."""
    local = spheres.positions(batch_placements(hand, reach.q_standoff[None]))[0]
    here = local @ reach.X_WB.rotation.T + reach.X_WB.translation
    world = here + offsets[:, :, None]
    clearance = solid.distance(world) - spheres.radii
    if options.table is not None:
        above = world @ np.array(options.table[:3]) - options.table[3] - spheres.radii
        clearance = np.minimum(clearance, above)
    return np.asarray(clearance.min(axis=2).mean(axis=1))


def _clear(
    collision: HandCollision, q: Array, X_WB: pin.SE3, solid: RevolvedSolid, clearance: float
) -> bool:
    near = collision.object_clearance(q, X_WB, solid.slices, solid.X_WO)
    return bool(min(near.distances.min(), near.pads.min()) >= clearance)
