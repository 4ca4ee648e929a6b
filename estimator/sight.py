"""A contact as a line sees it, and how that moves with the line and the nuisance states.

For a line (a, u) a contact at p lies at radius r = |u x (p - a)|, with e = u x (p - a) / r along
its parallel and rad = e x u away from the axis. Theta is the angle from row 0 of the measured
directions to e, about the normal.

Parameters of one contact: (t1, t2, w1, w2) of the line in the chart at itself, the common rotation
delta of its sensor's directions and log-scale lambda of its radii, the position bias (3) of its
finger. Everything is a function of beta, m_n = n . rad, m_u = n . u, r, theta and lambda, and
these move by four scalars: A = tau . e / r, B = w . e, C = w . rad, R = -tau . rad, where
tau = t + z w is how far the line shifts at the contact's height z.
"""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import NamedTuple

from estimator.compiled import V3, along, compiled, compiled_part, cross3, dot, scaled, vector
from estimator.readings import K0, K1, NORMAL, POSITION
from estimator.vectors import Array

LOCAL = 9  # parameters of one contact: t1 t2 w1 w2 delta lambda b1 b2 b3
A, B, C, R, BETA, MN, MU, THETA = range(8)  # rows of the work space


class Seen(NamedTuple):
    """A contact as a line sees it; c, s are cos and sin of theta, c2, s2 of 2 theta."""

    r: float
    z: float
    e: V3
    rad: V3
    beta: float
    m_n: float
    m_u: float
    c: float
    s: float
    c2: float
    s2: float


@compiled
def seen_from(row: Array, a: V3, u: V3, bias: V3, delta: float) -> Seen:
    """A contact (a row of `Readings`) about the line (a, u)."""
    n = vector(row, NORMAL)
    q = along(along(vector(row, POSITION), -1.0, bias), -1.0, a)
    v = cross3(u, q)
    r = max(sqrt(dot(v, v)), 1e-300)
    e = scaled(1.0 / r, v)
    rad = cross3(e, u)
    c, s = dot(vector(row, K0), e), dot(vector(row, K1), e)
    length = max(sqrt(c * c + s * s), 1e-150)
    c, s = c / length, s / length
    if delta != 0.0:
        turn_c, turn_s = cos(delta), sin(delta)
        c, s = c * turn_c - s * turn_s, s * turn_c + c * turn_s
    c2, s2 = c * c - s * s, 2.0 * s * c
    return Seen(r, dot(q, u), e, rad, dot(n, e), dot(n, rad), dot(n, u), c, s, c2, s2)


@compiled_part
def fill_motions(seen: Seen, E1: V3, E2: V3, rows: Array, locals_: int) -> None:
    """How A, B, C, R, beta, m_n, m_u and theta move with the parameters, into rows (8, 9)."""
    for k in range(4):
        for j in range(locals_):
            rows[k, j] = 0.0
    for j in range(2):
        E = E1 if j == 0 else E2
        e, rad = dot(E, seen.e), dot(E, seen.rad)
        rows[A, j], rows[R, j] = e / seen.r, -rad
        rows[A, 2 + j], rows[R, 2 + j] = seen.z * e / seen.r, -seen.z * rad
        rows[B, 2 + j], rows[C, 2 + j] = e, rad
    if locals_ == LOCAL:
        for j in range(3):
            rows[A, 6 + j], rows[R, 6 + j] = seen.e[j] / seen.r, -seen.rad[j]
    across = max(1.0 - seen.beta**2, 1e-12)  # of e's projection into the tangent plane, squared
    for j in range(locals_):
        A_j, B_j, C_j = rows[A, j], rows[B, j], rows[C, j]
        rows[BETA, j] = A_j * seen.m_n - B_j * seen.m_u
        rows[MN, j] = -A_j * seen.beta - C_j * seen.m_u
        rows[MU, j] = B_j * seen.beta + C_j * seen.m_n
        rows[THETA, j] = -(A_j * seen.m_u + B_j * seen.m_n) / across
    if locals_ > 4:
        rows[THETA, 4] = 1.0
