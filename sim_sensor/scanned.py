"""Scanned products: a profile, and how the real surface departs from it around and along.

A residual map has rows by height and columns by meridian angle; between its cells it is a spline
that closes around the object. A fingertip feels the quadric that fits the surface best over a
patch of its own size, so that dents and seams turn its principal directions with heavy tails that
no sensor's noise explains.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import RectBivariateSpline

from estimator.profile import Profile, SplineProfile
from estimator.surface import Geometry, SurfaceOfRevolution
from estimator.vectors import Array, cross, unit

PATCH = 3e-3  # radius of the fingertip's contact patch [m]
_WRAPPED = 4  # columns repeated at both sides, so that the map closes


@dataclass(frozen=True, eq=False)
class Scan:
    """A profile with a residual map, rho = r(z) + dents(z, theta); as a profile it is r alone.

    Args:
        name: Of the product.
        profile: r(z).
        dents: Over heights [m] and angles in [0, 2 pi) [m].
    """

    name: str
    profile: SplineProfile
    dents: RectBivariateSpline

    @property
    def z_range(self) -> tuple[float, float]:
        return self.profile.z_range

    def derivatives(self, z: Array) -> tuple[Array, Array, Array]:
        return self.profile.derivatives(z)

    def radius(self, theta: Array, z: Array) -> Array:
        """Distance of the real surface from the axis [m]."""
        wrapped = np.mod(theta, 2.0 * np.pi)
        return np.asarray(self.profile.derivatives(z)[0] + self.dents.ev(z, wrapped))


def scan_of(name: str, profile: SplineProfile, residuals: ArrayLike) -> Scan:
    """A scan from the cells of its residual map.

    Args:
        residuals: Radius over the profile's at the middle of each cell, rows by height from below,
            columns by meridian angle from zero [m], (rows, columns).
    Raises:
        ValueError: Not a map of 4 x 4 finite numbers or more.
    """
    cells = np.asarray(residuals, dtype=np.float64)
    if cells.ndim != 2 or min(cells.shape) < 4 or not np.all(np.isfinite(cells)):
        raise ValueError(f"residual map: expected 4 x 4 finite numbers or more, got {cells.shape}")
    rows, columns = cells.shape
    low, high = profile.z_range
    heights = low + (np.arange(rows) + 0.5) / rows * (high - low)
    angles = 2.0 * np.pi / columns * (np.arange(-_WRAPPED, columns + _WRAPPED) + 0.5)
    closed = np.take(cells, np.arange(-_WRAPPED, columns + _WRAPPED), axis=1, mode="wrap")
    return Scan(name, profile, RectBivariateSpline(heights, angles, closed))


def wall_radius(profile: Profile, theta: Array, z: Array) -> Array:
    """Distance of the wall from the axis [m], with its dents if it has any."""
    if isinstance(profile, Scan):
        return profile.radius(theta, z)
    return np.asarray(profile.derivatives(z)[0])


def wall_points(surface: SurfaceOfRevolution, theta: Array, z: Array) -> Array:
    """Points of the wall in the world [m], (..., 3), with its dents."""
    theta, z = np.broadcast_arrays(theta, z)
    r = wall_radius(surface.profile, theta, z)
    local = np.stack([r * np.cos(theta), r * np.sin(theta), z], axis=-1)
    return np.asarray(surface.axis.point + local @ surface.frame)


def felt(scan: Scan, theta: Array, z: Array, *, patch: float = PATCH) -> Geometry:
    """What a fingertip feels at places (B, n): the best quadric over its patch, upright object.

    `k_theta` is the principal direction nearer to the true parallel.
    """
    rad = np.stack([np.cos(theta), np.sin(theta), 0.0 * theta], axis=-1)
    e = np.stack([-np.sin(theta), np.cos(theta), 0.0 * theta], axis=-1)
    up = np.broadcast_to([0.0, 0.0, 1.0], e.shape)
    foot = scan.radius(theta, z)[..., None] * rad + z[..., None] * up
    height, slope, hessian = _quadric(_patch(scan, theta, z, patch) - foot[..., None, :], rad, e)
    tangent = np.stack([e + slope[..., :1] * rad, up + slope[..., 1:] * rad], axis=-2)
    kappa, rows = _principal(tangent, slope, hessian)
    order = np.argmax(np.abs(np.einsum("bnix,bnx->bni", rows, e)), axis=-1)[..., None]
    kappa = np.take_along_axis(kappa, np.concatenate([order, 1 - order], axis=-1), axis=-1)
    k_theta = np.take_along_axis(rows, order[..., None], axis=-2)[..., 0, :]
    n = unit(cross(tangent[..., 0, :], tangent[..., 1, :]))
    return Geometry(
        p=foot + height[..., None] * rad,
        n=n,
        k_theta=k_theta,
        k_z=cross(n, k_theta),
        kappa_theta=kappa[..., 0],
        kappa_z=kappa[..., 1],
    )


def felt_at(surface: SurfaceOfRevolution, scan: Scan, theta: float, z: float) -> Geometry:
    """The same at one place of an object in the world."""
    g, R = felt(scan, np.array([[theta]]), np.array([[z]])), surface.frame
    p, n, k_theta, k_z = (v[0, 0] @ R for v in (g.p, g.n, g.k_theta, g.k_z))
    kappa_theta, kappa_z = g.kappa_theta[0, 0], g.kappa_z[0, 0]
    return Geometry(surface.axis.point + p, n, k_theta, k_z, kappa_theta, kappa_z)


def _patch(scan: Scan, theta: Array, z: Array, patch: float) -> Array:
    """Points of the surface on rings about each place, (B, n, m, 3)."""
    ring, turn = np.meshgrid(np.linspace(0.25, 1.0, 4), np.linspace(0, 2 * np.pi, 12, False))
    turn = turn + 0.5 * ring  # no two rings alike
    across, along = (patch * ring * np.cos(turn)).ravel(), (patch * ring * np.sin(turn)).ravel()
    at = theta[..., None] + across / scan.radius(theta, z)[..., None]
    height = z[..., None] + along
    r = scan.radius(at, height)
    return np.stack([r * np.cos(at), r * np.sin(at), height], axis=-1)


def _quadric(points: Array, rad: Array, e: Array) -> tuple[Array, Array, Array]:
    """Height c, slope g and Hessian H of h = c + g.x + x^T H x / 2 over (e, z), least squares."""
    x = np.einsum("bnmx,bnx->bnm", points, e)
    y, h = points[..., 2], np.einsum("bnmx,bnx->bnm", points, rad)
    unit_length = PATCH  # keeps the normal equations well scaled
    a, b = x / unit_length, y / unit_length
    A = np.stack([np.ones_like(a), a, b, 0.5 * a * a, a * b, 0.5 * b * b], axis=-1)
    At = np.swapaxes(A, -1, -2)
    c = np.linalg.solve(At @ A, At @ h[..., None])[..., 0]
    hessian = np.stack([c[..., 3], c[..., 4], c[..., 4], c[..., 5]], axis=-1)
    return (
        c[..., 0],
        c[..., 1:3] / unit_length,
        hessian.reshape(*c.shape[:-1], 2, 2) / unit_length**2,
    )


def _principal(tangent: Array, slope: Array, hessian: Array) -> tuple[Array, Array]:
    """Curvatures (B, n, 2), convex positive, and unit directions (B, n, 2, 3) as rows."""
    metric = tangent @ np.swapaxes(tangent, -1, -2)
    second = -hessian / np.sqrt(1.0 + np.sum(slope**2, axis=-1))[..., None, None]
    whiten = np.linalg.inv(np.linalg.cholesky(metric))
    kappa, vectors = np.linalg.eigh(whiten @ second @ np.swapaxes(whiten, -1, -2))
    return kappa, np.swapaxes(vectors, -1, -2) @ whiten @ tangent
