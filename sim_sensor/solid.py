"""The solid that a profile encloses: true nearest points, in the half plane of a meridian.

A surface of revolution with flat ends is convex or concave by places; what is nearest to a point
is found on its meridian (rho, z), and it is the global minimum: every local one is polished.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from estimator.profile import Profile
from estimator.vectors import Array

_SAMPLES = 513
_POLISH = 24  # Newton steps inside a bracket; halving alone would leave 1e-11 m


class Part(Enum):
    """Which part of the solid a place belongs to."""

    WALL = "wall"
    CAP = "cap"
    RIM = "rim"


@dataclass(frozen=True)
class NearestPlace:
    """Where a solid is nearest to a point.

    Args:
        distance: From the point, negative inside the solid [m].
        rho: Distance of the place from the axis [m].
        z: Height of the place [m].
        part: Wall, flat cap, or the rim between them.
        theta: Meridian angle of the place [rad].
    """

    distance: float
    rho: float
    z: float
    part: Part
    theta: float = 0.0


class Solid:
    """All points with z in the profile's range and rho <= r(z).

    Args:
        profile: r(z), positive.
    """

    def __init__(self, profile: Profile) -> None:
        self._profile = profile
        self._z = np.linspace(*profile.z_range, _SAMPLES)
        self._r = profile.derivatives(self._z)[0]

    @property
    def largest_radius(self) -> float:
        """Of the profile's samples [m]."""
        return float(self._r.max())

    def nearest(self, rho: float, z: float, theta: float = 0.0) -> NearestPlace:
        """The place of the surface nearest to (rho, z), rho >= 0 [m], on the same meridian."""
        low, high = self._profile.z_range
        inside = low < z < high and rho < float(self._profile.derivatives(np.array(z))[0])
        places = [self._on_wall(rho, z), self._on_cap(0, rho, z), self._on_cap(-1, rho, z)]
        best = min(places, key=lambda place: place.distance)
        distance = -best.distance if inside else best.distance
        return NearestPlace(distance, best.rho, best.z, best.part, theta)

    def _on_cap(self, end: int, rho: float, z: float) -> NearestPlace:
        edge, height = float(self._r[end]), float(self._z[end])
        at = min(rho, edge)
        part = Part.RIM if at == edge else Part.CAP
        return NearestPlace(float(np.hypot(rho - at, z - height)), at, height, part)

    def _on_wall(self, rho: float, z: float) -> NearestPlace:
        squared = (self._r - rho) ** 2 + (self._z - z) ** 2
        padded = np.concatenate([[np.inf], squared, [np.inf]])
        dips = np.nonzero((squared <= padded[:-2]) & (squared <= padded[2:]))[0]
        feet = self._polished(rho, z, dips)
        r = self._profile.derivatives(feet)[0]
        distances = np.hypot(r - rho, feet - z)
        i = int(np.argmin(distances))
        part = Part.RIM if feet[i] in (self._z[0], self._z[-1]) else Part.WALL
        return NearestPlace(float(distances[i]), float(r[i]), float(feet[i]), part)

    def _polished(self, rho: float, z: float, dips: NDArray[np.intp]) -> Array:
        """Heights where the normal goes through (rho, z): roots of (r - rho) r' + (z_foot - z).

        Newton's step where it stays between the neighbouring samples, halving where it does not;
        a bracket without a root shrinks to its end, which is a rim.
        """
        lower = self._z[np.maximum(dips - 1, 0)]
        upper = self._z[np.minimum(dips + 1, _SAMPLES - 1)]
        foot = self._z[dips]
        for _ in range(_POLISH):
            r, dr, ddr = self._profile.derivatives(foot)
            slope = (r - rho) * dr + foot - z
            lower, upper = np.where(slope < 0, foot, lower), np.where(slope < 0, upper, foot)
            with np.errstate(divide="ignore", invalid="ignore"):
                step = foot - slope / (dr**2 + (r - rho) * ddr + 1.0)
            fits = (step >= lower) & (step <= upper)
            moved = np.where(fits, step, 0.5 * (lower + upper))
            if np.all(np.abs(moved - foot) < 1e-15):
                break
            foot = moved
        return np.asarray(foot)
