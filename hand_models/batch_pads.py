"""Pads of many configurations at once, with how they move when a joint moves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hand_models.batch import Array, batch_placements
from hand_models.geometry import pad_in_joint
from hand_models.hand import Hand
from hand_models.joints import joint_motions


@dataclass(frozen=True, eq=False)
class BatchPads:
    """All F pads of N configurations, in the hand base frame B.

    Attributes:
        centres, normals: (N, F, 3) [m], unit.
        moves: (N, F, 3, nq) d centre / d q.
        turns: (N, F, 3, nq) angular velocity of the pad per joint velocity.
    """

    centres: Array
    normals: Array
    moves: Array
    turns: Array


def batch_pads(hand: Hand, q: Array) -> BatchPads:
    """Pad centres, normals and Jacobians for configurations (N, nq)."""
    placements = batch_placements(hand, q)
    joints, centres, normals = (np.array(x) for x in zip(*_pads(hand), strict=True))
    centre = placements.points(joints, centres)
    moves = np.zeros((*centre.shape, q.shape[1]))
    turns = np.zeros_like(moves)
    motions = joint_motions(hand.model)
    for pad, finger in enumerate(hand.fingers):
        tip = hand.model.frames[finger.tip_frame_id].parentJoint
        for joint in [int(j) for j in hand.model.supports[tip]][1:]:
            motion = motions[joint - 1]
            R = placements.rotations[:, joint]
            arm = centre[:, pad] - placements.positions[:, joint]
            w, v = R @ motion.angular, R @ motion.linear
            turns[:, pad, :, motion.q_index] += motion.multiplier * w
            moves[:, pad, :, motion.q_index] += motion.multiplier * (np.cross(w, arm) + v)
    return BatchPads(centre, placements.vectors(joints, normals), moves, turns)


def _pads(hand: Hand) -> list[tuple[int, Array, Array]]:
    return [pad_in_joint(hand, finger) for finger in hand.fingers]
