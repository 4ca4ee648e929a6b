"""Joint angles of an arm for poses of the hand that it carries, many poses at once.

Each starts from postures of a library whose flange is near, and goes on by damped least squares
within the joint limits.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from estimator.vectors import Array
from hand_models.arm import Arm
from hand_models.batch import model_placements
from hand_models.joints import joint_motions

LIBRARY = 8000  # postures of the arm
SEEDS = 8  # of them, for each pose
STEPS = 25
JUMP = 0.15  # of a joint between two poses of a way [rad]
_TURN = 0.2  # an angle counts like its arc of this radius [m]
_DAMPING = 1e-4  # [m^2]
_NEAR = 1e-4  # on a way [m], [rad]
_PLACE, _ANGLE = 1e-3, 1e-2  # how near is there: the optimiser does the rest [m], [rad]
_THERE = 0.1  # of that: no step more


class ArmPoses:
    """Inverse kinematics of one arm. Frames: A its root, F its flange, B the hand's base."""

    def __init__(self, arm: Arm) -> None:
        self._arm = arm
        self._lower = np.asarray(arm.model.lowerPositionLimit)
        self._upper = np.asarray(arm.model.upperPositionLimit)

    def flange_poses(self, R_WB: Array, p_WB: Array) -> tuple[Array, Array]:
        """Poses of the flange in the arm's root for poses (N, 3, 3), (N, 3) of the hand base in the
        world."""
        X_AW, X_BF = self._arm.X_WA.inverse(), self._arm.X_FB.inverse()
        R_AB = X_AW.rotation @ R_WB
        p_AB = p_WB @ X_AW.rotation.T + X_AW.translation
        return R_AB @ X_BF.rotation, p_AB + R_AB @ X_BF.translation

    def nearest(self, R: Array, p: Array) -> tuple[Array, Array]:
        """For each pose of the flange, how far off library postures have it (N, SEEDS) [m], and
        these (N, SEEDS, n)."""
        library, tree = self._library
        far, nearest = tree.query(_features(R, p), SEEDS)
        return far, library[nearest]

    def solved(self, q: Array, R: Array, p: Array) -> tuple[Array, Array]:
        """Damped least squares; joints, and how far off, 1 at the edge of what is near enough."""
        q, off = q.copy(), np.full(len(q), np.inf)
        left = np.arange(len(q))  # not there yet
        for step_number in range(STEPS + 1):
            error, J = self._errors(q[left], R[left], p[left])
            place = np.linalg.norm(error[:, :3], axis=1) / _PLACE
            angle = np.linalg.norm(error[:, 3:], axis=1) / (_TURN * _ANGLE)
            off[left] = np.maximum(place, angle)
            going = off[left] > _THERE
            left, error, J = left[going], error[going], J[going]
            if len(left) == 0 or step_number == STEPS:
                break
            normal = J @ np.swapaxes(J, 1, 2) + _DAMPING * np.eye(6)
            step = np.einsum("nij,ni->nj", J, np.linalg.solve(normal, error[..., None])[..., 0])
            q[left] = np.clip(q[left] + np.clip(step, -0.5, 0.5), self._lower, self._upper)
        return q, off

    def from_home(self, q: Array) -> Array:
        """(N,) the largest way of a joint from where it begins."""
        return np.asarray(np.abs(q - self._arm.home).max(axis=1))

    def follow(self, q: Array, bases: tuple[pin.SE3, ...]) -> Array:
        """Joint positions (K, n) along poses of the hand base, from q on; they end before the first
        that is out of reach or a jump away."""
        path: list[Array] = []
        data = self._arm.model.createData()
        for X_WB in bases:
            X_AF = self._arm.X_WA.inverse() * X_WB * self._arm.X_FB.inverse()
            found = self._pulled(data, q, X_AF)
            if found is None or np.abs(found - q).max() > JUMP:
                break
            q = found
            path.append(q)
        return np.array(path).reshape(-1, len(self._lower))

    def _pulled(self, data: pin.Data, q: Array, X_AF: pin.SE3) -> Array | None:
        """Joints that put the flange there, near q; None if they do not come near enough."""
        model, flange = self._arm.model, self._arm.flange_id
        for _ in range(STEPS):
            pin.framesForwardKinematics(model, data, q)
            error = pin.log6(data.oMf[flange].actInv(X_AF)).vector
            if np.linalg.norm(error[:3]) < _NEAR and np.linalg.norm(error[3:]) < _NEAR:
                return q
            J = pin.computeFrameJacobian(model, data, q, flange, pin.LOCAL)
            step = J.T @ np.linalg.solve(J @ J.T + _DAMPING * np.eye(6), error)
            q = np.clip(q + step, self._lower, self._upper)
        return None

    @cached_property
    def _library(self) -> tuple[Array, KDTree]:
        rng = np.random.default_rng(0)
        q = rng.uniform(self._lower, self._upper, (LIBRARY, len(self._lower)))
        R, p = self._flange(q)
        return q, KDTree(_features(R, p))

    def _flange(self, q: Array) -> tuple[Array, Array]:
        frame = self._arm.model.frames[self._arm.flange_id]
        placed = model_placements(self._arm.model, q)
        R, p = placed.rotations[:, frame.parentJoint], placed.positions[:, frame.parentJoint]
        return R @ frame.placement.rotation, p + R @ frame.placement.translation

    def _errors(self, q: Array, R: Array, p: Array) -> tuple[Array, Array]:
        """(N, 6) what is left to move and turn, and its Jacobian (N, 6, n); turns as arcs."""
        frame = self._arm.model.frames[self._arm.flange_id]
        placed = model_placements(self._arm.model, q)
        R_F, p_F = self._flange(q)
        J = np.zeros((len(q), 6, q.shape[1]))
        motions = joint_motions(self._arm.model)
        for j in [int(j) for j in self._arm.model.supports[frame.parentJoint]][1:]:
            motion, R_j = motions[j - 1], placed.rotations[:, j]
            w, v = R_j @ motion.angular, R_j @ motion.linear
            lever = np.cross(w, p_F - placed.positions[:, j])
            J[:, :3, motion.q_index] += motion.multiplier * (lever + v)
            J[:, 3:, motion.q_index] += motion.multiplier * _TURN * w
        turn = Rotation.from_matrix(R @ np.swapaxes(R_F, 1, 2)).as_rotvec()
        return np.concatenate([p - p_F, _TURN * turn], axis=1), J


def _features(R: Array, p: Array) -> NDArray[np.float64]:
    """(N, 9): places and two axes of a frame as arcs, near where poses are near."""
    return np.concatenate([p, _TURN * R[:, :, 0], _TURN * R[:, :, 2]], axis=1)
