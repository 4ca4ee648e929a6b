"""How far off, and how long it took: every contestant on the same problems, and the ratios."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from benchmark_problems import BATCH, CONTESTANTS, OURS, Contestant, Problems

from estimator.axis import Axis, angle_between, offset_at
from estimator.fusion import estimate_axes
from estimator.vectors import Array

FAR_DEG = 10.0
Interval = tuple[float, float, float]  # a figure, and its 95 % interval


@dataclass(frozen=True)
class Figures:
    """One estimator in one setting, or in all of them.

    Args:
        angle_deg, offset_mm: Median errors.
        far: Share of problems more than FAR_DEG off.
        error_ratio: Its median error of the direction over that of ours.
        ms, time_ratio: Median time for one problem, and over that of ours.
    """

    contacts: int
    setting: str
    estimator: str
    problems: int
    angle_deg: Interval
    offset_mm: float
    far: float
    error_ratio: Interval
    ms: float
    time_ratio: float


@dataclass(frozen=True, eq=False)
class Scores:
    """One estimator on P problems; NaN where it does not apply.

    Args:
        angle_deg, offset_mm: Off the true axis; the offset beside the contacts' middle, (P,).
        seconds: For each problem, (P,).
    """

    angle_deg: Array
    offset_mm: Array
    seconds: Array


def score_all(problems: Problems, rng: np.random.Generator) -> dict[str, Scores]:
    """Every contestant on the same problems; ours also in a batch."""
    scores = {name: _one_by_one(problems, f, rng) for name, f in CONTESTANTS.items()}
    estimate_axes(problems.sets)  # warm
    start = time.perf_counter()
    estimates = estimate_axes(problems.sets)
    seconds = (time.perf_counter() - start) / len(problems.sets)
    errors = [_error(problems, i, estimates.axis(i)) for i in range(len(problems.sets))]
    angle, offset = np.array(errors).T
    batch = Scores(angle, offset, np.full(len(errors), seconds))
    return {OURS: scores.pop(OURS), BATCH: batch, **scores}


def _one_by_one(problems: Problems, find: Contestant, rng: np.random.Generator) -> Scores:
    sets = [problems.sets.take(i) for i in range(len(problems.sets))]
    find(sets[0], rng)  # warm: whatever is compiled or cached at the first call
    rows = []
    for i, contacts in enumerate(sets):
        start = time.perf_counter()
        axis = find(contacts, rng)
        seconds = time.perf_counter() - start
        rows.append((*_error(problems, i, axis), seconds))
    angle, offset, spent = np.array(rows).T
    return Scores(angle, offset, spent)


def _error(problems: Problems, i: int, axis: Axis | None) -> tuple[float, float]:
    """Degrees, and millimetres beside the contacts' middle."""
    if axis is None:
        return np.nan, np.nan
    truth = Axis(problems.scenes.points[i], problems.scenes.directions[i])
    middle = truth.foot(problems.scenes.geometry.p[i].mean(axis=0))
    return float(np.rad2deg(angle_between(axis, truth))), 1e3 * offset_at(axis, truth, middle)


def joined(scores: list[Scores]) -> Scores:
    """Problems of several settings as one."""
    names = ("angle_deg", "offset_mm", "seconds")
    return Scores(*(np.concatenate([getattr(s, name) for s in scores]) for name in names))


def figures_of(n: int, setting: str, scores: dict[str, Scores]) -> list[Figures]:
    """One row for each estimator that applies."""
    ours = scores[OURS]
    return [
        Figures(
            contacts=n,
            setting=setting,
            estimator=name,
            problems=len(ours.seconds),
            angle_deg=_interval(_off(s)),
            offset_mm=float(np.median(np.nan_to_num(s.offset_mm, nan=1e3))),
            far=float(np.mean(_off(s) > FAR_DEG)),
            error_ratio=_interval(_off(s), _off(ours)),
            ms=1e3 * float(np.median(s.seconds)),
            time_ratio=float(np.median(s.seconds) / np.median(ours.seconds)),
        )
        for name, s in scores.items()
        if not np.all(np.isnan(s.angle_deg))
    ]


def _off(scores: Scores) -> Array:
    return np.nan_to_num(scores.angle_deg, nan=90.0)


def _interval(values: Array, against: Array | None = None) -> Interval:
    """Median, or ratio of medians, with its 95 % bootstrap interval over the same problems."""
    rng = np.random.default_rng(0)
    drawn = rng.integers(len(values), size=(1000, len(values)))
    middle, medians = np.median(values), np.median(values[drawn], axis=1)
    if against is not None:
        middle, medians = (
            middle / np.median(against),
            medians / np.median(against[drawn], axis=1),
        )
    low, high = np.percentile(medians, [2.5, 97.5])
    return float(middle), float(low), float(high)
