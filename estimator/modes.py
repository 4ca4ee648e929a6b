"""The distinct peaks of a posterior, how much probability each holds, and its labels."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from estimator.axis import chart_coordinates
from estimator.likelihood import Lines, evaluate
from estimator.planes import Labelling
from estimator.posterior import Posterior, climb, label_weights
from estimator.seeds import seeds
from estimator.vectors import Array, Index

DRAMATICALLY_WORSE = 25.0  # cost above the best at which a peak no longer counts
MOST_PEAKS = 40
SAME_PEAK = 0.5  # distance in standard deviations below which two peaks are one
DIRECTION_VOLUME = 1.0  # information [1/rad^2] of "any direction", so that flat peaks stay finite
LABEL_DOUBT = 1e-3


@dataclass(frozen=True, eq=False)
class Peak:
    """One line that the posterior allows.

    Args:
        point, direction: Of the line; the point is the foot of the posterior's origin.
        delta: Common rotation of the directions [rad].
        information: Of (t1, t2, w1, w2, delta), everything included, (5, 5).
        contacts_information: The contacts' part of it, with the sensor's prior on delta, (5, 5).
        log_evidence: Laplace's, up to a constant common to all peaks.
        label_weights: Probability of each row being the parallel's at this line, (n, 2).
        chi_square: Of the contacts, each label weighed by its probability.
    """

    point: Array
    direction: Array
    delta: float
    information: Array
    contacts_information: Array
    log_evidence: float
    label_weights: Array
    chi_square: float


def find_peaks(posterior: Posterior) -> list[Peak]:
    """All peaks worth mentioning, the one with most evidence first.

    Fixed labellings first (few contacts), then with the labels summed out; peaks nearer than half
    a standard deviation are one.
    """
    start, labels = seeds(posterior.readings, posterior.origin, posterior.spread, posterior.prior)
    if labels is None:
        lines, terms = climb(posterior, start)
    else:
        lines, terms = climb(posterior, start, labels, iterations=12, gain_at_rest=1e-3)
        chosen = _worth_keeping(terms.cost, 2.0 * DRAMATICALLY_WORSE)
        chosen = _distinct(lines, terms.fisher, chosen)
        lines, terms = climb(posterior, lines.take(chosen))
    kept = _distinct(lines, terms.fisher, _worth_keeping(terms.cost, DRAMATICALLY_WORSE))
    peaks = _described(posterior, lines.take(kept))
    return sorted(peaks, key=lambda p: -p.log_evidence)


def _worth_keeping(cost: Array, worse: float) -> Index:
    order = np.argsort(cost, kind="stable")
    if not np.isfinite(cost[order[0]]):
        raise ValueError("contacts: no line has a finite likelihood, the numbers are absurd")
    return np.asarray(order[cost[order] < cost[order[0]] + worse], dtype=np.intp)


def _distinct(lines: Lines, fisher: Array, order: Index) -> Index:
    """The first of every group of lines that agree within SAME_PEAK standard deviations."""
    kept: list[int] = []
    for i in order:
        if len(kept) == MOST_PEAKS:
            break
        chosen = np.array(kept, dtype=np.intp)
        x = chart_coordinates(lines.a[i], lines.u[i], lines.a[chosen], lines.u[chosen])
        x = np.column_stack([x, lines.delta[chosen] - lines.delta[i]])
        if not np.any(np.einsum("kp,pq,kq->k", x, fisher[i], x) < SAME_PEAK**2):
            kept.append(int(i))
    return np.array(kept, dtype=np.intp)


def _described(posterior: Posterior, lines: Lines) -> list[Peak]:
    whole = posterior.at(lines)
    terms = evaluate(posterior.readings, lines)
    weights = label_weights(terms)
    unsized = evaluate(replace(posterior.readings, size=(0.0, np.inf)), lines)
    from_contacts = np.einsum("snl,snlpq->spq", weights, unsized.fisher)
    chi_square = np.sum(weights * terms.chi_square, axis=(1, 2))
    sensor = np.zeros((5, 5))
    sensor[4, 4] = 1.0 / max(posterior.readings.var_offset, 1e-12)
    volume = np.diag([0.0, 0.0, DIRECTION_VOLUME, DIRECTION_VOLUME, 0.0])
    floor = 1e-6 / posterior.spread**2 * np.diag([1.0, 1.0, 0.0, 0.0, 0.0])
    return [
        Peak(
            point=lines.a[s],
            direction=lines.u[s],
            delta=float(lines.delta[s]),
            information=whole.fisher[s],
            contacts_information=from_contacts[s] + sensor,
            log_evidence=float(
                -whole.cost[s] - 0.5 * np.linalg.slogdet(whole.fisher[s] + volume + floor)[1]
            ),
            label_weights=weights[s],
            chi_square=float(chi_square[s]),
        )
        for s in range(len(lines.a))
    ]


def peak_probabilities(peaks: list[Peak]) -> Array:
    """Evidence of each peak over that of all, (len(peaks),)."""
    log = np.array([p.log_evidence for p in peaks])
    weight = np.exp(log - log.max())
    return np.asarray(weight / weight.sum())


def labelling_probabilities(
    peaks: list[Peak], probabilities: Array
) -> tuple[tuple[Labelling, float], ...]:
    """Every labelling with its probability, likeliest first; those below 1e-4 left out."""
    total: dict[tuple[int, ...], float] = {}
    for peak, probability in zip(peaks, probabilities, strict=True):
        for labels, given in _labellings_at(peak.label_weights):
            total[labels] = total.get(labels, 0.0) + given * float(probability)
    ranked = sorted(total.items(), key=lambda item: -item[1])
    return tuple((Labelling(rows), p) for rows, p in ranked if rows and p >= 1e-4)


def _labellings_at(weights: Array) -> list[tuple[tuple[int, ...], float]]:
    """All labellings at one line; contacts beyond doubt are not doubled."""
    choices = []
    doubts = np.sort(weights.min(axis=1))[::-1]
    threshold = max(LABEL_DOUBT, doubts[10] if len(doubts) > 10 else 0.0)
    for row in weights:
        best = int(np.argmax(row))
        sure = row[1 - best] <= threshold
        choices.append([(best, 1.0)] if sure else [(0, float(row[0])), (1, float(row[1]))])
    return [
        (tuple(label for label, _ in combination), float(np.prod([p for _, p in combination])))
        for combination in product(*choices)
    ]
