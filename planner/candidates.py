"""Contacts this hand can really make: postures of the hand laid onto the believed surface.

Idea: a posture fixes where the pads are relative to each other. Laying it onto the surface leaves
the six coordinates of the hand's base, which are found for hundreds of postures at once: pads on
the surface, pad normals against it, heights inside the object. They start from what the hand can
do on cylinders of that radius (`reach_map`). What comes out is a set of contact triples with the
joint angles and the base pose that nearly make them; `reach` makes them exact.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from estimator.surface import SurfaceOfRevolution
from estimator.vectors import Array, Index, Mask, unit
from planner.reaching.clear import clear_of
from planner.reaching.laying import Laid, lay
from planner.reaching.reach_map import ReachMap
from planner.reaching.turning import Room, clear_turns, evenly, turned
from planner.reaching.workspace import Workspace

END_MARGIN = 0.08  # of the believed height, kept from both ends
FITTING = 5  # steps from a cylinder to the believed surface
TURNS, IN_ROOM = 48, 16  # about the object's axis, for a bounded base and for a free one
GAP = 2e-3  # of a laid pad from the surface that reach will close [m]
FREE, EMPTY = Workspace(), Room()


@dataclass(frozen=True, eq=False)
class Candidates:
    """N placements of the hand with m fingers on the believed surface.

    Args:
        fingers: Which of the hand's fingers touch, (N, m).
        q: Joint positions, (N, nq).
        R_WB, p_WB: Pose of the hand base, (N, 3, 3), (N, 3) [m].
        theta, z: Places on the believed surface, (N, m) [rad], [m].
        pad_angle: Between pad normal and inward surface normal, (N, m) [rad].
        rejected: How many placements fell, by reason, in order.
    """

    fingers: Index
    q: Array
    R_WB: Array
    p_WB: Array
    theta: Array
    z: Array
    pad_angle: Array
    rejected: tuple[tuple[str, int], ...]

    def __len__(self) -> int:
        return len(self.q)

    def take(self, index: Index) -> Candidates:
        return Candidates(
            self.fingers[index],
            self.q[index],
            self.R_WB[index],
            self.p_WB[index],
            self.theta[index],
            self.z[index],
            self.pad_angle[index],
            self.rejected,
        )

    def base(self, i: int) -> pin.SE3:
        return pin.SE3(self.R_WB[i], self.p_WB[i])


def placement_candidates(
    reach_map: ReachMap,
    surface: SurfaceOfRevolution,
    *,
    count: int,
    rng: np.random.Generator,
    workspace: Workspace = FREE,
    room: Room = EMPTY,
    fingers_at_once: int = 3,
) -> Candidates:
    """Placements with several fingers on the surface at once.

    Args:
        reach_map: Of the hand; its cone holds here, too.
        count: How many of its placements are fitted to the surface.
        fingers_at_once: Contacts per placement, at most the hand's fingers.
        workspace: Where the hand's base may be.
        room: What stands about the object.
    """
    hand, cone = reach_map.hand, reach_map.cone
    poses, fingers = reach_map.draw(surface, fingers_at_once, count=count, rng=rng)
    laid = lay(hand, surface, poses, fingers, cone=cone, iterations=FITTING)
    return _kept(reach_map, surface, fingers, laid, workspace, room)


def _kept(
    reach_map: ReachMap,
    surface: SurfaceOfRevolution,
    fingers: Index,
    laid: Laid,
    workspace: Workspace,
    room: Room,
) -> Candidates:
    """The placements that hold, and a count of those that do not, by reason."""
    low, high = surface.profile.z_range
    margin = END_MARGIN * (high - low)
    alive, told = _passed(
        len(laid.q),
        ("pads off the surface", np.all(np.abs(laid.gap) < GAP, axis=1)),
        ("pad turned away", np.all(laid.pad_angle < reach_map.cone, axis=1)),
        ("beyond the ends", np.all((laid.z > low + margin) & (laid.z < high - margin), axis=1)),
    )
    told = (("placements fitted", len(laid.q)), *told)
    fingers, laid, hand = fingers[alive], laid.take(alive), reach_map.hand
    free = clear_of(hand, reach_map.spheres, surface.profile, laid.q, laid.R_OB, laid.p_OB)
    fingers, laid = fingers[free], laid.take(np.flatnonzero(free))
    best = _turned_best(reach_map, surface, laid, workspace, room)
    alive, more = _passed(
        len(laid.q),
        ("base outside its workspace", best.within),
        ("in the table or a box, turned whichever way", best.clear),
    )
    rejected = (*told, ("links inside the object", int(np.sum(~free))), *more)
    return Candidates(
        fingers, laid.q, best.R_WB, best.p_WB, best.theta, laid.z, laid.pad_angle, rejected
    ).take(alive)  # fmt: skip


class _Turned(NamedTuple):
    """Poses of the base (N, 3, 3), (N, 3) and angles of the contacts (N, m) after a turn about the
    object's axis; whether the base is then in its workspace, and clear of the room, (N,)."""

    R_WB: Array
    p_WB: Array
    theta: Array
    within: Mask
    clear: Mask


