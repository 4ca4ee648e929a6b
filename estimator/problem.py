"""The whole problem of one axis, or of many alike, as arrays that compiled code reads.

State of a line: x = (a, u, nuisance...), a the foot of the chart's origin. Parameters: (t1, t2,
w1, w2) in the chart at the line, then the nuisance states.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from estimator.assumptions import Assumptions
from estimator.background import SPREAD, Background, background_of
from estimator.compiled import V3, compiled, compiled_part
from estimator.contact import Miss
from estimator.nuisances import Nuisances, Owner, State, nuisance_states, nuisances_of
from estimator.prior import AxisPrior
from estimator.readings import Readings
from estimator.vectors import Array, Index


class Problems(NamedTuple):
    """S sets of contacts with the same nuisance states, and what is believed of their lines."""

    readings: Readings
    nuisances: Nuisances
    background: Background


class Problem(NamedTuple):
    """One of them: its contacts (n, columns), its line's row, and what all sets share."""

    contacts: Array
    line: Array
    slots: Index
    precision: Array
    informed: bool
    misses: Array
    slope: float
    gross: float


@compiled
def problem_at(problems: Problems, s: int) -> Problem:
    """Problem of set s."""
    background, nuisances = problems.background, problems.nuisances
    return Problem(
        problems.readings[s],
        background.lines[min(s, len(background.lines) - 1)],
        nuisances.slots,
        nuisances.precision,
        background.informed,
        background.misses,
        background.slope,
        background.gross,
    )


@compiled_part
def trusting(problem: Problem) -> Problem:
    """The same without gross errors."""
    return Problem(
        problem.contacts,
        problem.line,
        problem.slots,
        problem.precision,
        problem.informed,
        problem.misses,
        problem.slope,
        0.0,
    )


@compiled_part
def spread_of(problem: Problem) -> float:
    spread: float = problem.line[SPREAD]
    return spread


@compiled_part
def states_of(problem: Problem, i: int, x: Array) -> tuple[float, float, V3]:
    """delta, lambda and position bias of contact i."""
    delta, scale, bias = 0.0, 0.0, (0.0, 0.0, 0.0)
    slot = problem.slots[i]
    if slot[0] >= 0:
        delta = x[6 + slot[0]]
    if slot[1] >= 0:
        scale = x[6 + slot[1]]
    if slot[2] >= 0:
        k = 6 + slot[2]
        bias = (x[k], x[k + 1], x[k + 2])
    return delta, scale, bias


@compiled_part
def place(problem: Problem, i: int, j: int) -> int:
    """Parameter of the whole problem that is parameter j of contact i; -1 for none."""
    if j < 4:
        return j
    slot = problem.slots[i, min(j - 4, 2)]
    if slot < 0:
        return -1
    first: int = slot
    return 4 + first + max(j - 6, 0)


def pose_problems(
    readings: Readings,
    owners: Sequence[Owner],
    *,
    priors: Sequence[AxisPrior] = (),
    misses: Sequence[Miss] = (),
    assumptions: Assumptions,
) -> tuple[Problems, tuple[State, ...]]:
    """The problems of S sets, and the nuisance states they share.

    Args:
        owners: Of the j-th contact of every set.
        priors: None, one for all sets, or one for each.
    """
    states = nuisance_states(owners, assumptions)
    gross = assumptions.gross(readings.shape[1])
    background = background_of(
        readings, priors, misses, slope=assumptions.sine_of_slope, gross=gross
    )
    return Problems(readings, nuisances_of(owners, states), background), states
