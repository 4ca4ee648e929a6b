"""Numbers for the optimiser: one task from one start, and what comes back."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from planner.motions.surroundings import Box
from planner.reaching.pull import pulled
from planner.reaching.reach_kinematics import LENGTH
from planner.reaching.reach_model import ReachModel, pack_parameters
from planner.reaching.solid import RevolvedSolid
from planner.reaching.starts import Start
from planner.reaching.workspace import Workspace

Array = NDArray[np.float64]

HULL_MARGIN = 1e-3  # asked of the spheres on top, as hulls stand out of them [m]
_FREE_TRAVEL = 0.15  # of a free base from its start [m]
_FREE_TURN = 0.6  # bound on each modified Rodrigues parameter of it
_PULLS = 3  # steps of a guess off the contact
NO_TABLE = (0.0, 0.0, 1.0, -1e3)


_FREE = Workspace()


@dataclass(frozen=True)
class ReachOptions:
    """What a reach must keep, and how hard to look for it. Compares by value.

    Args:
        cone: Largest angle between a pad's normal and the inward surface normal [rad].
        off_contact_cone: The same at stand-off and overshoot [rad].
        workspace: Where the hand base may be.
        clearance: Between object and links that do not touch [m].
        self_clearance: Between links [m].
        table: (a, b, c, h): half-space a x + b y + c z >= h the hand must stay in; None for none.
        boxes: Obstacles that neither hand nor arm may meet.
        standoff: How far before the contact the fingers retreat, if they can [m].
        least_standoff: How far they must [m].
        overshoot: How far behind the contact they can press on, if they can [m].
        least_overshoot: How far they must [m].
        starts: Library starts that are tried.
        refined: Starts that the SQP tries when Gauss-Newton fails.
        rescues: Starts that Ipopt tries when the SQP fails.
        position_tolerance: Largest residual of a pad's place [m].
        pad_depth: How deep a pad may be in the object beside its contact, where it is hollow [m].
    """

    cone: float = float(np.radians(40.0))
    off_contact_cone: float = float(np.radians(60.0))
    workspace: Workspace = _FREE
    clearance: float = 1e-3
    self_clearance: float = 0.0
    table: tuple[float, float, float, float] | None = None
    boxes: tuple[Box, ...] = ()
    standoff: float = 0.030
    least_standoff: float = 0.020
    overshoot: float = 0.025
    least_overshoot: float = 0.012
    starts: int = 16
    refined: int = 16
    rescues: int = 1
    position_tolerance: float = 1e-4
    pad_depth: float = 1e-3

    def __post_init__(self) -> None:
        for name in ("cone", "off_contact_cone"):
            if not 0.0 < getattr(self, name) <= np.pi / 2:
                raise ValueError(f"{name} must be in (0, pi/2] rad, got {getattr(self, name)}")
        for name in ("standoff", "overshoot"):
            if not 0.0 <= getattr(self, f"least_{name}") <= getattr(self, name):
                raise ValueError(f"least_{name} must be in [0, {name}]")
        if min(self.starts, self.refined, self.rescues) < 0:
            raise ValueError("starts, refined and rescues must be >= 0")


@dataclass(frozen=True, eq=False)
class ReachTask:
    """Contacts to be made on an object, and the rules."""

    points: Array  # (k, 3)
    normals: Array  # (k, 3)
    solid: RevolvedSolid
    options: ReachOptions

    @property
    def retreat(self) -> Array:
        """(3,) way of an arm from the contact to the stand-off, along the mean normal [m]."""
        normal = self.normals.mean(axis=0)
        return np.asarray(self.options.standoff * normal / max(np.linalg.norm(normal), 1e-9))


@dataclass(frozen=True, eq=False)
class Solution:
    """What the optimiser returned, good or not; to be certified.

    Attributes:
        fingers: The finger of each contact.
        q, q_standoff, q_overshoot: (nq,) at the contact, before and behind it.
        X_WB: Pose of the hand base.
        retreat: (3,) way of the base to the stand-off; zero if the fingers move [m].
        standoff, overshoot: (k,) the distances found [m].
        violation: Largest violated row, slack included; lengths in units of 50 mm.
        solver: Its name.
    """

    fingers: tuple[str, ...]
    q: Array
    q_standoff: Array
    q_overshoot: Array
    X_WB: pin.SE3
    retreat: Array
    standoff: Array
    overshoot: Array
    violation: float
    solver: str


def solve_task(model: ReachModel, task: ReachTask, start: Start, *, solver: str) -> Solution:
    """Run "sqp" or "ipopt" from a start.

    The model knows its fingers in ascending order, the task its contacts in the caller's; the
    solution is in the caller's.
    """
    start = _within_workspace(start, task.options.workspace)
    names = [model.hand.fingers[i].name for i in model.fingers]
    slots = np.array([names.index(name) for name in start.fingers])  # of contacts in the model
    x_bounds = _unknown_bounds(model, task, start)
    guess = np.clip(_guess(model, task, start), *x_bounds)
    run: ca.Function = model.sqp if solver == "sqp" else model.ipopt
    result = run(
        x0=guess,
        p=_parameters(model, task, start, np.argsort(slots)),
        lbx=x_bounds[0],
        ubx=x_bounds[1],
        lbg=0.0,
        ubg=np.inf,
    )
    w, g = np.array(result["x"]).ravel(), np.array(result["g"]).ravel()
    violation = float(w[0] + max(0.0, -g.min()))
    return _unpacked(model, task, start, slots, np.clip(w, *x_bounds)[1:], violation, solver)


def _within_workspace(start: Start, workspace: Workspace) -> Start:
    """A base that may not turn starts from its nominal orientation."""
    if workspace.X_WB is None or workspace.rotation_range > 0.0:
        return start
    X_WB = pin.SE3(workspace.X_WB.rotation, start.X_WB.translation)
    return Start(start.fingers, start.q, X_WB)


def _parameters(
    model: ReachModel, task: ReachTask, start: Start, order: NDArray[np.int64]
) -> Array:
    options, workspace = task.options, task.options.workspace
    free = workspace.X_WB is None
    least_cosine = -2.0 if free else float(np.cos(workspace.rotation_range))
    return pack_parameters(
        points=task.points[order],
        normals=task.normals[order],
        radii=np.array([model.hand.fingers[i].pad_radius for i in model.fingers]),
        start=start.X_WB,
        nominal=start.X_WB if free else workspace.X_WB,
        cosines=(least_cosine, np.cos(options.cone), np.cos(options.off_contact_cone)),
        clearance=options.clearance + HULL_MARGIN,
        retreat=task.retreat,
        table=np.array(NO_TABLE if options.table is None else options.table),
        solid=task.solid,
        q_start=start.q,
    )


def _guess(model: ReachModel, task: ReachTask, start: Start) -> Array:
    shape, options = model.shape, task.options
    parts = [np.zeros(7), start.q]  # no slack, the base where it starts
    if shape.by_fingers:
        half = [options.least_standoff, options.least_overshoot]
        moved = [_moved(model, task, start, away) for away in (half[0], -half[1])]
        parts += [*moved, np.repeat(half, shape.contacts) / LENGTH]
    return np.concatenate(parts)


def _moved(model: ReachModel, task: ReachTask, start: Start, away: float) -> Array:
    """The touching fingers' joints with their pads pulled along the normals, roughly."""
    q = start.q
    for name, p, n in zip(start.fingers, task.points, task.normals, strict=True):
        finger = model.hand.finger(name)
        target = p + (finger.pad_radius + away) * n
        way = pulled(model.hand, finger, start.X_WB, q[None], target[None], n, iterations=_PULLS)
        q = way.path[0]
    return np.asarray(q[list(model.shape.moving)])


