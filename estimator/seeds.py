"""Where to start the climb: lines that two contacts already fix, and a few that none does.

Everything is built from the data alone, so a rigid motion moves the seeds along.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from estimator.compiled import V3, across, along, compiled, cross3, dot, scaled
from estimator.likelihood import vector
from estimator.linear import factor, solve_factored
from estimator.posterior import shared, spread_of
from estimator.problem import BASIS, ORIGIN, POINT, Background
from estimator.readings import K0, K1, NORMAL, POSITION, VOID, Readings
from estimator.vectors import Array, cross

MOST_PAIRS = 45
FAN = 4  # contacts whose directions are tried as the axis' own
NEARLY_PARALLEL = 0.03  # sine of two planes' angle below which they give no line
COMPLEX = 5  # normals from which a linear complex is fitted


@compiled
def most_seeds(n: int) -> int:
    fan = min(n, FAN)
    return 4 * min(n * (n - 1) // 2, MOST_PAIRS) + 2 * fan + fan * (fan - 1) // 2 + 5


@compiled
def seed_lines(
    readings: Readings, background: Background, extra: Array, s: int, seeds: Array
) -> int:
    """Fill seeds (M, 6) with points and unit directions; returns how many.

    Two meridian planes meet in the axis, eq. (31): every pair of contacts under its four
    labellings. The rest starts where planes are parallel or directions void.
    """
    count = _pair_lines(readings, background, s, seeds)
    if background.informed:
        row = background.lines[shared(background, s)]
        _put(seeds, count, vector(row, POINT), vector(row, BASIS + 6))
        count += 1
    n = readings.shape[1]
    if n == 0:
        return count
    for k in range(extra.shape[1]):
        _put(seeds, count, vector(extra[s, k], 0), vector(extra[s, k], 3))
        count += 1
    return _fan(readings, background, s, seeds, count)


@compiled
def _pair_lines(readings: Readings, background: Background, s: int, seeds: Array) -> int:
    n = readings.shape[1]
    origin = vector(background.lines[shared(background, s)], ORIGIN)
    total = n * (n - 1) // 2
    stride = max(1.0, (total - 1) / (MOST_PAIRS - 1))
    count, seen, wanted = 0, 0, 0.0
    for i in range(n):
        for j in range(i + 1, n):
            chosen = seen >= wanted - 1e-9
            seen += 1
            if not chosen:
                continue
            wanted += stride
            if readings[s, i, VOID] > 0.0 or readings[s, j, VOID] > 0.0:
                continue
            for first in range(2):
                for second in range(2):
                    if _meet(readings, s, i, j, first, second, origin, seeds, count):
                        count += 1
    return count


@compiled
def _meet(
    readings: Readings,
    s: int,
    i: int,
    j: int,
    first: int,
    second: int,
    origin: V3,
    seeds: Array,
    count: int,
) -> bool:
    """Where plane (k_first of i) meets plane (k_second of j), nearest to the origin."""
    N1 = vector(readings[s, i], K0) if first == 0 else vector(readings[s, i], K1)
    N2 = vector(readings[s, j], K0) if second == 0 else vector(readings[s, j], K1)
    u = cross3(N1, N2)
    square = dot(u, u)
    if square < NEARLY_PARALLEL**2:
        return False
    d1 = dot(N1, along(vector(readings[s, i], POSITION), -1.0, origin))
    d2 = dot(N2, along(vector(readings[s, j], POSITION), -1.0, origin))
    point = along(scaled(d1, cross3(N2, u)), d2, cross3(u, N1))
    point = along(origin, 1.0 / square, point)
    u = scaled(1.0 / sqrt(square), u)
    _put(seeds, count, point, u)
    return True


@compiled
def _fan(readings: Readings, background: Background, s: int, seeds: Array, count: int) -> int:
    """Through the point the normals pass nearest: measured directions, and normals' products."""
    n = readings.shape[1]
    point = _meeting_point(readings, background, s)
    fan = min(n, FAN)
    for i in range(fan):
        for k in (K0, K1):
            u = vector(readings[s, i], k)
            _put(seeds, count, _point_beside(readings, s, u, point), u)
            count += 1
        for j in range(i):
            u = cross3(vector(readings[s, i], NORMAL), vector(readings[s, j], NORMAL))
            square = dot(u, u)
            if square > NEARLY_PARALLEL**2:
                u = scaled(1.0 / sqrt(square), u)
                _put(seeds, count, _point_beside(readings, s, u, point), u)
                count += 1
    return count


