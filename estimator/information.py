"""What touches not yet made would tell: expected information, and the odds of their labels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimator.assumptions import Assumptions
from estimator.compiled import across, compiled, vector
from estimator.contact import SensorNoise
from estimator.likelihood import fill_derivatives, fit_of
from estimator.modes import find_modes
from estimator.nuisances import Owner
from estimator.posterior import cost_at
from estimator.prior import AxisPrior
from estimator.problem import Problems, pose_problems, problem_at
from estimator.readings import Readings, exact_readings
from estimator.search import DRAMATICALLY_WORSE
from estimator.side_by_side import in_shares
from estimator.sight import fill_motions, seen_from
from estimator.surface import Geometry
from estimator.vectors import Array
from estimator.work import LOCAL_WORK, work_space

WITH_ROTATION = 5  # parameters: the line's four and the common rotation


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
    lines = np.ascontiguousarray(np.concatenate([points, directions], axis=1))
    out = np.zeros((*geometry.p.shape[:2], WITH_ROTATION, WITH_ROTATION))

    def tell(part: slice) -> None:
        some = Geometry(*(x[part] for x in vars(geometry).values()))
        _fill_information(exact_readings(some, noise), lines[part], out[part])

    in_shares(tell, len(out))
    return out


@compiled
def _fill_information(readings: Readings, lines: Array, out: Array) -> None:
    local = np.zeros(1, dtype=LOCAL_WORK)  # a record alone does not keep its memory
    for s in range(readings.shape[0]):
        a, u = vector(lines[s], 0), vector(lines[s], 3)
        E1, E2 = across(u)
        for i in range(readings.shape[1]):
            row = readings[s, i]
            seen = seen_from(row, a, u, (0.0, 0.0, 0.0), 0.0)
            fill_motions(seen, E1, E2, local[0].rows, WITH_ROTATION)
            fit = fit_of(row, seen, 0.0, local[0].lean)
            fill_derivatives(
                row, seen, fit, 1.0, 0.0, local[0].lean,
                local[0].gradient, local[0].fisher, local[0].rows, WITH_ROTATION,
            )  # fmt: skip
            for j in range(WITH_ROTATION):
                for k in range(j + 1):
                    out[s, i, j, k] = local[0].fisher[j, k]
                    out[s, i, k, j] = local[0].fisher[j, k]


def known_before(prior: Array, direction_offset: float) -> Array:
    """Information before the touches about (t1, t2, w1, w2, delta), (5, 5).

    Args:
        prior: Covariance of the axis before, (4, 4).
        direction_offset: Prior sd of the common rotation [rad].
    """
    before = np.zeros((WITH_ROTATION, WITH_ROTATION))
    before[:4, :4] = np.linalg.inv(prior)
    before[4, 4] = 1.0 / max(direction_offset**2, 1e-12)
    return before


def predicted_covariance(information: Array, prior: Array, direction_offset: float) -> Array:
    """Covariance of the axis after touches worth `information` (..., 5, 5).

    Args:
        prior, direction_offset: As `known_before` takes them.
    Returns:
        (..., 4, 4), the common rotation marginalised.
    """
    before = known_before(prior, direction_offset)
    return np.asarray(np.linalg.inv(information + before)[..., :4, :4])


def with_untold_rotation(total: Array, before: Array, untold: float) -> Array:
    """Mean square errors of the axis if all directions are turned by what nobody was told of.

    The estimator that knows of no such rotation takes its trace in the directions for a tilt, and
    errs by b for each radian of it; contacts that wrap around cancel that:

        E[x x^T] = K + untold^2 b b^T,   b = K c tau / d

    with K the axis' block of the inverse, c the information between axis and rotation, d that of
    the rotation and tau its share from before the touches: where a rotation was admitted, most of
    it is found, and little biases.

    Args:
        total: Information with what was known before, (..., 5, 5).
        before: The latter alone, (5, 5).
        untold: Sd of the rotation beside what was admitted [rad].
    Returns:
        (..., 4, 4).
    """
    K = np.linalg.inv(total)[..., :4, :4]
    if untold == 0.0:
        return np.asarray(K)
    share = before[4, 4] / total[..., 4, 4]
    b = np.einsum("...ij,...j->...i", K, total[..., :4, 4]) * share[..., None]
    return np.asarray(K + untold**2 * b[..., :, None] * b[..., None, :])


@dataclass(frozen=True, eq=False)
class Expected:
    """Sets of m exact contacts on known objects: places (P, m), axes (P, 3), (P, 3)."""

    geometry: Geometry
    points: Array
    directions: Array


def label_log_odds(expected: Expected, noise: SensorNoise, prior: AxisPrior | None) -> Array:
    """How much likelier the right labelling will look than the worst wrong one, (P,).

    The estimator itself looks for every line that explains the exact contacts; the odds are the
    difference in cost between the true line and the best one with a wrong label. Zero and below
    means that the labels cannot be told; 3 is twenty to one; where no wrong line comes near, the
    odds are those beyond which the estimator drops a line.
    """
    readings = exact_readings(expected.geometry, noise)
    owners = [Owner(noise)] * readings.shape[1]
    priors: Sequence[AxisPrior] = [] if prior is None else [prior]
    faultless = Assumptions(gross_error=0.0)
    problems, _ = pose_problems(readings, owners, priors=priors, assumptions=faultless)
    modes = find_modes(problems)
    wrong = np.any(modes.parallel_rows < 0.5, axis=2)
    cost = np.where(wrong, modes.cost, np.inf).min(axis=1)
    truth = np.zeros((len(readings), modes.x.shape[2]))
    truth[:, :3], truth[:, 3:6] = expected.points, expected.directions
    right = np.empty(len(readings))
    _fill_costs(problems, truth, right)
    return np.asarray(np.minimum(cost - right, DRAMATICALLY_WORSE))


@compiled
def _fill_costs(problems: Problems, x: Array, out: Array) -> None:
    work = work_space(x.shape[1] - 2, problems.readings.shape[1])
    for s in range(len(x)):
        out[s] = cost_at(problem_at(problems, s), x[s], False, work)
