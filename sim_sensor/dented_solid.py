"""The solid that a scan encloses: true nearest points of its dented wall.

Dents are shallow beside a fingertip, so the nearest place lies within a window about the nearest
place of the bare profile. The window is searched on a grid and narrowed about the best point: no
dent of the map's own cell size is missed. Caps and rims are the bare profile's.
"""

from __future__ import annotations

import numpy as np

from estimator.vectors import Array
from sim_sensor.scanned import Scan
from sim_sensor.solid import NearestPlace, Part, Solid

_WINDOWS = ((20e-3, 41), (1.5e-3, 13), (0.3e-3, 13), (0.06e-3, 13), (0.012e-3, 13), (2.4e-6, 13))
_NEAR = 30e-3  # farther away than this a lower bound of the distance will do [m]


class DentedSolid(Solid):
    """All points with z in the scan's range and rho <= its radius there.

    Args:
        scan: With a residual map.
    """

    def __init__(self, scan: Scan) -> None:
        super().__init__(scan.profile)
        self._scan = scan
        self._deepest = float(np.abs(scan.dents.get_coeffs()).max())  # splines stay within these

    def nearest(self, rho: float, z: float, theta: float = 0.0) -> NearestPlace:
        """The place of the surface nearest to (rho, theta, z); far away that of the bare profile,
        its distance less the deepest dent."""
        bare = super().nearest(rho, z, theta)
        if abs(bare.distance) > _NEAR:
            short = np.sign(bare.distance) * (abs(bare.distance) - self._deepest)
            return NearestPlace(float(short), bare.rho, bare.z, bare.part, theta)
        wall = self._on_dented_wall(rho, z, theta, bare)
        best = min((wall, self._on_cap(0, rho, z), self._on_cap(-1, rho, z)), key=_distance)
        low, high = self._scan.z_range
        radius = self._scan.radius(np.array(theta), np.array(np.clip(z, low, high)))
        inside = low < z < high and rho < float(radius)
        at = wall.theta if best is wall else theta
        return NearestPlace(-best.distance if inside else best.distance, best.rho, best.z,
                            best.part, at)  # fmt: skip

    def _on_dented_wall(
        self, rho: float, z: float, theta: float, about: NearestPlace
    ) -> NearestPlace:
        low, high = self._scan.z_range
        turn, height = theta, about.z
        for half, count in _WINDOWS:
            step = np.linspace(-half, half, count)
            turns = turn + step[:, None] / max(about.rho, half)
            heights = np.clip(height + step, low, high)[None]
            turns, heights = np.broadcast_arrays(turns, heights)
            r = self._scan.radius(turns.ravel(), heights.ravel()).reshape(turns.shape)
            squared = _squared(rho, z, turns - theta, r, heights)
            k = np.unravel_index(np.argmin(squared), squared.shape)
            turn, height = float(turns[k]), float(heights[k])
        part = Part.RIM if height in (low, high) else Part.WALL
        return NearestPlace(float(np.sqrt(squared[k])), float(r[k]), height, part, turn)


def _squared(rho: float, z: float, turn: Array, r: Array, height: Array) -> Array:
    """Squared distances of (rho, 0, z) from (r, turn, height), without cancellation."""
    across = 4.0 * rho * r * np.sin(0.5 * turn) ** 2
    return np.asarray((rho - r) ** 2 + across + (z - height) ** 2)


def _distance(place: NearestPlace) -> float:
    return place.distance
