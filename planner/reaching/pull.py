"""One finger's joints moved until its pad is where it should be: damped least squares."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from estimator.vectors import Array
from hand_models.hand import Finger, Hand

_DAMPING = 1e-6  # [m^2]
_ITERATIONS = 8
_CLOSE = 1e-7  # [m]


def pulled(
    hand: Hand,
    finger: Finger,
    X_WB: pin.SE3,
    q: Array,
    target: Array,
    *,
    iterations: int = _ITERATIONS,
) -> Array:
    """A configuration with the pad's centre at the target, or as near as limits and steps allow.

    Args:
        q: Where to start, (nq,); only the finger's own joints move, within their limits.
        target: In the world, (3,) [m].
        iterations: At most so many.
    """
    row, joints = hand.fingers.index(finger), finger.q_indices
    q = q.copy()
    for _ in range(iterations):
        pose = hand.at(q, X_WB)
        error = target - pose.pad_centres[row]
        if np.linalg.norm(error) < _CLOSE:
            break
        J = pose.pad_jacobian(finger)[:, joints]
        step = J.T @ np.linalg.solve(J @ J.T + _DAMPING * np.eye(3), error)
        q[joints] = np.clip(q[joints] + step, hand.lower[joints], hand.upper[joints])
    return q
