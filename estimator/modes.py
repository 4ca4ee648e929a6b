"""The distinct peaks of a posterior, how much probability each holds, and which go together."""

from __future__ import annotations

from math import atan2, erf, exp, pi, sqrt
from typing import NamedTuple

import numpy as np

from estimator.compiled import across, compiled
from estimator.likelihood import LOCAL, THETA, fill_motions, seen_from
from estimator.linear import factor, inverse, marginal
from estimator.posterior import (
    Work,
    chart_at,
    climb,
    contacts_cost,
    copied,
    cost_at,
    line_of,
    move,
    place,
    spread_of,
    states_of,
    work_space,
)
from estimator.problem import Background, Nuisances
from estimator.readings import VOID, Readings
from estimator.seeds import complex_lines, most_seeds, seed_lines
from estimator.vectors import Array, Index

DRAMATICALLY_WORSE = 16.0  # cost above the best at which a peak no longer counts
MOST_PEAKS = 16
MOST_STARTS = 24  # seeds from which a few steps are taken
FIRST_STEPS = 3
HOPELESS = 0.05  # of what a climb lags behind the best: gaining less than this in a step, it rests
ROUGH = 30  # steps before a start is compared with the others
SAME_PEAK = 0.5  # distance in standard deviations below which two peaks are one
SAME_AXIS = 3.0  # ... below which they are one hypothesis
DIRECTION_VOLUME = 1.0  # information [1/rad^2] of "any direction", so that flat peaks stay finite
FREE_SHIFT = 30.0  # a shift that nothing limits gets this many spreads, a tilt ten radians


class Modes(NamedTuple):
    """Peaks of S sets, M places for each, the likeliest first.

    Args:
        peaks: Places that are filled, (S,).
        x: Point, direction, nuisance states, (S, M, D).
        cost: Negative log posterior, (S, M).
        probability: Laplace's evidence over that of all; zero in empty places, (S, M).
        covariance: Of line and nuisance states, everything included, (S, M, P, P).
        contacts: Information of the line from the contacts alone, nuisances out, (S, M, 4, 4).
        parallel_rows: Probability that row 0 of each contact is the parallel's, (S, M, n).
        right: Probability that each contact is no gross error, (S, M, n).
        tally: Sum of squares of the contacts' residuals and how many there are beyond the four
            of the line; gross errors left out, and all of them, (S, M, 4).
        leader: First peak of the same hypothesis, (S, M).
    """

    peaks: Index
    x: Array
    cost: Array
    probability: Array
    covariance: Array
    contacts: Array
    parallel_rows: Array
    right: Array
    tally: Array
    leader: Index


def find_modes(readings: Readings, nuisances: Nuisances, background: Background) -> Modes:
    """All peaks of every set worth mentioning: climbed from many seeds, equal ones merged."""
    S, n = readings.shape[:2]
    P = 4 + len(nuisances.precision)
    M = MOST_PEAKS
    modes = Modes(
        np.zeros(S, dtype=np.intp),
        np.zeros((S, M, P + 2)),
        np.full((S, M), np.inf),
        np.zeros((S, M)),
        np.zeros((S, M, P, P)),
        np.zeros((S, M, 4, 4)),
        np.zeros((S, M, n)),
        np.zeros((S, M, n)),
        np.zeros((S, M, 4)),
        np.zeros((S, M), dtype=np.intp),
    )
    _fill(readings, nuisances, background, complex_lines(readings), modes)
    return modes


@compiled
def _fill(
    readings: Readings, nuisances: Nuisances, background: Background, extra: Array, modes: Modes
) -> None:
    n, D = readings.shape[1], modes.x.shape[2]
    work = work_space(D - 2, n)
    most = most_seeds(n) + extra.shape[1]
    seeds, starts = np.zeros((most, 6)), np.zeros((most, D))
    costs, order = np.zeros(most), np.zeros(most, dtype=np.intp)
    # far from a peak every contact looks grossly wrong, and nothing would pull
    trusting = Background(
        background.lines, background.informed, background.misses, background.slope, 0.0
    )
    rough, rough_cost = np.zeros((MOST_PEAKS, D)), np.zeros(MOST_PEAKS)
    for s in range(readings.shape[0]):
        count = seed_lines(readings, background, extra, s, seeds)
        _start(readings, nuisances, background, s, seeds, count, starts, costs, work)
        count = _first_steps(readings, nuisances, trusting, s, starts, costs, count, order, work)
        found, least = 0, costs[order[0]]
        for k in range(count):
            x = starts[order[k]]
            if _on_the_way(readings, nuisances, background, s, x, rough, found, work):
                continue
            rest = max(1e-2, HOPELESS * (costs[order[k]] - least))
            cost = climb(readings, nuisances, background, s, x, ROUGH, rest, work)
            least = min(least, cost)
            found = _keep(background, s, x, cost, work, rough, rough_cost, found)
        sort_into(rough_cost, found, order)
        kept = 0
        for k in range(found):
            if rough_cost[order[k]] < rough_cost[order[0]] + DRAMATICALLY_WORSE:
                x = rough[order[k]]
                cost = climb(readings, nuisances, background, s, x, 60, 1e-12, work)
                kept = _keep(background, s, x, cost, work, modes.x[s], modes.cost[s], kept)
        modes.peaks[s] = kept
        _describe(readings, nuisances, background, s, modes, order, costs, work)


