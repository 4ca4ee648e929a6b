"""What is believed of a line besides the contacts, as arrays.

prior on the line      an AxisPrior; without one the line passes the contacts' centroid within
                       about half their spread, with heavy tails, in any direction
size                   the prior's radius against that of every contact
misses                 a finger met nothing there
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from estimator.contact import Miss
from estimator.prior import AxisPrior
from estimator.readings import NORMAL, POSITION, Readings
from estimator.vectors import Array, basis_across

MISS_SOFTNESS = 5e-3  # how sharply the believed radius may be taken where a finger met nothing [m]

# columns of a line's row
ORIGIN, SPREAD, BASIS, PRECISION, SIZE = 0, 3, 4, 13, 29
COLUMNS = 31


class Background(NamedTuple):
    """What is believed of each set's line.

    Args:
        lines: Origin of the charts, which is the prior's point or the contacts' centroid [m],
            length scale [m], and of a prior its chart basis (e1, e2, direction), precision (4, 4),
            mean radius [m] and weight 1 / (sd^2 n); one row a set or one shared by all,
            (S or 1, COLUMNS).
        informed: Whether there is a prior.
        misses: Tip [m], distance the axis keeps at least [m], softness [m], (M, 5).
        slope: Sd of sin(slope of the profile) [-], infinite where nothing is assumed of it.
        gross: Probability that a contact is grossly wrong, zero for never.
    """

    lines: Array
    informed: bool
    misses: Array
    slope: float
    gross: float


def background_of(
    readings: Readings,
    priors: Sequence[AxisPrior],
    misses: Sequence[Miss],
    *,
    slope: float,
    gross: float,
) -> Background:
    """What is believed, as numbers; `priors` has none, one for all sets, or one for each."""
    if not priors:
        return Background(_uninformed(readings), False, np.zeros((0, 5)), slope, gross)
    lines = np.array([_informed(prior, max(readings.shape[1], 1)) for prior in priors])
    return Background(lines, True, _missed(misses, priors[0]), slope, gross)


def _informed(prior: AxisPrior, n: int) -> Array:
    axis = prior.axis
    return np.concatenate(
        [
            axis.point,
            [prior.radius],
            basis_across(axis.direction).ravel(),
            axis.direction,
            np.linalg.inv(prior.covariance).ravel(),
            [prior.radius, 1.0 / (prior.radius_sd**2 * n)],
        ]
    )


def _uninformed(readings: Readings) -> Array:
    p = readings[..., POSITION:NORMAL]
    centroid = p.mean(axis=1)
    lines = np.zeros((len(p), COLUMNS))
    lines[:, ORIGIN:SPREAD] = centroid
    square = np.mean(np.sum((p - centroid[:, None]) ** 2, axis=-1), axis=1)
    lines[:, SPREAD] = np.maximum(np.sqrt(square), 1e-300)
    return lines


def _missed(misses: Sequence[Miss], prior: AxisPrior) -> Array:
    sd = float(np.hypot(prior.radius_sd, MISS_SOFTNESS))
    rows = [[*miss.tip, prior.radius + miss.radius, sd] for miss in misses]
    return np.array(rows, dtype=np.float64).reshape(len(rows), 5)
