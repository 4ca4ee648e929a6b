"""Pads of many configurations at once, with how they move when a joint moves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hand_models.batch import Array, batch_placements, joint_screw
from hand_models.geometry import pad_in_joint
from hand_models.hand import Hand


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
    for pad, finger in enumerate(hand.fingers):
        for name, column in zip(finger.joints, finger.q_indices, strict=True):
            joint = hand.model.getJointId(name)
            v, w = joint_screw(hand, joint)
            R = placements.rotations[:, joint]
            arm = centre[:, pad] - placements.positions[:, joint]
            turns[:, pad, :, column] = R @ w
            moves[:, pad, :, column] = np.cross(R @ w, arm) + R @ v
    return BatchPads(centre, placements.vectors(joints, normals), moves, turns)


def _pads(hand: Hand) -> list[tuple[int, Array, Array]]:
    return [pad_in_joint(hand, finger) for finger in hand.fingers]
