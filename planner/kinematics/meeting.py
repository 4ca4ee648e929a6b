"""Where pads on straight approaches meet many objects, walls or rims, inside compiled loops.

A pad is a ball, or taken for the one that stands for it from afar. It touches where its centre
comes onto the wall's offset surface, whose meridian is

    R(h) = r + rho / w,   Z(h) = h - rho r' / w,   w = sqrt(1 + r'^2)

with h the height of the touched place and rho the pad's radius. Newton's steps go for the way along
the approach and for h at once. Where a wall is hollow more tightly than the pad is round it touches
at two places, and h is either. A pad that meets no wall between the ends may meet the rim of one: a
circle, of every slope between the wall's and the flat end's.
"""

from __future__ import annotations

from math import atan2, cos, hypot, sin, sqrt

from estimator.compiled import V3, compiled, compiled_part
from estimator.vectors import Array

STEEPEST = -0.2  # slope that a step reckons with at least: on a wall that leans away it stays short
FLATTEST = 0.2  # dZ/dh that a step reckons with at least
LONGEST = 0.02  # step of the touched height [m]
MET = 5e-4  # gap that counts as none [m]
NO_WAY = 1.0  # gap of a pad that meets nothing [m]
UPRIGHT = 0.05  # share of a rim's normal across the axis, below which it is the flat end's


@compiled
def fill_met(
    heights: Array, pieces: Array, origins: Array, frames: Array, p: Array, n: Array, pads: Array,
    range_s: Array, steps: int, edge: float, met: Array,
) -> None:  # fmt: skip
    """M pads, their foremost points on lines p - s n, against the walls of B objects.

    Args:
        heights: (k,) ascending, of the profiles' nodes.
        pieces: (B, k - 1, 4) of t^3, t^2, t, 1 on each interval.
        origins, frames: (B, 3), (B, 3, 3) rows x, y, z of each object frame.
        p, n: (M, 3).
        pads: Radii (M,); zero for a point.
        range_s: Least and largest s (2,).
        edge: Radius of rims [m]; zero where none is to be met.
        met: (B, M, 6) for s, meridian angle, what is left of the gap, and height, slope r' and
            r'' of the touched place.
    """
    for b in range(len(origins)):
        for i in range(len(p)):
            centre, way = _in_object(frames[b], origins[b], p[i], n[i], pads[i])
            _meet_wall(heights, pieces[b], pads[i], centre, way, range_s, steps, met[b, i])
            beyond = met[b, i, 3] < heights[0] or met[b, i, 3] > heights[-1]
            if beyond and edge > 0.0 and pads[i] > 0.0:
                _meet_rim(heights, pieces[b], pads[i], centre, way, range_s, steps, edge, met[b, i])


@compiled_part
def _in_object(R: Array, origin: Array, p: Array, n: Array, pad: float) -> tuple[V3, V3]:
    """Where a pad's centre is when its foremost point is p, and its way out n, in a frame R."""
    x = y = z = u = v = w = 0.0
    for a in range(3):
        out = p[a] + pad * n[a] - origin[a]
        x += R[0, a] * out
        y += R[1, a] * out
        z += R[2, a] * out
        u += R[0, a] * n[a]
        v += R[1, a] * n[a]
        w += R[2, a] * n[a]
    return (x, y, z), (u, v, w)


@compiled_part
def _back(p: V3, n: V3, s: float) -> V3:
    """p - s n."""
    return (p[0] - s * n[0], p[1] - s * n[1], p[2] - s * n[2])


@compiled_part
def _meet_wall(
    heights: Array, pieces: Array, pad: float, p: V3, n: V3, range_s: Array, steps: int, met: Array
) -> None:
    """The wall, thought on straight beyond its ends."""
    s, h = 0.0, p[2]
    for _ in range(steps):
        x, y, z = _back(p, n, s)
        r, dr, ddr = wall_at(heights, pieces, h)
        R, Z, dZ = _offset(r, dr, ddr, h, pad)
        across = hypot(x, y) - R - dr * (z - Z)
        theta = atan2(y, x)
        slope = -(n[0] * cos(theta) + n[1] * sin(theta)) + dr * n[2]
        stop = min(max(s - across / min(slope, STEEPEST), range_s[0]), range_s[1])
        rise = (z - (stop - s) * n[2] - Z) / max(dZ, FLATTEST)
        s, h = stop, h + min(max(rise, -LONGEST), LONGEST)
    x, y, z = _back(p, n, s)
    r, dr, ddr = wall_at(heights, pieces, h)
    R, Z, _ = _offset(r, dr, ddr, h, pad)
    met[0], met[1], met[2] = s, atan2(y, x), hypot(hypot(x, y) - R, z - Z)
    met[3], met[4], met[5] = h, dr, ddr


@compiled_part
def _meet_rim(
    heights: Array, pieces: Array, pad: float, p: V3, n: V3, range_s: Array, steps: int,
    edge: float, met: Array,
) -> None:  # fmt: skip
    """The rim of the end that the wall was left beyond."""
    top = met[3] > heights[-1]
    end = heights[-1] if top else heights[0]
    r, dr, _ = wall_at(heights, pieces, end)
    s = _along_to_rim(r, end, pad, p, n, range_s, 2 * steps)
    x, y, z = _back(p, n, s)
    out, up = hypot(x, y) - r, z - end
    outward = up + out * dr if top else -up - out * dr
    met[0], met[1], met[2], met[3] = s, atan2(y, x), NO_WAY, end
    if out > UPRIGHT * pad and outward >= 0.0:
        slope = -up / out
        met[2] = abs(hypot(out, up) - pad)
        met[4], met[5] = slope, -((1.0 + slope * slope) ** 1.5) / edge


@compiled_part
def _along_to_rim(
    r: float, end: float, pad: float, p: V3, n: V3, range_s: Array, steps: int
) -> float:
    """How far a pad goes from p along -n to a circle of radius r at a height, first met."""
    s = float(range_s[0])
    for _ in range(steps):
        x, y, z = _back(p, n, s)
        rho = hypot(x, y)
        far = max(hypot(rho - r, z - end), 1e-9)
        across = -(n[0] * x + n[1] * y) / max(rho, 1e-9)
        closing = ((rho - r) * across - (z - end) * n[2]) / far
        if closing > -UPRIGHT:
            break
        s = min(s - (far - pad) / closing, float(range_s[1]))
    return s


@compiled_part
def _offset(r: float, dr: float, ddr: float, h: float, pad: float) -> V3:
    """R, Z and dZ/dh = 1 - rho r'' / w^3; dR/dh is r' times that."""
    w = sqrt(1.0 + dr * dr)
    return (r + pad / w, h - pad * dr / w, 1.0 - pad * ddr / (w * w * w))


@compiled_part
def wall_at(heights: Array, pieces: Array, z: float) -> V3:
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
