"""Where pads that are domes meet many objects, from where balls meet them, inside compiled loops.

A dome touches along u at c + E(u), with E(u) = A u / sqrt(u . A u) + rho u (`hand_models.dome`).
One that is planned to touch at p under the normal n, and comes along p - s n, touches the wall
S(theta, h) of normal n' where

    p - s n + E(n) - E(n') = S(theta, h),

three equations, solved by Newton's method (a pad that turns on its way does so a step late) with

    dE = T dn',  T = (A - e e^T) / sqrt(n' . A n') + rho I,  e = A n' / sqrt(n' . A n')
    dn'/dtheta = e_theta / w,  dn'/dh = -r'' (r' e_rho + e_z) / w^3,  w = sqrt(1 + r'^2).
"""

from __future__ import annotations

from math import atan2, cos, sin, sqrt

from estimator.compiled import V3, along, compiled, compiled_part, cross3, dot, scaled
from estimator.vectors import Array
from planner.kinematics.meeting import LONGEST, MET, wall_at
from planner.kinematics.small import turned

M3 = tuple[V3, V3, V3]  # rows
TURN = 0.3  # longest step about the axis [rad]
STEPS = 10
CLOSE = 1e-7  # gap of a touch that is found [m]
SINGULAR = 1e-4  # determinant below which the way goes along the wall [m]


@compiled
def fill_met_by_domes(
    heights: Array, pieces: Array, origins: Array, frames: Array, p: Array, n: Array,
    balls: Array, spreads: Array, spins: Array, range_s: Array, met: Array,
) -> None:  # fmt: skip
    """M domes on B objects: `met` (B, M, 6) as `fill_met` has it for balls, renewed where a dome
    meets the wall between its ends.

    Args:
        heights, pieces, origins, frames, p, n, range_s: As for `fill_met`.
        balls, spreads, spins: rho and A in the world, (M,), (M, 3, 3) [m], [m^2]; A is zero for a
            ball. Angular velocities by which they turn on their way inwards, (M, 3) [rad/m].
    """
    for b in range(len(origins)):
        o = (origins[b, 0], origins[b, 1], origins[b, 2])
        X, Y, Z = _rows(frames[b])
        for i in range(len(p)):
            A = _seen_in((X, Y, Z), _rows(spreads[i]))
            q = along((p[i, 0], p[i, 1], p[i, 2]), -1.0, o)
            out = (n[i, 0], n[i, 1], n[i, 2])
            way = (dot(X, out), dot(Y, out), dot(Z, out))
            start = (dot(X, q), dot(Y, q), dot(Z, q))
            spin = _times((X, Y, Z), (spins[i, 0], spins[i, 1], spins[i, 2]))
            _meet(heights, pieces[b], A, balls[i], spin, start, way, range_s, met[b, i])


@compiled_part
def _rows(matrix: Array) -> M3:
    return (
        (matrix[0, 0], matrix[0, 1], matrix[0, 2]),
        (matrix[1, 0], matrix[1, 1], matrix[1, 2]),
        (matrix[2, 0], matrix[2, 1], matrix[2, 2]),
    )


@compiled_part
def _times(M: M3, v: V3) -> V3:
    return (dot(M[0], v), dot(M[1], v), dot(M[2], v))


@compiled_part
def _seen_in(R: M3, A: M3) -> M3:
    """R A R^T of a symmetric A."""
    x, y, z = _times(A, R[0]), _times(A, R[1]), _times(A, R[2])
    return (_times(R, x), _times(R, y), _times(R, z))


@compiled_part
def _turned(back: V3) -> M3:
    """exp(-back), by its rows."""
    x, y, z = back
    return (
        turned(x, y, z, 1.0, 0.0, 0.0),
        turned(x, y, z, 0.0, 1.0, 0.0),
        turned(x, y, z, 0.0, 0.0, 1.0),
    )


@compiled_part
def _touched(A: M3, ball: float, n: V3) -> V3:
    """E(n)."""
    v = _times(A, n)
    square = dot(n, v)
    scale = 1.0 / sqrt(square) if square > 0.0 else 0.0
    return along(scaled(scale, v), ball, n)


@compiled_part
def _turning(A: M3, ball: float, n: V3, dn: V3) -> V3:
    """T dn."""
    v, moved = _times(A, n), _times(A, dn)
    square = dot(n, v)
    if square <= 0.0:
        return scaled(ball, dn)
    moved = along(moved, -dot(v, dn) / square, v)
    return along(scaled(1.0 / sqrt(square), moved), ball, dn)


@compiled_part
def _meet(
    heights: Array, pieces: Array, spread: M3, ball: float, spin: V3, start: V3, way: V3,
    range_s: Array, met: Array,
) -> None:  # fmt: skip
    """From `met`, as a ball has it, to the dome's own place; as it was where there is none.

    Args:
        spread, spin, start, way: A at the start, its turn, p and n in the object frame.
    """
    s, theta, h = met[0], met[1], met[3]
    for turn in range(STEPS + 1):
        r, dr, ddr = wall_at(heights, pieces, h)
        w = sqrt(1.0 + dr * dr)
        rho, around = (cos(theta), sin(theta), 0.0), (-sin(theta), cos(theta), 0.0)
        n = (rho[0] / w, rho[1] / w, -dr / w)
        up = (dr * rho[0], dr * rho[1], 1.0)
        A = _seen_in(_turned(scaled(-s, spin)), spread)
        gap = along(along(start, -s, way), 1.0, _touched(A, ball, way))
        gap = along(gap, -1.0, _touched(A, ball, n))
        gap = along(gap, -1.0, (r * rho[0], r * rho[1], h))
        far = sqrt(dot(gap, gap))
        if far < CLOSE or turn == STEPS:
            break
        by_theta = along(_turning(A, ball, n, scaled(1.0 / w, around)), r, around)
        by_h = along(_turning(A, ball, n, scaled(-ddr / (w * w * w), up)), 1.0, up)
        across = cross3(by_theta, by_h)
        volume = dot(way, across)  # of the columns -n, -d(E + S)/dtheta, -d(E + S)/dh, up to sign
        if abs(volume) < SINGULAR:
            break
        s = min(max(s + dot(gap, across) / volume, range_s[0]), range_s[1])
        step = dot(way, cross3(gap, by_h)) / volume
        theta += min(max(step, -TURN), TURN)
        rise = dot(way, cross3(by_theta, gap)) / volume
        h += min(max(rise, -LONGEST), LONGEST)
    if far < MET and heights[0] <= h <= heights[-1] and dot(n, way) > 0.0:
        met[0], met[1], met[2] = s, atan2(rho[1], rho[0]), far
        met[3], met[4], met[5] = h, dr, ddr