@compiled
def _on_the_way(
    readings: Readings,
    nuisances: Nuisances,
    background: Background,
    s: int,
    x: Array,
    kept: Array,
    count: int,
    work: Work,
) -> bool:
    """Whether a start has come so near to a peak already found that it would end there too."""
    cost_at(readings, nuisances, background, s, x, True, work)
    information = marginal(work.fisher)
    for k in range(count):
        if separation(background, s, x, kept[k], information) < SAME_AXIS**2:
            return True
    return False


@compiled
def _first_steps(
    readings: Readings,
    nuisances: Nuisances,
    background: Background,
    s: int,
    starts: Array,
    costs: Array,
    count: int,
    order: Index,
    work: Work,
) -> int:
    """A few steps from the cheapest seeds; `order` then has those worth the whole climb first."""
    sort_into(costs, count, order)
    for k in range(min(count, MOST_STARTS)):
        x = starts[order[k]]
        cost = climb(readings, nuisances, background, s, x, FIRST_STEPS, 1e-2, work)
        costs[order[k]] = cost if np.isfinite(cost) else 1e300
    for k in range(MOST_STARTS, count):
        costs[order[k]] = 1e300
    sort_into(costs, count, order)
    return min(count, MOST_STARTS)


@compiled
def sort_into(values: Array, count: int, order: Index) -> None:
    """order[:count] sorts values[:count]; by insertion, for the few there are."""
    for k in range(count):
        j = k
        while j > 0 and values[order[j - 1]] > values[k]:
            order[j] = order[j - 1]
            j -= 1
        order[j] = k


@compiled
def _start(
    readings: Readings,
    nuisances: Nuisances,
    background: Background,
    s: int,
    seeds: Array,
    count: int,
    starts: Array,
    costs: Array,
    work: Work,
) -> None:
    """Seeds as states with every nuisance zero, and their costs."""
    for j in range(len(work.step)):
        work.step[j] = 0.0
    for k in range(count):
        for j in range(starts.shape[1]):
            starts[k, j] = seeds[k, j] if j < 6 else 0.0
        move(background, s, starts[k], work.step, starts[k])
        cost = cost_at(readings, nuisances, background, s, starts[k], False, work)
        costs[k] = cost if np.isfinite(cost) else 1e300


@compiled
def separation(background: Background, s: int, x: Array, other: Array, information: Array) -> float:
    """Squared distance of two lines in the chart at the first, in standard deviations."""
    a, u = line_of(x)
    e1, e2 = across(u)
    b, v = line_of(other)
    d = chart_at(a, (e1, e2, u), b, v)
    total = 0.0
    for j in range(4):
        for k in range(4):
            total += d[j] * information[j, k] * d[k]
    return total


@compiled
def _keep(
    background: Background,
    s: int,
    x: Array,
    cost: float,
    work: Work,
    kept: Array,
    costs: Array,
    count: int,
) -> int:
    """Add a peak to those kept unless it is one of them; the cheaper of two equals stays."""
    if not np.isfinite(cost):
        return count
    information = marginal(work.fisher)
    worst = 0
    for k in range(count):
        near = separation(background, s, x, kept[k], information) < SAME_PEAK**2
        if near and abs(costs[k] - cost) < 1.0:
            if cost < costs[k]:
                copied(x, kept[k])
                costs[k] = cost
            return count
        if costs[k] > costs[worst]:
            worst = k
    if count < len(kept):
        worst = count
        count += 1
    elif cost > costs[worst]:
        return count
    copied(x, kept[worst])
    costs[worst] = cost
    return count


