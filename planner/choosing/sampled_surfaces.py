"""Objects drawn from a belief as surfaces, all at once: arrays over B objects and N places."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from estimator.belief import SampledObjects
from estimator.surface import Geometry, geometry_at
from estimator.vectors import Array, basis_across


@dataclass(frozen=True, eq=False)
class SampledProfiles:
    """Natural cubic splines through common heights, as `estimator.profile.SplineProfile`.

    Args:
        z: Heights, strictly increasing, (k,) [m].
        radii: Of each object there, (B, k) [m].
    """

    z: Array
    radii: Array

    @property
    def z_range(self) -> tuple[float, float]:
        return float(self.z[0]), float(self.z[-1])

    @cached_property
    def coefficients(self) -> Array:
        """Of t^3, t^2, t, 1 on each interval, (B, k - 1, 4)."""
        spline = CubicSpline(self.z, self.radii, axis=1, bc_type="natural")
        return np.ascontiguousarray(np.moveaxis(spline.c, (0, 1), (2, 1)))

    def derivatives(self, z: Array) -> tuple[Array, Array, Array]:
        """r, r', r'' at heights (B, N)."""
        at = np.clip(np.searchsorted(self.z, z, side="right") - 1, 0, len(self.z) - 2)
        a, b, c, d = np.moveaxis(self.coefficients[np.arange(len(z))[:, None], at], -1, 0)
        t = z - self.z[at]
        r = ((a * t + b) * t + c) * t + d
        return r, (3.0 * a * t + 2.0 * b) * t + c, 6.0 * a * t + 2.0 * b


@dataclass(frozen=True, eq=False)
class SampledSurfaces:
    """B surfaces of revolution."""

    objects: SampledObjects

    @cached_property
    def profiles(self) -> SampledProfiles:
        return SampledProfiles(self.objects.z, self.objects.radii)

    @cached_property
    def frames(self) -> Array:
        """Rows x, y, z of each object frame in the world, (B, 3, 3)."""
        u = self.objects.directions
        return np.concatenate([basis_across(u), u[:, None]], axis=1)

    def cylindrical(self, points_W: Array) -> tuple[Array, Array, Array]:
        """Meridian angle, distance from the axis and height of points (B, N, 3), each (B, N)."""
        local = (points_W - self.objects.points[:, None]) @ np.swapaxes(self.frames, 1, 2)
        x, y = local[..., 0], local[..., 1]
        return np.arctan2(y, x), np.hypot(x, y), local[..., 2]

    def at(self, theta: Array, z: Array) -> Geometry:
        """Exact geometry at places (B, N), in the world."""
        return self.placed(geometry_at(theta, z, *self.profiles.derivatives(z)))

    def placed(self, local: Geometry) -> Geometry:
        """Geometry (B, N) about each object's own axis, in the world."""
        R = self.frames
        return Geometry(
            p=self.objects.points[:, None] + local.p @ R,
            n=local.n @ R,
            k_theta=local.k_theta @ R,
            k_z=local.k_z @ R,
            kappa_theta=local.kappa_theta,
            kappa_z=local.kappa_z,
        )
