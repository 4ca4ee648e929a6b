"""The density whose peaks are the possible axes, and the climb to those peaks.

Given the axis, contacts are independent: the cost of a line is a sum over contacts, labels
included (see `estimator.likelihood`), whatever their number.
"""

from __future__ import annotations

from math import exp, log, sqrt
from typing import NamedTuple

import numpy as np

from estimator.compiled import V3, across, along, compiled, dot, scaled
from estimator.likelihood import (
    LOCAL,
    add_constraints,
    fill_derivatives,
    fill_motions,
    fit_of,
    gross_errors,
    seen_from,
    vector,
)
from estimator.linear import factor, solve_factored
from estimator.problem import (
    BASIS,
    ORIGIN,
    POINT,
    PRECISION,
    SIZE,
    SPREAD,
    Background,
    Nuisances,
)
from estimator.readings import POSITION, VOID, Readings
from estimator.vectors import Array

LARGEST_TURN = 0.3  # of one step [rad]
LARGEST_SHIFT = 1.5  # of one step, in spreads
NEAR = 0.5  # without a prior the axis passes the centroid within about so many spreads
HEAVY = 4.0  # degrees of freedom of that
MISSED_ANYWAY = 0.2  # chance that a miss has another reason: an end, a dent, a slip
CHART_STEP = 1e-6


class Work(NamedTuple):
    """Space for derivatives of P parameters; made once, overwritten by every call."""

    gradient: Array  # (P,)
    fisher: Array  # (P, P), lower triangle
    kept_gradient: Array  # (P,)
    kept_fisher: Array  # (P, P)
    local_gradient: Array  # (9,)
    local_fisher: Array  # (9, 9)
    rows: Array  # (8, 9)
    chart: Array  # (4, 4)
    lifted: Array  # (P, P)
    step: Array  # (P,)
    right: Array  # (n,): probability that each contact is no gross error
    tally: Array  # sum and number of squared residuals: gross errors left out, and all


@compiled
def work_space(parameters: int, contacts: int) -> Work:
    return Work(
        np.zeros(parameters),
        np.zeros((parameters, parameters)),
        np.zeros(parameters),
        np.zeros((parameters, parameters)),
        np.zeros(LOCAL),
        np.zeros((LOCAL, LOCAL)),
        np.zeros((8, LOCAL)),
        np.zeros((4, 4)),
        np.zeros((parameters, parameters)),
        np.zeros(parameters),
        np.zeros(contacts),
        np.zeros(4),
    )


@compiled
def copied(x: Array, out: Array) -> None:
    for k in range(len(x)):
        out[k] = x[k]


@compiled
def shared(background: Background, s: int) -> int:
    """Row of set s, or the one row that all sets share."""
    return min(s, len(background.lines) - 1)


@compiled
def spread_of(background: Background, s: int) -> float:
    spread: float = background.lines[shared(background, s), SPREAD]
    return spread


@compiled
def line_of(x: Array) -> tuple[V3, V3]:
    return (x[0], x[1], x[2]), (x[3], x[4], x[5])


@compiled
def states_of(nuisances: Nuisances, i: int, x: Array) -> tuple[float, float, V3]:
    """delta, lambda and position bias of contact i."""
    delta, scale, bias = 0.0, 0.0, (0.0, 0.0, 0.0)
    slot = nuisances.slots[i]
    if slot[0] >= 0:
        delta = x[6 + slot[0]]
    if slot[1] >= 0:
        scale = x[6 + slot[1]]
    if slot[2] >= 0:
        k = 6 + slot[2]
        bias = (x[k], x[k + 1], x[k + 2])
    return delta, scale, bias


