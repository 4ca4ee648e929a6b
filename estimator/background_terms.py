"""Cost of a line from what is believed of it besides the contacts: see `estimator.background`."""

from __future__ import annotations

from math import exp, log, sqrt

import numpy as np

from estimator.background import BASIS, ORIGIN, PRECISION, SIZE
from estimator.chart import chart_at, line_of, nudged
from estimator.compiled import V3, across, along, compiled_part, dot, vector
from estimator.problem import Problem, spread_of
from estimator.readings import POSITION
from estimator.vectors import Array
from estimator.work import Work

NEAR = 0.5  # without a prior the axis passes the centroid within about so many spreads
HEAVY = 4.0  # degrees of freedom of that
MISSED_ANYWAY = 0.2  # chance that a miss has another reason: an end, a dent, a slip
CHART_STEP = 1e-6


@compiled_part
def background_cost(problem: Problem, x: Array, derivatives: bool, work: Work) -> float:
    """All of it; derivatives are added to those in work."""
    if not problem.informed:
        return _location_cost(problem, x, derivatives, work)
    cost = _prior_cost(problem, x, derivatives, work)
    cost += _size_cost(problem, x, derivatives, work)
    return cost + _miss_cost(problem, x, derivatives, work)


@compiled_part
def _location_cost(problem: Problem, x: Array, derivatives: bool, work: Work) -> float:
    """The line passes the contacts' centroid at a distance of about their spread, but contacts
    huddled on one side of a large object are not impossible: Student's t.

    Lines hold the foot of the origin as their point, so tilt does not change it to first order.
    """
    a, u = line_of(x)
    t = along(a, -1.0, vector(problem.line, ORIGIN))
    square = HEAVY * (NEAR * spread_of(problem)) ** 2
    weight = (HEAVY + 2.0) / (square + dot(t, t))
    if derivatives:
        E1, E2 = across(u)
        work.gradient[0] += weight * dot(t, E1)
        work.gradient[1] += weight * dot(t, E2)
        work.fisher[0, 0] += weight
        work.fisher[1, 1] += weight
    return 0.5 * (HEAVY + 2.0) * log(1.0 + dot(t, t) / square)


@compiled_part
def _prior_cost(problem: Problem, x: Array, derivatives: bool, work: Work) -> float:
    """Gaussian in the prior's chart; the Jacobian between charts by central differences."""
    row, chart = problem.line, work.local[0].chart
    point = vector(row, ORIGIN)
    frame = (vector(row, BASIS), vector(row, BASIS + 3), vector(row, BASIS + 6))
    a, u = line_of(x)
    here = chart_at(point, frame, a, u)
    y = np.zeros(4)
    for j in range(4):
        for k in range(4):
            y[j] += row[PRECISION + 4 * j + k] * here[k]
    if derivatives:
        basis = across(u)
        for j in range(4):
            h = CHART_STEP * (spread_of(problem) if j < 2 else 1.0)
            a1, u1 = nudged(a, u, basis, j, h)
            a2, u2 = nudged(a, u, basis, j, -h)
            ahead, behind = chart_at(point, frame, a1, u1), chart_at(point, frame, a2, u2)
            for k in range(4):
                chart[k, j] = (ahead[k] - behind[k]) / (2.0 * h)
        for j in range(4):
            for k in range(4):
                work.gradient[j] += chart[k, j] * y[k]
                for m in range(4):
                    for i in range(j + 1):
                        P_km = row[PRECISION + 4 * k + m]
                        work.fisher[j, i] += chart[k, j] * P_km * chart[m, i]
    cost = 0.0
    for j in range(4):
        cost += 0.5 * here[j] * y[j]
    return cost


@compiled_part
def _size_cost(problem: Problem, x: Array, derivatives: bool, work: Work) -> float:
    """Radius of each contact against the believed size; n contacts weigh as much as one."""
    a, u = line_of(x)
    E1, E2 = across(u)
    mean, weight = problem.line[SIZE], problem.line[SIZE + 1]
    cost = 0.0
    for i in range(len(problem.contacts)):
        q = along(vector(problem.contacts[i], POSITION), -1.0, a)
        cost += 0.5 * weight * _pull(q, u, E1, E2, mean, weight, derivatives, work)
    return cost


@compiled_part
def _pull(
    q: V3, u: V3, E1: V3, E2: V3, mean: float, weight: float, derivatives: bool, work: Work
) -> float:
    """Squared difference of the distance of q from the line and `mean`; derivatives weighted."""
    z = dot(q, u)
    away = along(q, -z, u)
    r = max(sqrt(dot(away, away)), 1e-300)
    if derivatives:
        d1, d2 = -dot(E1, away) / r, -dot(E2, away) / r
        slope = (d1, d2, z * d1, z * d2)
        for j in range(4):
            work.gradient[j] += weight * (r - mean) * slope[j]
            for k in range(j + 1):
                work.fisher[j, k] += weight * slope[j] * slope[k]
    squared: float = (r - mean) ** 2
    return squared


@compiled_part
def _miss_cost(problem: Problem, x: Array, derivatives: bool, work: Work) -> float:
    """Where a finger met nothing the line is farther away than radius plus pad, softly.

    A miss may have other reasons, so it never costs more than -log MISSED_ANYWAY; several misses
    share their reason and together weigh as one.
    """
    a, u = line_of(x)
    E1, E2 = across(u)
    cost, count = 0.0, len(problem.misses)
    for i in range(count):
        q = along(vector(problem.misses[i], 0), -1.0, a)
        away = along(q, -dot(q, u), u)
        kept, sd = problem.misses[i, 3], problem.misses[i, 4]
        short = max(kept - sqrt(dot(away, away)), 0.0) / sd
        told = (1.0 - MISSED_ANYWAY) * exp(-0.5 * short**2)
        cost -= log(MISSED_ANYWAY + told) / count
        if short > 0.0:
            weight = told / (MISSED_ANYWAY + told) / count / sd**2
            _pull(q, u, E1, E2, kept, weight, derivatives, work)
    return cost
