"""A hand in a configuration and a place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from hand_models.hand import Finger, Hand

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class HandPose:
    """A hand in a configuration and a place; to hold one is to know that kinematics ran.

    Made by `Hand.at`.

    Attributes:
        hand: The hand.
        q: (nq,) joint positions.
        X_WB: Pose of the hand base B in the world W.
        data: Pinocchio data with joint and frame placements and joint Jacobians. Pinocchio's
            world is B: `data.oMf[i]` is X_BF, not X_WF.
    """

    hand: Hand
    q: Array
    X_WB: pin.SE3
    data: pin.Data

    def transform_tip_to_world(self, finger: Finger) -> pin.SE3:
        """X_WT, the pose of the finger's tip frame in the world."""
        return self.X_WB * self.data.oMf[finger.tip_frame_id]

    @cached_property
    def pad_centres(self) -> Array:
        """(F, 3) centres of the spheres that stand for the pads, in the world [m]."""
        fingers = self.hand.fingers
        return _frozen([self.transform_tip_to_world(f).act(f.pad_centre) for f in fingers])

    @cached_property
    def pad_normals(self) -> Array:
        """(F, 3) unit vectors out of the pads in the world, in the order of the fingers."""
        fingers = self.hand.fingers
        return _frozen([self.transform_tip_to_world(f).rotation @ f.pad_normal for f in fingers])

    def ball_centres(self, fingers: Sequence[int], normals: ArrayLike) -> Array:
        """(k, 3) centres in the world of the balls of the pads' radii that touch surfaces of the
        given outward normals (k, 3) exactly where the pads do [m]: p + pad_radius * n at a contact.
        Those of `pad_centres` where pads are spheres."""
        out = []
        for row, n in zip(fingers, np.asarray(normals, dtype=np.float64), strict=True):
            finger = self.hand.fingers[row]
            X_WT = self.transform_tip_to_world(finger)
            out.append(X_WT.act(finger.ball_along(-X_WT.rotation.T @ n)))
        return _frozen(out)

    def link_axis(self, finger: Finger) -> Array:
        """(3,) unit vector along the finger's last link in the world: from its last joint to the
        pad, made perpendicular to the pad's normal. A cylindrical sensor lies along it."""
        frame = self.hand.model.frames[finger.tip_frame_id]
        row = self.hand.fingers.index(finger)
        joint = self.X_WB.act(self.data.oMi[frame.parentJoint].translation)
        n = self.pad_normals[row]
        along = self.pad_centres[row] - joint
        along = along - (along @ n) * n
        if np.linalg.norm(along) < 1e-6:  # a pad on the tip of the link has no such direction
            along = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
        return _frozen(along / np.linalg.norm(along))

    def pad_jacobian(self, finger: Finger) -> Array:
        """(3, nq) velocity of the pad's centre per joint velocity, world axes, base at rest."""
        return self._pad_twist(finger)[:3]

    def pad_turn_jacobian(self, finger: Finger) -> Array:
        """(3, nq) angular velocity of the tip per joint velocity, world axes, base at rest.

        The pad normal n moves with dn/dt = (J dq/dt) x n.
        """
        return self._pad_twist(finger)[3:]

    def _pad_twist(self, finger: Finger) -> Array:
        """(6, nq) velocity of the pad's centre above angular velocity of the tip, world axes."""
        frame = self.hand.model.frames[finger.tip_frame_id]
        X_JP = frame.placement * pin.SE3(np.eye(3), finger.pad_centre)  # pad in its joint's frame
        J_B = pin.getFrameJacobian(
            self.hand.model, self.data, frame.parentJoint, X_JP, pin.LOCAL_WORLD_ALIGNED
        ).reshape(6, -1)  # of a hand with one joint it is a vector
        return _frozen(np.kron(np.eye(2), self.X_WB.rotation) @ J_B)


def _frozen(values: ArrayLike) -> Array:
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array
