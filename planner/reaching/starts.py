"""Where to start the optimiser: library postures whose pads already nearly fit the contacts.

A posture fits contacts when the pads' centres and points ahead of the pads have the mutual
distances of the contacts' sphere centres and points ahead of them, whatever the hand's place. So
postures are found by their distances (k-d tree), the place follows by Kabsch's method, and the
best are ranked by what is left: misfit, penetration of the object, violation of the base's range.
Where the base is held near a nominal pose, postures are also looked up by place, finger by finger.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import permutations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from hand_models.batch import batch_placements
from hand_models.hand import Hand
from hand_models.postures import Postures, posture_library
from hand_models.spheres import LinkSpheres
from planner.reaching.solid import RevolvedSolid
from planner.reaching.workspace import Workspace

Array = NDArray[np.float64]

_AHEAD = 0.015  # weight of a pad's direction against its place, as a length [m]
_NEIGHBOURS = 24  # postures looked up per assignment of fingers
_ROLLS = 8  # turns tried where one or two contacts leave the hand's roll open
_RANKED = 120  # candidates whose links are tested against the object


@dataclass(frozen=True, eq=False)
class Start:
    """A first guess.

    Attributes:
        fingers: The finger for each contact, by name.
        q: (nq,) joint positions.
        X_WB: Pose of the hand base.
    """

    fingers: tuple[str, ...]
    q: Array
    X_WB: pin.SE3


@dataclass(frozen=True, eq=False)
class _Pool:
    """N guesses side by side: assignment of fingers, joints, base."""

    fingers: NDArray[np.int64]  # (N, k)
    q: Array  # (N, nq)
    R: Array  # (N, 3, 3)
    p: Array  # (N, 3)
    misfit: Array  # (N,) root mean square over centres and points ahead [m]

    def take(self, index: NDArray[np.int64]) -> _Pool:
        return _Pool(
            self.fingers[index], self.q[index], self.R[index], self.p[index], self.misfit[index]
        )


class StartSearch:
    """Starts for any contacts of one hand; holds its library and the trees over it."""

    def __init__(self, hand: Hand, spheres: LinkSpheres) -> None:
        self._hand, self._spheres = hand, spheres
        self._library: Postures = posture_library(hand)
        self._tree = lru_cache(maxsize=None)(self._build_tree)

    def find(
        self,
        centres: Array,
        normals: Array,
        solid: RevolvedSolid,
        *,
        fingers: tuple[int, ...] | None,
        workspace: Workspace,
        table: tuple[float, float, float, float] | None,
        count: int,
    ) -> list[Start]:
        """The best starts, best first.

        Args:
            centres: (k, 3) where the pads' centres must be, in the world [m].
            normals: (k, 3) outward surface normals at the contacts.
            solid: What the links should stay out of.
            fingers: Finger index of each contact; None tries all assignments.
            workspace: Range of the hand base.
            table: Half-space a x + b y + c z >= h that the links should stay in.
            count: At most so many.
        """
        assignments = self._assignments(len(centres), fingers)
        ahead = centres - _AHEAD * normals
        found = [self._by_shape(a, centres, ahead) for a in assignments]
        if workspace.X_WB is not None:
            found.extend(self._by_place(a, centres, ahead, workspace.X_WB) for a in assignments)
        pool = _joined(found)
        score = pool.misfit + workspace.violation(pool.R, pool.p)
        first = np.argsort(score, kind="stable")[:_RANKED]
        pool, score = pool.take(first), score[first]
        score = score + self._penetration(pool, solid, table)
        best = pool.take(np.argsort(score, kind="stable")[:count])
        return [
            Start(tuple(self._hand.fingers[i].name for i in f), q, pin.SE3(R, p))
            for f, q, R, p in zip(best.fingers, best.q, best.R, best.p, strict=True)
        ]

    def _assignments(self, k: int, fingers: tuple[int, ...] | None) -> list[tuple[int, ...]]:
        if fingers is not None:
            return [fingers]
        return list(permutations(range(len(self._hand.fingers)), k))

    def _by_shape(self, fingers: tuple[int, ...], centres: Array, ahead: Array) -> _Pool:
        k = len(fingers)
        target = np.vstack([centres, ahead])
        chosen = np.linspace(0, len(self._library) - 1, 2 * _NEIGHBOURS).astype(int)
        if k > 1:
            ordered = sorted(range(k), key=lambda i: fingers[i])
            wanted = _distances(target[None, [*ordered, *(k + i for i in ordered)]])[0]
            _, chosen = self._tree(tuple(sorted(fingers))).query(wanted, _NEIGHBOURS)
        return self._placed(fingers, np.atleast_1d(chosen), target)

    def _placed(self, fingers: tuple[int, ...], chosen: NDArray[np.int64], target: Array) -> _Pool:
        """Postures put where they fit best, with rolls where the contacts leave them open."""
        k = len(fingers)
        points = self._points(list(fingers))[chosen]
        R, p = _kabsch(points, target)
        if k < 3:
            along = target[1] - target[0]  # to the point ahead, or to the other contact
            turns = np.linspace(0.0, 2.0 * np.pi, _ROLLS, endpoint=False)
            rolls = Rotation.from_rotvec(turns[:, None] * along / np.linalg.norm(along)).as_matrix()
            p = (np.einsum("rij,nj->nri", rolls, p - target[0]) + target[0]).reshape(-1, 3)
            R = np.einsum("rij,njk->nrik", rolls, R).reshape(-1, 3, 3)
            chosen, points = np.repeat(chosen, _ROLLS), np.repeat(points, _ROLLS, axis=0)
        error = np.einsum("nij,nmj->nmi", R, points) + p[:, None] - target
        return _Pool(
            np.tile(np.array(fingers), (len(chosen), 1)),
            self._library.q[chosen],
            R,
            p,
            np.sqrt(np.mean(np.sum(error**2, axis=2), axis=1)),
        )

    def _by_place(
        self, fingers: tuple[int, ...], centres: Array, ahead: Array, X_WB: pin.SE3
    ) -> _Pool:
        """With the base nominal, each finger's joints from the postures that serve it best."""
        R, p = X_WB.rotation, X_WB.translation
        points = self._points(list(fingers)) @ R.T + p
        k, few = len(fingers), 4
        target = np.vstack([centres, ahead])
        error = np.sum((points - target) ** 2, axis=2)
        per_finger = error[:, :k] + error[:, k:]
        best = np.argsort(per_finger, axis=0)[:few]  # (few, k)
        q = self._library.q[best[:, 0]].copy()
        for i, finger in enumerate(fingers):
            joints = self._hand.fingers[finger].q_indices
            q[:, joints] = self._library.q[best[:, i]][:, joints]
        square = np.take_along_axis(per_finger, best, axis=0).sum(axis=1) / (2 * k)
        return _Pool(
            np.tile(np.array(fingers), (few, 1)),
            q,
            np.tile(R, (few, 1, 1)),
            np.tile(p, (few, 1)),
            np.sqrt(square),
        )

    def _penetration(
        self,
        pool: _Pool,
        solid: RevolvedSolid,
        table: tuple[float, float, float, float] | None,
    ) -> Array:
        """(N,) depth of the deepest link sphere in object or table, touching pads left out [m]."""
        local = self._spheres.positions(batch_placements(self._hand, pool.q))
        world = np.einsum("nij,nmj->nmi", pool.R, local, optimize=True) + pool.p[:, None]
        clearance = solid.distance(world) - self._spheres.radii
        if table is not None:
            above = world @ np.array(table[:3]) - table[3] - self._spheres.radii
            clearance = np.minimum(clearance, above)
        touching = (self._spheres.finger_indices[None, :, None] == pool.fingers[:, None]).any(2)
        clearance[touching & self._spheres.is_pad] = 0.0
        return np.asarray(np.maximum(-clearance.min(axis=1), 0.0))

    def _points(self, fingers: Sequence[int]) -> Array:
        """(N, 2k, 3) pad centres, then the points ahead of them, in B."""
        centres = self._library.pad_centres[:, fingers]
        return np.concatenate(
            [centres, centres + _AHEAD * self._library.pad_normals[:, fingers]], 1
        )

    def _build_tree(self, fingers: tuple[int, ...]) -> KDTree:
        return KDTree(_distances(self._points(fingers)))


