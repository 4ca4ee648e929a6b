"""Bring a hand where it must be by the arm that carries it: joint angles for poses of its base.

Many poses at once: each starts from the postures of a library whose flange is nearest, and goes on
by damped least squares within the joint limits. Placements that were found for the hand alone
become placements of the whole, whose base stands still: turned about the object's axis, which
changes nothing for the fingers, and with another of the arm's postures, until one is clear.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from estimator.surface import SurfaceOfRevolution
from estimator.vectors import Array, Mask
from hand_models.arm import Arm
from hand_models.batch import model_placements
from hand_models.joints import joint_motions
from hand_models.spheres import link_spheres
from planner.candidates import Candidates
from planner.motions.retreat import Retreat
from planner.reaching.turning import Room, clear_turns, evenly, turned

LIBRARY = 8000  # postures of the arm
SEEDS = 8  # of them, for each pose
TURNS = 12  # of a placement about the object's axis
POSTURES = 12  # of the arm that are solved for a placement, whichever way it is turned
STEPS = 25
JUMP = 0.15  # of a joint between two poses of a way [rad]
_TURN = 0.2  # an angle counts like its arc of this radius [m]
_DAMPING = 1e-4  # [m^2]
_NEAR = 1e-4  # on a way [m], [rad]
_PLACE, _ANGLE = 1e-3, 1e-2  # how near is there: the optimiser does the rest [m], [rad]
_THERE = 0.1  # of that: no step more
OUT_OF_REACH = "wrist out of the arm's reach"

Standing = Callable[[Array], str | None]  # what is in the way of a posture (nq,), in words


class _Brought(NamedTuple):
    """A turn about the object's axis [rad], and the arm's joints that bring the hand there."""

    angle: float
    q_arm: Array


class ArmReach:
    """What one arm reaches with the hand it carries."""

    def __init__(self, arm: Arm) -> None:
        self._arm = arm
        self._lower = np.asarray(arm.model.lowerPositionLimit)
        self._upper = np.asarray(arm.model.upperPositionLimit)

    @cached_property
    def _library(self) -> tuple[Array, KDTree]:
        rng = np.random.default_rng(0)
        q = rng.uniform(self._lower, self._upper, (LIBRARY, len(self._lower)))
        R, p = self._flange(q)
        return q, KDTree(_features(R, p))

    def joints(self, R_WB: Array, p_WB: Array) -> tuple[Array, Mask]:
        """Joint positions (N, n) for poses of the hand base (N, 3, 3), (N, 3), and whether each
        is reached."""
        R, p = self._wanted(R_WB, p_WB)
        q = self._nearest(R, p)[1].reshape(-1, len(self._lower))
        q, off = self._solved(q, np.repeat(R, SEEDS, axis=0), np.repeat(p, SEEDS, axis=0))
        rank = np.where(off < 1.0, self._from_home(q), 1e3 + off).reshape(-1, SEEDS)
        best = rank.argmin(axis=1) + SEEDS * np.arange(len(p))
        return q[best], off[best] < 1.0

    def _nearest(self, R: Array, p: Array) -> tuple[Array, Array]:
        """For each pose of the flange, how far off library postures have it (N, SEEDS) [m], and
        these (N, SEEDS, n)."""
        library, tree = self._library
        far, nearest = tree.query(_features(R, p), SEEDS)
        return far, library[nearest]

    def _from_home(self, q: Array) -> Array:
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

    def placements(
        self, laid: Candidates, surface: SurfaceOfRevolution, room: Room, standing: Standing
    ) -> Candidates:
        """Placements of the hand alone that the arm reaches, as placements of the whole.

        Args:
            surface: On which they are laid, and about whose axis they may be turned.
            room: What stands about it.
            standing: Says what is in the way of a posture of the whole.
        """
        blocked = Counter[str]()
        kept, angles, chosen = [], [], []
        for i, brought in enumerate(self._brought(laid, surface, room)):
            found = self._first_clear(brought, laid.q[i], standing)
            if isinstance(found, str):
                blocked[found] += 1
                continue
            kept.append(i)
            angles.append(found.angle)
            chosen.append(found.q_arm)
        told = (*laid.rejected, *blocked.items())
        laid = laid.take(np.array(kept, dtype=np.intp))
        root, n = self._arm.X_WA, len(laid)
        return replace(
            laid,
            q=self._arm.joined(np.reshape(chosen, (n, len(self._lower))), laid.q),
            R_WB=np.tile(root.rotation, (n, 1, 1)),
            p_WB=np.tile(root.translation, (n, 1)),
            theta=np.angle(np.exp(1j * (laid.theta + np.reshape(angles, (n, 1))))),
            rejected=told,
        )

    def _first_clear(
        self, brought: list[_Brought], q_hand: Array, standing: Standing
    ) -> _Brought | str:
        """The first with nothing in its way, or what is in the first's way."""
        fault = OUT_OF_REACH
        for one in reversed(brought):
            found = standing(self._arm.joined(one.q_arm, q_hand))
            if found is None:
                return one
            fault = found
        return fault

    def _brought(
        self, laid: Candidates, surface: SurfaceOfRevolution, room: Room
    ) -> list[list[_Brought]]:
        """For each placement the turns and postures of the arm that bring the hand there, those
        nearest to home last."""
        angles, frame = evenly(TURNS), surface.frame
        R_OB, p_OB = frame @ laid.R_WB, (laid.p_WB - surface.axis.point) @ frame.T
        R_WB, p_WB = turned(surface, R_OB, p_OB, angles)
        alone = self._arm.hand
        clear = clear_turns(room, alone, link_spheres(alone), laid.q, R_WB, p_WB)
        R, p = self._wanted(R_WB.reshape(-1, 3, 3), p_WB.reshape(-1, 3))
        far, seeds = self._nearest(R, p)
        far = np.where(clear[..., None], far.reshape(TURNS, len(laid), SEEDS), np.inf)
        far = np.swapaxes(far, 0, 1).reshape(len(laid), -1)
        best = np.argsort(far, axis=1)[:, :POSTURES]  # of (turn, seed)
        rows = np.repeat(np.arange(len(laid)), POSTURES)
        turn, seed = np.divmod(best.ravel(), SEEDS)
        pose = turn * len(laid) + rows
        q, off = self._solved(seeds[pose, seed], R[pose], p[pose])
        good = (off < 1.0) & np.isfinite(far[rows, best.ravel()])
        out: list[list[_Brought]] = [[] for _ in range(len(laid))]
        for k in np.argsort(-self._from_home(q)).tolist():
            if good[k]:
                out[rows[k]].append(_Brought(float(angles[turn[k]]), q[k]))
        return out

    def retreat(self, q: Array, way: Retreat) -> Retreat:
        """A way out of the hand alone, by the arm: as far as that follows.

        Args:
            q: (nq,) joint positions of the whole at the stand-off.
        """
        path = self.follow(q[self._arm.q_indices], way.bases)
        count = max(1, len(path))
        rows = np.repeat(q[None], count, axis=0)
        rows[: len(path), self._arm.q_indices] = path
        share = (count - 1) / max(1, len(way.bases) - 1)
        clearance = way.nearest + share * (way.clearance - way.nearest)
        rows.setflags(write=False)
        return replace(
            way, q=rows[0], path=rows, bases=(self._arm.X_WA,) * count, clearance=clearance
        )

    def _wanted(self, R_WB: Array, p_WB: Array) -> tuple[Array, Array]:
        """Poses of the flange in the arm's root for poses of the hand base in the world."""
        X_AW, X_BF = self._arm.X_WA.inverse(), self._arm.X_FB.inverse()
        R_AB = X_AW.rotation @ R_WB
        p_AB = p_WB @ X_AW.rotation.T + X_AW.translation
        return R_AB @ X_BF.rotation, p_AB + R_AB @ X_BF.translation

    def _flange(self, q: Array) -> tuple[Array, Array]:
        frame = self._arm.model.frames[self._arm.flange_id]
        placed = model_placements(self._arm.model, q)
        R, p = placed.rotations[:, frame.parentJoint], placed.positions[:, frame.parentJoint]
        return R @ frame.placement.rotation, p + R @ frame.placement.translation

    def _solved(self, q: Array, R: Array, p: Array) -> tuple[Array, Array]:
        """Damped least squares; joints, and how far off, 1 at the edge of what is near enough."""
        q, off = q.copy(), np.full(len(q), np.inf)
        left = np.arange(len(q))  # not there yet
        for _ in range(STEPS):
            error, J = self._errors(q[left], R[left], p[left])
            place = np.linalg.norm(error[:, :3], axis=1) / _PLACE
            angle = np.linalg.norm(error[:, 3:], axis=1) / (_TURN * _ANGLE)
            off[left] = np.maximum(place, angle)
            going = off[left] > _THERE
            left, error, J = left[going], error[going], J[going]
            if len(left) == 0:
                break
            normal = J @ np.swapaxes(J, 1, 2) + _DAMPING * np.eye(6)
            step = np.einsum("nij,ni->nj", J, np.linalg.solve(normal, error[..., None])[..., 0])
            q[left] = np.clip(q[left] + np.clip(step, -0.5, 0.5), self._lower, self._upper)
        return q, off

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