def _passed(count: int, *tests: tuple[str, Mask]) -> tuple[Index, tuple[tuple[str, int], ...]]:
    """What passes all tests, and how many each refused of those that had passed so far."""
    alive, told = np.arange(count), []
    for reason, passed in tests:
        told.append((reason, int(np.sum(~passed[alive]))))
        alive = alive[passed[alive]]
    return alive, tuple(told)


def _turned_best(
    reach_map: ReachMap, surface: SurfaceOfRevolution, laid: Laid, workspace: Workspace, room: Room
) -> _Turned:
    """Each after the turn that suits workspace and room best; as it was laid, if that will do."""
    free = workspace.X_WB is None
    angles = evenly(TURNS if not free else 1 if room.is_empty else IN_ROOM)
    R, p = turned(surface, laid.R_OB, laid.p_OB, angles)
    within = workspace.allows(R, p)
    clear = clear_turns(room, reach_map.hand, reach_map.spheres, laid.q, R, p)
    cost = workspace.distance(R, p) + 1e3 * ~within + 1e2 * ~clear
    best, rows = np.argmin(cost, axis=0), np.arange(len(laid.q))
    theta = np.angle(np.exp(1j * (laid.theta + angles[best, None])))
    return _Turned(
        R[best, rows], p[best, rows], theta, within[best, rows], clear[best, rows]
    )  # fmt: skip


def single_candidates(
    reach_map: ReachMap,
    surface: SurfaceOfRevolution,
    *,
    count: int,
    rng: np.random.Generator,
    workspace: Workspace = FREE,
    room: Room = EMPTY,
) -> Candidates:
    """Placements of the hand with one finger on the surface: every place an arm can bring it to.

    The pad is put at a random place with its normal within half the cone, at a random roll; the
    posture is drawn from the library, not from the map's cylinders: one finger reaches everywhere.
    """
    hand, postures, cone = reach_map.hand, reach_map.postures, reach_map.cone
    fingers = rng.integers(len(hand.fingers), size=(count, 1)).astype(np.intp)
    chosen = rng.choice(len(postures), size=count, replace=count > len(postures))
    rows = np.arange(count)
    centre = postures.pad_centres[chosen][rows, fingers[:, 0]]
    normal = postures.pad_normals[chosen][rows, fingers[:, 0]]
    low, high = surface.profile.z_range
    inset = (END_MARGIN + 0.02) * (high - low)
    theta = rng.uniform(-np.pi, np.pi, size=count)
    z = rng.uniform(low + inset, high - inset, size=count)
    place = surface.at(theta, z)
    radius = np.array([f.pad_radius for f in hand.fingers])[fingers[:, 0]]
    inward = unit(-place.n + 0.5 * np.tan(cone) * _in_disc(count, rng) * unit(place.k_z))
    R_WB = _aligning(normal, inward, rng)
    p_W = place.p + radius[:, None] * place.n
    p_WB = p_W - np.einsum("nij,nj->ni", R_WB, centre)
    frame = surface.frame
    laid = Laid(
        q=postures.q[chosen],
        R_OB=np.einsum("ij,njk->nik", frame, R_WB),
        p_OB=(p_WB - surface.axis.point) @ frame.T,
        theta=theta[:, None],
        z=z[:, None],
        gap=np.zeros((count, 1)),
        pad_angle=np.arccos(np.clip(-np.sum(inward * place.n, axis=1), -1.0, 1.0))[:, None],
    )
    return _kept(reach_map, surface, fingers, laid, workspace, room)


def _in_disc(count: int, rng: np.random.Generator) -> Array:
    return rng.uniform(-1.0, 1.0, size=(count, 1))


def _aligning(a: Array, b: Array, rng: np.random.Generator) -> Array:
    """Rotations (N, 3, 3) that take units a to b, the roll about b random."""

    def frames(v: Array, roll: Array) -> Array:
        helper = unit(np.cross(v, np.eye(3)[np.argmin(np.abs(v), axis=1)]))
        other = np.cross(v, helper)
        c, s = np.cos(roll)[:, None], np.sin(roll)[:, None]
        return np.stack([v, c * helper + s * other, c * other - s * helper], axis=2)

    roll = rng.uniform(-np.pi, np.pi, size=len(a))
    return np.asarray(frames(b, roll) @ np.swapaxes(frames(a, np.zeros(len(a))), 1, 2))