def _unknown_bounds(model: ReachModel, task: ReachTask, start: Start) -> tuple[Array, Array]:
    shape, options, workspace = model.shape, task.options, task.options.workspace
    lower, upper = model.hand.lower, model.hand.upper
    if workspace.X_WB is None:
        x_low, x_high = np.full(3, -_FREE_TRAVEL), np.full(3, _FREE_TRAVEL)
    else:
        to_nominal = workspace.X_WB.translation - start.X_WB.translation
        x_low = to_nominal - workspace.position_range
        x_high = to_nominal + workspace.position_range
    turns = workspace.X_WB is None or workspace.rotation_range > 0.0
    s = np.full(3, _FREE_TURN if turns else 0.0)
    low, high = (
        [np.zeros(1), x_low / LENGTH, -s, lower],
        [np.full(1, np.inf), x_high / LENGTH, s, upper],
    )
    if shape.by_fingers:
        moving, k = list(shape.moving), shape.contacts
        low += [lower[moving], lower[moving]]
        high += [upper[moving], upper[moving]]
        for least, most in (
            (options.least_standoff, options.standoff),
            (options.least_overshoot, options.overshoot),
        ):
            low.append(np.full(k, least / LENGTH))
            high.append(np.full(k, most / LENGTH))
    return np.concatenate(low), np.concatenate(high)


def _unpacked(
    model: ReachModel,
    task: ReachTask,
    start: Start,
    slots: NDArray[np.int64],
    w: Array,
    violation: float,
    solver: str,
) -> Solution:
    shape = model.shape
    n, m, k = shape.nq, len(shape.moving), shape.contacts
    x, s, q, *motion = np.split(w, np.cumsum([3, 3, n, m, m, k, k])[: 7 if shape.by_fingers else 2])
    q_standoff, q_overshoot = q.copy(), q.copy()
    retreat = task.retreat if shape.motion == "arm" else np.zeros(3)
    standoff, overshoot = task.normals @ retreat, np.zeros(k)
    if shape.by_fingers:
        moving = list(shape.moving)
        q_standoff[moving], q_overshoot[moving] = motion[0], motion[1]
        standoff, overshoot = LENGTH * motion[2][slots], LENGTH * motion[3][slots]
    R = start.X_WB.rotation @ Rotation.from_mrp(s).as_matrix()
    return Solution(
        fingers=start.fingers,
        q=q,
        q_standoff=q_standoff,
        q_overshoot=q_overshoot,
        X_WB=pin.SE3(R, start.X_WB.translation + LENGTH * x),
        retreat=retreat,
        standoff=standoff,
        overshoot=overshoot,
        violation=violation,
        solver=solver,
    )
