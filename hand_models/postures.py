"""A library of postures in which the hand does not touch itself: starts for the optimiser."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hand_models.batch import batch_placements
from hand_models.cache import cached_arrays, hand_fingerprint
from hand_models.collision import HandCollision
from hand_models.geometry import pad_in_joint
from hand_models.hand import Hand, HandError

Array = NDArray[np.float64]

_VERSION = 5  # of the sampling and the rules of collision; part of the cache's key
_FIELDS = ("q", "pad_centres", "pad_normals")
_APART = 2e-3  # of links where a hand is to begin [m]
_DRAWS_PER_POSTURE = 50  # a hand that is free of itself in fewer than 2 % of draws is misdescribed


@dataclass(frozen=True, eq=False)
class Postures:
    """N postures within the joint limits, no two links overlapping.

    Attributes:
        q: (N, nq) joint positions [rad], [m] if prismatic.
        pad_centres: (N, F, 3) centres of the spheres that stand for the pads, in the hand base
            frame B [m].
        pad_normals: (N, F, 3) unit vectors out of the pads, in B.
    """

    q: Array
    pad_centres: Array
    pad_normals: Array

    def __len__(self) -> int:
        return len(self.q)


def posture_library(hand: Hand, *, count: int = 12_000, seed: int = 0) -> Postures:
    """Random postures free of self-collision, uniform within the joint limits.

    Built once (seconds) and kept in the cache (`hand_models.cache`) under a name that depends on
    the hand's content, `count` and `seed`; equal arguments give equal postures.

    Args:
        count: Number of postures N, at least one.
        seed: Of the random draws.

    Raises:
        HandError: The hand collides with itself in nearly every posture.
    """
    if count < 1:
        raise ValueError(f"count must be at least 1, got {count}")
    key = hand_fingerprint(hand, "postures", _VERSION, count, seed)
    rng = np.random.default_rng(seed)
    arrays = cached_arrays(f"postures-{key}", _FIELDS, lambda: _draw(hand, count, rng))
    for array in arrays.values():
        array.setflags(write=False)
    return Postures(*(arrays[name].astype(np.float64, copy=False) for name in _FIELDS))


def start_posture(hand: Hand) -> Array:
    """Where a hand can begin, (nq,): its home, or the nearest posture whose links are apart.

    In mid-range some hands meet themselves (Psyonic's thumb its index finger). The library is
    looked through by the farthest joint, as a share of its range; an arm stays at home.

    Raises:
        HandError: The hand collides with itself in nearly every posture.
    """
    if hand.arm is not None:
        return hand.arm.joined(hand.arm.home, start_posture(hand.arm.hand))
    collision, home = HandCollision(hand), hand.home
    if collision.self_clearance(home).distance > 0.0:
        return home
    q = posture_library(hand).q
    nearest = np.argsort(np.max(np.abs(q - home) / (hand.upper - hand.lower), axis=1))
    gaps = (collision.self_clearance(q[k]).distance for k in nearest)
    first = next((k for k, gap in enumerate(gaps) if gap > _APART), 0)
    return np.asarray(q[nearest[first]])


def _draw(hand: Hand, count: int, rng: np.random.Generator) -> dict[str, NDArray[np.generic]]:
    collision = HandCollision(hand)
    postures: list[Array] = []
    for _ in range(_DRAWS_PER_POSTURE * count):
        q = rng.uniform(hand.lower, hand.upper)
        if collision.is_self_free(q):
            postures.append(q)
            if len(postures) == count:
                break
    else:
        raise HandError(
            f"{hand.name}: only {len(postures)} of {_DRAWS_PER_POSTURE * count} random postures"
            " are free of self-collision; check the description's meshes"
        )
    q = np.array(postures)
    centres, normals = pads_of(hand, q)
    return {"q": q, "pad_centres": centres, "pad_normals": normals}


def pads_of(hand: Hand, q: Array) -> tuple[Array, Array]:
    """Pad centres and normals, each (N, F, 3) in the hand base frame B, of (N, nq) postures."""
    joints, centres, normals = zip(*(pad_in_joint(hand, f) for f in hand.fingers), strict=True)
    placements = batch_placements(hand, q)
    index = np.array(joints, dtype=np.int64)
    return (
        placements.points(index, np.array(centres)),
        placements.vectors(index, np.array(normals)),
    )
