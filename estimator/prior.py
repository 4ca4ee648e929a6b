"""What is believed of the axis before, or beside, the touches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimator.axis import Axis, chart_coordinates
from estimator.contact import Miss
from estimator.likelihood import Lines
from estimator.vectors import Array, finite_array, frozen

MISS_SOFTNESS = 5e-3  # how sharply the believed radius may be taken where a finger met nothing [m]
MISSED_ANYWAY = 0.2  # chance that a miss has another reason: an end, a dent, a slip


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
    """Where a finger met nothing the line is farther away than radius plus pad, softly.

    A miss may have other reasons, so it never costs more than -log MISSED_ANYWAY; several misses
    share their reason and together weigh as one.
    """
    sd = float(np.hypot(radius_sd, MISS_SOFTNESS))
    S = len(lines.a)
    total = LineTerms(np.zeros(S), np.zeros((S, 5)), np.zeros((S, 5, 5)))
    for miss in misses:
        short, slope = _shortfall(miss, radius, sd, lines)
        told = (1.0 - MISSED_ANYWAY) * np.exp(-0.5 * short**2)
        weight = told / (MISSED_ANYWAY + told) / len(misses)
        total += LineTerms(
            -np.log(MISSED_ANYWAY + told) / len(misses),
            (weight * short)[:, None] * slope,
            weight[:, None, None] * slope[:, :, None] * slope[:, None, :],
        )
    return total


def _shortfall(miss: Miss, radius: float, sd: float, lines: Lines) -> tuple[Array, Array]:
    """By how much the line is too near the pad, in sd, (S,), and its derivative (S, 5)."""
    away = miss.tip - lines.a
    along = np.sum(away * lines.u, axis=1)
    away = away - along[:, None] * lines.u
    rho = np.linalg.norm(away, axis=1)
    short = np.maximum(radius + miss.radius - rho, 0.0) / sd
    towards = lines.in_basis(away / np.maximum(rho, 1e-12)[:, None]) / sd
    slope = np.zeros((len(rho), 5))
    slope[:, :2], slope[:, 2:4] = towards, towards * along[:, None]
    return short, slope * (short > 0)[:, None]
