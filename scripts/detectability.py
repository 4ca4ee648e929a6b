"""How often could any test notice that fingertips are off? The ceiling of a misfit test.

About the truth the whitened residuals of all contacts are r = J x + B b + e: x the axis' own
motion, b the fingers' shifts in their standard deviation, e ~ N(0, 1). A fit takes out J; off it
remain residuals of variance one, or of 1 + s_i^2 along the singular vectors of B where there is a
shift. Of all tests of one against the other the likelihood ratio, sum r_i^2 s_i^2 / (1 + s_i^2), is
the best (Neyman & Pearson 1933); the chi-square test sums r_i^2.
"""

from __future__ import annotations

import numpy as np
from scenarios import Scenes
from scipy.stats import chi2

from estimator.axis import chart_lines
from estimator.contact import SensorNoise
from estimator.likelihood import fit_of
from estimator.readings import ERRORS, Readings, exact_readings
from estimator.sight import seen_from
from estimator.vectors import Array

STEP = 1e-6  # of the differences [m, rad]
LEVEL = 0.05
DRAWS = 1000


def powers(
    scenes: Scenes, noise: SensorNoise, finger: Array, bias: float, *, rng: np.random.Generator
) -> Array:
    """Share of shifts that the chi-square test notices at 5 %, and the best test, (B, 2).

    Args:
        finger: Which finger made each contact, (n,).
        bias: Standard deviation of each coordinate of its shift [m].
    """
    readings = exact_readings(scenes.geometry, noise)
    return np.array(
        [
            _power(_shape(row, point, direction, finger, bias), rng)
            for row, point, direction in zip(
                readings, scenes.points, scenes.directions, strict=True
            )
        ]
    )


def _power(variances: Array, rng: np.random.Generator) -> tuple[float, float]:
    """Of both tests, where residual i has variance 1 + variances[i]."""
    still = rng.standard_normal((DRAWS, len(variances))) ** 2
    moved = rng.standard_normal((DRAWS, len(variances))) ** 2 * (1.0 + variances)
    weights = variances / (1.0 + variances)
    edge = np.quantile(still @ weights, 1.0 - LEVEL)
    noticed = moved.sum(axis=1) > chi2.isf(LEVEL, len(variances))
    return float(np.mean(noticed)), float(np.mean(moved @ weights > edge))


def _shape(row: Readings, point: Array, direction: Array, finger: Array, bias: float) -> Array:
    """Variances s_i^2 off the axis' own motions, zero where the shifts do not reach."""
    at_rest = np.zeros((len(row), 3))
    motions = [
        _residuals(row, *(x[0] for x in chart_lines(point, direction, step[None])), at_rest)
        for step in np.vstack([STEP * np.eye(4), -STEP * np.eye(4)])
    ]
    shifts = []
    for owner in np.unique(finger):
        for coordinate in np.eye(3):
            shift = STEP * np.outer(finger == owner, coordinate)
            ahead, behind = (_residuals(row, point, direction, k * shift) for k in (1.0, -1.0))
            shifts.append(ahead - behind)
    J = (np.array(motions[:4]) - np.array(motions[4:])).T
    rest = np.linalg.svd(J)[0][:, 4:]
    s = np.linalg.svd(rest.T @ np.array(shifts).T * bias / (2.0 * STEP), compute_uv=False)
    return np.pad(s**2, (0, max(0, rest.shape[1] - len(s))))[: rest.shape[1]]


def _residuals(row: Readings, point: Array, direction: Array, shift: Array) -> Array:
    """Whitened residuals of all contacts of a set about a line, (3 n,)."""
    a, u = tuple(point.tolist()), tuple(direction.tolist())
    lean = np.empty((3, ERRORS))
    fits = [
        fit_of(contact, seen_from(contact, a, u, tuple(off.tolist()), 0.0), 0.0, lean)
        for contact, off in zip(row, shift, strict=True)
    ]
    return np.array([[f.a, f.b, f.c] for f in fits]).ravel()
