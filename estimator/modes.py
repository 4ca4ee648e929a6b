"""The distinct peaks of a posterior, how much probability each holds, and which go together."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from estimator.compiled import compiled
from estimator.peaks import Peaks, describe, evidence_of, leader_of
from estimator.problem import Problems, problem_at
from estimator.search import MOST_PEAKS, bench, find_peaks, sort_into
from estimator.seeds import complex_lines, most_seeds
from estimator.side_by_side import in_shares
from estimator.vectors import Array, Index
from estimator.work import copied, work_space


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


def find_modes(problems: Problems) -> Modes:
    """All peaks of every set worth mentioning."""
    S, n = problems.readings.shape[:2]
    P = 4 + len(problems.nuisances.precision)
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
    lines = complex_lines(problems.readings)
    in_shares(lambda part: fill_modes(problems, lines, modes, part.start, part.stop), S)
    return modes


@compiled
def fill_modes(problems: Problems, extra: Array, modes: Modes, first: int, end: int) -> None:
    """Search, weigh and describe the sets from `first` to before `end`, one after the other."""
    n, D = problems.readings.shape[1], modes.x.shape[2]
    work = work_space(D - 2, n)
    room = bench(most_seeds(n) + extra.shape[1], D)
    states, costs = np.zeros((MOST_PEAKS, D)), np.zeros(MOST_PEAKS)
    for s in range(first, end):
        problem = problem_at(problems, s)
        count = find_peaks(problem, extra[s], room, work, states, costs)
        for k in range(count):
            costs[k] = evidence_of(problem, states[k], work)
        sort_into(costs, count, room.order)
        peaks = Peaks(
            modes.x[s], modes.cost[s], modes.covariance[s], modes.contacts[s],
            modes.parallel_rows[s], modes.right[s], modes.tally[s],
        )  # fmt: skip
        modes.peaks[s] = count
        total = 0.0
        for k in range(count):
            j = room.order[k]
            copied(states[j], peaks.x[k])
            describe(problem, peaks, k, work)
            modes.probability[s, k] = np.exp(costs[room.order[0]] - costs[j])
            total += modes.probability[s, k]
        for k in range(count):
            modes.probability[s, k] /= total
            modes.leader[s, k] = leader_of(peaks, k, modes.leader[s])
