"""Where straight approaches meet the walls of many objects, inside compiled loops."""

from __future__ import annotations

from math import atan2, cos, hypot, sin

from estimator.compiled import compiled
from estimator.vectors import Array

STEEPEST = -0.2  # slope that a step reckons with at least: on a wall that leans away it stays short


@compiled
def fill_met(
    heights: Array, pieces: Array, origins: Array, frames: Array, p: Array, n: Array,
    range_s: Array, steps: int, met: Array,
) -> None:  # fmt: skip
    """Newton's steps along M lines p - s n to the walls of B objects.

    Args:
        heights: (k,) ascending, of the profiles' nodes.
        pieces: (B, k - 1, 4) of t^3, t^2, t, 1 on each interval.
        origins, frames: (B, 3), (B, 3, 3) rows x, y, z of each object frame.
        p, n: (M, 3).
        range_s: Least and largest s (2,).
        met: (B, M, 4) for s, meridian angle, what is left of the gap, height.
    """
    for b in range(len(origins)):
        R = frames[b]
        for i in range(len(p)):
            x = y = z = u = v = w = 0.0  # the point and the way in, in the object frame
            for a in range(3):
                out = p[i, a] - origins[b, a]
                x += R[0, a] * out
                y += R[1, a] * out
                z += R[2, a] * out
                u += R[0, a] * n[i, a]
                v += R[1, a] * n[i, a]
                w += R[2, a] * n[i, a]
            s = 0.0
            for _ in range(steps):
                px, py, pz = x - s * u, y - s * v, z - s * w
                r, dr = _wall(heights, pieces[b], pz)
                theta = atan2(py, px)
                slope = -(u * cos(theta) + v * sin(theta)) + dr * w
                s -= (hypot(px, py) - r) / min(slope, STEEPEST)
                s = min(max(s, range_s[0]), range_s[1])
            px, py, pz = x - s * u, y - s * v, z - s * w
            r, _ = _wall(heights, pieces[b], pz)
            met[b, i, 0], met[b, i, 1] = s, atan2(py, px)
            met[b, i, 2], met[b, i, 3] = hypot(px, py) - r, pz


@compiled
def _wall(heights: Array, pieces: Array, z: float) -> tuple[float, float]:
    """Radius and slope; beyond the ends those of the ends."""
    last = len(heights) - 1
    z = min(max(z, heights[0]), heights[last])
    at = 0
    while at < last - 1 and heights[at + 1] <= z:
        at += 1
    t, c = z - heights[at], pieces[at]
    r = ((c[0] * t + c[1]) * t + c[2]) * t + c[3]
    return r, (3.0 * c[0] * t + 2.0 * c[1]) * t + c[2]
