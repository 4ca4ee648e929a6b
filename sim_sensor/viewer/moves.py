"""Motions in time, as they went: what the page plays at the speed of the hand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from estimator.vectors import Array, finite_array


@dataclass(frozen=True, eq=False)
class Move:
    """Postures of the hand in time.

    Args:
        times: From zero, ascending, (K,) [s].
        path: Configurations, (K, nq).
        bases: Pose of the hand base in the world at each (`X_WB`).
    Raises:
        ValueError: Shapes that do not fit, not finite, or times that do not ascend from zero.
    """

    times: Array
    path: Array
    bases: tuple[pin.SE3, ...]

    def __post_init__(self) -> None:
        times = finite_array("times", self.times, (len(self.bases),))
        path = finite_array("path", self.path, (len(self.bases), np.shape(self.path)[-1]))
        if len(times) < 2 or times[0] != 0.0 or not np.all(np.diff(times) > 0.0):
            raise ValueError("times: expected two or more, ascending from zero")
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "path", path)

    @property
    def duration(self) -> float:
        """[s]."""
        return float(self.times[-1])


@dataclass(frozen=True, eq=False)
class ActMotion:
    """How one finger's act went in time.

    Args:
        come: From where the hand was; None where it did not have to move.
        forward: Along the approach, until the finger stopped.
        back: Along it again, and away after the last act of a placement; None if it was there.
    """

    come: Move | None
    forward: Move
    back: Move | None
