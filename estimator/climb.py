"""The climb from a line to a peak of the posterior."""

from __future__ import annotations

import numpy as np

from estimator.background import ORIGIN
from estimator.chart import stepped
from estimator.compiled import compiled_part, vector
from estimator.linear import factor, solve_factored
from estimator.posterior import cost_at
from estimator.problem import Problem, spread_of
from estimator.vectors import Array
from estimator.work import Work, copied, recall, remember

LARGEST_TURN = 0.3  # of one step [rad]
LARGEST_SHIFT = 1.5  # of one step, in spreads


@compiled_part
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


@compiled_part
def climb(problem: Problem, x: Array, iterations: int, gain_at_rest: float, work: Work) -> float:
    """Fisher scoring with Levenberg's damping; x becomes the peak, work holds its derivatives.

    A step is taken only where the full cost (log determinants included) falls.
    """
    trial = np.empty_like(x)
    spread, origin = spread_of(problem), vector(problem.line, ORIGIN)
    cost = cost_at(problem, x, True, work)
    damping = 1e-3
    for _ in range(iterations):
        solve_lifted(work, damping, spread)
        stepped(x, work.step, origin, trial)
        remember(work)
        found = cost_at(problem, trial, True, work)
        gain = cost - found
        if gain > 0.0:
            copied(trial, x)
            cost = found
            damping = max(0.2 * damping, 1e-9)
            if gain < gain_at_rest:
                break
        else:
            recall(work)
            damping *= 8.0
            if damping > 1e7 or gain > -1e-13:
                break
    return cost
