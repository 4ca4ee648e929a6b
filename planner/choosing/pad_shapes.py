"""The pads of placements as they lie in the world: what a touch becomes on other objects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimator.vectors import Array, Index
from hand_models.batch import batch_placements
from hand_models.batch_pads import batch_pads
from hand_models.chains import chains_of
from hand_models.hand import Hand
from planner.kinematics.pulling import DAMPING


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


def pad_shapes(
    hand: Hand, fingers: Index, q: Array, R_WB: Array, n_W: Array, *, carried: bool
) -> PadShapes | None:
    """Of fingers (N, m) in postures (N, nq) on bases (N, 3, 3) that touch under outward normals
    (N, m, 3); None where all pads are spheres.

    Args:
        carried: Whether something else moves a finger along its approach, not its own joints.
    """
    if hand.has_balls:
        return None
    pads, placed = chains_of(hand).pads[fingers], batch_placements(hand, q)
    rows = np.arange(len(q))[:, None]
    R_BJ = placed.rotations[rows, pads["joint"]]
    A = R_BJ @ pads["dome_spread"] @ np.swapaxes(R_BJ, -1, -2)
    spins = np.zeros(n_W.shape)
    if not carried:
        middles = placed.positions[rows, pads["joint"]]
        middles = middles + np.einsum("nmij,nmj->nmi", R_BJ, pads["dome_centre"])
        u = -np.einsum("nji,nmj->nmi", R_WB, n_W)
        spins = _spins(hand, fingers, q, _Touching(u, middles, A, pads["dome_more"]))
        spins = np.ascontiguousarray(np.einsum("nij,nmj->nmi", R_WB, spins))
    R = R_WB[:, None]
    spreads = np.ascontiguousarray(R @ A @ np.swapaxes(R, -1, -2))
    return PadShapes(np.asarray(pads["radius"] + pads["dome_more"]), spreads, spins)


@dataclass(frozen=True, eq=False)
class _Touching:
    """Pads that touch along u (N, m, 3): middles, A and rho less r, all in the hand base frame."""

    u: Array
    middles: Array
    A: Array
    more: Array

    def balls(self) -> tuple[Array, Array]:
        """b and db/du of `hand_models.dome`, (N, m, 3), (N, m, 3, 3)."""
        v = np.einsum("nmij,nmj->nmi", self.A, self.u)
        stretch = np.sqrt(np.maximum(np.sum(v * self.u, axis=-1), 1e-30))[..., None]
        e, more = v / stretch, self.more[..., None]
        T = (self.A - e[..., None] * e[..., None, :]) / stretch[..., None]
        return self.middles + e + more * self.u, T + more[..., None] * np.eye(3)


def _spins(hand: Hand, fingers: Index, q: Array, touching: _Touching) -> Array:
    """The least joint velocities that take each pad's touching ball along u, and the pad's turn,
    in the hand base frame: as `planner.reaching.pull` goes."""
    pads, rows = batch_pads(hand, q), np.arange(len(q))[:, None]
    b, T = touching.balls()
    w, u = pads.turns[rows, fingers], touching.u[..., None]
    arm = (b - pads.centres[rows, fingers])[..., None]
    J = pads.moves[rows, fingers] + np.cross(w, arm, axis=2) - T @ np.cross(w, u, axis=2)
    own = np.zeros((len(hand.fingers), q.shape[1]))
    for row, finger in zip(own, hand.fingers, strict=True):
        row[list(finger.q_indices)] = 1.0
    J = J * own[fingers][..., None, :]
    system = J @ np.swapaxes(J, -1, -2) + DAMPING * np.eye(3)
    dq = np.swapaxes(J, -1, -2) @ np.linalg.solve(system, u)
    return np.asarray((w @ dq)[..., 0])
