"""Where to start the climb: lines that two contacts already fix, and a few that none does."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np

from estimator.likelihood import Lines, evaluate
from estimator.posterior import label_weights
from estimator.prior import AxisPrior
from estimator.readings import Readings
from estimator.vectors import Array, Index, cross, unit

ENUMERATED = 4  # up to this many contacts every labelling gets starts of its own
MOST_PAIRS = 45


def seeds(
    readings: Readings, origin: Array, spread: float, prior: AxisPrior | None
) -> tuple[Lines, Index | None]:
    """Starts, and their fixed labels for few contacts (None: labels summed out).

    Returns:
        Lines (S,), labels (S, n) or None.
    """
    n = readings.p.shape[1]
    general = _general_lines(readings, origin, spread, prior)
    if n > ENUMERATED:
        pairs, _ = _pair_lines(readings, origin, list(_spread_pairs(n)))
        return _joined(pairs, general), None
    weights = label_weights(evaluate(readings, general))
    likeliest = np.argmax(weights, axis=-1).astype(np.intp)
    if n < 2:
        return general, likeliest
    pairs, pair_labels = _pair_lines(readings, origin, list(combinations(range(n), 2)))
    lines, labels = _completed(pairs, pair_labels, n)
    return _joined(lines, general), np.vstack([labels, likeliest])


def _pair_lines(
    readings: Readings, origin: Array, pairs: list[tuple[int, int]]
) -> tuple[Lines, Index]:
    """Intersections of two meridian planes under the four labellings of a pair, eq. (31).

    Returns:
        Lines, and for each the labels (S, n) with -1 where the pair says nothing.
    """
    i, j = np.array(pairs).T
    first, second = (x.ravel() for x in np.meshgrid([0, 1], [0, 1]))
    i, j = np.repeat(i, 4), np.repeat(j, 4)
    first, second = np.tile(first, len(pairs)), np.tile(second, len(pairs))
    N1, N2 = readings.k[0, i, first], readings.k[0, j, second]
    d1 = np.sum(N1 * (readings.p[0, i] - origin), axis=1)
    d2 = np.sum(N2 * (readings.p[0, j] - origin), axis=1)
    line = cross(N1, N2)
    sine = np.linalg.norm(line, axis=1)
    kept = sine > 0.03  # nearly the same plane: no line, the general starts take over
    system = np.stack([N1, N2, line], axis=1)[kept]
    rhs = np.stack([d1, d2, np.zeros_like(d1)], axis=1)[kept]
    a = np.linalg.solve(system, rhs[..., None])[..., 0] + origin
    labels = np.full((len(i), readings.p.shape[1]), -1, dtype=np.intp)
    rows = np.arange(len(i))
    labels[rows, i], labels[rows, j] = first, second
    return Lines(a, unit(line[kept]), np.zeros(int(kept.sum()))), labels[kept]


def _completed(lines: Lines, labels: Index, n: int) -> tuple[Lines, Index]:
    """Each line once for every way to label the contacts its pair left open."""
    open_ways = np.array(list(product((0, 1), repeat=n - 2)), dtype=np.intp)
    repeated = np.repeat(np.arange(len(lines.a)), len(open_ways))
    full = labels[repeated].copy()
    full[full < 0] = np.tile(open_ways, (len(lines.a), 1)).ravel()
    return lines.take(repeated), full


def _general_lines(
    readings: Readings, origin: Array, spread: float, prior: AxisPrior | None
) -> Lines:
    """The prior's axis, and a fan of directions through the point the normals pass nearest."""
    n = readings.n[0]
    across = np.eye(3) - n[:, :, None] * n[:, None, :]
    pull = 1e-3 * np.eye(3)  # keeps the point near the contacts where normals are parallel
    point = np.linalg.solve(
        across.sum(axis=0) + pull,
        np.einsum("nij,nj->i", across, readings.p[0] - origin),
    )
    length = float(np.linalg.norm(point))
    point = origin + point * min(1.0, 2.0 * spread / max(length, 1e-12))
    fan = unit(np.array([v for v in product((-1, 0, 1), repeat=3) if v > (0, 0, 0)], dtype=float))
    # nudged: symmetric grasps make some of these exactly stationary
    fan = unit(fan + 0.05 * fan[::-1])
    a, u = np.repeat(point[None], len(fan), axis=0), fan
    if prior is not None:
        a = np.vstack([prior.axis.point, a])
        u = np.vstack([prior.axis.direction, u])
    return Lines(a, u, np.zeros(len(a)))


def _spread_pairs(n: int) -> list[tuple[int, int]]:
    """At most MOST_PAIRS pairs, evenly taken from all."""
    pairs = list(combinations(range(n), 2))
    chosen = np.unique(np.linspace(0, len(pairs) - 1, min(MOST_PAIRS, len(pairs))).astype(int))
    return [pairs[i] for i in chosen]


def _joined(first: Lines, second: Lines) -> Lines:
    return Lines(
        np.vstack([first.a, second.a]),
        np.vstack([first.u, second.u]),
        np.concatenate([first.delta, second.delta]),
    )