def _distances(points: Array) -> Array:
    """(N, m (m - 1) / 2) mutual distances of N sets of m points."""
    i, j = np.triu_indices(points.shape[1], 1)
    return np.asarray(np.linalg.norm(points[:, i] - points[:, j], axis=2))


def _kabsch(points: Array, target: Array) -> tuple[Array, Array]:
    """Rotations (N, 3, 3) and positions (N, 3) that best bring points (N, m, 3) onto (m, 3)."""
    middle, goal = points.mean(axis=1), target.mean(axis=0)
    covariance = np.einsum("nmi,mj->nij", points - middle[:, None], target - goal)
    U, _, Vt = np.linalg.svd(covariance)
    V, Ut = np.swapaxes(Vt, 1, 2), np.swapaxes(U, 1, 2)
    V[:, :, 2] *= np.linalg.det(V @ Ut)[:, None]  # a turn, never a mirror
    R = V @ Ut
    return R, goal - np.einsum("nij,nj->ni", R, middle)


def _joined(parts: list[_Pool]) -> _Pool:
    return _Pool(
        np.concatenate([part.fingers for part in parts]),
        np.concatenate([part.q for part in parts]),
        np.concatenate([part.R for part in parts]),
        np.concatenate([part.p for part in parts]),
        np.concatenate([part.misfit for part in parts]),
    )
