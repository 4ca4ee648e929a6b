"""The search for every peak of one posterior: from many seeds, equal peaks merged."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from estimator.background import ORIGIN
from estimator.chart import separation, stepped
from estimator.climb import climb
from estimator.compiled import compiled_in_place, compiled_part, vector
from estimator.linear import marginal
from estimator.posterior import cost_at
from estimator.problem import Problem, trusting
from estimator.seeds import seed_lines
from estimator.vectors import Array, Index
from estimator.work import Work, copied

DRAMATICALLY_WORSE = 16.0  # cost above the best at which a peak no longer counts
MOST_PEAKS = 16
MOST_STARTS = 24  # seeds from which a few steps are taken
FIRST_STEPS = 3
HOPELESS = 0.05  # of what a climb lags behind the best: gaining less than this in a step, it rests
ROUGH = 30  # steps before a start is compared with the others
FINE = 60  # steps that a peak may take at most
SAME_PEAK = 0.5  # distance in standard deviations below which two peaks are one
SAME_AXIS = 3.0  # ... below which they are one hypothesis
_NEVER = 1e300  # cost of a start without a finite one


class Bench(NamedTuple):
    """Room for the starts of a search, and the rough peaks it finds; overwritten by the next."""

    seeds: Array  # (K, 6)
    starts: Array  # (K, D)
    costs: Array  # (K,)
    order: Index  # (K,)
    rough: Array  # (MOST_PEAKS, D)
    rough_cost: Array  # (MOST_PEAKS,)


@compiled_part
def bench(most: int, D: int) -> Bench:
    return Bench(
        np.zeros((most, 6)),
        np.zeros((most, D)),
        np.zeros(most),
        np.zeros(max(most, MOST_PEAKS), dtype=np.intp),
        np.zeros((MOST_PEAKS, D)),
        np.zeros(MOST_PEAKS),
    )


@compiled_in_place
def find_peaks(
    problem: Problem, extra: Array, room: Bench, work: Work, peaks: Array, costs: Array
) -> int:
    """Fill `peaks` (M, D) with states and `costs` (M,), in no order; returns how many there are.

    A few steps from the cheapest seeds show which are worth the climb; whoever comes near to a
    peak already found, climbing or not, ends there.
    """
    count = seed_lines(problem, extra, room.seeds)
    _start(problem, room, count, work)
    # far from a peak every contact looks grossly wrong, and nothing would pull
    count = _first_steps(trusting(problem), room, count, work)
    found = _climb_all(problem, room, count, work)
    sort_into(room.rough_cost, found, room.order)
    kept, best = 0, room.rough_cost[room.order[0]]
    for k in range(found):
        j = room.order[k]
        if room.rough_cost[j] < best + DRAMATICALLY_WORSE:
            x = room.rough[j]
            cost = climb(problem, x, FINE, 1e-12, work)
            kept = _keep(x, cost, work, peaks, costs, kept)
    return kept


@compiled_in_place
def _climb_all(problem: Problem, room: Bench, count: int, work: Work) -> int:
    """Rough climbs from every start that is not on its way to a known peak."""
    found, least = 0, room.costs[room.order[0]]
    for k in range(count):
        j = room.order[k]
        x = room.starts[j]
        if _on_the_way(problem, x, room.rough, found, work):
            continue
        rest = max(1e-2, HOPELESS * (room.costs[j] - least))
        cost = climb(problem, x, ROUGH, rest, work)
        least = min(least, cost)
        found = _keep(x, cost, work, room.rough, room.rough_cost, found)
    return found


@compiled_in_place
def _start(problem: Problem, room: Bench, count: int, work: Work) -> None:
    """Seeds as states with every nuisance zero, and their costs."""
    origin = vector(problem.line, ORIGIN)
    for j in range(len(work.step)):
        work.step[j] = 0.0
    for k in range(count):
        x = room.starts[k]
        for j in range(len(x)):
            x[j] = room.seeds[k, j] if j < 6 else 0.0
        stepped(x, work.step, origin, x)
        room.costs[k] = _finite(cost_at(problem, x, False, work))


@compiled_in_place
def _first_steps(problem: Problem, room: Bench, count: int, work: Work) -> int:
    """A few steps from the cheapest seeds; `order` then has those worth the whole climb first."""
    order, costs = room.order, room.costs
    sort_into(costs, count, order)
    for k in range(min(count, MOST_STARTS)):
        x = room.starts[order[k]]
        costs[order[k]] = _finite(climb(problem, x, FIRST_STEPS, 1e-2, work))
    for k in range(MOST_STARTS, count):
        costs[order[k]] = _NEVER
    sort_into(costs, count, order)
    return min(count, MOST_STARTS)


@compiled_part
def _finite(cost: float) -> float:
    return cost if np.isfinite(cost) else _NEVER


@compiled_in_place
def _on_the_way(problem: Problem, x: Array, kept: Array, count: int, work: Work) -> bool:
    """Whether a start has come so near to a peak already found that it would end there too."""
    cost_at(problem, x, True, work)
    information = marginal(work.fisher)
    nearest = np.inf
    for k in range(count):
        nearest = min(nearest, separation(x, kept[k], information))
    return nearest < SAME_AXIS**2


@compiled_part
def _keep(x: Array, cost: float, work: Work, kept: Array, costs: Array, count: int) -> int:
    """Add a peak to those kept unless it is one of them; the cheaper of two equals stays."""
    if not np.isfinite(cost):
        return count
    information = marginal(work.fisher)
    worst = 0
    for k in range(count):
        near = separation(x, kept[k], information) < SAME_PEAK**2
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


@compiled_part
def sort_into(values: Array, count: int, order: Index) -> None:
    """order[:count] sorts values[:count]; by insertion, for the few there are."""
    for k in range(count):
        j = k
        while j > 0 and values[order[j - 1]] > values[k]:
            order[j] = order[j - 1]
            j -= 1
        order[j] = k
