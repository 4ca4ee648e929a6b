"""A scanned product as a fingertip feels it: dents and seams turn its principal directions.

A scan is a JSON file of a profile (`z_mm`, `r_mm`) with a residual map `r_minus_profile` [mm],
rows by height and columns by meridian angle. A fingertip feels the quadric that fits the surface
best over a patch of its own size, so its directions err with heavy tails that no sensor's noise
explains. `bare` is the profile alone, the clean comparison.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenarios import Scenes, posed
from scipy.interpolate import RectBivariateSpline

from estimator.assumptions import Roughness
from estimator.profile import SplineProfile, spline_through
from estimator.surface import Geometry
from estimator.vectors import Array, cross, unit

PATCH = 3e-3  # radius of the fingertip's contact patch [m]
RIM = 8e-3  # kept away from both ends [m]
WRAPPED = 4  # columns repeated at both sides, so that the map closes


@dataclass(frozen=True, eq=False)
class Scan:
    """A profile and what the scanned surface departs from it, r = profile(z) + dents(z, theta)."""

    name: str
    profile: SplineProfile
    dents: RectBivariateSpline

    def radius(self, theta: Array, z: Array) -> Array:
        wrapped = np.mod(theta, 2.0 * np.pi)
        return np.asarray(self.profile.derivatives(z)[0] + self.dents.ev(z, wrapped))


def load_scan(folder: Path) -> Scan:
    """The first scan with a residual map in a folder.

    Raises:
        ValueError: No such folder, or no file in it has a residual map.
    """
    for path in sorted(folder.glob("*.json")):
        record = json.loads(path.read_text(encoding="utf-8"))
        if "residual_map_mm" in record:
            return _scan(record)
    raise ValueError(f"--objects {folder}: no file there has a residual map (residual_map_mm)")


def _scan(record: dict[str, dict[str, list[float]]]) -> Scan:
    z = 1e-3 * np.array(record["profile"]["z_mm"])
    z = z - 0.5 * (z[0] + z[-1])
    profile = spline_through(z, 1e-3 * np.array(record["profile"]["r_mm"]))
    dents = 1e-3 * np.array(record["residual_map_mm"]["r_minus_profile"])
    rows, columns = dents.shape
    heights = z[0] + (np.arange(rows) + 0.5) / rows * (z[-1] - z[0])
    angles = 2.0 * np.pi / columns * (np.arange(-WRAPPED, columns + WRAPPED) + 0.5)
    closed = np.pad(dents, ((0, 0), (WRAPPED, WRAPPED)), mode="wrap")
    return Scan(str(record["name"]), profile, RectBivariateSpline(heights, angles, closed))


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


def draw_touches(
    scan: Scan,
    count: int,
    contacts: int,
    *,
    rng: np.random.Generator,
    meridians: tuple[float, float] = (-np.pi, np.pi),
) -> Scenes:
    """Random places, away from the rims, in random poses."""
    low, high = scan.profile.z_range
    theta = rng.uniform(*meridians, (count, contacts))
    z = rng.uniform(low + RIM, high - RIM, (count, contacts))
    return posed(felt(scan, theta, z), scan.radius(np.zeros(count), np.zeros(count)), rng=rng)


def roughness(
    scan: Scan, meridians: tuple[float, float], *, rng: np.random.Generator, count: int = 5000
) -> Roughness:
    """How far a part of the scan strays from its own profile, as a fingertip feels it.

    The normal's tilt out of the meridian plane and the twist K_tz would vanish on a surface of
    revolution; their root mean square is what dents and seams do. Worst one per cent left out:
    that is for the gross errors of the estimator.
    """
    touched = draw_touches(scan, count, 1, rng=rng, meridians=meridians)
    g, u = touched.geometry, touched.directions[:, None]
    e = unit(cross(u, g.p - touched.points[:, None]))
    c, s = np.sum(g.k_theta * e, axis=-1), np.sum(g.k_z * e, axis=-1)
    twist = (g.kappa_theta - g.kappa_z) * c * s
    return Roughness(_rms(np.sum(g.n * e, axis=-1)), _rms(twist))


def _rms(values: Array) -> float:
    kept = np.sort(np.abs(values.ravel()))[: int(0.99 * values.size)]
    return float(np.sqrt(np.mean(kept**2)))


def bare(scan: Scan) -> Scan:
    """The profile alone."""
    low, high = scan.profile.z_range
    flat = RectBivariateSpline(np.linspace(low, high, 4), np.linspace(-1, 8, 4), np.zeros((4, 4)))
    return Scan(scan.name, scan.profile, flat)
