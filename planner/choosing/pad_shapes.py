"""The pads of placements as they lie in the world: what a touch becomes on other objects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimator.vectors import Array, Index
from hand_models.batch import batch_placements
from hand_models.batch_pads import batch_pads
from hand_models.chains import chains_of
from hand_models.hand import Hand

DAMPING = 1e-6  # [m^2], as approaches have it


@dataclass(frozen=True, eq=False)
class PadShapes:
    """Surfaces of m pads of N placements (`hand_models.dome`).

    Args:
        balls: rho, (N, m) [m].
        spreads: A in the world, (N, m, 3, 3) [m^2].
        spins: Angular velocity in the world, per way inwards, as a finger's joints take its pad
            along its approach, (N, m, 3) [rad/m]; zero where something else carries the finger.
    """

    balls: Array
    spreads: Array
    spins: Array


def pad_shapes(hand: Hand, fingers: Index, q: Array, R_WB: Array, n_W: Array) -> PadShapes | None:
    """Of fingers (N, m) in postures (N, nq) on bases (N, 3, 3) that touch under outward normals
    (N, m, 3); None where all pads are spheres.

    Several fingers go along their approaches by their own joints, a single one is carried.
    """
    if hand.has_balls:
        return None
    pads = chains_of(hand).pads[fingers]
    rows = np.arange(len(q))[:, None]
    R_WJ = R_WB[:, None] @ batch_placements(hand, q).rotations[rows, pads["joint"]]
    spreads = R_WJ @ pads["dome_spread"] @ np.swapaxes(R_WJ, -1, -2)
    spins = np.zeros(n_W.shape) if fingers.shape[1] == 1 else _spins(hand, fingers, q, R_WB, n_W)
    balls = np.asarray(pads["radius"] + pads["dome_more"])
    return PadShapes(balls, np.ascontiguousarray(spreads), spins)


def _spins(hand: Hand, fingers: Index, q: Array, R_WB: Array, n_W: Array) -> Array:
    """The least joint velocities that take each pad's centre along -n, and the pad's turn."""
    pads, rows = batch_pads(hand, q), np.arange(len(q))[:, None]
    own = np.zeros((len(hand.fingers), q.shape[1]))
    for row, finger in zip(own, hand.fingers, strict=True):
        row[list(finger.q_indices)] = 1.0
    J = pads.moves[rows, fingers] * own[fingers][..., None, :]
    inwards = -np.einsum("nji,nmj->nmi", R_WB, n_W)
    system = J @ np.swapaxes(J, -1, -2) + DAMPING * np.eye(3)
    dq = np.einsum("nmij,nmi->nmj", J, np.linalg.solve(system, inwards[..., None])[..., 0])
    turn = np.einsum("nmij,nmj->nmi", pads.turns[rows, fingers], dq)
    return np.ascontiguousarray(np.einsum("nij,nmj->nmi", R_WB, turn))
