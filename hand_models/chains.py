"""A hand's joints and pads as plain arrays, for loops that are compiled.

Every joint is a screw of one degree of freedom (`hand_models.joints`), every pad is fixed to one
joint: what a compiled loop needs to put thousands of postures in place is a handful of arrays.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hand_models.geometry import dome_in_joint, pad_in_joint
from hand_models.hand import Hand
from hand_models.joints import joint_motions

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


class Chains(NamedTuple):
    """J joints, the first of them the hand base; F pads.

    Attributes:
        parents: (J,) joint that carries each; its own for the base.
        rotations, positions: (J, 3, 3), (J, 3) fixed pose of each joint in its parent [m].
        angular, linear: (J, 3) velocity in the joint's own frame per unit of its position.
        q_indices, multipliers, offsets: (J,) joint j stands at multiplier q[q_index] + offset.
        lower, upper: (nq,) limits.
        pad_joints, pad_centres, pad_normals, pad_radii: (F,), (F, 3), (F, 3), (F,) in the joints'
            frames: spheres that stand for the pads [m].
        dome_centres, dome_spreads, dome_radii: (F, 3), (F, 3, 3), (F,) c and A of the pads'
            surfaces (`hand_models.dome`) in the joints' frames, and rho less `pad_radii` [m].
        supports: (F, L) joints between base and pad, filled up with -1.
    """

    parents: IntArray
    rotations: Array
    positions: Array
    angular: Array
    linear: Array
    q_indices: IntArray
    multipliers: Array
    offsets: Array
    lower: Array
    upper: Array
    pad_joints: IntArray
    pad_centres: Array
    pad_normals: Array
    pad_radii: Array
    dome_centres: Array
    dome_spreads: Array
    dome_radii: Array
    supports: IntArray


@lru_cache(maxsize=8)
def chains_of(hand: Hand) -> Chains:
    """The arrays of a hand; equal arguments give the same object, which is only to be read."""
    model, motions = hand.model, joint_motions(hand.model)
    placements = list(model.jointPlacements)
    joints, centres, normals = zip(*(pad_in_joint(hand, f) for f in hand.fingers), strict=True)
    domes, nothing = [dome_in_joint(hand, f) for f in hand.fingers], np.zeros(3)
    return Chains(
        parents=np.array([int(i) for i in model.parents]),
        rotations=np.array([X.rotation for X in placements]),
        positions=np.array([X.translation for X in placements]),
        angular=np.array([nothing, *(motion.angular for motion in motions)]),
        linear=np.array([nothing, *(motion.linear for motion in motions)]),
        q_indices=np.array([0, *(motion.q_index for motion in motions)]),
        multipliers=np.array([0.0, *(motion.multiplier for motion in motions)]),
        offsets=np.array([0.0, *(motion.offset for motion in motions)]),
        lower=np.array(hand.lower),
        upper=np.array(hand.upper),
        pad_joints=np.array(joints),
        pad_centres=np.array(centres),
        pad_normals=np.array(normals),
        pad_radii=np.array([f.pad_radius for f in hand.fingers]),
        dome_centres=np.array([dome.centre for dome in domes]),
        dome_spreads=np.array([dome.spread for dome in domes]),
        dome_radii=np.array(
            [dome.ball - f.pad_radius for dome, f in zip(domes, hand.fingers, strict=True)]
        ),
        supports=_supports(hand, joints),
    )


def _supports(hand: Hand, joints: tuple[int, ...]) -> IntArray:
    chains = [[int(j) for j in hand.model.supports[joint]][1:] for joint in joints]
    out = np.full((len(chains), max(map(len, chains))), -1)
    for row, chain in zip(out, chains, strict=True):
        row[: len(chain)] = chain
    return out