@compiled
def contacts_cost(
    readings: Readings,
    nuisances: Nuisances,
    background: Background,
    s: int,
    x: Array,
    derivatives: bool,
    work: Work,
) -> float:
    """Cost of all contacts of set s; derivatives are added to those in work, tallies renewed."""
    a, u = line_of(x)
    basis = across(u)
    cost = 0.0
    for k in range(len(work.tally)):
        work.tally[k] = 0.0
    locals_ = 4 if len(nuisances.precision) == 0 else LOCAL
    for i in range(readings.shape[1]):
        delta, scale, bias = states_of(nuisances, i, x)
        row = readings[s, i]
        seen = seen_from(row, a, u, bias, delta)
        fit = fit_of(row, seen, scale)
        density, trust, normal_only = fit.log_density, 1.0, 0.0
        if background.gross > 0.0:
            density, trust, normal_only = gross_errors(row, seen, fit, background.gross)
        cost -= density
        turned = fit.b**2 + fit.c**2
        readable = (row[VOID] == 0.0) + (fit.F_K > 0.0)  # residuals beyond the normal's
        work.tally[0] += (trust + normal_only) * fit.a**2 + trust * turned
        work.tally[1] += trust + normal_only + trust * readable
        work.tally[2] += fit.a**2 + turned
        work.tally[3] += 1.0 + readable
        work.right[i] = trust
        if derivatives:
            fill_motions(seen, basis[0], basis[1], work.rows, locals_)
            fill_derivatives(
                row, seen, fit, trust, normal_only,
                work.local_gradient, work.local_fisher, work.rows, locals_,
            )  # fmt: skip
        cost += add_constraints(
            row, seen, background.slope, derivatives,
            work.local_gradient, work.local_fisher, work.rows, locals_,
        )  # fmt: skip
        if derivatives:
            _scatter(nuisances, i, work, locals_)
    return cost


@compiled
def place(nuisances: Nuisances, i: int, j: int) -> int:
    """Parameter of the whole problem that is parameter j of contact i; -1 for none."""
    if j < 4:
        return j
    slot = nuisances.slots[i, min(j - 4, 2)]
    if slot < 0:
        return -1
    first: int = slot
    return 4 + first + max(j - 6, 0)


@compiled
def _scatter(nuisances: Nuisances, i: int, work: Work, locals_: int) -> None:
    for j in range(locals_):
        J = place(nuisances, i, j)
        if J < 0:
            continue
        work.gradient[J] += work.local_gradient[j]
        for k in range(j + 1):
            K = place(nuisances, i, k)
            if K >= 0:
                work.fisher[max(J, K), min(J, K)] += work.local_fisher[j, k]


@compiled
def cost_at(
    readings: Readings,
    nuisances: Nuisances,
    background: Background,
    s: int,
    x: Array,
    derivatives: bool,
    work: Work,
) -> float:
    """Negative log posterior of a line; with derivatives, work holds gradient and information."""
    if derivatives:
        for j in range(len(work.gradient)):
            work.gradient[j] = 0.0
            for k in range(j + 1):
                work.fisher[j, k] = 0.0
    cost = contacts_cost(readings, nuisances, background, s, x, derivatives, work)
    for k in range(len(nuisances.precision)):
        cost += 0.5 * nuisances.precision[k] * x[6 + k] ** 2
        if derivatives:
            work.gradient[4 + k] += nuisances.precision[k] * x[6 + k]
            work.fisher[4 + k, 4 + k] += nuisances.precision[k]
    if background.informed:
        cost += _prior_cost(background, s, x, derivatives, work)
        cost += _size_cost(readings, background, s, x, derivatives, work)
        return cost + _miss_cost(background, x, derivatives, work)
    return cost + _location_cost(background, s, x, derivatives, work)


@compiled
def _location_cost(bg: Background, s: int, x: Array, derivatives: bool, work: Work) -> float:
    """The line passes the contacts' centroid at a distance of about their spread, but contacts
    huddled on one side of a large object are not impossible: Student's t.

    Lines hold the foot of the origin as their point, so tilt does not change it to first order.
    """
    a, u = line_of(x)
    t = along(a, -1.0, vector(bg.lines[shared(bg, s)], ORIGIN))
    square = HEAVY * (NEAR * spread_of(bg, s)) ** 2
    weight = (HEAVY + 2.0) / (square + dot(t, t))
    if derivatives:
        E1, E2 = across(u)
        work.gradient[0] += weight * dot(t, E1)
        work.gradient[1] += weight * dot(t, E2)
        work.fisher[0, 0] += weight
        work.fisher[1, 1] += weight
    return 0.5 * (HEAVY + 2.0) * log(1.0 + dot(t, t) / square)


