"""Joints of one degree of freedom, as screws that an entry of q drives.

A joint of its own stands at q[i]; one that follows another stands at multiplier q[i] + offset.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class JointMotion:
    """How one joint moves.

    Attributes:
        q_index: The entry of q that drives it.
        multiplier, offset: The joint stands at multiplier q + offset [rad], [m].
        linear, angular: (3,) velocity in the joint's own frame per unit of its position.
    """

    q_index: int
    multiplier: float
    offset: float
    linear: Array
    angular: Array

    def at(self, q: Array) -> Array:
        """Its position, for one (nq,) or many (..., nq) configurations [rad], [m]."""
        return np.asarray(self.multiplier * q[..., self.q_index] + self.offset)


def joint_motion(joint: pin.JointModel) -> JointMotion:
    """Of a revolute or prismatic joint, or of one that follows such a joint."""
    multiplier, offset = 1.0, 0.0
    if joint.shortname() == "JointModelMimic":
        follower = joint.extract()
        multiplier, offset = float(follower.scaling), float(follower.offset)
    subspace = np.asarray(joint.createData().S, dtype=np.float64).ravel()
    linear, angular = np.split(subspace / multiplier, 2)  # a follower's has its multiplier in it
    return JointMotion(int(joint.idx_q), multiplier, offset, linear, angular)


def joint_motions(model: pin.Model) -> tuple[JointMotion, ...]:
    """Of all joints but the universe, in the model's order."""
    return tuple(joint_motion(joint) for joint in list(model.joints)[1:])
