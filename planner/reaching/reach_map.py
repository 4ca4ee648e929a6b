"""Where a hand can touch, by radius: placements on cylinders, found once and kept.

Idea: what three fingers can reach together hardly depends on the object but for its radius. So
postures are laid onto cylinders of growing radius once per hand; those that hold, their links
clear of the cylinder between the pads and of each other, are kept on disk. A plan draws
from the map at the believed object's own radii and needs a few steps to fit its true slopes.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations
from typing import Any, NamedTuple, cast

import numpy as np

from estimator.axis import Axis
from estimator.profile import cylinder
from estimator.surface import SurfaceOfRevolution
from estimator.vectors import Array, Index, Mask
from hand_models.cache import cached_arrays, hand_fingerprint
from hand_models.collision import HandCollision
from hand_models.hand import Hand
from hand_models.postures import Postures
from hand_models.spheres import LinkSpheres
from planner.reaching.clear import clear_of
from planner.reaching.laying import Laid, Poses, inset, lay, opening_poses

SMALLEST, RATIO, CLASSES = 0.008, 1.25, 14  # radii of the cylinders: 8 to 145 mm [m], [-]
HEIGHT = 0.16  # of the cylinders [m]
LAID = 2400  # postures that are laid onto each
GAP = 1e-3  # of a laid pad from the cylinder [m]

_VERSION = 4  # of all this; part of the cache's key
_HALF_TURN = np.diag([1.0, -1.0, -1.0])


class Entries(NamedTuple):
    """N placements on one cylinder, pads at middle height zero, in its frame O."""

    fingers: Index  # (N, m)
    q: Array  # (N, nq)
    R_OB: Array  # (N, 3, 3)
    p_OB: Array  # (N, 3)
    z: Array  # (N, m) heights of the pads


class ReachMap:
    """The map of one hand: a cylinder's entries are laid, or loaded, when first asked for.

    Args:
        hand, postures, spheres: The hand, what is laid on, and what must stay outside.
        collision: Of the hand with itself.
        cone: Largest angle between pad normal and inward surface normal [rad].
    """

    def __init__(
        self,
        hand: Hand,
        postures: Postures,
        spheres: LinkSpheres,
        collision: HandCollision,
        *,
        cone: float,
    ) -> None:
        self.hand, self.postures, self.spheres = hand, postures, spheres
        self.collision, self.cone = collision, cone
        self._entries: dict[tuple[int, int], Entries] = {}

    def entries(self, radius_class: int, fingers_at_once: int) -> Entries:
        """All placements with so many fingers on one of the cylinders."""
        key = (radius_class, fingers_at_once)
        if key not in self._entries:
            settings = (_VERSION, len(self.postures), round(self.cone, 6), *key)
            name = "reach-" + hand_fingerprint(self.hand, *settings)
            arrays = cached_arrays(name, Entries._fields, lambda: self._laid(*key)._asdict())
            self._entries[key] = Entries(**cast("Mapping[str, Any]", arrays))
        return self._entries[key]

    def draw(
        self,
        surface: SurfaceOfRevolution,
        fingers_at_once: int,
        *,
        count: int,
        rng: np.random.Generator,
    ) -> tuple[Poses, Index]:
        """Starts on a surface: about `count`, of all its radii; fewer where the map has gaps.

        Returns:
            Poses in the object frame and the fingers that touch, (N, m).
        """
        low, high = inset(surface.profile.z_range)
        radius = surface.profile.derivatives(rng.uniform(low, high, size=count))[0]
        classes = np.unique(_class(radius), return_counts=True)
        picked: list[Entries] = []
        for radius_class, several in zip(*classes, strict=True):
            known = self.entries(int(radius_class), fingers_at_once)
            if len(known.q):
                rows = rng.integers(len(known.q), size=several)
                picked.append(Entries(*(x[rows] for x in known)))
        if not picked:
            picked = [_none(self.hand, fingers_at_once)]
        joined = Entries(*(np.concatenate(x) for x in zip(*picked, strict=True)))
        return _set_down(joined, low, high, rng)

    def _laid(self, radius_class: int, fingers_at_once: int) -> Entries:
        """The entries of a cylinder, from scratch: seconds."""
        rng = np.random.default_rng([radius_class, fingers_at_once])
        hand, surface = self.hand, _cylinder(radius_class)
        ways = np.array(list(combinations(range(len(hand.fingers)), fingers_at_once)), np.intp)
        fingers = ways[rng.integers(len(ways), size=LAID)]
        q = self.postures.q[rng.choice(len(self.postures), size=LAID)]
        opening = opening_poses(hand, surface, q, fingers, rng=rng)
        laid = lay(hand, surface, opening, fingers, cone=self.cone)
        kept = np.all((np.abs(laid.gap) < GAP) & (laid.pad_angle < self.cone), axis=1)
        kept[kept] = self._clear(surface, laid, kept)
        kept[kept] = [self.collision.is_self_free(x) for x in laid.q[kept]]
        middle = laid.z.mean(axis=1)
        p_OB = laid.p_OB - middle[:, None] * [0.0, 0.0, 1.0]
        return Entries(
            fingers[kept], laid.q[kept], laid.R_OB[kept], p_OB[kept], (laid.z.T - middle).T[kept]
        )

    def _clear(self, surface: SurfaceOfRevolution, laid: Laid, rows: Mask) -> Mask:
        """Whether links but the pads are out of the cylinder between the pads.

        Beyond them the object may end: whether it does is the plan's to see.
        """
        z = laid.z[rows]
        between = np.stack([z.min(axis=1), z.max(axis=1)], axis=1)
        return clear_of(
            self.hand, self.spheres, surface.profile, laid.q[rows], laid.R_OB[rows],
            laid.p_OB[rows], between=between,
        )  # fmt: skip


def _cylinder(radius_class: int) -> SurfaceOfRevolution:
    upright = Axis(np.zeros(3), np.array([0.0, 0.0, 1.0]))
    return SurfaceOfRevolution(upright, cylinder(SMALLEST * RATIO**radius_class, HEIGHT))


def _class(radius: Array) -> Index:
    nearest = np.rint(np.log(radius / SMALLEST) / np.log(RATIO))
    return np.asarray(np.clip(nearest, 0, CLASSES - 1), dtype=np.intp)


def _set_down(
    known: Entries, low: float, high: float, rng: np.random.Generator
) -> tuple[Poses, Index]:
    """Entries upright or upside down, at a height where all their pads fit if they can."""
    flipped = rng.random(len(known.q)) < 0.5
    turn = np.where(flipped[:, None, None], _HALF_TURN, np.eye(3))
    z = np.where(flipped[:, None], -known.z, known.z)
    lowest, highest = low - z.min(axis=1), high - z.max(axis=1)
    middle = 0.5 * (lowest + highest)
    room = np.maximum(0.5 * (highest - lowest), 0.0)
    height = middle + room * rng.uniform(-1.0, 1.0, size=len(middle))
    p_OB = np.einsum("nij,nj->ni", turn, known.p_OB) + height[:, None] * [0.0, 0.0, 1.0]
    return Poses(known.q, turn @ known.R_OB, p_OB), known.fingers


def _none(hand: Hand, fingers_at_once: int) -> Entries:
    shapes = ((0, fingers_at_once), (0, hand.model.nq), (0, 3, 3), (0, 3), (0, fingers_at_once))
    empty = [np.zeros(shape) for shape in shapes]
    return Entries(empty[0].astype(np.intp), *empty[1:])
