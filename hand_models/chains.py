"""A hand's joints and pads as plain arrays, for loops that are compiled.

Every joint is a screw of one degree of freedom (`hand_models.joints`), every pad is fixed to one
joint: what a compiled loop needs to put thousands of postures in place is a handful of arrays.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hand_models.geometry import dome_in_joint, pad_in_joint
from hand_models.hand import Hand
from hand_models.joints import joint_motions

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


JOINT = np.dtype([
    ("parent", np.int64), ("rotation", np.float64, (3, 3)), ("position", np.float64, 3),
    ("angular", np.float64, 3), ("linear", np.float64, 3),
    ("q_index", np.int64), ("multiplier", np.float64), ("offset", np.float64),
], align=True)  # fmt: skip
PAD = np.dtype([
    ("joint", np.int64), ("centre", np.float64, 3), ("normal", np.float64, 3),
    ("radius", np.float64), ("dome_centre", np.float64, 3), ("dome_spread", np.float64, (3, 3)),
    ("dome_more", np.float64),
], align=True)  # fmt: skip


class Chains(NamedTuple):
    """J joints, the first of them the hand base; F pads.

    Records, not an array for each number: every array that compiled functions hand to one another
    costs a tenth of a second of compiling.

    Attributes:
        joints: (J,) records of `parent`, the joint that carries it, its own for the base;
            `rotation`, `position` (3, 3), (3,) fixed pose in its parent [m]; `angular`, `linear`
            (3,) velocity in its own frame per unit of its position; it stands at
            `multiplier` q[`q_index`] + `offset`.
        pads: (F,) records of `joint`, and in its frame `centre`, `normal` (3,), `radius` of the
            sphere that stands for the pad [m]; `dome_centre`, `dome_spread` (3,), (3, 3) c and A of
            the pad's surface (`hand_models.dome`) there, `dome_more` rho less `radius` [m].
        supports: (F, L) joints between base and pad, filled up with -1.
        lower, upper: (nq,) limits.
        domed: Whether some pad is no sphere.
    """

    joints: NDArray[np.void]
    pads: NDArray[np.void]
    supports: IntArray
    lower: Array
    upper: Array
    domed: bool


@lru_cache(maxsize=8)
def chains_of(hand: Hand) -> Chains:
    """The arrays of a hand; equal arguments give the same object, which is only to be read."""
    pads = _pads(hand)
    return Chains(
        joints=_joints(hand),
        pads=pads,
        supports=_supports(hand, pads["joint"]),
        lower=np.array(hand.lower),
        upper=np.array(hand.upper),
        domed=not hand.has_balls,
    )


def records(kind: np.dtype[np.void], **columns: ArrayLike) -> NDArray[np.void]:
    """N records, from a column for each of their fields, the first of them of N rows."""
    out = np.zeros(len(np.asarray(next(iter(columns.values())))), dtype=kind)
    for name, column in columns.items():
        out[name] = column
    return out


def _joints(hand: Hand) -> NDArray[np.void]:
    model, nothing = hand.model, np.zeros(3)
    motions, placements = joint_motions(model), list(model.jointPlacements)
    return records(
        JOINT,
        parent=[int(i) for i in model.parents],
        rotation=[X.rotation for X in placements],
        position=[X.translation for X in placements],
        angular=[nothing, *(motion.angular for motion in motions)],
        linear=[nothing, *(motion.linear for motion in motions)],
        q_index=[0, *(motion.q_index for motion in motions)],
        multiplier=[0.0, *(motion.multiplier for motion in motions)],
        offset=[0.0, *(motion.offset for motion in motions)],
    )


def _pads(hand: Hand) -> NDArray[np.void]:
    joints, centres, normals = zip(*(pad_in_joint(hand, f) for f in hand.fingers), strict=True)
    domes = [dome_in_joint(hand, f) for f in hand.fingers]
    return records(
        PAD,
        joint=joints,
        centre=centres,
        normal=normals,
        radius=[f.pad_radius for f in hand.fingers],
        dome_centre=[dome.centre for dome in domes],
        dome_spread=[dome.spread for dome in domes],
        dome_more=[d.ball - f.pad_radius for d, f in zip(domes, hand.fingers, strict=True)],
    )


def _supports(hand: Hand, joints: IntArray) -> IntArray:
    chains = [[int(j) for j in hand.model.supports[int(joint)]][1:] for joint in joints]
    out = np.full((len(chains), max(map(len, chains))), -1)
    for row, chain in zip(out, chains, strict=True):
        row[: len(chain)] = chain
    return out
