"""The believed object as an obstacle: a solid of revolution with flat ends."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import BSpline, PchipInterpolator

from estimator.surface import SurfaceOfRevolution
from hand_models.slices import revolved_slices
from planner.kinematics.meridian import Meridian, tabulated

Array = NDArray[np.float64]

COEFFICIENTS = 26
"""Of the cubic B-spline that stands for the profile in the optimiser."""

_DEGREE = 3
_SPANS = COEFFICIENTS - _DEGREE
_SLICES = 24  # of the convex decomposition for the final check
_DENSE = 201  # heights at which the profile is fitted
_HEIGHTS = 101  # at which a believed profile is read
_CORNER = 1e-3  # rounding where wall and end meet, so that the distance is smooth [m]


@dataclass(frozen=True, eq=False)
class RevolvedSolid:
    """The solid between two heights under a profile r(z), turned about the z axis of frame O.

    Args:
        X_WO: Pose of the object; its z is the axis.
        z: (K,) ascending heights, at least two [m].
        r: (K,) radii there, positive [m].

    Raises:
        ValueError: Heights not ascending, radii not positive, or of other shapes.
    """

    X_WO: pin.SE3
    z: Array
    r: Array

    def __post_init__(self) -> None:
        z, r = (np.array(values, dtype=np.float64) for values in (self.z, self.r))
        if z.ndim != 1 or z.shape != r.shape or len(z) < 2:
            raise ValueError(f"z and r must be of one shape (K,), K >= 2: {z.shape}, {r.shape}")
        if not (np.all(np.diff(z) > 0.0) and np.isfinite(z).all()):
            raise ValueError("z must be ascending and finite")
        if not (np.all(r > 0.0) and np.isfinite(r).all()):
            raise ValueError(f"r must be positive, its least value is {r.min():g}")
        for name, values in (("z", z), ("r", r)):
            values.setflags(write=False)
            object.__setattr__(self, name, values)

    def radius(self, z: ArrayLike) -> Array:
        """Radius at heights between the ends [m]."""
        return np.asarray(self._profile(z))

    @cached_property
    def _profile(self) -> PchipInterpolator:
        return PchipInterpolator(self.z, self.r)

    @cached_property
    def meridian(self) -> Meridian:
        """Radius and slope as a table for compiled loops."""
        return tabulated(
            float(self.z[0]), float(self.z[-1]), lambda z: (self._profile(z), self._profile(z, 1))
        )

    @cached_property
    def coefficients(self) -> Array:
        """(26,) least-squares uniform cubic B-spline of the profile over its heights [m]."""
        dense = self.radius(np.linspace(self.z[0], self.z[-1], _DENSE))
        return np.asarray(_fit() @ dense)

    @cached_property
    def slices(self) -> tuple[coal.ConvexBase, ...]:
        """Convex parts in frame O for `HandCollision.object_clearance`."""
        z = np.linspace(self.z[0], self.z[-1], _SLICES + 1)
        return revolved_slices(z, self.radius(z))

    @cached_property
    def parameters(self) -> Array:
        """What `signed_distance` is given: rotation (9, by rows), position, ends, coefficients."""
        pose = [*self.X_WO.rotation.ravel(), *self.X_WO.translation]
        return np.array([*pose, self.z[0], self.z[-1], *self.coefficients])

    def distance(self, points_W: Array) -> Array:
        """Distance of points (..., 3) to the solid, first order, negative inside [m].

        max((rho - r) / sqrt(1 + r'^2), |z - middle| - height / 2); exact at the surface, a lower
        bound beyond the rims.
        """
        points_O = (points_W - self.X_WO.translation) @ self.X_WO.rotation
        rho, z = np.hypot(points_O[..., 0], points_O[..., 1]), points_O[..., 2]
        heights, radii, slopes = self._table
        wall = (rho - np.interp(z, heights, radii)) / np.hypot(1.0, np.interp(z, heights, slopes))
        end = np.abs(z - (heights[0] + heights[-1]) / 2) - (heights[-1] - heights[0]) / 2
        return np.asarray(_rounded_max(wall, end))

    @cached_property
    def _table(self) -> tuple[Array, Array, Array]:
        """Heights, and radius and slope of the spline there."""
        u = np.linspace(0.0, 1.0, _DENSE)
        spline = BSpline(_knots(), self.coefficients, _DEGREE)
        height = self.z[-1] - self.z[0]
        return self.z[0] + u * height, spline(u), spline(u, 1) / height


def believed_solid(surface: SurfaceOfRevolution) -> RevolvedSolid:
    """A believed object as an obstacle, between the ends of its profile."""
    z = np.linspace(*surface.profile.z_range, _HEIGHTS)
    X_WO = pin.SE3(np.ascontiguousarray(surface.frame.T), np.array(surface.axis.point))
    return RevolvedSolid(X_WO, z, surface.profile.derivatives(z)[0])


PARAMETERS = 9 + 3 + 2 + COEFFICIENTS


def signed_distance(points: ca.MX, parameters: ca.MX) -> ca.MX:
    """The same distance for an optimiser: (3, M) points in the world to (1, M) [m].

    The profile's coefficients are parameters: a belief that changes needs no new problem. Written
    for whole rows, with the four coefficients of each point gathered by index, because CasADi then
    spends its time on long vectors and not on M small functions.

    Args:
        points: (3, M) in the world [m].
        parameters: (40,) as `RevolvedSolid.parameters`.
    """
    count = points.shape[1]
    R_OW, p_WO = ca.reshape(parameters[:9], 3, 3), parameters[9:12]  # by columns: transposed
    x, y, z = ca.vertsplit(R_OW @ (points - ca.repmat(p_WO, 1, count)))
    low, high, coefficients = parameters[12], parameters[13], parameters[14:]
    per_span = _SPANS / (high - low)
    u = _SPANS * ca.fmin(ca.fmax((z - low) / (high - low), 0.0), 1.0)
    span = ca.fmin(ca.floor(u), _SPANS - 1)
    c = [ca.reshape(coefficients.nz[span + j], 1, count) for j in range(_DEGREE + 1)]
    r, dr = _cubic(u - span, c)
    wall = (ca.sqrt(x**2 + y**2 + 1e-12) - r) / ca.sqrt(1.0 + (dr * per_span) ** 2)
    end = ca.fabs(z - (low + high) / 2) - (high - low) / 2
    return _rounded_max(wall, end)


def _cubic(t: ca.MX, c: list[ca.MX]) -> tuple[ca.MX, ca.MX]:
    """Uniform cubic B-spline and its slope at t in [0, 1] of a span with coefficients c."""
    s = 1.0 - t
    value = s**3 * c[0] + (3 * t**3 - 6 * t**2 + 4) * c[1]
    value += (3 * s**3 - 6 * s**2 + 4) * c[2] + t**3 * c[3]
    slope = -(s**2) * c[0] + (3 * t**2 - 4 * t) * c[1] - (3 * s**2 - 4 * s) * c[2] + t**2 * c[3]
    return value / 6, slope / 2


def _rounded_max(a: Any, b: Any) -> Any:
    """max(a, b), smooth where they meet and there half a millimetre too large."""
    return (a + b + ((a - b) ** 2 + _CORNER**2) ** 0.5) / 2


def _knots() -> Array:
    return np.arange(-_DEGREE, _SPANS + _DEGREE + 1) / _SPANS


def _fit() -> Array:
    """(26, K) map from radii at evenly spaced heights to least-squares coefficients."""
    u = np.linspace(0.0, 1.0, _DENSE)
    basis = BSpline.design_matrix(u, _knots(), _DEGREE).toarray()
    return np.asarray(np.linalg.pinv(basis))
