"""Sums of an impulse response over a Hertz contact: a quadrature as fine as the ellipse needs.

With Hertz's pressure p ~ sqrt(1 - |u|^2) the disk is cut along the ellipse's long axis: with
u = (s, sqrt(1 - s^2) t) the weight falls apart into (1 - s^2) and sqrt(1 - t^2), each with its own
Gauss rule. An integrand with poles a depth d away, seen from a half axis a, loses a factor rho^2
by each node, rho = d/a + sqrt(1 + (d/a)^2): so many nodes are taken as the digits asked for need,
and a long thin ellipse needs few across. (Too few along it bias the inverse.)
"""

from __future__ import annotations

import numpy as np
from scipy.special import roots_jacobi

from estimator.compiled import compiled_part
from estimator.readers.response import response_at
from estimator.vectors import Array

MOST_NODES = 24  # along one axis: five digits at a = 5 d
Sums = tuple[float, float, float, float, float, float]


def _gauss_rules() -> Array:
    """[0]: along, weight 1 - s^2; [1]: across, sqrt(1 - t^2). (2, n, nodes and weights, n)."""
    rules = np.zeros((2, MOST_NODES + 1, 2, MOST_NODES))
    for n in range(1, MOST_NODES + 1):
        for axis, power in enumerate((1.0, 0.5)):
            nodes, weights = roots_jacobi(n, power, power)
            rules[axis, n, 0, :n], rules[axis, n, 1, :n] = nodes, weights / weights.sum()
    return rules


GAUSS = _gauss_rules()


@compiled_part
def nodes_needed(half_axis: float, depth: float, digits: float) -> int:
    """Of a Gauss rule over this half axis, for a response this deep."""
    q = depth / half_axis
    n = int(digits * 1.1513 / np.log(q + (1.0 + q * q) ** 0.5)) + 1  # ln(10) / 2
    return min(max(n, 2), MOST_NODES)


@compiled_part
def disk_nodes(M: Array, depth: float, digits: float, u: Array, p: Array) -> int:
    """Write nodes u_x, u_y, weight and their places M u on the skin; how many.

    Args:
        M: (M_xx, M_yy, M_xy) [m].
        u, p: Out, with room for MOST_NODES^2, (3, N) and (2, N).
    """
    half, off = 0.5 * (M[0] - M[1]), M[2]
    mean, spread = 0.5 * (M[0] + M[1]), (half * half + off * off) ** 0.5
    angle = 0.5 * np.arctan2(off, half)
    c, s = np.cos(angle), np.sin(angle)
    n_a = nodes_needed(mean + spread, depth, digits)
    n_b = nodes_needed(max(mean - spread, 1e-3 * mean), depth, digits)
    k = 0
    for i in range(n_a):
        along, w = GAUSS[0, n_a, 0, i], GAUSS[0, n_a, 1, i]
        width = (1.0 - along * along) ** 0.5
        for j in range(n_b):
            across = width * GAUSS[1, n_b, 0, j]
            x, y = c * along - s * across, s * along + c * across
            u[0, k], u[1, k], u[2, k] = x, y, w * GAUSS[1, n_b, 1, j]
            p[0, k], p[1, k] = M[0] * x + M[2] * y, M[2] * x + M[1] * y
            k += 1
    return k


@compiled_part
def point_load_sums(rows: Array, t: int, x: float, y: float, p: Array, u: Array, n: int) -> Sums:
    """Weighted sums of h, h_x, h_y, h_x u_x, h_y u_y, h_x u_y + h_y u_x for a half space.

    The response's own formula again (`response.response_at`), in a loop that vectorises.
    """
    A, c, v, d2 = rows[t, 0], rows[t, 1], rows[t, 2], rows[t, 3]
    s0, s1, s2, s3, s4, s5 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(n):
        dx, dy = p[0, k] + x, p[1, k] + y
        r2 = dx * dx + dy * dy
        q = 1.0 / (r2 + d2)
        weight = u[2, k] * q * q * np.sqrt(q)
        top = c - v * r2
        slope = weight * (v + 2.5 * top * q)
        fx, fy = slope * dx, slope * dy
        s0 += weight * top
        s1 += fx
        s2 += fy
        s3 += fx * u[0, k]
        s4 += fy * u[1, k]
        s5 += fx * u[1, k] + fy * u[0, k]
    B = -2.0 * A
    return A * s0, B * s1, B * s2, B * s3, B * s4, B * s5


@compiled_part
def response_sums(kind: int, row: Array, x: float, y: float, p: Array, u: Array, n: int) -> Sums:
    """The same of any response."""
    s0, s1, s2, s3, s4, s5 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(n):
        h, fx, fy = response_at(kind, row, p[0, k] + x, p[1, k] + y)
        w = u[2, k]
        fx, fy = w * fx, w * fy
        s0 += w * h
        s1 += fx
        s2 += fy
        s3 += fx * u[0, k]
        s4 += fy * u[1, k]
        s5 += fx * u[1, k] + fy * u[0, k]
    return s0, s1, s2, s3, s4, s5