@compiled
def _describe(
    readings: Readings,
    nuisances: Nuisances,
    background: Background,
    s: int,
    modes: Modes,
    order: Index,
    evidence: Array,
    work: Work,
) -> None:
    """Covariances, evidence, labels of every peak; then the likeliest first."""
    spread = spread_of(background, s)
    count = modes.peaks[s]
    for k in range(count):
        x = modes.x[s, k]
        modes.cost[s, k] = cost_at(readings, nuisances, background, s, x, True, work)
        for j in range(4):  # a line free to turn or shift keeps a finite volume
            work.fisher[j, j] += 1e-6 / spread**2 if j < 2 else DIRECTION_VOLUME
        evidence[k] = modes.cost[s, k] + 0.5 * factor(work.fisher, work.lifted)
        for j in range(4):
            work.fisher[j, j] += FREE_SHIFT**-2 / spread**2 if j < 2 else 0.01 - DIRECTION_VOLUME
        inverse(work.fisher, modes.covariance[s, k], work.lifted)
        for i in range(readings.shape[1]):
            modes.parallel_rows[s, k, i] = _parallel_row(
                readings, nuisances, s, i, x, modes.covariance[s, k], work
            )
        _contacts_alone(readings, nuisances, background, s, k, modes, work)
    sort_into(evidence, count, order)
    _reorder(modes, s, order)
    total = 0.0
    for k in range(count):
        modes.probability[s, k] = exp(evidence[order[0]] - evidence[order[k]])
        total += modes.probability[s, k]
    for k in range(count):
        modes.probability[s, k] /= total
        modes.leader[s, k] = _leader(background, s, k, modes)


@compiled
def _contacts_alone(
    readings: Readings,
    nuisances: Nuisances,
    background: Background,
    s: int,
    k: int,
    modes: Modes,
    work: Work,
) -> None:
    """What the contacts and the nuisance states' priors say of the line, without its own prior."""
    P = len(work.gradient)
    for j in range(P):
        for m in range(P):
            work.fisher[j, m] = nuisances.precision[j - 4] if j == m and j > 3 else 0.0
    contacts_cost(readings, nuisances, background, s, modes.x[s, k], True, work)
    prior = 0.0
    for j in range(len(nuisances.precision)):
        prior += nuisances.precision[j] * modes.x[s, k, 6 + j] ** 2
    for j in range(4):
        modes.tally[s, k, j] = work.tally[j] + (prior if j % 2 == 0 else -4.0)
    for i in range(readings.shape[1]):
        modes.right[s, k, i] = work.right[i]
    information = marginal(work.fisher)
    for j in range(4):
        for m in range(4):
            modes.contacts[s, k, j, m] = information[j, m]


@compiled
def _reorder(modes: Modes, s: int, order: Index) -> None:
    """Bring the peaks of a set into order, in place, by following swaps."""
    for k in range(modes.peaks[s]):
        j = order[k]
        while j < k:
            j = order[j]
        if j != k:
            _swap(modes.x[s, k], modes.x[s, j])
            _swap(modes.parallel_rows[s, k], modes.parallel_rows[s, j])
            for row in range(modes.covariance.shape[2]):
                _swap(modes.covariance[s, k, row], modes.covariance[s, j, row])
            for row in range(4):
                _swap(modes.contacts[s, k, row], modes.contacts[s, j, row])
            _swap(modes.right[s, k], modes.right[s, j])
            _swap(modes.tally[s, k], modes.tally[s, j])
            modes.cost[s, k], modes.cost[s, j] = modes.cost[s, j], modes.cost[s, k]


@compiled
def _swap(a: Array, b: Array) -> None:
    for j in range(len(a)):
        a[j], b[j] = b[j], a[j]


@compiled
def _parallel_row(
    readings: Readings,
    nuisances: Nuisances,
    s: int,
    i: int,
    x: Array,
    covariance: Array,
    work: Work,
) -> float:
    """Probability that row 0 is nearer to the parallel, theta being known as well as the line."""
    if readings[s, i, VOID] > 0.0:
        return 0.5
    a, u = line_of(x)
    delta, _, bias = states_of(nuisances, i, x)
    seen = seen_from(readings[s, i], a, u, bias, delta)
    E1, E2 = across(u)
    fill_motions(seen, E1, E2, work.rows, LOCAL)
    total = 0.0
    for j in range(LOCAL):
        J = place(nuisances, i, j)
        for k in range(LOCAL):
            K = place(nuisances, i, k)
            if J >= 0 and K >= 0:
                total += work.rows[THETA, j] * work.rows[THETA, k] * covariance[J, K]
    folded = 0.5 * abs(atan2(seen.s2, seen.c2))
    return 0.5 * (1.0 + erf((0.25 * pi - folded) / sqrt(2.0 * max(total, 1e-18))))


@compiled
def _leader(background: Background, s: int, k: int, modes: Modes) -> int:
    """The first peak within SAME_AXIS of this one: together they are one hypothesis."""
    both, information, L = np.zeros((4, 4)), np.zeros((4, 4)), np.zeros((4, 4))
    for j in range(k):
        if modes.leader[s, j] != j:
            continue
        for row in range(4):
            for column in range(4):
                both[row, column] = modes.covariance[s, j, row, column]
                both[row, column] += modes.covariance[s, k, row, column]
        inverse(both, information, L)
        if separation(background, s, modes.x[s, j], modes.x[s, k], information) < SAME_AXIS**2:
            return j
    return k
