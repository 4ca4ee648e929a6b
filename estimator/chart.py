"""The 4-parameter chart of `estimator.axis`, compiled: lines as coordinates at other lines."""

from __future__ import annotations

from math import sqrt

import numpy as np

from estimator.compiled import V3, across, along, compiled, compiled_part, dot, scaled
from estimator.vectors import Array


@compiled_part
def line_of(x: Array) -> tuple[V3, V3]:
    return (x[0], x[1], x[2]), (x[3], x[4], x[5])


@compiled_part
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


@compiled_part
def nudged(a: V3, u: V3, basis: tuple[V3, V3], j: int, h: float) -> tuple[V3, V3]:
    if j < 2:
        return along(a, h, basis[j]), u
    v = along(u, h, basis[j - 2])
    return a, scaled(1.0 / sqrt(dot(v, v)), v)


@compiled
def stepped(x: Array, step: Array, origin: V3, out: Array) -> None:
    """The state after a step in the chart at its own line; the point returns to the foot."""
    a, u = line_of(x)
    E1, E2 = across(u)
    v = along(along(u, step[2], E1), step[3], E2)
    u = scaled(1.0 / sqrt(dot(v, v)), v)
    a = along(along(a, step[0], E1), step[1], E2)
    gap = along(origin, -1.0, a)
    a = along(a, dot(gap, u), u)
    out[0], out[1], out[2] = a
    out[3], out[4], out[5] = u
    for k in range(6, len(x)):
        out[k] = x[k] + step[k - 2]


@compiled_part
def separation(x: Array, other: Array, information: Array) -> float:
    """Squared distance of two lines in the chart at the first, in standard deviations."""
    a, u = line_of(x)
    e1, e2 = across(u)
    b, v = line_of(other)
    d = chart_at(a, (e1, e2, u), b, v)
    total = 0.0
    for j in range(4):
        for k in range(4):
            total += d[j] * information[j, k] * d[k]
    return total
