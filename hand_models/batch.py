"""Kinematics of many configurations at once, in NumPy.

Pinocchio computes one configuration per call; ranking thousands of starts wants thousands per
call. Every joint of a `Hand` is a screw of one degree of freedom, so this is short.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from hand_models.hand import Hand
from hand_models.joints import JointMotion, joint_motions

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class BatchPlacements:
    """Joint frames of N configurations in the hand base frame B; joint 0 is B itself.

    Attributes:
        rotations: (N, J, 3, 3).
        positions: (N, J, 3) [m].
    """

    rotations: Array
    positions: Array

    def points(self, joints: IntArray, local: Array) -> Array:
        """Points fixed in joint frames, (M,) and (M, 3), as (N, M, 3) points in B [m]."""
        turned = np.einsum("nmij,mj->nmi", self.rotations[:, joints], local, optimize=True)
        return np.asarray(turned + self.positions[:, joints])

    def vectors(self, joints: IntArray, local: Array) -> Array:
        """Vectors fixed in joint frames, (M,) and (M, 3), as (N, M, 3) vectors in B."""
        return np.asarray(np.einsum("nmij,mj->nmi", self.rotations[:, joints], local))


def batch_placements(hand: Hand, q: Array) -> BatchPlacements:
    """Joint placements of many configurations.

    Args:
        q: (N, nq) joint positions [rad], [m] if prismatic.
    """
    return model_placements(hand.model, q)


def model_placements(model: pin.Model, q: Array) -> BatchPlacements:
    """The same for any model of joints with one degree of freedom, in its universe."""
    n, count = len(q), model.njoints
    R = np.broadcast_to(np.eye(3), (n, count, 3, 3)).copy()
    p = np.zeros((n, count, 3))
    for j, motion in enumerate(joint_motions(model), start=1):  # parents before children
        parent, fixed = int(model.parents[j]), model.jointPlacements[j]
        turn, shift = _moved(motion, motion.at(q))
        R_fixed = R[:, parent] @ fixed.rotation
        R[:, j] = R_fixed @ turn
        p[:, j] = (
            p[:, parent]
            + R[:, parent] @ fixed.translation
            + np.einsum("nij,nj->ni", R_fixed, shift)
        )
    return BatchPlacements(R, p)


def _moved(motion: JointMotion, angle: Array) -> tuple[Array, Array]:
    """Rotation (N, 3, 3), by Rodrigues' formula, and translation (N, 3) of one joint's motion."""
    w = motion.angular
    K = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.eye(3) + s * K + (1.0 - c) * (K @ K), angle[:, None] * motion.linear
