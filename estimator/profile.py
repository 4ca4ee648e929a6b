"""Profiles: the curve r(z) that is turned about the axis, with r' and r''.

Closed forms are exact, `SplineProfile` is twice differentiable through any points. All lengths in
metres; z runs along the axis over `z_range`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from estimator.vectors import Array, frozen


class Profile(Protocol):
    """Anything that gives radius, slope and second derivative at a height."""

    @property
    def z_range(self) -> tuple[float, float]:
        """Lowest and highest z [m]."""

    def derivatives(self, z: Array) -> tuple[Array, Array, Array]:
        """r [m], r' [-] and r'' [1/m] at heights z [m], of any shape."""


@dataclass(frozen=True)
class PolynomialProfile:
    """r(z) = c0 + c1 z + c2 z^2 + ...; cylinder, cone, barrel and the paper's lathe object.

    Args:
        coefficients: Lowest power first, SI.
        z_range: Lowest and highest z [m].
    Raises:
        ValueError: The range is empty, or r is not positive all over it.
    """

    coefficients: tuple[float, ...]
    z_range: tuple[float, float]

    def __post_init__(self) -> None:
        _require_range(self.z_range)
        _require_positive(self)

    def derivatives(self, z: Array) -> tuple[Array, Array, Array]:
        c = np.polynomial.polynomial.Polynomial(self.coefficients)
        z = np.asarray(z, dtype=np.float64)
        return np.asarray(c(z)) + 0 * z, np.asarray(c.deriv(1)(z)), np.asarray(c.deriv(2)(z))


@dataclass(frozen=True)
class ArcProfile:
    """r(z) = R + sign * sqrt(a^2 - z^2): the section of a torus; a sphere where R = 0.

    Args:
        core_radius: R, distance of the arc's centre from the axis [m]; 0 gives a sphere.
        arc_radius: a [m].
        z_range: Inside (-a, a) [m].
        outer: The outer, convex side of the tube, or its inner side, a saddle.
    Raises:
        ValueError: The range leaves the arc, or r is not positive all over it.
    """

    core_radius: float
    arc_radius: float
    z_range: tuple[float, float]
    outer: bool = True

    def __post_init__(self) -> None:
        _require_range(self.z_range)
        if not max(map(abs, self.z_range)) < self.arc_radius:
            raise ValueError(
                f"z_range {self.z_range}: expected inside the arc, +-{self.arc_radius} m"
            )
        _require_positive(self)

    def derivatives(self, z: Array) -> tuple[Array, Array, Array]:
        sign = 1.0 if self.outer else -1.0
        height = np.sqrt(self.arc_radius**2 - np.square(z))
        r = self.core_radius + sign * height
        return r, -sign * z / height, -sign * self.arc_radius**2 / height**3


@dataclass(frozen=True, eq=False)
class SplineProfile:
    """Cubic spline through points, natural at both ends.

    Args:
        z: Heights, strictly increasing [m], shape (k,), k >= 4.
        r: Radii, positive [m], shape (k,).
    Raises:
        ValueError: Too few points, heights that fold back, or a radius that is not positive.
    """

    z: Array
    r: Array

    def __post_init__(self) -> None:
        z, r = frozen(self.z), frozen(self.r)
        if z.ndim != 1 or z.shape != r.shape or len(z) < 4:
            raise ValueError(f"profile: expected 4 or more pairs z, r; got {z.shape} and {r.shape}")
        if not (np.all(np.isfinite(z)) and np.all(np.isfinite(r))):
            raise ValueError("profile: expected finite numbers")
        folded = np.nonzero(np.diff(z) <= 0)[0]
        if len(folded):
            raise ValueError(
                f"profile folds back: z must increase, but point {folded[0] + 2} has "
                f"z = {z[folded[0] + 1]:g} after {z[folded[0]]:g}"
            )
        if np.any(r <= 0):
            bad = int(np.argmax(r <= 0))
            raise ValueError(
                f"profile: radius must be positive, point {bad + 1} has r = {r[bad]:g}"
            )
        object.__setattr__(self, "z", z)
        object.__setattr__(self, "r", r)
        object.__setattr__(self, "_spline", CubicSpline(z, r, bc_type="natural"))
        _require_positive(self)

    @property
    def z_range(self) -> tuple[float, float]:
        return float(self.z[0]), float(self.z[-1])

    def derivatives(self, z: Array) -> tuple[Array, Array, Array]:
        spline: CubicSpline = self._spline  # type: ignore[attr-defined]
        return spline(z), spline(z, 1), spline(z, 2)


def cylinder(radius: float, height: float) -> PolynomialProfile:
    """r = radius, z from -height/2 to height/2 [m]."""
    return PolynomialProfile((radius,), _centred(height))


def cone(radius: float, slope: float, height: float) -> PolynomialProfile:
    """r = radius + slope z, z from -height/2 to height/2 [m]; slope = r' [-]."""
    return PolynomialProfile((radius, slope), _centred(height))


def barrel(radius: float, bulge: float, height: float) -> PolynomialProfile:
    """r = radius - bulge z^2, z from -height/2 to height/2 [m]; bulge [1/m]."""
    return PolynomialProfile((radius, 0.0, -bulge), _centred(height))


def sphere(radius: float, height: float) -> ArcProfile:
    """The zone of a sphere between -height/2 and height/2 [m]; umbilic everywhere."""
    return ArcProfile(0.0, radius, _centred(height))


def spline_through(z: ArrayLike, r: ArrayLike) -> SplineProfile:
    """A twice differentiable profile through measured points [m]."""
    return SplineProfile(frozen(z), frozen(r))


def _centred(height: float) -> tuple[float, float]:
    return (-0.5 * height, 0.5 * height)


def _require_range(z_range: tuple[float, float]) -> None:
    low, high = z_range
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise ValueError(f"z_range: expected low < high, got {z_range}")


def _require_positive(profile: Profile) -> None:
    z = np.linspace(*profile.z_range, 201)
    r = profile.derivatives(z)[0]
    if not np.all(r > 0):
        bad = z[int(np.argmin(np.where(np.isfinite(r), r, -np.inf)))]
        raise ValueError(f"profile: radius must be positive, it is not at z = {bad:g} m")
