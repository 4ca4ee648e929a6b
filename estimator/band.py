"""A profile that is only partly known: a Gaussian over splines, and what touches tell it.

The profile is the natural cubic spline through nodes at fixed heights, straight beyond them; the
node radii have a mean and a covariance. Radius, slope and second derivative at any height are
linear in the nodes, so touches condition the band exactly (linear Gaussian), and the posterior has
the prior's type.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from estimator.profile import SplineProfile
from estimator.profile_readings import ProfileReadings
from estimator.vectors import Array, frozen

SLOPE_SD = 0.15  # of the profile as a whole [-]
BULGE_SD = 0.10  # of its shape, over the radius [-]
WAVELENGTH = 0.3  # of that shape, over the height [-]
NODES = 15


@dataclass(frozen=True, eq=False)
class ProfileBand:
    """Node heights z (k,) [m], mean radii (k,) [m] and their covariance (k, k) [m^2].

    `by_axis` (k, 4) is by how much the mean exceeds the truth for an axis that lies at x in the
    chart at the one it was read about: radii read on one side of an axis are too large, those on
    the other too small, all by one error. None where no touch told of it. The covariance has it.
    """

    z: Array
    mean: Array
    covariance: Array
    by_axis: Array | None = None

    @cached_property
    def profile(self) -> SplineProfile:
        """The mean, as a profile."""
        return SplineProfile(self.z, np.maximum(self.mean, 0.2 * np.max(self.mean)))

    @property
    def sd(self) -> Array:
        """Standard deviation of the radius at the nodes [m]."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))

    def radius(self, z: Array) -> tuple[Array, Array]:
        """Mean and standard deviation of the radius at heights z (m,) [m]."""
        H = self._rows(z)[0]
        variance = np.einsum("ij,jk,ik->i", H, self.covariance, H)
        return H @ self.mean, np.sqrt(np.maximum(variance, 0.0))

    def radii(self, z: Array) -> tuple[Array, Array]:
        """Mean and joint covariance of the radii at heights z (m,) [m], [m^2]."""
        H = self._rows(z)[0]
        return H @ self.mean, np.asarray(H @ self.covariance @ H.T)

    def radii_by_axis(self, z: Array) -> Array:
        """By how much the mean radii at heights z (m,) exceed the truth with the axis, (m, 4)."""
        if self.by_axis is None:
            return np.zeros((len(z), 4))
        return np.asarray(self._rows(z)[0] @ self.by_axis)

    def conditioned(self, told: ProfileReadings) -> ProfileBand:
        """The band after radii, slopes and second derivatives were read at some heights."""
        H = np.vstack(self._rows(told.z))
        read = np.concatenate([told.r, told.dr, told.ddr])
        gain = np.linalg.solve(H @ self.covariance @ H.T + told.covariance, H @ self.covariance).T
        mean = self.mean + gain @ (read - H @ self.mean)
        covariance = self.covariance - gain @ H @ self.covariance
        covariance = frozen(0.5 * (covariance + covariance.T))
        return ProfileBand(self.z, frozen(mean), covariance, frozen(gain @ told.by_axis))

    def sample(self, count: int, *, rng: np.random.Generator) -> Array:
        """Node radii drawn from the band, kept above a fifth of the mean, (count, k) [m]."""
        drawn = rng.multivariate_normal(self.mean, self.covariance, size=count, method="eigh")
        return np.maximum(drawn, 0.2 * np.max(self.mean))

    def sample_about(self, x: Array, covariance: Array, *, rng: np.random.Generator) -> Array:
        """The same for objects whose axes lie at x (count, 4) in the chart, of this covariance.

        An axis that lies aside takes the wall along, so that every object goes through what was
        touched: the band's own doubt is what is left of it for a known axis.
        """
        if self.by_axis is None:
            return self.sample(len(x), rng=rng)
        own = self.covariance - self.by_axis @ covariance @ self.by_axis.T
        value, vector = np.linalg.eigh(0.5 * (own + own.T))
        root = vector * np.sqrt(np.maximum(value, 0.0))
        drawn = self.mean - x @ self.by_axis.T + rng.normal(size=(len(x), len(root))) @ root.T
        return np.asarray(np.maximum(drawn, 0.2 * np.max(self.mean)))

    def _rows(self, z: Array) -> tuple[Array, Array, Array]:
        """r, r' and r'' at heights z (m,) as linear maps of the node radii, each (m, k)."""
        spline = CubicSpline(self.z, np.eye(len(self.z)), bc_type="natural")
        inside = np.clip(z, self.z[0], self.z[-1])
        slope = spline(inside, 1)
        return spline(inside) + (z - inside)[:, None] * slope, slope, spline(inside, 2)


def coarse_band(radius: float, radius_sd: float, z_range: tuple[float, float]) -> ProfileBand:
    """What a camera tells of the shape: a radius, roughly, over a range of heights.

    Args:
        radius, radius_sd: [m].
        z_range: Lowest and highest z about the believed axis' point [m].
    """
    z = np.linspace(*z_range, NODES)
    gap = (z[:, None] - z) / (WAVELENGTH * (z_range[1] - z_range[0]))
    covariance = (
        radius_sd**2
        + SLOPE_SD**2 * np.outer(z - z.mean(), z - z.mean())
        + (BULGE_SD * radius) ** 2 * np.exp(-0.5 * gap**2)
    )
    return ProfileBand(frozen(z), frozen(np.full(NODES, radius)), frozen(covariance))
