"""Where to start the climb: lines that two contacts already fix, and a few that none does.

Everything is built from the data alone, so a rigid motion moves the seeds along.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from estimator.background import BASIS, ORIGIN
from estimator.compiled import V3, across, along, compiled_part, cross3, dot, scaled, vector
from estimator.linear import factor, solve_factored
from estimator.problem import Problem, spread_of
from estimator.readings import K0, K1, NORMAL, POSITION, VOID, Readings
from estimator.vectors import Array, cross

MOST_PAIRS = 45
FAN = 4  # contacts whose directions are tried as the axis' own
NEARLY_PARALLEL = 0.03  # sine of two planes' angle below which they give no line
COMPLEX = 5  # normals from which a linear complex is fitted


@compiled_part
def most_seeds(n: int) -> int:
    fan = min(n, FAN)
    return 4 * min(n * (n - 1) // 2, MOST_PAIRS) + 2 * fan + fan * (fan - 1) // 2 + 5


@compiled_part
def seed_lines(problem: Problem, extra: Array, seeds: Array) -> int:
    """Fill seeds (M, 6) with points and unit directions, `extra` (E, 6) among them; how many.

    Two meridian planes meet in the axis, eq. (31): every pair of contacts under its four
    labellings. The rest starts where planes are parallel or directions void.
    """
    count = _pair_lines(problem, seeds)
    if problem.informed:
        _write(seeds[count], vector(problem.line, ORIGIN), vector(problem.line, BASIS + 6))
        count += 1
    if len(problem.contacts) == 0:
        return count
    for k in range(len(extra)):
        _write(seeds[count], vector(extra[k], 0), vector(extra[k], 3))
        count += 1
    return _fan(problem, seeds, count)


@compiled_part
def _pair_lines(problem: Problem, seeds: Array) -> int:
    contacts, origin = problem.contacts, vector(problem.line, ORIGIN)
    n = len(contacts)
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
            if contacts[i, VOID] > 0.0 or contacts[j, VOID] > 0.0:
                continue
            for first in (K0, K1):
                for second in (K0, K1):
                    if _meet(contacts[i], first, contacts[j], second, origin, seeds[count]):
                        count += 1
    return count


@compiled_part
def _meet(one: Array, first: int, other: Array, second: int, origin: V3, seed: Array) -> bool:
    """Where the plane across direction `first` of one contact meets that of the other, nearest to
    the origin; false where the planes are nearly parallel."""
    N1, N2 = vector(one, first), vector(other, second)
    u = cross3(N1, N2)
    square = dot(u, u)
    if square < NEARLY_PARALLEL**2:
        return False
    d1 = dot(N1, along(vector(one, POSITION), -1.0, origin))
    d2 = dot(N2, along(vector(other, POSITION), -1.0, origin))
    point = along(scaled(d1, cross3(N2, u)), d2, cross3(u, N1))
    _write(seed, along(origin, 1.0 / square, point), scaled(1.0 / sqrt(square), u))
    return True


@compiled_part
def _fan(problem: Problem, seeds: Array, count: int) -> int:
    """Through the point the normals pass nearest: measured directions, and normals' products."""
    contacts = problem.contacts
    point = _meeting_point(problem)
    for i in range(min(len(contacts), FAN)):
        for k in (K0, K1):
            u = vector(contacts[i], k)
            _write(seeds[count], _point_beside(contacts, u, point), u)
            count += 1
        for j in range(i):
            u = cross3(vector(contacts[i], NORMAL), vector(contacts[j], NORMAL))
            square = dot(u, u)
            if square > NEARLY_PARALLEL**2:
                u = scaled(1.0 / sqrt(square), u)
                _write(seeds[count], _point_beside(contacts, u, point), u)
                count += 1
    return count


@compiled_part
def _write(seed: Array, point: V3, u: V3) -> None:
    seed[0], seed[1], seed[2] = point
    seed[3], seed[4], seed[5] = u


@compiled_part
def _point_beside(contacts: Array, u: V3, point: V3) -> V3:
    """Where the line along u passes the normals' lines nearest; near `point` where they do not say.

    A normal's line meets the axis where (u x n) . (p - a) = 0: two unknowns across u.
    """
    E1, E2 = across(u)
    g11, g12, g22, h1, h2 = 1e-3, 0.0, 1e-3, 0.0, 0.0
    for row in contacts:
        m = cross3(u, vector(row, NORMAL))
        gap = dot(m, along(vector(row, POSITION), -1.0, point))
        m1, m2 = dot(m, E1), dot(m, E2)
        g11, g12, g22 = g11 + m1 * m1, g12 + m1 * m2, g22 + m2 * m2
        h1, h2 = h1 + m1 * gap, h2 + m2 * gap
    det = g11 * g22 - g12 * g12
    return along(along(point, (g22 * h1 - g12 * h2) / det, E1), (g11 * h2 - g12 * h1) / det, E2)


@compiled_part
def _meeting_point(problem: Problem) -> V3:
    """The point that the normals' lines pass nearest; where parallel, near the contacts."""
    contacts, origin = problem.contacts, vector(problem.line, ORIGIN)
    system, pulled = np.zeros((3, 3)), np.zeros(3)
    for j in range(3):
        system[j, j] = len(contacts) + 1e-3  # the pull keeps the point near the contacts
    for row in contacts:
        normal = vector(row, NORMAL)
        gap = along(vector(row, POSITION), -1.0, origin)
        side = along(gap, -dot(normal, gap), normal)
        for j in range(3):
            pulled[j] += side[j]
            for k in range(j + 1):
                system[j, k] -= normal[j] * normal[k]
    factor(system, system)
    solve_factored(system, pulled)
    point = (pulled[0], pulled[1], pulled[2])
    length = sqrt(dot(point, point))
    return along(origin, min(1.0, 2.0 * spread_of(problem) / max(length, 1e-300)), point)


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
