"""What touches not yet made would tell: expected information, and the odds of their labels."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations, product

import numpy as np

from estimator.contact import SensorNoise
from estimator.likelihood import Lines, evaluate
from estimator.posterior import Posterior, climb
from estimator.prior import AxisPrior
from estimator.readings import Readings, exact_readings
from estimator.surface import Geometry
from estimator.vectors import Array, Index, cross, unit


def contact_information(
    geometry: Geometry, points: Array, directions: Array, noise: SensorNoise
) -> Array:
    """Fisher information of each place about its line, labels known.

    Information of independent contacts adds, so a set of touches is scored by a sum.

    Args:
        geometry: Places (B, n) on B objects.
        points, directions: The objects' axes, (B, 3) [m], unit.
        noise: Of the sensor.
    Returns:
        (B, n, 5, 5) over (t1, t2, w1, w2, delta) in the chart at each axis.
    """
    terms = evaluate(
        exact_readings(geometry, noise), Lines(points, directions, np.zeros(len(points)))
    )
    return np.asarray(terms.fisher[:, :, 0])


def predicted_covariance(information: Array, prior: Array, direction_offset: float) -> Array:
    """Covariance of the axis after touches worth `information` (..., 5, 5).

    Args:
        prior: Covariance of the axis before, (4, 4).
        direction_offset: Prior sd of the common rotation [rad].
    Returns:
        (..., 4, 4), the common rotation marginalised.
    """
    before = np.zeros((5, 5))
    before[:4, :4] = np.linalg.inv(prior)
    before[4, 4] = 1.0 / max(direction_offset**2, 1e-12)
    return np.asarray(np.linalg.inv(information + before)[..., :4, :4])


@dataclass(frozen=True, eq=False)
class Expected:
    """Sets of m exact contacts on known objects: places (P, m), axes (P, 3), (P, 3)."""

    geometry: Geometry
    points: Array
    directions: Array


def label_log_odds(expected: Expected, noise: SensorNoise, prior: AxisPrior | None) -> Array:
    """How much likelier the right labelling will look than the worst wrong one, (P,).

    For every wrong labelling the best line is sought from the true axis and from the lines its
    contact pairs fix; the odds are the difference of the costs, without noise. Zero and below
    means that the labels cannot be told; 3 is twenty to one.
    """
    readings = exact_readings(expected.geometry, noise)
    if prior is not None:
        readings = replace(readings, size=(prior.radius, prior.radius_sd))
    count, m = readings.p.shape[:2]
    problem, lines, labels = _wrong_starts(readings, expected)
    wrong = _posterior(readings.take(problem), expected.points[problem], prior)
    _, terms = climb(wrong, lines, labels, iterations=8, gain_at_rest=1e-1)
    best = np.full(count, np.inf)
    np.minimum.at(best, problem, terms.cost)
    truth = Lines(expected.points, expected.directions, np.zeros(count))
    right = _posterior(readings, expected.points, prior)
    return np.asarray(best - right.at(truth, np.zeros((count, m), dtype=np.intp)).cost)


def _posterior(readings: Readings, points: Array, prior: AxisPrior | None) -> Posterior:
    centroid = readings.p.mean(axis=(0, 1))
    spread = float(np.sqrt(np.mean(np.sum((readings.p - points[:, None]) ** 2, axis=-1))))
    origin = prior.axis.point if prior is not None else centroid
    return Posterior(readings, origin, spread, prior)


def _wrong_starts(readings: Readings, expected: Expected) -> tuple[Index, Lines, Index]:
    """Problem index, line and labels of every start: 2^m - 1 labellings, true axis and pairs."""
    count, m = readings.p.shape[:2]
    wrong = np.array(list(product((0, 1), repeat=m))[1:], dtype=np.intp)
    sources: list[tuple[Array, Array]] = []
    for _ in wrong:
        sources.append((expected.points, expected.directions))
    rows = [np.broadcast_to(row, (count, m)) for row in wrong]
    for row in wrong:
        for i, j in combinations(range(m), 2):
            sources.append(_pair_line(readings, i, j, int(row[i]), int(row[j])))
            rows.append(np.broadcast_to(row, (count, m)))
    a = np.concatenate([source[0] for source in sources])
    u = np.concatenate([source[1] for source in sources])
    problem = np.tile(np.arange(count), len(sources))
    labels = np.concatenate(rows).astype(np.intp)
    return problem.astype(np.intp), Lines(a, u, np.zeros(len(a))), labels


def _pair_line(readings: Readings, i: int, j: int, row_i: int, row_j: int) -> tuple[Array, Array]:
    """Where two planes meet in each problem; nearly equal planes give some line in them."""
    N1, N2 = readings.k[:, i, row_i], readings.k[:, j, row_j]
    centre = readings.p.mean(axis=1)
    u = cross(N1, N2)
    u = unit(u + 1e-3 * cross(N1, readings.n[:, i]))
    gap = np.stack(
        [
            np.sum(N1 * (readings.p[:, i] - centre), axis=1),
            np.sum(N2 * (readings.p[:, j] - centre), axis=1),
            np.zeros(len(centre)),
        ],
        axis=1,
    )
    system = np.stack([N1, N2, u], axis=1)
    regular = np.swapaxes(system, 1, 2) @ system + 1e-4 * np.eye(3)
    a = np.linalg.solve(regular, np.swapaxes(system, 1, 2) @ gap[..., None])[..., 0]
    return centre + a, u