@compiled
def chart_at(point: V3, basis: tuple[V3, V3, V3], a: V3, u: V3) -> tuple[float, ...]:
    """(t1, t2, w1, w2) of a line in the chart at (point, basis[2]): see `estimator.axis`."""
    if dot(u, basis[2]) < 0.0:
        u = scaled(-1.0, u)
    s1, s2, c = dot(u, basis[0]), dot(u, basis[1]), dot(u, basis[2])
    norm = sqrt(s1 * s1 + s2 * s2)
    angle = np.arctan2(norm, c)
    d1, d2 = (s1 / norm, s2 / norm) if norm > 0.0 else (0.0, 0.0)
    gap = along(a, -1.0, point)
    foot = along(gap, -dot(gap, u), u)
    # the basis carried along the rotation from basis[2] to u
    towards = along(scaled(d1, basis[0]), d2, basis[1])
    turned = along(scaled(c - 1.0, towards), -norm, basis[2])
    t1 = dot(foot, along(basis[0], d1, turned))
    t2 = dot(foot, along(basis[1], d2, turned))
    return t1, t2, d1 * angle, d2 * angle


@compiled
def _prior_frame(bg: Background, s: int) -> tuple[V3, tuple[V3, V3, V3]]:
    row = bg.lines[shared(bg, s)]
    basis = (vector(row, BASIS), vector(row, BASIS + 3), vector(row, BASIS + 6))
    return vector(row, POINT), basis


@compiled
def _nudged(a: V3, u: V3, basis: tuple[V3, V3], j: int, h: float) -> tuple[V3, V3]:
    if j < 2:
        return along(a, h, basis[j]), u
    v = along(u, h, basis[j - 2])
    return a, scaled(1.0 / sqrt(dot(v, v)), v)


@compiled
def _prior_cost(bg: Background, s: int, x: Array, derivatives: bool, work: Work) -> float:
    """Gaussian in the prior's chart; the Jacobian between charts by central differences."""
    point, frame = _prior_frame(bg, s)
    a, u = line_of(x)
    here = chart_at(point, frame, a, u)
    row = bg.lines[shared(bg, s)]
    y = np.zeros(4)
    for j in range(4):
        for k in range(4):
            y[j] += row[PRECISION + 4 * j + k] * here[k]
    if derivatives:
        basis = across(u)
        for j in range(4):
            h = CHART_STEP * (spread_of(bg, s) if j < 2 else 1.0)
            a1, u1 = _nudged(a, u, basis, j, h)
            a2, u2 = _nudged(a, u, basis, j, -h)
            ahead, behind = chart_at(point, frame, a1, u1), chart_at(point, frame, a2, u2)
            for k in range(4):
                work.chart[k, j] = (ahead[k] - behind[k]) / (2.0 * h)
        for j in range(4):
            for k in range(4):
                work.gradient[j] += work.chart[k, j] * y[k]
                for m in range(4):
                    for i in range(j + 1):
                        P_km = row[PRECISION + 4 * k + m]
                        work.fisher[j, i] += work.chart[k, j] * P_km * work.chart[m, i]
    cost = 0.0
    for j in range(4):
        cost += 0.5 * here[j] * y[j]
    return cost


@compiled
def _size_cost(
    readings: Readings, bg: Background, s: int, x: Array, derivatives: bool, work: Work
) -> float:
    """Radius of each contact against the believed size; n contacts weigh as much as one."""
    a, u = line_of(x)
    E1, E2 = across(u)
    mean, weight = bg.lines[shared(bg, s), SIZE], bg.lines[shared(bg, s), SIZE + 1]
    cost = 0.0
    for i in range(readings.shape[1]):
        q = along(vector(readings[s, i], POSITION), -1.0, a)
        cost += 0.5 * weight * _pull(q, u, E1, E2, mean, weight, derivatives, work)
    return cost


@compiled
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


