"""What is believed of the axis before the touches, by a camera for example."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimator.axis import Axis
from estimator.vectors import Array, finite_array, frozen


@dataclass(frozen=True, eq=False)
class AxisPrior:
    """A Gaussian over the axis in the chart at its mean, and the object's size.

    Args:
        axis: Mean; its point is the chart's origin, best near the object's middle.
        covariance: Of (t1, t2, w1, w2) [m, m, rad, rad], symmetric positive definite, (4, 4).
        radius: Believed radius of the object [m].
        radius_sd: How far a touched place may differ from it [m].
    Raises:
        ValueError: The covariance is no covariance, or radius and its sd are not positive.
    """

    axis: Axis
    covariance: Array
    radius: float
    radius_sd: float

    def __post_init__(self) -> None:
        covariance = finite_array("prior covariance", self.covariance, (4, 4))
        scale = np.sqrt(np.abs(np.outer(np.diag(covariance), np.diag(covariance))))
        if np.any(np.abs(covariance - covariance.T) > 1e-9 * scale):
            raise ValueError("prior covariance: expected a symmetric matrix")
        covariance = frozen(0.5 * (covariance + covariance.T))
        if np.linalg.eigvalsh(covariance)[0] <= 0.0:
            raise ValueError("prior covariance: expected positive eigenvalues")
        for name in ("radius", "radius_sd"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"prior {name}: expected a length > 0 m, got {value}")
        object.__setattr__(self, "covariance", covariance)


def coarse_prior(
    axis: Axis, *, angle: float, offset: float, radius: float, radius_sd: float
) -> AxisPrior:
    """A prior that is wrong by `angle` [rad] and `offset` [m] (root mean square, any way)."""
    variances = 0.5 * np.array([offset, offset, angle, angle]) ** 2
    return AxisPrior(axis, np.diag(variances), radius, radius_sd)
