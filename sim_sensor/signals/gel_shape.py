"""The true body near a touched place: its height over the tangent plane, from its profile.

A reader fits a quadratic; the simulator presses on the surface itself. Over a few millimetres that
is a polynomial of fourth order fitted to exact heights: 1 um at radii of 10 mm or more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimator.surface import Geometry, SurfaceOfRevolution
from estimator.vectors import Array, cross, unit

POWERS = tuple((n - k, k) for n in (2, 3, 4) for k in range(n + 1))  # of x, y: 12 terms
_REACH, _BEND = 7e-3, 0.45  # fitted to these from the place [m], or turns of the normal [rad]
_U, _V = (a.ravel() for a in np.meshgrid(np.linspace(-1.0, 1.0, 7), np.linspace(-1.0, 1.0, 7)))
_SOLVE = np.linalg.pinv(np.column_stack([_U**i * _V**k for i, k in POWERS]))


@dataclass(frozen=True, eq=False)
class ObjectPatches:
    """B touched places, each with the body's height under its tangent plane.

    Args:
        positions: World [m], (B, 3).
        frames: Rows x, y, n in the world, n out of the body, right-handed, (B, 3, 3).
        heights: Coefficients of `POWERS` of (x, y): how far the body recedes from its tangent
            plane, convex positive [m^(1 - order)], (B, 12).
    """

    positions: Array
    frames: Array
    heights: Array

    def __len__(self) -> int:
        return len(self.heights)

    @property
    def tensors(self) -> Array:
        """Curvature at the places [1/m], (B, 2, 2)."""
        xx, xy, yy = self.heights[:, :3].T
        return np.stack([np.stack([2.0 * xx, xy], -1), np.stack([xy, 2.0 * yy], -1)], -1)


def arc_patches(tensors: Array) -> ObjectPatches:
    """Bodies of these curvature tensors (B, 2, 2) whose principal sections are arcs of circles to
    fourth order, q + 1/4 q x'K^2x with q = 1/2 x'Kx, at the origin with n = z."""
    K = np.asarray(tensors, dtype=np.float64).reshape(-1, 2, 2)
    K2 = K @ K
    q = np.stack([0.5 * K[:, 0, 0], K[:, 0, 1], 0.5 * K[:, 1, 1]])
    p = 0.25 * np.stack([K2[:, 0, 0], 2.0 * K2[:, 0, 1], K2[:, 1, 1]])
    heights = np.zeros((len(K), len(POWERS)))
    heights[:, :3] = q.T
    for i in range(3):
        for k in range(3):
            heights[:, 7 + i + k] += q[i] * p[k]
    return ObjectPatches(np.zeros((len(K), 3)), np.tile(np.eye(3), (len(K), 1, 1)), heights)


def patches_on(
    surface: SurfaceOfRevolution,
    theta: Array,
    z: Array,
    *,
    x_axis_W: Array | None = None,
) -> ObjectPatches:
    """Places on a surface of revolution; the body goes on beyond its profile's ends.

    Args:
        theta, z: Meridian angle [rad] and height [m], (B,).
        x_axis_W: Projected to the tangent plane it is x, (3,) or (B, 3); None is the parallel.
    """
    g = surface.at(np.atleast_1d(theta), np.atleast_1d(z))
    x = g.k_theta if x_axis_W is None else np.broadcast_to(np.asarray(x_axis_W, float), g.n.shape)
    x = unit(x - np.sum(x * g.n, axis=-1, keepdims=True) * g.n)
    frames = np.stack([x, cross(g.n, x), g.n], axis=1)
    k_theta, k_z = (np.sum(frames[:, :2] * k[:, None], axis=-1) for k in (g.k_theta, g.k_z))
    return ObjectPatches(g.p, frames, _turned(_quartics(surface, g), k_theta, k_z))


def _quartics(surface: SurfaceOfRevolution, g: Geometry) -> Array:
    """Heights over (k_theta, k_z) as coefficients of `POWERS`, (B, 12): least squares."""
    reach = [
        np.minimum(_REACH, _BEND / np.maximum(np.abs(k), 1e-9)) for k in (g.kappa_theta, g.kappa_z)
    ]
    heights = _heights(surface, g, reach[0][:, None] * _U, reach[1][:, None] * _V)
    scale = [reach[0] ** -float(i) * reach[1] ** -float(k) for i, k in POWERS]
    return np.asarray(heights @ _SOLVE.T * np.stack(scale, axis=-1))


def _turned(heights: Array, k_theta: Array, k_z: Array) -> Array:
    """Coefficients over x, y of a polynomial over k_theta and k_z, given in x and y (B, 2)."""
    u = k_theta[:, :1] * _U + k_theta[:, 1:] * _V
    v = k_z[:, :1] * _U + k_z[:, 1:] * _V
    values = sum(heights[:, n, None] * u**i * v**k for n, (i, k) in enumerate(POWERS))
    return np.asarray(values @ _SOLVE.T)


def _heights(surface: SurfaceOfRevolution, g: Geometry, u: Array, v: Array) -> Array:
    """How far the body is below its tangent planes, u along k_theta and v along k_z, exact [m].

    Newton on rho^2 = r(s)^2 down each normal, from the quadratic; u, v and result (B, n).
    """
    axis = surface.axis.direction
    base = (g.p - surface.axis.point)[:, None] + (
        u[..., None] * g.k_theta[:, None] + v[..., None] * g.k_z[:, None]
    )
    base_n, base_u = np.sum(base * g.n[:, None], axis=-1), base @ axis
    base_2, axial = np.sum(base * base, axis=-1), (g.n @ axis)[:, None]
    h = 0.5 * (g.kappa_theta[:, None] * u**2 + g.kappa_z[:, None] * v**2)
    for _ in range(6):
        s = base_u - h * axial
        rho2 = base_2 - 2.0 * h * base_n + h * h - s * s
        r, dr, _ = surface.profile.derivatives(s)
        h = h - (rho2 - r * r) / (2.0 * (h - base_n + axial * (s + r * dr)))
    return h
