"""The smooth surface that a few touches suggest about an axis, whether or not the axis is right.

Its profile is the mean of a Gaussian process: a radius, a slope and a bulge on the scale of one
radius. Radius r, slope r' and second derivative r'' of the touches are all linear in it, so it
follows them as far as they agree, and two touches at one height are no special case.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from estimator.axis import Axis
from estimator.contact import Contact
from estimator.surface import Geometry
from estimator.vectors import Array, Index, unit

RADIUS_SD = 1.0  # of the radius as a whole, over the object's radius [-]
SLOPE_SD = 0.3  # of the profile as a whole [-]
BULGE_SD = 0.15  # of its shape, over the radius, on the scale of one radius [-]
STEEPEST = 3.0  # slope beyond which no side is left to touch [-]
THINNEST = 0.05  # radius that is always left, over the largest [-]
ROUGH = 0.02  # how far radius (relative) and slope may miss the touches besides their noise [-]
UNKNOWN = 1e6  # sd of a curvature that was not measured [1/m]


def surface_through(axis: Axis, contacts: Sequence[Contact], targets: Array) -> Geometry:
    """Nearest places on the smooth surface through the contacts, turned about an axis.

    Args:
        axis: Any; where it is wrong the surface passes the contacts as well as it can.
        targets: World [m], (G, 3); on the axis the meridian is meaningless.
    Returns:
        Exact geometry there, eqs (2), (16)-(20), fields (G, 3) and (G,).
    """
    u = axis.direction
    q = targets - axis.point
    z = q @ u
    r, dr, ddr = smooth_profile(*_touched(axis, contacts), z)
    r = np.maximum(r, THINNEST * np.abs(r).max(initial=0.0))
    dr = np.clip(dr, -STEEPEST, STEEPEST)
    w = np.sqrt(1.0 + dr**2)
    rad = unit(q - z[:, None] * u)
    return Geometry(
        p=axis.point + z[:, None] * u + r[:, None] * rad,
        n=(rad - dr[:, None] * u) / w[:, None],  # (2)
        k_theta=np.cross(u, rad),  # (17)
        k_z=(dr[:, None] * rad + u) / w[:, None],  # (16)
        kappa_theta=1.0 / (r * w),  # (20)
        kappa_z=-ddr / w**3,  # (19)
    )


def _touched(axis: Axis, contacts: Sequence[Contact]) -> tuple[Array, Array, Array]:
    """Heights (n,), and r, r', r'' with sds (3, n) of the contacts about an axis.

    r'' follows from the curvature along the meridian, the tensor's trace less K_tt: no label.
    """
    p, n = np.array([c.position for c in contacts]), np.array([c.normal for c in contacts])
    q, u = p - axis.point, axis.direction
    z = q @ u
    across = q - z[:, None] * u
    r = np.maximum(np.linalg.norm(across, axis=1), 1e-9)
    m_n, m_u = np.abs(np.sum(n * across, axis=1)) / r, n @ u
    dr = -m_u / np.maximum(m_n, 1.0 / STEEPEST)
    w = np.sqrt(1.0 + dr**2)
    trace = np.array([np.nan_to_num(c.curvatures).sum() for c in contacts])
    ddr = -(trace - m_n / r) * w**3
    noises = [c.noise for c in contacts]
    sd_r = np.array([s.position for s in noises]) + ROUGH * r
    sd_dr = (np.array([s.normal for s in noises]) + ROUGH) * w**2
    sd_K = np.array([min(s.flat, UNKNOWN) + s.mean_curvature + s.deviator for s in noises])
    return z, np.stack([r, dr, ddr]), np.stack([sd_r, sd_dr, sd_K * w**3])


def smooth_profile(z: Array, values: Array, sds: Array, heights: Array) -> Array:
    """Profile at `heights` (G,) [m] from touches at z (n,) [m].

    Args:
        values: r [m], r' [-] and r'' [1/m] of the touches, (3, n).
        sds: Of each [same units], greater than zero, (3, n).
    Returns:
        r, r' and r'', (3, G).
    """
    radius, middle = float(values[0].mean()), float(z.mean())
    x, orders = np.tile(z - middle, 3), np.repeat(np.arange(3), len(z))
    to, asked = np.tile(heights - middle, 3), np.repeat(np.arange(3), len(heights))
    K = _covariance(x, orders, x, orders, radius) + np.diag(sds.ravel() ** 2)
    cross = _covariance(to, asked, x, orders, radius)
    gap = values.ravel() - np.where(orders == 0, radius, 0.0)
    mean = np.where(asked == 0, radius, 0.0) + cross @ np.linalg.solve(K, gap)
    return np.asarray(mean.reshape(3, -1))


def _covariance(x: Array, a: Index, y: Array, b: Index, radius: float) -> Array:
    """Of the derivative of order a at x (X,) and of order b at y (Y,), shape (X, Y).

    d^m/dh^m exp(-h^2/2) = (-1)^m He_m(h) exp(-h^2/2), with Hermite's polynomials He_m.
    """
    x, a = x[:, None], a[:, None]
    h, m = (x - y) / radius, a + b
    He = np.choose(m, [np.ones_like(h), h, h**2 - 1.0, h**3 - 3.0 * h, h**4 - 6.0 * h**2 + 3.0])
    bulge = BULGE_SD**2 * (-1.0) ** a * He * np.exp(-0.5 * h**2) * radius ** (2.0 - m)
    slope = SLOPE_SD**2 * np.where(a == 0, x, a == 1) * np.where(b == 0, y, b == 1)
    return np.asarray((RADIUS_SD * radius) ** 2 * (m == 0) + slope + bulge)
