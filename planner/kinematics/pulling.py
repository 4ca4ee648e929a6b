"""A finger's joints moved until its pad is where it should be, along a whole path at once."""

from __future__ import annotations

import numpy as np

from estimator.compiled import compiled
from estimator.linear import factor, solve_factored
from estimator.vectors import Array, Index
from hand_models.chains import Chains
from planner.kinematics.placing import ball_jacobian, place_ball, place_joints, place_pad

DAMPING = 1e-6  # [m^2]
CLOSE = 1e-7  # [m]


@compiled
def pull(
    chains: Chains, finger: int, joints: Index, path: Array, facing: Array, targets: Array,
    iterations: int, marching: bool, centres: Array, normals: Array,
) -> None:  # fmt: skip
    """Damped least squares for each of K configurations, in place, within the joints' limits.

    Args:
        joints: Entries of q that may move.
        marching: Whether each starts where the one before it ended.
        path: (K, nq), changed.
        facing: (3,) along which the pad is to touch, in the hand base frame.
        targets: Of the centre of the ball that touches so, in the hand base frame, (K, 3) [m].
        centres, normals: Of that ball and of the pad, where they came to, (K, 3).
    """
    nq, J = path.shape[1], len(chains.joints)
    R, p = np.zeros((J, 3, 3)), np.zeros((J, 3))
    moves, turns = np.zeros((3, nq)), np.zeros((3, nq))
    turning, system, lower = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3))
    error = np.zeros(3)
    for k in range(len(path)):
        if marching and k > 0:
            for c in range(nq):
                path[k, c] = path[k - 1, c]
        for turn in range(iterations + 1):
            place_joints(chains, path[k], R, p)
            place_pad(chains, finger, R, p, centres[k], normals[k])
            place_ball(chains, finger, R, p, facing, centres[k], turning)
            square = 0.0
            for a in range(3):
                error[a] = targets[k, a] - centres[k, a]
                square += error[a] ** 2
            if turn == iterations or square < CLOSE**2:
                break
            ball_jacobian(chains, finger, R, p, facing, centres[k], turning, moves, turns)
            for a in range(3):
                for b in range(a + 1):
                    system[a, b] = DAMPING if a == b else 0.0
                    for c in joints:
                        system[a, b] += moves[a, c] * moves[b, c]
            factor(system, lower)
            solve_factored(lower, error)
            for c in joints:
                step = moves[0, c] * error[0] + moves[1, c] * error[1] + moves[2, c] * error[2]
                path[k, c] = min(max(path[k, c] + step, chains.lower[c]), chains.upper[c])
