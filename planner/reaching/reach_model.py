"""The optimiser's problem: one hand, some of its fingers, each pad on its contact.

Unknown: all joints q and the base pose; if the fingers are to move also, for each that touches, its
joints at a stand-off before the contact and at an overshoot behind it, and both distances. If an
arm is to move, the way of the whole hand to the stand-off is kept clear instead. Written down
once per set of fingers; contacts, object, base and cone are parameters.

    minimise    |(q - rest) / range|^2 + 0.05 |s|^2 + shortfall of both distances + price slack
    subject to  pad's ball at p + radius n                     contact, exact
                pad's ball at p + (radius + standoff) n        stand-off
                pad's ball at p + (radius - overshoot) n       overshoot
                pad normal within the cone about -n            wider off the contact
                distance(link sphere) >= its radius + clearance, at contact and stand-off,
                there of what has moved
                base turned from nominal by at most its range, q within limits

A pad's ball is the one that touches a surface of normal n as the pad does (`hand_models.dome`): the
pad itself where that is a sphere, else it goes along as the tip turns.

All rows but the bounds share one slack at a high price, so that every quadratic subproblem has a
solution: without it three in four starts stop at an inconsistent one. What slack is left where the
task cannot be done says by how much.

The base is T = T_start + x, R = R_start MRP(s): near a start, far from the parameters'
singularity at a full turn. Lengths are in units of 50 mm, which makes all rows alike.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import casadi as ca
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from hand_models.hand import Hand
from hand_models.spheres import LinkSpheres
from planner.reaching.reach_kinematics import LENGTH, links_function, pads_function, turned
from planner.reaching.solid import PARAMETERS, RevolvedSolid, signed_distance

Array = NDArray[np.float64]

_RETREATED = (0.5, 1.0)  # shares of an arm's retreat at which the hand is kept out of the object
BESIDE_PAD = 1e-4  # of what is fixed to a touching pad from the object: hulls stand out [m]
_CENTRAL = 0.25  # of the way from the start to mid-range: where the joints rest
_TURN_WEIGHT = 0.05
_KNOT_WEIGHT = 0.1  # stand-off and overshoot postures need not be near
_SHORTFALL_WEIGHT = 5.0
_SLACK_WEIGHT = 2000.0  # large enough that no slack is left where the task can be done

_SQP_OPTIONS = {
    "qpsol": "daqp",
    "qpsol_options": {"error_on_fail": False},
    "hessian_approximation": "limited-memory",
    "max_iter": 50,
    "tol_pr": 1e-5,  # 0.5 um
    "tol_du": 1.0,
    "error_on_fail": False,
    "print_time": False,
    "print_header": False,
    "print_iteration": False,
    "print_status": False,
}
_IPOPT_OPTIONS = {
    "error_on_fail": False,
    "print_time": False,
    "ipopt": {
        "print_level": 0,
        "sb": "yes",
        "tol": 1e-7,
        "max_iter": 100,
        "mu_strategy": "adaptive",
    },
}


Motion = Literal["none", "fingers", "arm"]
"""What retreats to the stand-off: nothing, the fingers with the base held, or the base."""


@dataclass(frozen=True)
class Shape:
    """Sizes of the problem: joints, fingers that touch, their joints, and what moves."""

    nq: int
    contacts: int
    moving: tuple[int, ...]  # joint indices of the touching fingers, finger by finger
    motion: Motion

    @property
    def by_fingers(self) -> bool:
        return self.motion == "fingers"

    @property
    def unknowns(self) -> int:
        extra = 2 * len(self.moving) + 2 * self.contacts if self.by_fingers else 0
        return 7 + self.nq + extra


class ReachModel:
    """The problem for one set of fingers; solvers are made when first asked for.

    Args:
        hand: The hand.
        spheres: Its links for the optimiser.
        fingers: Indices of the fingers that touch, in the order of the contacts.
        motion: What retreats to the stand-off.
    """

    def __init__(
        self, hand: Hand, spheres: LinkSpheres, fingers: tuple[int, ...], *, motion: Motion
    ) -> None:
        self.hand, self.spheres, self.fingers = hand, spheres, fingers
        moving = tuple(int(i) for f in fingers for i in hand.fingers[f].q_indices)
        self.shape = Shape(hand.model.nq, len(fingers), moving, motion)
        self._links = links_function(hand, spheres)
        self._pads = pads_function(hand, fingers)
        self._problem = self._write()

    @cached_property
    def sqp(self) -> ca.Function:
        """Fast, and good near a solution."""
        return ca.nlpsol("reach_sqp", "sqpmethod", self._problem, _SQP_OPTIONS)

    @cached_property
    def ipopt(self) -> ca.Function:
        """Slower, from farther away."""
        return ca.nlpsol("reach_ipopt", "ipopt", self._problem, _IPOPT_OPTIONS)

    def _write(self) -> dict[str, ca.MX]:
        hand, shape = self.hand, self.shape
        w, p = Unknowns(shape), Parameters(shape)
        base = (w.x, w.s, p.R_start, p.T_start)
        postures = [(w.q, p.radii, p.cone)]
        if shape.by_fingers:
            postures.append((w.q_standoff, p.radii + w.standoff * LENGTH, p.wide_cone))
            postures.append((w.q_overshoot, p.radii - w.overshoot * LENGTH, p.wide_cone))
        equal, cones = [], []
        for q, away, cone in postures:
            centres, normals = self._pads(q, *base, p.normals)
            target = p.points + ca.repmat(away.T, 3, 1) * p.normals
            equal.append(ca.vec(centres - target) / LENGTH)
            cones.append((-ca.sum1(normals * p.normals) - cone).T)
        clearances = [self._clearance(w.q, base, p, self._apart)]
        if shape.by_fingers:
            clearances.append(self._clearance(w.q_standoff, base, p, self._moving))
        if shape.motion == "arm":
            for share in _RETREATED:
                away = (w.x + share * p.retreat / LENGTH, *base[1:])
                clearances.append(self._clearance(w.q, away, p, self._apart))
        R = turned(w.s, p.R_start)
        turn = (ca.trace(p.R_nominal.T @ R) - 1) / 2 - p.least_cosine
        gap = ca.vertcat(*equal)
        rows = [gap, -gap, ca.vertcat(*cones), turn, ca.vertcat(*clearances)]
        return {
            "x": w.vector,
            "p": p.vector,
            "f": _cost(hand, w, p, shape),
            "g": ca.vertcat(*rows) + w.slack,
        }

    @property
    def _apart(self) -> NDArray[np.intp]:
        """The spheres that may not touch at the contact: all but the touching pads."""
        touching = np.isin(self.spheres.finger_indices, self.fingers)
        return np.flatnonzero(~(self.spheres.is_pad & touching))

    @property
    def _moving(self) -> NDArray[np.intp]:
        """The spheres that the touching fingers move to the stand-off, pads included."""
        moving = self.shape.moving
        joints = [j for j, x in enumerate(self.hand.model.joints) if j and x.idx_q in moving]
        return np.flatnonzero(np.isin(self.spheres.joints, joints))

    def _clearance(
        self, q: ca.MX, base: tuple[ca.MX, ...], p: Parameters, kept: NDArray[np.intp]
    ) -> ca.MX:
        """Column of distances less radius and clearance, of the spheres kept."""
        spheres = self.spheres
        points = self._links(q, *base)[:, kept.tolist()]
        distance = signed_distance(points, p.solid)
        table = p.table[:3].T @ points - p.table[3]
        nearest = ca.fmin(distance, table).T
        # What is fixed to a touching pad cannot keep the distance, only out of the object.
        apart = ~np.isin(spheres.finger_indices[kept], self.fingers)
        asked = ca.if_else(ca.DM(apart.astype(float)), p.clearance, BESIDE_PAD)
        asked *= ca.DM((~spheres.is_pad[kept]).astype(float) + (spheres.is_pad[kept] & apart))
        return (nearest - spheres.radii[kept] - asked) / LENGTH


class Unknowns:
    """The vector of unknowns and its parts, symbolic."""

    def __init__(self, shape: Shape) -> None:
        self.vector = ca.MX.sym("w", shape.unknowns)
        n, m, k = shape.nq, len(shape.moving), shape.contacts
        ends = np.cumsum([0, 1, 3, 3, n] + ([m, m, k, k] if shape.by_fingers else [])).tolist()
        slack, *parts = ca.vertsplit(self.vector, ends)
        self.slack = slack
        self.x, self.s, self.q = parts[:3]
        if shape.by_fingers:
            self.q_standoff = _with_joints(self.q, shape.moving, parts[3])
            self.q_overshoot = _with_joints(self.q, shape.moving, parts[4])
            self.standoff, self.overshoot = parts[5], parts[6]


class Parameters:
    """The vector of parameters and its parts, symbolic; `pack_parameters` makes the numbers."""

    def __init__(self, shape: Shape) -> None:
        k = shape.contacts
        sizes = [3 * k, 3 * k, k, 9, 3, 9, 1, 1, 1, 1, 3, 4, PARAMETERS, shape.nq]
        self.vector = ca.MX.sym("p", sum(sizes))
        parts = ca.vertsplit(self.vector, np.cumsum([0, *sizes]).tolist())
        self.points, self.normals = (ca.reshape(part, 3, k) for part in parts[:2])
        self.radii = parts[2]
        self.R_start, self.T_start = ca.reshape(parts[3], 3, 3), parts[4]
        self.R_nominal, self.least_cosine = ca.reshape(parts[5], 3, 3), parts[6]
        self.cone, self.wide_cone, self.clearance = parts[7:10]
        self.retreat, self.table, self.solid, self.q_start = parts[10:]


def pack_parameters(
    points: Array,
    normals: Array,
    radii: Array,
    start: pin.SE3,
    nominal: pin.SE3,
    cosines: tuple[float, float, float],
    clearance: float,
    retreat: Array,
    table: Array,
    solid: RevolvedSolid,
    q_start: Array,
) -> Array:
    """The numbers of `Parameters`, in its order.

    Args:
        points, normals: (k, 3) contacts in the world.
        radii: (k,) of the pads [m].
        start, nominal: Base poses: the start, and the middle of the base's range.
        cosines: Of the base's range of rotation, of the cone, and of the cone off the contact.
        clearance: Between link spheres and object or table [m].
        retreat: (3,) way of an arm from the contact to the stand-off [m].
        table: (4,) n, h of the half-space n . p >= h the hand must stay in.
        solid: The object.
        q_start: (nq,) joint positions of the start.
    """
    parts = (
        points.ravel(),
        normals.ravel(),
        radii,
        start.rotation.ravel(order="F"),
        start.translation,
        nominal.rotation.ravel(order="F"),
        [*cosines, clearance],
        retreat,
        table,
        solid.parameters,
        q_start,
    )
    return np.concatenate([np.asarray(part, dtype=np.float64) for part in parts])


def _cost(hand: Hand, w: Unknowns, p: Parameters, shape: Shape) -> ca.MX:
    """Near the start, which is free of self-collision (in mid-range some hands are not), but a
    little off the limits."""
    span = hand.upper - hand.lower
    rest = p.q_start + _CENTRAL * (hand.middle - p.q_start)

    def near(q: ca.MX) -> ca.MX:
        return ca.sumsqr((q - rest) / span)

    cost = _SLACK_WEIGHT * w.slack + near(w.q) + _TURN_WEIGHT * ca.sumsqr(w.s)
    if shape.by_fingers:
        cost += _KNOT_WEIGHT * (near(w.q_standoff) + near(w.q_overshoot))
        cost -= _SHORTFALL_WEIGHT * (ca.sum1(w.standoff) + ca.sum1(w.overshoot))
    return cost


def _with_joints(q: ca.MX, indices: tuple[int, ...], values: ca.MX) -> ca.MX:
    changed = ca.MX(q)
    changed[list(indices)] = values
    return changed
