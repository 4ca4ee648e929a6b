"""Where pads on straight approaches meet the walls of many objects, inside compiled loops.

A pad is a ball. It touches where its centre comes onto the wall's offset surface, whose meridian is

    R(h) = r + rho / w,   Z(h) = h - rho r' / w,   w = sqrt(1 + r'^2)

with h the height of the touched place and rho the pad's radius. Newton's steps go for the way along
the approach and for h at once. Where a wall is hollow more tightly than the pad is round it touches
at two places, and h is either.
"""

from __future__ import annotations

from math import atan2, cos, hypot, sin, sqrt

from estimator.compiled import V3, compiled, compiled_part
from estimator.vectors import Array

STEEPEST = -0.2  # slope that a step reckons with at least: on a wall that leans away it stays short
FLATTEST = 0.2  # dZ/dh that a step reckons with at least
LONGEST = 0.02  # step of the touched height [m]


@compiled
def fill_met(
    heights: Array, pieces: Array, origins: Array, frames: Array, p: Array, n: Array, pads: Array,
    range_s: Array, steps: int, met: Array,
) -> None:  # fmt: skip
    """M pads, their foremost points on lines p - s n, against the walls of B objects.

    Args:
        heights: (k,) ascending, of the profiles' nodes.
        pieces: (B, k - 1, 4) of t^3, t^2, t, 1 on each interval.
        origins, frames: (B, 3), (B, 3, 3) rows x, y, z of each object frame.
        p, n: (M, 3).
        pads: Radii (M,); zero for a point.
        range_s: Least and largest s (2,).
        met: (B, M, 4) for s, meridian angle, what is left of the gap, height of the touched place.
    """
    for b in range(len(origins)):
        R = frames[b]
        for i in range(len(p)):
            x = y = z = u = v = w = 0.0  # the pad's centre and the way in, in the object frame
            for a in range(3):
                out = p[i, a] + pads[i] * n[i, a] - origins[b, a]
                x += R[0, a] * out
                y += R[1, a] * out
                z += R[2, a] * out
                u += R[0, a] * n[i, a]
                v += R[1, a] * n[i, a]
                w += R[2, a] * n[i, a]
            s, h = 0.0, z
            for _ in range(steps):
                px, py, pz = x - s * u, y - s * v, z - s * w
                r, dr, ddr = _wall(heights, pieces[b], h)
                R_h, Z_h, dZ = _offset(r, dr, ddr, h, pads[i])
                across = hypot(px, py) - R_h - dr * (pz - Z_h)
                theta = atan2(py, px)
                slope = -(u * cos(theta) + v * sin(theta)) + dr * w
                stop = s - across / min(slope, STEEPEST)
                stop = min(max(stop, range_s[0]), range_s[1])
                rise = (pz - (stop - s) * w - Z_h) / max(dZ, FLATTEST)
                s, h = stop, h + min(max(rise, -LONGEST), LONGEST)
            px, py, pz = x - s * u, y - s * v, z - s * w
            r, dr, ddr = _wall(heights, pieces[b], h)
            R_h, Z_h, _ = _offset(r, dr, ddr, h, pads[i])
            met[b, i, 0], met[b, i, 1] = s, atan2(py, px)
            met[b, i, 2], met[b, i, 3] = hypot(hypot(px, py) - R_h, pz - Z_h), h


@compiled_part
def _offset(r: float, dr: float, ddr: float, h: float, pad: float) -> V3:
    """R, Z and dZ/dh = 1 - rho r'' / w^3; dR/dh is r' times that."""
    w = sqrt(1.0 + dr * dr)
    return (r + pad / w, h - pad * dr / w, 1.0 - pad * ddr / (w * w * w))


@compiled_part
def _wall(heights: Array, pieces: Array, z: float) -> V3:
    """Radius and its derivatives; beyond the ends straight on."""
    last = len(heights) - 1
    inside = min(max(z, heights[0]), heights[last])
    at = 0
    while at < last - 1 and heights[at + 1] <= inside:
        at += 1
    t, c = inside - heights[at], pieces[at]
    r = ((c[0] * t + c[1]) * t + c[2]) * t + c[3]
    dr, ddr = (3.0 * c[0] * t + 2.0 * c[1]) * t + c[2], 6.0 * c[0] * t + 2.0 * c[1]
    beyond = z - inside
    if beyond != 0.0:
        return (r + beyond * dr, dr, 0.0)
    return (r, dr, ddr)
