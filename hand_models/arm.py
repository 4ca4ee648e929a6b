"""An arm that carries a hand. The whole is one `Hand`; this tells its two halves apart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from hand_models.hand import Hand

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Arm:
    """What carries a hand. Frames: A arm's root, F flange, B base of the hand alone.

    Attributes:
        hand: The hand alone, its base free.
        model: The arm alone; its universe is A.
        flange_id: Index of F into `model.frames`.
        X_FB: Pose of the hand base in the flange.
        X_WA: Pose of the arm's root in the world.
        home: (n,) where its joints begin [rad], [m].
        q_indices: Where the arm's joints are in the configuration of the whole.
        hand_q_indices: Where the hand's are.
    """

    hand: Hand
    model: pin.Model
    flange_id: int
    X_FB: pin.SE3
    X_WA: pin.SE3
    home: Array
    q_indices: NDArray[np.int64]
    hand_q_indices: NDArray[np.int64]

    def base_of_hand(self, q: ArrayLike) -> pin.SE3:
        """X_WB of the hand alone, for a configuration (nq,) of the whole."""
        data = self.model.createData()
        pin.framesForwardKinematics(self.model, data, np.asarray(q)[self.q_indices])
        return self.X_WA * data.oMf[self.flange_id] * self.X_FB

    def joined(self, q_arm: Array, q_hand: Array) -> Array:
        """(..., nq) configurations of the whole."""
        q = np.empty((*q_hand.shape[:-1], len(self.q_indices) + len(self.hand_q_indices)))
        q[..., self.q_indices], q[..., self.hand_q_indices] = q_arm, q_hand
        return q