@compiled
def _put(seeds: Array, k: int, point: V3, u: V3) -> None:
    seeds[k, 0], seeds[k, 1], seeds[k, 2] = point
    seeds[k, 3], seeds[k, 4], seeds[k, 5] = u


@compiled
def _point_beside(readings: Readings, s: int, u: V3, point: V3) -> V3:
    """Where the line along u passes the normals' lines nearest; near `point` where they do not say.

    A normal's line meets the axis where (u x n) . (p - a) = 0: two unknowns across u.
    """
    E1, E2 = across(u)
    g11, g12, g22, h1, h2 = 1e-3, 0.0, 1e-3, 0.0, 0.0
    for i in range(readings.shape[1]):
        row = readings[s, i]
        m = cross3(u, vector(row, NORMAL))
        gap = dot(m, along(vector(row, POSITION), -1.0, point))
        m1, m2 = dot(m, E1), dot(m, E2)
        g11, g12, g22 = g11 + m1 * m1, g12 + m1 * m2, g22 + m2 * m2
        h1, h2 = h1 + m1 * gap, h2 + m2 * gap
    det = g11 * g22 - g12 * g12
    return along(along(point, (g22 * h1 - g12 * h2) / det, E1), (g11 * h2 - g12 * h1) / det, E2)


@compiled
def _meeting_point(readings: Readings, background: Background, s: int) -> V3:
    """The point that the normals' lines pass nearest; where parallel, near the contacts."""
    n = readings.shape[1]
    origin = vector(background.lines[shared(background, s)], ORIGIN)
    spread = spread_of(background, s)
    system, pulled = np.zeros((3, 3)), np.zeros(3)
    for j in range(3):
        system[j, j] = n + 1e-3  # the pull keeps the point near the contacts
    for i in range(n):
        normal = vector(readings[s, i], NORMAL)
        gap = along(vector(readings[s, i], POSITION), -1.0, origin)
        side = along(gap, -dot(normal, gap), normal)
        for j in range(3):
            pulled[j] += side[j]
            for k in range(j + 1):
                system[j, k] -= normal[j] * normal[k]
    factor(system, system)
    solve_factored(system, pulled)
    point = (pulled[0], pulled[1], pulled[2])
    length = sqrt(dot(point, point))
    return along(origin, min(1.0, 2.0 * spread / max(length, 1e-300)), point)


def complex_lines(readings: Readings) -> Array:
    """Axis of the linear complex nearest to the normals' lines (Pottmann and Randrup 1998).

    Lines (n, p x n) that all meet the axis (g, g') satisfy g . (p x n) + g' . n = 0; the sum of
    squares is least, under |g| = 1, at the smallest eigenvector of A - B C^-1 B^T.

    Returns:
        Points and unit directions (S, 1, 6), from five contacts up; else (S, 0, 6).
    """
    S, n = readings.shape[:2]
    if n < COMPLEX:
        return np.empty((S, 0, 6))
    p, normals = readings[..., POSITION:NORMAL], readings[..., NORMAL:K0]
    centre = p.mean(axis=1)
    q = p - centre[:, None]
    scale = np.sqrt(np.mean(np.sum(q**2, axis=-1), axis=1))[:, None, None] + 1e-300
    rows = np.concatenate([cross(q / scale, normals), normals], axis=-1)
    M = np.swapaxes(rows, 1, 2) @ rows + 1e-9 * n * np.eye(6)
    A, B, C = M[:, :3, :3], M[:, :3, 3:], M[:, 3:, 3:]
    BT = np.swapaxes(B, 1, 2)
    g = np.linalg.eigh(A - B @ np.linalg.solve(C, BT))[1][:, :, 0]
    moment = -np.linalg.solve(C, BT @ g[:, :, None])[..., 0]
    points = centre + scale[:, 0] * cross(g, moment)
    return np.concatenate([points, g], axis=1)[:, None]
