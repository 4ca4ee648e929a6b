"""A profile as a table: radius and slope at any height, inside compiled loops."""

from __future__ import annotations

from collections.abc import Callable
from math import hypot, sqrt
from typing import NamedTuple

import numpy as np

from estimator.compiled import compiled
from estimator.profile import Profile
from estimator.vectors import Array

_PIECES = 128  # cubic ones: off a spline's radius by less than a micrometre
_FOOT_STEPS = 3
_FARTHEST = 0.02  # step along the axis [m]


class Meridian(NamedTuple):
    """Radii r [m] and slopes dr [-] at even heights from `low` to `high` [m]."""

    low: float
    high: float
    r: Array
    dr: Array


def meridian_of(profile: Profile) -> Meridian:
    """The table of a profile, over its whole height."""
    low, high = profile.z_range
    return tabulated(float(low), float(high), lambda z: profile.derivatives(z)[:2])


def tabulated(
    low: float, high: float, radius_and_slope_at: Callable[[Array], tuple[Array, Array]]
) -> Meridian:
    """The table between two heights [m] of what gives radii [m] and slopes there."""
    r, dr = radius_and_slope_at(np.linspace(low, high, _PIECES + 1))
    return Meridian(low, high, np.array(r, dtype=float), np.array(dr, dtype=float))


@compiled
def radius_and_slope(meridian: Meridian, z: float) -> tuple[float, float]:
    """Cubic Hermite pieces; beyond the ends those of the ends."""
    step = (meridian.high - meridian.low) / (len(meridian.r) - 1)
    inside = min(max(z, meridian.low), meridian.high)
    at = min(int((inside - meridian.low) / step), len(meridian.r) - 2)
    t = (inside - meridian.low) / step - at
    a, b = meridian.r[at], meridian.r[at + 1]
    da, db = step * meridian.dr[at], step * meridian.dr[at + 1]
    two, three = 2.0 * (a - b) + da + db, 3.0 * (b - a) - 2.0 * da - db
    return a + t * (da + t * (three + t * two)), (da + t * (2.0 * three + 3.0 * t * two)) / step


@compiled
def foot(meridian: Meridian, rho: float, height: float) -> tuple[float, float, float]:
    """Height, radius and slope of the nearest place on the meridian, by Newton's steps."""
    z = height
    for _ in range(_FOOT_STEPS):
        r, dr = radius_and_slope(meridian, z)
        off = (z - height - (rho - r) * dr) / (1.0 + dr**2)
        z -= min(max(off, -_FARTHEST), _FARTHEST)
    r, dr = radius_and_slope(meridian, z)
    return z, r, dr


@compiled
def distance(meridian: Meridian, rho: float, z: float) -> float:
    """`SurfaceOfRevolution.signed_distance` at a distance from the axis and a height [m]."""
    r, dr = radius_and_slope(meridian, z)
    cap = max(meridian.low - z, z - meridian.high)
    if cap > 0.0:
        return hypot(max(rho - r, 0.0), cap)
    return max(float((rho - r) / sqrt(1.0 + dr**2)), cap)


@compiled
def distance_and_slopes(meridian: Meridian, rho: float, z: float) -> tuple[float, float, float]:
    """The same with how it grows with the distance from the axis, and with the height."""
    r, dr = radius_and_slope(meridian, z)
    above, below = z - meridian.high, meridian.low - z
    cap, up = (above, 1.0) if above > below else (below, -1.0)
    if cap > 0.0:
        out = max(rho - r, 0.0)
        d = max(hypot(out, cap), 1e-12)
        return d, out / d, up * cap / d
    w = sqrt(1.0 + dr**2)
    wall = (rho - r) / w
    if wall > cap:
        return wall, 1.0 / w, -dr / w
    return cap, 0.0, up
