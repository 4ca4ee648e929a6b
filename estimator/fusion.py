"""The estimator's front door: contacts in, axis with uncertainty and verdict out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from estimator.axis import Axis, chart_coordinates
from estimator.contact import Contact, Miss, require_distinct
from estimator.estimate import AxisEstimate, Hypothesis
from estimator.modes import Peak, find_peaks, labelling_probabilities, peak_probabilities
from estimator.posterior import Posterior
from estimator.prior import AxisPrior
from estimator.readings import VOID_DIRECTION, Readings, readings_of
from estimator.vectors import Array, frozen
from estimator.verdict import judge

SAME_AXIS = 3.0  # distance in standard deviations below which peaks are one hypothesis
UNLIKELY = 1e-4


def estimate_axis(
    contacts: Sequence[Contact],
    *,
    prior: AxisPrior | None = None,
    misses: Sequence[Miss] = (),
) -> AxisEstimate:
    """The axis of the surface of revolution that was touched, whichever way its labels are.

    Idea: maximum a posteriori over lines, with the labels summed out and the common rotation of
    the sensor's directions estimated along; every peak of the posterior is found from lines that
    two contacts fix, and weighed by Laplace's evidence. See `estimator.likelihood` for what one
    contact says.

    Args:
        contacts: Two or more (with a prior any number), world frame, at distinct points.
        prior: What is believed of axis and size; without one the axis is expected within about
            two spreads of the contacts, any direction.
        misses: Where fingers met nothing; used only with a prior, which knows the size.
    Returns:
        Axis, 4x4 covariance in the chart of `estimator.axis`, hypotheses, label probabilities,
        verdict and reasons. Umbilic contacts, one common meridian or parallel, flat ends and
        spheres give `undetermined`.
    Raises:
        ValueError: Fewer than two contacts, or two at one point.
    """
    require_distinct(contacts, minimum=2 if prior is None else 0)
    posterior = posterior_of(contacts, prior=prior, misses=misses)
    peaks = find_peaks(posterior)
    probabilities = peak_probabilities(peaks)
    hypotheses = _hypotheses(peaks, probabilities)
    size = prior.radius if prior is not None else posterior.spread
    weighed = list(zip(peaks, probabilities.tolist(), strict=True))
    p_value = _p_value(posterior.readings, peaks[0])
    verdict, reasons = judge(list(contacts), posterior.readings, weighed, hypotheses, size, p_value)
    return AxisEstimate(
        hypotheses=hypotheses,
        labellings=labelling_probabilities(peaks, probabilities),
        verdict=verdict,
        reasons=reasons,
        p_value=p_value,
    )


def posterior_of(
    contacts: Sequence[Contact],
    *,
    prior: AxisPrior | None = None,
    misses: Sequence[Miss] = (),
) -> Posterior:
    """The density over lines; its origin is the prior's point, or the contacts' centroid."""
    readings = readings_of(contacts)
    points = readings.p[0]
    if prior is not None:
        readings = replace(readings, size=(prior.radius, prior.radius_sd))
        return Posterior(readings, prior.axis.point, prior.radius, prior, tuple(misses))
    centroid = points.mean(axis=0)
    spread = float(np.sqrt(np.mean(np.sum((points - centroid) ** 2, axis=1))))
    return Posterior(readings, centroid, max(spread, 1e-3))


def _hypotheses(peaks: list[Peak], probabilities: Array) -> tuple[Hypothesis, ...]:
    """Peaks that agree on the axis within their uncertainty, as one, likeliest first."""
    groups: list[tuple[Peak, float]] = []
    for peak, probability in zip(peaks, probabilities.tolist(), strict=True):
        for i, (leader, total) in enumerate(groups):
            if _separation(leader, peak) < SAME_AXIS:
                groups[i] = (leader, total + probability)
                break
        else:
            groups.append((peak, probability))
    groups.sort(key=lambda group: -group[1])
    return tuple(
        Hypothesis(
            axis=Axis(peak.point, peak.direction),
            covariance=frozen(_covariance(peak)),
            probability=min(1.0, total),
            direction_offset=peak.delta,
            parallel_rows=frozen(peak.label_weights[:, 0]),
        )
        for peak, total in groups
        if total > UNLIKELY
    )


def _separation(a: Peak, b: Peak) -> float:
    x = chart_coordinates(a.point, a.direction, b.point[None], b.direction[None])[0]
    squared = x @ np.linalg.solve(_covariance(a) + _covariance(b), x)
    return float(np.sqrt(max(squared, 0.0)))


def _covariance(peak: Peak) -> Array:
    """Of the line's four coordinates; a motion nothing limits gets a radian, or a metre."""
    information = peak.information + np.diag([1.0, 1.0, 1.0, 1.0, 0.0])
    covariance = np.linalg.inv(information)[:4, :4]
    return np.asarray(0.5 * (covariance + covariance.T))


def _p_value(readings: Readings, peak: Peak) -> float:
    n = readings.p.shape[1]
    void = int(np.sum(readings.var_psi >= VOID_DIRECTION**2))
    freedom = 3 * n - void - 4 - (1 if readings.var_offset > 0 else 0)
    return float(chi2.sf(peak.chi_square, freedom)) if freedom > 0 else 1.0
