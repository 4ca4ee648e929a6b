"""The density whose peaks are the possible axes.

Given the axis, contacts are independent: the cost of a line is a sum over contacts, labels
included (see `estimator.likelihood`), whatever their number.
"""

from __future__ import annotations

from estimator.background_terms import background_cost
from estimator.chart import line_of
from estimator.compiled import across, compiled, compiled_part
from estimator.gross import gross_errors
from estimator.likelihood import Fit, fill_derivatives, fit_of
from estimator.problem import Problem, place, states_of
from estimator.readings import VOID
from estimator.shape_terms import add_constraints
from estimator.sight import LOCAL, fill_motions, seen_from
from estimator.vectors import Array
from estimator.work import Work


@compiled
def contacts_cost(problem: Problem, x: Array, derivatives: bool, work: Work) -> float:
    """Cost of all contacts; derivatives are added to those in work, tallies renewed."""
    a, u = line_of(x)
    one = work.local[0]
    basis = across(u)
    cost = 0.0
    for k in range(len(one.tally)):
        one.tally[k] = 0.0
    locals_ = 4 if len(problem.precision) == 0 else LOCAL
    for i in range(len(problem.contacts)):
        delta, scale, bias = states_of(problem, i, x)
        row = problem.contacts[i]
        seen = seen_from(row, a, u, bias, delta)
        fit = fit_of(row, seen, scale, one.lean)
        density, trust, normal_only = fit.log_density, 1.0, 0.0
        if problem.gross > 0.0:
            density, trust, normal_only = gross_errors(row, fit, problem.gross)
        cost -= density
        work.right[i] = trust
        _add_to_tally(row, fit, trust, normal_only, one.tally)
        if derivatives:
            fill_motions(seen, basis[0], basis[1], one.rows, locals_)
            fill_derivatives(
                row, seen, fit, trust, normal_only, one.lean,
                one.gradient, one.fisher, one.rows, locals_,
            )  # fmt: skip
        cost += add_constraints(
            row, seen, problem.slope, derivatives,
            one.gradient, one.fisher, one.rows, locals_,
        )  # fmt: skip
        if derivatives:
            _scatter(problem, i, work, locals_)
    return cost


@compiled_part
def _add_to_tally(row: Array, fit: Fit, trust: float, normal_only: float, tally: Array) -> None:
    """Squared residuals and their number: gross errors left out, and all."""
    turned = fit.b**2 + fit.c**2
    readable = (row[VOID] == 0.0) + (fit.F_K > 0.0)  # residuals beyond the normal's
    tally[0] += (trust + normal_only) * fit.a**2 + trust * turned
    tally[1] += trust + normal_only + trust * readable
    tally[2] += fit.a**2 + turned
    tally[3] += 1.0 + readable


@compiled_part
def _scatter(problem: Problem, i: int, work: Work, locals_: int) -> None:
    one = work.local[0]
    for j in range(locals_):
        J = place(problem, i, j)
        if J < 0:
            continue
        work.gradient[J] += one.gradient[j]
        for k in range(j + 1):
            K = place(problem, i, k)
            if K >= 0:
                work.fisher[max(J, K), min(J, K)] += one.fisher[j, k]


@compiled
def cost_at(problem: Problem, x: Array, derivatives: bool, work: Work) -> float:
    """Negative log posterior of a line; with derivatives, work holds gradient and information."""
    if derivatives:
        for j in range(len(work.gradient)):
            work.gradient[j] = 0.0
            for k in range(j + 1):
                work.fisher[j, k] = 0.0
    cost = contacts_cost(problem, x, derivatives, work)
    for k in range(len(problem.precision)):
        cost += 0.5 * problem.precision[k] * x[6 + k] ** 2
        if derivatives:
            work.gradient[4 + k] += problem.precision[k] * x[6 + k]
            work.fisher[4 + k, 4 + k] += problem.precision[k]
    return cost + background_cost(problem, x, derivatives, work)
