"""The quick way to a reach: compiled Gauss-Newton on contact, stand-off and overshoot at once.

A hundred times faster than the optimiser's problem, and it knows less: no cost, full stand-offs or
none, the worst link spheres only. What it finds goes through the same inspection.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from estimator.vectors import Array
from hand_models.chains import chains_of, records
from hand_models.hand import Hand
from hand_models.spheres import LinkSpheres
from planner.kinematics.demands import CONTACT, KNOT, SETTING, SPHERE, Demands
from planner.kinematics.settling import BASE_UNITS, settle
from planner.reaching.reach_kinematics import LENGTH
from planner.reaching.reach_model import BESIDE_PAD
from planner.reaching.reach_task import HULL_MARGIN, NO_TABLE, ReachTask, Solution
from planner.reaching.starts import Start
from planner.reaching.straight import extended

ITERATIONS = 60
SOLVED = 4e-3  # violation up to which a solution is worth inspecting: 0.2 mm
_JOINT = 1.0  # how willingly a joint moves [rad]
_FREE_TRAVEL = 0.15  # of a free base from its start [m]


@dataclass(frozen=True, eq=False)
class _Knots:
    """Which joints are the touching fingers', and the unknown of each joint at each knot."""

    moving: NDArray[np.intp]
    columns: NDArray[np.intp]

    @property
    def unknowns(self) -> int:
        knots, nq = self.columns.shape
        return int(nq + 6 + len(self.moving) * (knots - 1))


def settled(
    hand: Hand, spheres: LinkSpheres, task: ReachTask, start: Start, *, by_fingers: bool
) -> Solution:
    """From a start to a solution, good or not; to be inspected.

    Stand-off and overshoot are as asked; where that fails, the least that will do, and from there
    as far as each finger goes alone.

    Args:
        by_fingers: Whether the fingers go to stand-off and overshoot; else the contact only.
    """
    if not by_fingers:
        return _settled(hand, spheres, task, start, None)
    options = task.options
    whole = _settled(hand, spheres, task, start, (options.standoff, options.overshoot))
    if whole.violation < SOLVED:
        return whole
    least = (options.least_standoff, options.least_overshoot)
    short = _settled(hand, spheres, task, start, least)
    if short.violation < SOLVED:
        return extended(hand, task, short)
    return min((whole, short), key=lambda solution: solution.violation)


def _settled(
    hand: Hand,
    spheres: LinkSpheres,
    task: ReachTask,
    start: Start,
    strokes: tuple[float, float] | None,
) -> Solution:
    """With these stand-off and overshoot of all fingers [m]; None for the contact alone."""
    options, workspace = task.options, task.options.workspace
    rows = np.array([hand.fingers.index(hand.finger(name)) for name in start.fingers])
    by_fingers = strokes is not None
    standoff, overshoot = strokes or (0.0, 0.0)
    lengths = [0.0, standoff, -overshoot] if by_fingers else [0.0]
    knots = _knots(hand, rows, len(lengths))
    R, p = np.array(start.X_WB.rotation), np.array(start.X_WB.translation)
    if workspace.X_WB is not None and workspace.rotation_range == 0.0:
        R = np.array(workspace.X_WB.rotation)
    chains, q = chains_of(hand), np.repeat(start.q[None], len(lengths), axis=0)
    cones = [options.cone, *[max(options.cone, options.off_contact_cone)] * (len(lengths) - 1)]
    box = _box(task, start)
    demands = Demands(
        contacts=records(CONTACT, finger=rows, point=task.points, normal=task.normals),
        knots=records(KNOT, length=lengths, cone=cones),
        setting=_setting(task, box, R),
        meridian=task.solid.meridian,
        spheres=records(SPHERE, joint=spheres.joints, centre=spheres.centres, radius=spheres.radii),
        asked=_asked(hand, spheres, task, rows, knots),
        columns=knots.columns,
        willing=_willing(hand, task, knots),
    )
    np.clip(p, *box, out=p)
    left = settle(chains, demands, q, R, p, ITERATIONS)
    none = np.zeros(len(rows))
    return Solution(
        fingers=start.fingers,
        q=q[0],
        q_standoff=q[1] if by_fingers else q[0],
        q_overshoot=q[2] if by_fingers else q[0],
        X_WB=pin.SE3(R, p),
        retreat=np.zeros(3),
        standoff=none + standoff,
        overshoot=none + overshoot,
        violation=left / LENGTH,
        solver="newton",
    )


def _knots(hand: Hand, fingers: NDArray[np.intp], count: int) -> _Knots:
    nq = hand.model.nq
    moving = np.unique(np.concatenate([hand.fingers[i].q_indices for i in fingers])).astype(np.intp)
    columns = np.tile(np.arange(nq), (count, 1))
    for knot in range(1, count):
        columns[knot, moving] = nq + 6 + (knot - 1) * len(moving) + np.arange(len(moving))
    return _Knots(moving, columns)


def _asked(
    hand: Hand, spheres: LinkSpheres, task: ReachTask, fingers: NDArray[np.intp], knots: _Knots
) -> Array:
    """Least distance of each sphere at each knot: of all at the contact, of what has moved at the
    stand-off, of none at the overshoot."""
    touching = np.isin(spheres.finger_indices, fingers)
    asked = np.where(touching, BESIDE_PAD, task.options.clearance + HULL_MARGIN)
    asked = np.where(spheres.is_pad & touching, 0.0, asked)
    out = np.full((len(knots.columns), len(asked)), -np.inf)
    out[0] = np.where(spheres.is_pad & touching, -np.inf, asked)
    if len(out) > 1:
        joints = [j for j, x in enumerate(hand.model.joints) if j and int(x.idx_q) in knots.moving]
        out[1] = np.where(np.isin(spheres.joints, joints), asked, -np.inf)
    return out


def _willing(hand: Hand, task: ReachTask, knots: _Knots) -> Array:
    """All joints alike; the base where its workspace lets it."""
    workspace, nq = task.options.workspace, hand.model.nq
    out = np.full(knots.unknowns, _JOINT)
    free = workspace.X_WB is None
    out[nq : nq + 3] = BASE_UNITS[0] if free or workspace.position_range > 0.0 else 0.0
    out[nq + 3 : nq + 6] = BASE_UNITS[1] if free or workspace.rotation_range > 0.0 else 0.0
    return out


def _setting(task: ReachTask, box: Array, R_start: Array) -> NDArray[np.void]:
    table = NO_TABLE if task.options.table is None else task.options.table
    X_WO = task.solid.X_WO
    return records(
        SETTING, R_WO=[X_WO.rotation], p_WO=X_WO.translation, table=table, box=box,
        R_nominal=_nominal(task, R_start), most_turn=_most_turn(task),
    )  # fmt: skip


def _nominal(task: ReachTask, R_start: Array) -> Array:
    X_WB = task.options.workspace.X_WB
    return np.array(R_start if X_WB is None else X_WB.rotation)


def _most_turn(task: ReachTask) -> float:
    workspace = task.options.workspace
    return float(np.pi if workspace.X_WB is None else workspace.rotation_range)


def _box(task: ReachTask, start: Start) -> Array:
    workspace = task.options.workspace
    middle, half = start.X_WB.translation, _FREE_TRAVEL
    if workspace.X_WB is not None:
        middle, half = workspace.X_WB.translation, workspace.position_range
    return np.array([middle - half, middle + half])
