"""One finger's joints moved until its pad is where it should be: damped least squares."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from estimator.vectors import Array
from hand_models.chains import chains_of
from hand_models.hand import Finger, Hand
from planner.kinematics.pulling import pull

_ITERATIONS = 40


@dataclass(frozen=True, eq=False)
class Pulled:
    """K configurations and where the finger's pad is there.

    Args:
        path: (K, nq).
        centres: In the world, of the ball that touches as the pad does, (K, 3) [m].
        normals: Of the pad in the world, (K, 3), unit.
    """

    path: Array
    centres: Array
    normals: Array


def pulled(
    hand: Hand,
    finger: Finger,
    X_WB: pin.SE3,
    path: Array,
    targets: Array,
    n_W: Array,
    *,
    iterations: int = _ITERATIONS,
    marching: bool = False,
) -> Pulled:
    """Configurations with the pad's ball at the targets, or as near as limits and steps allow.

    Args:
        path: Where each starts, (K, nq); only the finger's own joints move, within their limits.
        targets: Of the ball's centre in the world, (K, 3) [m].
        n_W: Outward normal of what the pad is to touch (`hand_models.dome`), (3,).
        iterations: At most so many, each.
        marching: Whether each starts where the one before it ended; only the first counts then.
    """
    path = np.array(path, dtype=np.float64)
    local = np.ascontiguousarray((targets - X_WB.translation) @ X_WB.rotation)
    centres, normals = np.zeros_like(local), np.zeros_like(local)
    row, joints = hand.fingers.index(finger), np.asarray(finger.q_indices, dtype=np.intp)
    R, facing = X_WB.rotation.T, -X_WB.rotation.T @ n_W
    pull(chains_of(hand), row, joints, path, facing, local, iterations, marching, centres, normals)
    return Pulled(path, centres @ R + X_WB.translation, normals @ R)
