"""When to stop touching."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimator.belief import Belief
from estimator.vectors import Array

NEARLY = 2.0  # times the goal, from where one more touch may do


@dataclass(frozen=True)
class Goal:
    """How well the axis must be known: with 95 % probability within these.

    Args:
        angle: Of the direction [rad].
        offset: Of the axis beside the middle of what was touched [m].
    Raises:
        ValueError: Not positive.
    """

    angle: float
    offset: float

    def __post_init__(self) -> None:
        if not 0.0 < self.angle <= 0.5 * np.pi:
            raise ValueError(f"goal angle: expected 0 < angle <= pi/2 rad, got {self.angle}")
        if not (np.isfinite(self.offset) and self.offset > 0.0):
            raise ValueError(f"goal offset: expected a length > 0 m, got {self.offset}")

    def met_by(self, belief: Belief) -> bool:
        """Determined, and sure enough of direction and position."""
        estimate = belief.estimate
        if estimate is None or estimate.verdict != "determined":
            return False
        return bool(estimate.angle_95 <= self.angle and estimate.offset_95 <= self.offset)

    def nearly_met_by(self, belief: Belief) -> bool:
        """Determined, and within `NEARLY` times the goal."""
        return Goal(min(NEARLY * self.angle, 0.5 * np.pi), NEARLY * self.offset).met_by(belief)

    def would_be_met(self, belief: Belief, covariance: Array) -> bool:
        """Whether a determined axis would be known well enough with this covariance.

        The 95 % errors are taken to shrink as the root mean square errors do.

        Args:
            covariance: Of the axis in its chart, as touches are expected to leave it, (4, 4).
        """
        estimate = belief.estimate
        if estimate is None or estimate.verdict != "determined":
            return False
        now = np.diag(belief.covariance)
        then = np.diag(covariance)
        offset = estimate.offset_95 * np.sqrt(then[:2].sum() / now[:2].sum())
        angle = estimate.angle_95 * np.sqrt(then[2:].sum() / now[2:].sum())
        return bool(angle <= self.angle and offset <= self.offset)

    def missing(self, belief: Belief) -> str:
        """What is missing, in words; empty where the goal is met."""
        estimate = belief.estimate
        if estimate is None:
            return "nothing was touched"
        if estimate.verdict != "determined":
            return f"{estimate.verdict}: {'; '.join(estimate.reasons)}"
        parts = []
        if estimate.angle_95 > self.angle:
            parts.append(
                f"direction within {np.rad2deg(estimate.angle_95):.1f} deg, "
                f"asked {np.rad2deg(self.angle):.1f}"
            )
        if estimate.offset_95 > self.offset:
            parts.append(
                f"position within {1e3 * estimate.offset_95:.1f} mm, asked {1e3 * self.offset:.1f}"
            )
        return "; ".join(parts)
