"""What is believed of the axis before, or beside, the touches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimator.axis import Axis, chart_coordinates
from estimator.contact import Miss
from estimator.likelihood import Lines
from estimator.vectors import Array, finite_array

MISS_SOFTNESS = 5e-3  # how sharply the believed radius may be taken where a finger met nothing [m]


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
        if not np.allclose(covariance, covariance.T, rtol=1e-9, atol=0.0):
            raise ValueError("prior covariance: expected a symmetric matrix")
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


@dataclass(frozen=True, eq=False)
class LineTerms:
    """Cost (S,), gradient (S, 5) and information (S, 5, 5) of whole lines."""

    cost: Array
    gradient: Array
    fisher: Array

    def __add__(self, other: LineTerms) -> LineTerms:
        return LineTerms(
            self.cost + other.cost, self.gradient + other.gradient, self.fisher + other.fisher
        )


def prior_terms(prior: AxisPrior, lines: Lines) -> LineTerms:
    """Gaussian in the prior's chart; the Jacobian between charts by central differences."""

    h, S = 1e-6, len(lines.a)
    steps = np.zeros((9, 5))
    steps[1:5, :4], steps[5:, :4] = h * np.eye(4), -h * np.eye(4)
    origin = prior.axis.point
    moved = lines.take(np.tile(np.arange(S), 9)).moved(np.repeat(steps, S, axis=0), origin)
    every = chart_coordinates(origin, prior.axis.direction, moved.a, moved.u)
    x, ahead, behind = np.split(every.reshape(9, S, 4), [1, 5])
    jacobian = np.zeros((S, 4, 5))
    jacobian[:, :, :4] = np.moveaxis((ahead - behind) / (2 * h), 0, 2)
    x = x[0]
    precision = np.linalg.inv(prior.covariance)
    y = x @ precision
    return LineTerms(
        0.5 * np.sum(x * y, axis=1),
        np.einsum("sij,si->sj", jacobian, y),
        np.einsum("sik,ij,sjl->skl", jacobian, precision, jacobian),
    )


def location_terms(origin: Array, sd: float, lines: Lines) -> LineTerms:
    """The line passes the contacts' centroid at a distance of about `sd` [m].

    Lines hold the foot of the origin as their point, so tilt does not change it to first order.
    """
    t = lines.in_basis(lines.a - origin)
    gradient = np.zeros((len(t), 5))
    gradient[:, :2] = t / sd**2
    fisher = np.zeros((len(t), 5, 5))
    fisher[:, [0, 1], [0, 1]] = 1.0 / sd**2
    return LineTerms(0.5 * np.sum(t**2, axis=1) / sd**2, gradient, fisher)


def offset_terms(variance: float, lines: Lines) -> LineTerms:
    """The common rotation of the directions; without one it stays at zero."""
    precision = 1.0 / max(variance, 1e-12)
    gradient = np.zeros((len(lines.delta), 5))
    gradient[:, 4] = precision * lines.delta
    fisher = np.zeros((len(lines.delta), 5, 5))
    fisher[:, 4, 4] = precision
    return LineTerms(0.5 * precision * lines.delta**2, gradient, fisher)


def miss_terms(misses: Sequence[Miss], radius: float, radius_sd: float, lines: Lines) -> LineTerms:
    """Where a finger met nothing the line is farther away than radius plus pad, softly."""
    sd = float(np.hypot(radius_sd, MISS_SOFTNESS))
    total = LineTerms(
        np.zeros(len(lines.a)), np.zeros((len(lines.a), 5)), np.zeros((len(lines.a), 5, 5))
    )
    for miss in misses:
        away = miss.tip - lines.a
        away = away - np.sum(away * lines.u, axis=1, keepdims=True) * lines.u
        along = np.sum((miss.tip - lines.a) * lines.u, axis=1)
        rho = np.linalg.norm(away, axis=1)
        short = np.maximum(radius + miss.radius - rho, 0.0) / sd
        towards = lines.in_basis(away / np.maximum(rho, 1e-12)[:, None])
        slope = np.zeros((len(rho), 5))
        slope[:, :2] = towards / sd
        slope[:, 2:4] = towards * along[:, None] / sd
        slope *= (short > 0)[:, None]
        total += LineTerms(
            0.5 * short**2, short[:, None] * slope, slope[:, :, None] * slope[:, None, :]
        )
    return total
