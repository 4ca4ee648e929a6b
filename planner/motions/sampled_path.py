"""A way round by sampling: RRT-Connect over base and joints, from OMPL.

First only the base looks for a way, six dimensions, while the joints keep to the straight line from
where they are to where they are wanted, at a pace of their own; if that line is not free, or leads
nowhere, the joints look as well. Where the base is fixed, or the root of an arm, only joints do.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from ompl import base, geometric, util

from hand_models.broadphase import Among
from planner.motions.trajectory import Array, Configuration

if TYPE_CHECKING:
    from planner.motions.transfer import Movable

ROOM = 0.25  # of the base about begin and end [m]
_RESOLUTION = 0.02  # between checked configurations [m], a turn of the base as on a 0.1 m arm
_JOINT_WEIGHT = 0.05  # of a joint's angle beside the base's way [m/rad]
_ARM_WEIGHT = 0.3  # the same for the joints of arm and hand [m/rad]
_TURN_WEIGHT = 0.1  # of the base's turn [m/rad]
_REDUCE = (30, 15, 1.0)  # attempts to leave corners out, in vain in a row, share of the path
_SHORTEN = (30, 15, 1.0)  # likewise, between any two places
_ON_LINE = 9  # places at which the joints' straight line has to be free


@dataclass(frozen=True, eq=False)
class _Joints:
    """What is sampled for the joints: themselves, or their share of a straight line.

    Args:
        low, high: Bounds.
        ends: At begin and end.
        weight: Of its distances [m].
        posture: Joint positions of it.
    """

    low: Array
    high: Array
    ends: tuple[Array, Array]
    weight: float
    posture: Callable[[Array], Array]


def sampled_path(
    movable: Movable, begin: Configuration, end: Configuration, free: Among, *, checks: int
) -> list[Configuration] | None:
    """Corners of a way round, straight in joints and base between them; None if none was found.

    The same arguments give the same way: the effort is counted in checks, not in time.

    Args:
        free: Says whether a configuration is.
        checks: How many configurations may be checked.
    """
    few = _along_line(movable, begin.q, end.q)
    if few is not None:
        found = _search(movable, (begin, end), few, free, checks // 2)
        if found is not None:
            return found
    weight = _JOINT_WEIGHT if movable.hand.arm is None else _ARM_WEIGHT
    every = _Joints(movable.hand.lower, movable.hand.upper, (begin.q, end.q), weight, lambda q: q)
    return _search(movable, (begin, end), every, free, checks)


def _along_line(movable: Movable, begin: Array, end: Array) -> _Joints | None:
    """The hand's joints as one share of their straight line, the arm's as they are, if there is
    one; None where nothing else moves or the hand would meet itself on the line."""
    hand, along = movable.hand, end - begin
    arm = [] if hand.arm is None else [int(i) for i in hand.arm.q_indices]
    if movable.base_stays and not arm:
        return None

    def posture(vector: Array) -> Array:
        q = begin + vector[-1] * along
        q[arm] = vector[:-1]
        return np.asarray(q)

    on_line = (begin + u * along for u in np.linspace(0.0, 1.0, _ON_LINE))
    if not arm and not all(movable.around.collision.is_self_free(q) for q in on_line):
        return None
    return _Joints(
        np.append(hand.lower[arm], 0.0),
        np.append(hand.upper[arm], 1.0),
        (np.append(begin[arm], 0.0), np.append(end[arm], 1.0)),
        _ARM_WEIGHT if arm else max(_JOINT_WEIGHT * float(np.linalg.norm(along)), 1e-3),
        posture,
    )


def _search(
    movable: Movable,
    ends: tuple[Configuration, Configuration],
    joints: _Joints,
    free: Among,
    checks: int,
) -> list[Configuration] | None:
    util.setLogLevel(util.LogLevel.LOG_NONE)
    util.RNG.setSeed(1 + movable.seed)
    held = ends[0].X_WB if movable.base_stays else None
    space, count = _space(ends, joints, held), 0

    def place(state: Any) -> Configuration:
        vector = state[0] if held is not None else state[2]
        q = joints.posture(np.array([vector[i] for i in range(len(joints.low))]))
        return Configuration(q, _pose(state) if held is None else held)

    def is_valid(state: Any) -> bool:
        nonlocal count
        count += 1
        at = place(state)
        if not movable.workspace.allows(at.X_WB.rotation[None], at.X_WB.translation[None])[0]:
            return False
        return free.is_free(at.q, at.X_WB)

    setup = geometric.SimpleSetup(space)
    setup.setStateValidityChecker(is_valid)
    states = [_state(space, X, v, held) for X, v in zip(ends, joints.ends, strict=True)]
    setup.setStartAndGoalStates(*states)
    info = setup.getSpaceInformation()
    setup.setPlanner(geometric.RRTConnect(info))
    setup.solve(base.PlannerTerminationCondition(lambda: count >= checks))
    if not setup.haveExactSolutionPath():
        return None
    path, shorten = setup.getSolutionPath(), geometric.PathSimplifier(info)
    shorten.reduceVertices(path, *_REDUCE)
    shorten.partialShortcutPath(path, *_SHORTEN)
    return [place(path.getState(i)) for i in range(path.getStateCount())]


def _space(ends: tuple[Configuration, Configuration], joints: _Joints, held: pin.SE3 | None) -> Any:
    """Base poses about both ends, and what is sampled of the joints, measured in metres."""
    space = base.CompoundStateSpace()
    if held is None:
        places = np.array([end.X_WB.translation for end in ends])
        position = base.RealVectorStateSpace(3)
        position.setBounds(_bounds(places.min(axis=0) - ROOM, places.max(axis=0) + ROOM))
        space.addSubspace(position, 1.0)
        space.addSubspace(base.SO3StateSpace(), 2.0 * _TURN_WEIGHT)  # its distance is half a turn
    vector = base.RealVectorStateSpace(len(joints.low))
    vector.setBounds(_bounds(joints.low, joints.high))
    space.addSubspace(vector, joints.weight)
    space.setLongestValidSegmentFraction(_RESOLUTION / space.getMaximumExtent())
    space.setup()
    return space


def _bounds(low: Array, high: Array) -> Any:
    bounds = base.RealVectorBounds(len(low))
    for i, (a, b) in enumerate(zip(low, high, strict=True)):
        bounds.setLow(i, float(a))
        bounds.setHigh(i, float(b))
    return bounds


def _state(space: Any, end: Configuration, vector: Array, held: pin.SE3 | None) -> Any:
    state = space.allocState()
    turn = pin.Quaternion(end.X_WB.rotation).coeffs()
    pose = [*end.X_WB.translation, *turn] if held is None else []
    space.copyFromReals(state, [*pose, *vector])
    return state


def _pose(state: Any) -> pin.SE3:
    p, turn = state[0], state[1]
    R = pin.Quaternion(turn.w, turn.x, turn.y, turn.z).matrix()
    return pin.SE3(R, np.array([p[0], p[1], p[2]]))