@compiled
def _miss_cost(bg: Background, x: Array, derivatives: bool, work: Work) -> float:
    """Where a finger met nothing the line is farther away than radius plus pad, softly.

    A miss may have other reasons, so it never costs more than -log MISSED_ANYWAY; several misses
    share their reason and together weigh as one.
    """
    a, u = line_of(x)
    E1, E2 = across(u)
    cost, count = 0.0, len(bg.misses)
    for i in range(count):
        q = along(vector(bg.misses[i], 0), -1.0, a)
        away = along(q, -dot(q, u), u)
        kept, sd = bg.misses[i, 3], bg.misses[i, 4]
        short = max(kept - sqrt(dot(away, away)), 0.0) / sd
        told = (1.0 - MISSED_ANYWAY) * exp(-0.5 * short**2)
        cost -= log(MISSED_ANYWAY + told) / count
        if short > 0.0:
            weight = told / (MISSED_ANYWAY + told) / count / sd**2
            _pull(q, u, E1, E2, kept, weight, derivatives, work)
    return cost


@compiled
def move(background: Background, s: int, x: Array, step: Array, out: Array) -> None:
    """The state after a step in the chart at its own line; the point returns to the foot."""
    a, u = line_of(x)
    E1, E2 = across(u)
    v = along(along(u, step[2], E1), step[3], E2)
    u = scaled(1.0 / sqrt(dot(v, v)), v)
    a = along(along(a, step[0], E1), step[1], E2)
    gap = along(vector(background.lines[shared(background, s)], ORIGIN), -1.0, a)
    a = along(a, dot(gap, u), u)
    out[0], out[1], out[2] = a
    out[3], out[4], out[5] = u
    for k in range(6, len(x)):
        out[k] = x[k] + step[k - 2]


@compiled
def solve_lifted(work: Work, damping: float, spread: float) -> None:
    """work.step = -(F + damping (diag F + 1))^-1 gradient, lengths of the line in spreads."""
    P = len(work.gradient)
    L, y = work.lifted, work.step
    for j in range(P):
        uj = spread if j < 2 else 1.0
        for k in range(j + 1):
            L[j, k] = work.fisher[j, k] * uj * (spread if k < 2 else 1.0)
        L[j, j] += damping * (L[j, j] + 1.0) + 1e-12
        y[j] = -work.gradient[j] * uj
    factor(L, L)
    solve_factored(L, y)
    longest = max(abs(y[0]), abs(y[1])) / LARGEST_SHIFT
    longest = max(longest, max(abs(y[2]), abs(y[3])) / LARGEST_TURN, 1.0)
    for j in range(P):
        y[j] *= (spread if j < 2 else 1.0) / longest


@compiled
def _remember(work: Work) -> None:
    copied(work.gradient, work.kept_gradient)
    for j in range(len(work.fisher)):
        copied(work.fisher[j], work.kept_fisher[j])


@compiled
def _recall(work: Work) -> None:
    copied(work.kept_gradient, work.gradient)
    for j in range(len(work.fisher)):
        copied(work.kept_fisher[j], work.fisher[j])


@compiled
def climb(
    readings: Readings,
    nuisances: Nuisances,
    background: Background,
    s: int,
    x: Array,
    iterations: int,
    gain_at_rest: float,
    work: Work,
) -> float:
    """Fisher scoring with Levenberg's damping; x becomes the peak, work holds its derivatives.

    A step is taken only where the full cost (log determinants included) falls.
    """
    trial = np.empty_like(x)
    spread = spread_of(background, s)
    cost = cost_at(readings, nuisances, background, s, x, True, work)
    damping = 1e-3
    for _ in range(iterations):
        solve_lifted(work, damping, spread)
        move(background, s, x, work.step, trial)
        _remember(work)
        found = cost_at(readings, nuisances, background, s, trial, True, work)
        gain = cost - found
        if gain > 0.0:
            copied(trial, x)
            cost = found
            damping = max(0.2 * damping, 1e-9)
            if gain < gain_at_rest:
                break
        else:
            _recall(work)
            damping *= 8.0
            if damping > 1e7 or gain > -1e-13:
                break
    return cost
