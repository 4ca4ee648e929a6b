"""Placements of a hand brought about by the arm that carries it.

What was found for the hand alone becomes a placement of the whole, whose base stands still: turned
about the object's axis, which changes nothing for the fingers, and with another of the arm's
postures, until nothing is in the way.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from estimator.surface import SurfaceOfRevolution
from estimator.vectors import Array
from hand_models.arm import Arm
from hand_models.spheres import link_spheres
from planner.candidates import Candidates
from planner.funnel import Funnel
from planner.motions.retreat import Retreat
from planner.reaching.arm_poses import SEEDS, ArmPoses
from planner.reaching.turning import Room, clear_turns, evenly, turned

TURNS = 12  # of a placement about the object's axis
POSTURES = 12  # of the arm that are solved for a placement, whichever way it is turned
OUT_OF_REACH = "wrist out of the arm's reach"


class InTheWay(NamedTuple):
    """Whether a posture (nq,) of the whole is free, and what it meets in words if not."""

    is_free: Callable[[Array], bool]
    words: Callable[[Array], str]


class _Brought(NamedTuple):
    """A turn about the object's axis [rad], and the arm's joints that bring the hand there."""

    angle: float
    q_arm: Array


class ArmReach:
    """What one arm reaches with the hand it carries."""

    def __init__(self, arm: Arm) -> None:
        self._arm, self._poses = arm, ArmPoses(arm)

    def placements(
        self, laid: Candidates, surface: SurfaceOfRevolution, room: Room, in_the_way: InTheWay
    ) -> Candidates:
        """Placements of the hand alone that the arm reaches, as placements of the whole.

        Args:
            surface: On which they are laid, and about whose axis they may be turned.
            room: What stands about it.
            in_the_way: Whether a posture of the whole is free, and what it meets.
        """
        if len(laid) == 0:
            return self._whole(laid, [], [], laid.rejected)
        blocked = Counter[str]()
        kept, angles, chosen = [], [], []
        for i, brought in enumerate(self._brought(laid, surface, room)):
            found = self._first_clear(brought, laid.q[i], in_the_way)
            if isinstance(found, str):
                blocked[found] += 1
                continue
            kept.append(i)
            angles.append(found.angle)
            chosen.append(found.q_arm)
        told = (*laid.rejected, *blocked.items())
        return self._whole(laid.take(np.array(kept, dtype=np.intp)), angles, chosen, told)

    def _whole(
        self, laid: Candidates, angles: list[float], chosen: list[Array], rejected: Funnel
    ) -> Candidates:
        root, n = self._arm.X_WA, len(laid)
        return replace(
            laid,
            q=self._arm.joined(np.reshape(chosen, (n, self._arm.model.nq)), laid.q),
            R_WB=np.tile(root.rotation, (n, 1, 1)),
            p_WB=np.tile(root.translation, (n, 1)),
            theta=np.angle(np.exp(1j * (laid.theta + np.reshape(angles, (n, 1))))),
            rejected=rejected,
        )

    def _first_clear(
        self, brought: list[_Brought], q_hand: Array, in_the_way: InTheWay
    ) -> _Brought | str:
        """The first with nothing in its way, or what is in the first's way."""
        if not brought:
            return OUT_OF_REACH
        for one in brought:
            if in_the_way.is_free(self._arm.joined(one.q_arm, q_hand)):
                return one
        return in_the_way.words(self._arm.joined(brought[0].q_arm, q_hand))

    def _brought(
        self, laid: Candidates, surface: SurfaceOfRevolution, room: Room
    ) -> list[list[_Brought]]:
        """For each placement the turns and postures of the arm that bring the hand there, those
        nearest to home first."""
        angles, frame = evenly(TURNS), surface.frame
        R_OB, p_OB = frame @ laid.R_WB, (laid.p_WB - surface.axis.point) @ frame.T
        R_WB, p_WB = turned(surface, R_OB, p_OB, angles)
        alone = self._arm.hand
        clear = clear_turns(room, alone, link_spheres(alone), laid.q, R_WB, p_WB)
        R, p = self._poses.flange_poses(R_WB.reshape(-1, 3, 3), p_WB.reshape(-1, 3))
        far, seeds = self._poses.nearest(R, p)
        far = np.where(clear[..., None], far.reshape(TURNS, len(laid), SEEDS), np.inf)
        far = np.swapaxes(far, 0, 1).reshape(len(laid), -1)
        best = np.argsort(far, axis=1)[:, :POSTURES]  # of (turn, seed)
        rows = np.repeat(np.arange(len(laid)), POSTURES)
        turn, seed = np.divmod(best.ravel(), SEEDS)
        pose = turn * len(laid) + rows
        q, off = self._poses.solved(seeds[pose, seed], R[pose], p[pose])
        good = (off < 1.0) & np.isfinite(far[rows, best.ravel()])
        out: list[list[_Brought]] = [[] for _ in range(len(laid))]
        for k in np.argsort(self._poses.from_home(q)).tolist():
            if good[k]:
                out[rows[k]].append(_Brought(float(angles[turn[k]]), q[k]))
        return out

    def retreat(self, q: Array, way: Retreat) -> Retreat:
        """A way out of the hand alone, by the arm: as far as that follows.

        Args:
            q: (nq,) joint positions of the whole at the stand-off.
        """
        path = self._poses.follow(q[self._arm.q_indices], way.bases)
        count = max(1, len(path))
        rows = np.repeat(q[None], count, axis=0)
        rows[: len(path), self._arm.q_indices] = path
        share = (count - 1) / max(1, len(way.bases) - 1)
        clearance = way.nearest + share * (way.clearance - way.nearest)
        rows.setflags(write=False)
        return replace(
            way, q=rows[0], path=rows, bases=(self._arm.X_WA,) * count, clearance=clearance
        )
