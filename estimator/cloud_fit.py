"""A line and a spline about it, fitted together to the points of a cloud that are on the wall."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import OptimizeResult, least_squares

from estimator.axis import Axis, chart_lines, from_chart
from estimator.vectors import Array, Mask, basis_across

FEWEST_ON_WALL = 15
NODES = 10
SLOPE_SD, BULGE_SD = 1.0, 0.3  # of the profile before the fit, over height and radius [-]
STEEP = 0.85  # |n . u| beyond which a point is taken for one of a flat end
OUTLIER = 3.0  # residual beyond which a point counts less, in its own sd
LARGEST = 4.0  # radius over the cloud's size, beyond which an axis is far away and a plane fits


@dataclass(frozen=True, eq=False)
class WallFit:
    """Line and node radii fitted to the wall points, in the chart at `reference`."""

    points: Array
    normals: Array
    reference: Axis
    z: Array
    wall: Mask
    x: Array
    noise: float
    cost: float

    @property
    def axis(self) -> Axis:
        return from_chart(self.reference, self.x[:4])

    @classmethod
    def at(
        cls, p: Array, n: Array, start: Axis, noise: float, *, rounds: int = 3
    ) -> WallFit | None:
        """From a start, heights and wall found anew every round; None where there is no wall."""
        axis: Axis = start
        fit: WallFit | None = None
        for _ in range(rounds):
            axis = axis.based_near(p.mean(axis=0))
            wall = np.abs(n @ axis.direction) < STEEP
            if np.count_nonzero(wall) < max(FEWEST_ON_WALL, 0.3 * len(p)):
                return fit
            height = (p[wall] - axis.point) @ axis.direction
            low, high = np.quantile(height, [0.01, 0.99])
            axis = Axis(axis.point + 0.5 * (low + high) * axis.direction, axis.direction)
            z = np.linspace(-0.5, 0.5, NODES) * max(high - low, 5.0 * noise)
            fit = cls._solved(p, n, axis, z, wall, noise)
            if fit is None:
                return None
            axis = fit.axis
        return fit

    @classmethod
    def _solved(
        cls, p: Array, n: Array, axis: Axis, z: Array, wall: Mask, noise: float
    ) -> WallFit | None:
        size = float(np.sqrt(np.mean(np.sum((p - p.mean(axis=0)) ** 2, axis=1))))
        seen = cls(p, n, axis, z, wall, np.zeros(4 + NODES), noise, np.inf)
        rho = float(np.median(seen.cylindrical(np.zeros(4))[0]))
        if not noise < rho < LARGEST * size:
            return None
        whiten = np.linalg.cholesky(np.linalg.inv(profile_prior(z, rho))).T
        first = np.concatenate([np.zeros(4), np.full(NODES, rho)])
        count = int(np.count_nonzero(wall))

        def residuals(x: Array) -> Array:
            return np.concatenate([seen.residuals(x), whiten @ (x[4:] - first[4:])])

        def jacobian(x: Array) -> Array:
            prior = np.hstack([np.zeros((NODES, 4)), whiten])
            return np.vstack([seen.jacobian(x), prior])

        def loss(square: Array) -> Array:
            """Soft beyond OUTLIER for points; plain for the profile's prior."""
            soft = 1.0 + square[:count] / OUTLIER**2
            rho3 = np.vstack([square, np.ones_like(square), np.zeros_like(square)])
            rho3[0, :count] = OUTLIER**2 * np.log(soft)
            rho3[1, :count] = 1.0 / soft
            rho3[2, :count] = -1.0 / (OUTLIER * soft) ** 2
            return rho3

        result: OptimizeResult = least_squares(
            residuals, first, jacobian, loss=loss, x_scale="jac", max_nfev=15, ftol=1e-5, xtol=1e-6
        )
        strays = (len(p) - count) * OUTLIER**2 * np.log(2.0)
        return cls(p, n, axis, z, wall, result.x, noise, float(2.0 * result.cost + strays))

    def refined(self) -> WallFit:
        """Once more with the noise that the residuals show, if that is more."""
        e = self.noise * self.residuals(self.x)
        noise = max(self.noise, float(1.4826 * np.median(np.abs(e))))
        if noise < 1.1 * self.noise:
            return self
        again = WallFit.at(self.points, self.normals, self.axis, noise)
        return self if again is None else again

    def cylindrical(self, x: Array) -> tuple[Array, Array, Array]:
        """Distance from the axis, height and meridian of the wall points."""
        a, u = chart_lines(self.reference.point, self.reference.direction, x[None, :4])
        gap = self.points[self.wall] - a[0]
        height = gap @ u[0]
        across = (gap - np.outer(height, u[0])) @ basis_across(u[0]).T
        return np.hypot(*across.T), height, np.arctan2(across[:, 1], across[:, 0])

    def residuals(self, x: Array) -> Array:
        rho, height, _ = self.cylindrical(x)
        value, slope = _spline_rows(self.z, height)
        return np.asarray((rho - value @ x[4:]) / np.hypot(1.0, slope @ x[4:]) / self.noise)

    def jacobian(self, x: Array) -> Array:
        """Of the residuals; for the line to first order in its tilt from the reference."""
        a, u0 = chart_lines(self.reference.point, self.reference.direction, x[None, :4])
        u, start = u0[0], self.reference.direction
        basis = basis_across(start)
        carried = basis - np.outer(basis @ u, start + u) / (1.0 + start @ u)
        gap = self.points[self.wall] - a[0]
        height = gap @ u
        across = gap - np.outer(height, u)
        rho = np.linalg.norm(across, axis=1)
        value, slope = _spline_rows(self.z, height)
        dr, off = slope @ x[4:], rho - value @ x[4:]
        lean = np.hypot(1.0, dr)[:, None]
        J = np.empty((len(gap), len(x)))
        J[:, :2] = -(across @ carried.T) / rho[:, None] / lean
        J[:, 2:4] = J[:, :2] * (height + dr * rho)[:, None]
        J[:, 4:] = -value / lean - (off * dr)[:, None] / lean**3 * slope
        return np.asarray(J / self.noise)


def _spline_rows(z: Array, height: Array) -> tuple[Array, Array]:
    """Radius and slope at heights as linear maps of the node radii, straight beyond the ends."""
    spline = _spline(len(z))
    length = z[-1] - z[0]
    inside = np.clip(height, z[0], z[-1])
    share = (inside - z[0]) / length
    slope = spline(share, 1) / length
    return spline(share) + (height - inside)[:, None] * slope, slope


@lru_cache
def _spline(nodes: int) -> CubicSpline:
    """The natural splines that are one at one node and zero at the others, over [0, 1]."""
    return CubicSpline(np.linspace(0.0, 1.0, nodes), np.eye(nodes), bc_type="natural")


def profile_prior(z: Array, radius: float) -> Array:
    """Covariance of the node radii before the fit: any size, any slope, smooth."""
    length = z[-1] - z[0]
    gap = (z[:, None] - z) / (0.3 * length)
    smooth = (BULGE_SD * radius) ** 2 * np.exp(-0.5 * gap**2)
    return np.asarray(
        radius**2 + SLOPE_SD**2 * np.outer(z, z) + smooth + 1e-8 * radius**2 * np.eye(len(z))
    )
