"""Where the arm can hold the hand base."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

Array = NDArray[np.float64]

_LENGTH_PER_TURN = 0.1  # an excess turn counts like this arc [m]


@dataclass(frozen=True, eq=False)
class Workspace:
    """A box of positions and a cone of rotations about a nominal pose of the hand base.

    Args:
        X_WB: Nominal pose; None leaves the hand free, as on a long arm.
        position_range: Half edges of the box, along the world's axes [m]; 0 holds it fast.
        rotation_range: Largest turn from the nominal orientation, at most pi [rad].

    Raises:
        ValueError: A range is negative, not finite, or more than a half turn.
    """

    X_WB: pin.SE3 | None = None
    position_range: float = 0.0
    rotation_range: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.position_range < np.inf:
            raise ValueError(f"position_range must be >= 0 m and finite, got {self.position_range}")
        if not 0.0 <= self.rotation_range <= np.pi:
            raise ValueError(f"rotation_range must be in [0, pi] rad, got {self.rotation_range}")

    @property
    def is_fixed(self) -> bool:
        """Whether the base stays where it is: only joints move."""
        return self.X_WB is not None and self.position_range == self.rotation_range == 0.0

    def allows(self, R_WB: Array, p_WB: Array) -> NDArray[np.bool_]:
        """(...) which of the poses R (..., 3, 3), p (..., 3) are in range."""
        return self.violation(R_WB, p_WB) <= 1e-6

    def violation(self, R_WB: Array, p_WB: Array) -> Array:
        """(...) how far poses are out of range, a turn counted as an arc of 0.1 m radius [m]."""
        if self.X_WB is None:
            return np.zeros(p_WB.shape[:-1])
        out = np.maximum(np.abs(p_WB - self.X_WB.translation) - self.position_range, 0.0)
        excess = np.maximum(self._turn(R_WB) - self.rotation_range, 0.0)
        return np.asarray(np.linalg.norm(out, axis=-1) + _LENGTH_PER_TURN * excess)

    def distance(self, R_WB: Array, p_WB: Array) -> Array:
        """(...) how far poses are from the nominal one, turns as above; zero without one [m]."""
        if self.X_WB is None:
            return np.zeros(p_WB.shape[:-1])
        away = np.linalg.norm(p_WB - self.X_WB.translation, axis=-1)
        return np.asarray(away + _LENGTH_PER_TURN * self._turn(R_WB))

    def _turn(self, R_WB: Array) -> Array:
        """(...) from the nominal orientation [rad]."""
        assert self.X_WB is not None
        cosine = (np.einsum("ij,...ij->...", self.X_WB.rotation, R_WB) - 1.0) / 2.0
        return np.asarray(np.arccos(np.clip(cosine, -1.0, 1.0)))
