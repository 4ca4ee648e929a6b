"""A way round by sampling: RRT-Connect over joints and base, from OMPL."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from ompl import base, geometric, util

from planner.trajectory import Array, Configuration

if TYPE_CHECKING:
    from planner.transfer import Movable

ROOM = 0.25  # of the base about begin and end [m]
_RESOLUTION = 0.02  # between checked configurations [m], a turn of the base as on a 0.1 m arm
_JOINT_WEIGHT = 0.05  # of a joint's angle beside the base's way [m/rad]
_ARM_WEIGHT = 0.3  # the same for the joints of arm and hand [m/rad]
_TURN_WEIGHT = 0.1  # of the base's turn [m/rad]
_REDUCE = (30, 15, 1.0)  # attempts to leave corners out, in vain in a row, share of the path
_SHORTEN = (40, 20, 1.0)  # likewise, between any two places


def sampled_path(
    movable: Movable, begin: Configuration, end: Configuration, *, margin: float, checks: int
) -> list[Configuration] | None:
    """Corners of a way round, straight in joints and base between them; None if none was found.

    The same arguments give the same way: the effort is counted in checks, not in time.

    Args:
        margin: Least distance of the hand from the believed object [m].
        checks: How many configurations may be checked.
    """
    util.setLogLevel(util.LogLevel.LOG_NONE)
    util.RNG.setSeed(1 + movable.seed)
    space, dof = _space(movable, begin, end), movable.hand.model.nq
    held = None if movable.hand.arm is None else begin.X_WB  # an arm's root stands still
    count = 0

    def is_valid(state: Any) -> bool:
        nonlocal count
        count += 1
        place = _configuration(state, dof, held)
        R, p = place.X_WB.rotation[None], place.X_WB.translation[None]
        if not movable.workspace.allows(R, p)[0]:
            return False
        return movable.around.is_free(place.q, place.X_WB, margin)

    setup = geometric.SimpleSetup(space)
    setup.setStateValidityChecker(is_valid)
    setup.setStartAndGoalStates(_state(space, begin), _state(space, end))
    info = setup.getSpaceInformation()
    setup.setPlanner(geometric.RRTConnect(info))
    spent = base.PlannerTerminationCondition(lambda: count >= checks)
    setup.solve(spent)
    if not setup.haveExactSolutionPath():
        return None
    path = setup.getSolutionPath()
    shorten = geometric.PathSimplifier(info)
    shorten.reduceVertices(path, *_REDUCE)
    shorten.partialShortcutPath(path, *_SHORTEN)
    return [_configuration(path.getState(i), dof, held) for i in range(path.getStateCount())]


def _space(movable: Movable, begin: Configuration, end: Configuration) -> Any:
    """Joints within limits and base poses about begin and end, measured in metres."""
    ends = np.array([begin.X_WB.translation, end.X_WB.translation])
    place = base.RealVectorStateSpace(3)
    place.setBounds(_bounds(ends.min(axis=0) - ROOM, ends.max(axis=0) + ROOM))
    joints = base.RealVectorStateSpace(movable.hand.model.nq)
    joints.setBounds(_bounds(movable.hand.lower, movable.hand.upper))
    space = base.CompoundStateSpace()
    space.addSubspace(place, 1.0)
    space.addSubspace(base.SO3StateSpace(), 2.0 * _TURN_WEIGHT)  # its distance is half the turn
    space.addSubspace(joints, _JOINT_WEIGHT if movable.hand.arm is None else _ARM_WEIGHT)
    space.setLongestValidSegmentFraction(_RESOLUTION / space.getMaximumExtent())
    space.setup()
    return space


def _bounds(low: Array, high: Array) -> Any:
    bounds = base.RealVectorBounds(len(low))
    for i, (a, b) in enumerate(zip(low, high, strict=True)):
        bounds.setLow(i, float(a))
        bounds.setHigh(i, float(b))
    return bounds


def _state(space: Any, place: Configuration) -> Any:
    state = space.allocState()
    turn = pin.Quaternion(place.X_WB.rotation).coeffs()
    space.copyFromReals(state, [*place.X_WB.translation, *turn, *place.q])
    return state


def _configuration(state: Any, dof: int, held: pin.SE3 | None) -> Configuration:
    p, turn, q = state[0], state[1], state[2]
    joints = np.array([q[i] for i in range(dof)])
    if held is not None:
        return Configuration(joints, held)
    R = pin.Quaternion(turn.w, turn.x, turn.y, turn.z).matrix()
    return Configuration(joints, pin.SE3(R, np.array([p[0], p[1], p[2]])))
