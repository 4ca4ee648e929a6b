"""What is said of one peak of a posterior: evidence, covariance, labels, and its like."""

from __future__ import annotations

from math import atan2, erf, pi, sqrt
from typing import NamedTuple

import numpy as np

from estimator.chart import line_of, separation
from estimator.compiled import across, compiled_in_place, compiled_part
from estimator.linear import factor, inverse, marginal
from estimator.posterior import contacts_cost, cost_at
from estimator.problem import Problem, place, spread_of, states_of
from estimator.readings import VOID
from estimator.search import SAME_AXIS
from estimator.sight import LOCAL, THETA, fill_motions, seen_from
from estimator.vectors import Array, Index
from estimator.work import Work

# A line that nothing keeps from shifting or turning still has a finite volume: its evidence counts
# shifts of a thousand spreads and turns of a radian,
EVIDENCE_SHIFT, EVIDENCE_TURN = 1e3, 1.0
# and its covariance says thirty spreads and ten radians, which everyone reads as "not known".
FREE_SHIFT, FREE_TURN = 30.0, 10.0


class Peaks(NamedTuple):
    """The peaks of one set, as in `estimator.modes.Modes` without its first axis."""

    x: Array
    cost: Array
    covariance: Array
    contacts: Array
    parallel_rows: Array
    right: Array
    tally: Array


@compiled_in_place
def evidence_of(problem: Problem, x: Array, work: Work) -> float:
    """Negative log of Laplace's evidence, up to what all peaks share."""
    cost = cost_at(problem, x, True, work)
    _add_finite_volume(problem, work.fisher, EVIDENCE_SHIFT, EVIDENCE_TURN)
    return cost + 0.5 * factor(work.fisher, work.lifted)


@compiled_part
def _add_finite_volume(problem: Problem, fisher: Array, shift: float, turn: float) -> None:
    for j in range(4):
        fisher[j, j] += (shift * spread_of(problem)) ** -2 if j < 2 else turn**-2


@compiled_in_place
def describe(problem: Problem, peaks: Peaks, k: int, work: Work) -> None:
    """Fill what is said of peak k, whose state is known."""
    x = peaks.x[k]
    peaks.cost[k] = cost_at(problem, x, True, work)
    _add_finite_volume(problem, work.fisher, FREE_SHIFT, FREE_TURN)
    inverse(work.fisher, peaks.covariance[k], work.lifted)
    for i in range(len(problem.contacts)):
        peaks.parallel_rows[k, i] = _parallel_row(problem, i, x, peaks.covariance[k], work)
    _contacts_alone(problem, peaks, k, work)


@compiled_in_place
def _contacts_alone(problem: Problem, peaks: Peaks, k: int, work: Work) -> None:
    """What the contacts and the nuisance states' priors say of the line, without its own prior."""
    x, P = peaks.x[k], len(work.gradient)
    prior = 0.0
    for j in range(P):
        for m in range(P):
            work.fisher[j, m] = problem.precision[j - 4] if j == m and j > 3 else 0.0
    for j in range(P - 4):
        prior += problem.precision[j] * x[6 + j] ** 2
    contacts_cost(problem, x, True, work)
    for j in range(4):
        peaks.tally[k, j] = work.local[0].tally[j] + (prior if j % 2 == 0 else -4.0)
    for i in range(len(problem.contacts)):
        peaks.right[k, i] = work.right[i]
    information = marginal(work.fisher)
    for j in range(4):
        for m in range(4):
            peaks.contacts[k, j, m] = information[j, m]


@compiled_part
def _parallel_row(problem: Problem, i: int, x: Array, covariance: Array, work: Work) -> float:
    """Probability that row 0 is nearer to the parallel, theta being known as well as the line."""
    contact = problem.contacts[i]
    if contact[VOID] > 0.0:
        return 0.5
    a, u = line_of(x)
    delta, _, bias = states_of(problem, i, x)
    seen = seen_from(contact, a, u, bias, delta)
    E1, E2 = across(u)
    rows = work.local[0].rows
    fill_motions(seen, E1, E2, rows, LOCAL)
    total = 0.0
    for j in range(LOCAL):
        J = place(problem, i, j)
        for k in range(LOCAL):
            K = place(problem, i, k)
            if J >= 0 and K >= 0:
                total += rows[THETA, j] * rows[THETA, k] * covariance[J, K]
    folded = 0.5 * abs(atan2(seen.s2, seen.c2))
    return 0.5 * (1.0 + erf((0.25 * pi - folded) / sqrt(2.0 * max(total, 1e-18))))


@compiled_part
def leader_of(peaks: Peaks, k: int, leader: Index) -> int:
    """The first peak within SAME_AXIS of this one: together they are one hypothesis."""
    both, information, L = np.zeros((4, 4)), np.zeros((4, 4)), np.zeros((4, 4))
    for j in range(k):
        if leader[j] != j:
            continue
        for row in range(4):
            for column in range(4):
                both[row, column] = peaks.covariance[j, row, column]
                both[row, column] += peaks.covariance[k, row, column]
        inverse(both, information, L)
        if separation(peaks.x[j], peaks.x[k], information) < SAME_AXIS**2:
            return j
    return k
