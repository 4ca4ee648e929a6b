"""Where fingertips really come to rest when a planned grasp closes on another object.

A grasp is planned on the believed object; every finger closes along its planned normal. On an
object a little other than believed the pad, a sphere or taken for the one that touches as it does
where it is planned to, meets the wall elsewhere, earlier or later, under another normal, or not at
all. The object is taken to stand still until all fingers touch.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from estimator.belief import SampledObjects
from estimator.surface import SurfaceOfRevolution
from estimator.vectors import Array, Mask, basis_across

RIM = 0.02  # of the height at each end where a touch does not count as one of the wall
_STEPS = 12  # of Newton's method
_LONGEST = 0.01  # of one step, along the line and along the wall [m]
_TOUCHING = 2e-5  # of a pad from the wall [m]


@dataclass(frozen=True, eq=False)
class Bodies:
    """B surfaces of revolution of one height.

    Args:
        points, directions: Axes, z = 0 at the point, (B, 3) [m], unit.
        z_range: Lowest and highest z [m].
        derivatives: r, r' and r'' at heights (B, M), row b on body b.
    """

    points: Array
    directions: Array
    z_range: tuple[float, float]
    derivatives: Callable[[Array], tuple[Array, Array, Array]]

    def __len__(self) -> int:
        return len(self.points)

    def signed_distance(self, points_W: Array) -> Array:
        """First-order distance of points (M, 3) to each solid, negative inside, (B, M) [m]."""
        q = points_W - self.points[:, None]
        z = np.einsum("bmi,bi->bm", q, self.directions)
        rho = np.linalg.norm(q - z[..., None] * self.directions[:, None], axis=-1)
        low, high = self.z_range
        r, dr, _ = self.derivatives(np.clip(z, low, high))
        cap = np.maximum(low - z, z - high)
        corner = np.hypot(np.maximum(rho - r, 0.0), np.maximum(cap, 0.0))
        wall = np.maximum((rho - r) / np.sqrt(1.0 + dr**2), cap)
        return np.asarray(np.where(cap > 0.0, corner, wall))


def body_of(surface: SurfaceOfRevolution) -> Bodies:
    """One surface."""
    profile, axis = surface.profile, surface.axis
    return Bodies(axis.point[None], axis.direction[None], profile.z_range, profile.derivatives)


def bodies_of(samples: SampledObjects) -> Bodies:
    """Objects drawn from a belief: natural splines through their nodes, all evaluated at once."""
    spline = CubicSpline(samples.z, samples.radii.T, bc_type="natural")
    rows = np.arange(len(samples.radii))[:, None]

    def derivatives(z: Array) -> tuple[Array, Array, Array]:
        span = np.clip(np.searchsorted(samples.z, z, side="right") - 1, 0, len(samples.z) - 2)
        t = z - samples.z[span]
        a, b, c, d = (spline.c[k][span, rows] for k in range(4))
        return ((a * t + b) * t + c) * t + d, (3 * a * t + 2 * b) * t + c, 6 * a * t + 2 * b

    z_range = (float(samples.z[0]), float(samples.z[-1]))
    return Bodies(samples.points, samples.directions, z_range, derivatives)


@dataclass(frozen=True, eq=False)
class Closed:
    """M fingers at rest on B bodies.

    Args:
        points, normals: Contacts, (B, M, 3) [m], unit and outward.
        travel: Beyond the planned contact, negative before it, (B, M) [m].
        wall: Whether the pad rests on the wall there: not beyond an end, not nowhere, (B, M).
        heights: z of the contacts on each body, (B, M) [m].
    """

    points: Array
    normals: Array
    travel: Array
    wall: Mask
    heights: Array


def close_on(bodies: Bodies, p_W: Array, n_W: Array, radius: Array) -> Closed:
    """Move pads along -n_W, each through its planned contact, until they touch.

    In the half plane of the pad's centre (rho, z) the pad touches at height h of the wall where
        rho = r + R / w,  z = h - R r' / w,  w = sqrt(1 + r'^2),
    two equations for the travel along the line and for h. Newton's method from the planned
    contact; of two ways through a hollow wall it finds the one nearer to the plan.

    Args:
        p_W, n_W: Planned contacts and outward normals, (M, 3) [m], unit.
        radius: Of the pads, (M,) [m].
    """
    frame = np.concatenate(
        [basis_across(bodies.directions), bodies.directions[:, None]], axis=1
    )  # rows x, y, z
    c = np.einsum("bij,bmj->bmi", frame, p_W + radius[:, None] * n_W - bodies.points[:, None])
    d = -np.einsum("bij,mj->bmi", frame, n_W)
    low, high = bodies.z_range
    s, h = np.zeros(c.shape[:2]), np.clip(c[..., 2], low, high)
    for _ in range(_STEPS):
        gap, jacobian, _ = _rest(bodies, c, d, s, h, radius)
        step = _solved(jacobian, gap)
        s = np.clip(s + step[0], -0.1, 0.1)
        h = np.clip(h + step[1], low, high)
    gap, _, n_half = _rest(bodies, c, d, s, h, radius)
    centre = c + s[..., None] * d
    out = centre[..., :2] / np.hypot(centre[..., 0], centre[..., 1])[..., None]
    n_O = np.concatenate([n_half[0][..., None] * out, n_half[1][..., None]], axis=-1)
    normals = np.einsum("bij,bmi->bmj", frame, n_O)
    points = np.einsum("bij,bmi->bmj", frame, centre - radius[:, None] * n_O)
    inset = RIM * (high - low)
    wall = np.hypot(gap[0], gap[1]) < _TOUCHING
    wall &= (h > low + inset) & (h < high - inset) & (np.sum(d * n_O, axis=-1) < 0.0)
    return Closed(points + bodies.points[:, None], normals, s, wall, h)


def _rest(
    bodies: Bodies, c: Array, d: Array, s: Array, h: Array, radius: Array
) -> tuple[tuple[Array, Array], tuple[Array, Array, Array, Array], tuple[Array, Array]]:
    """Residuals of both equations, their derivatives by s and h, and the wall's normal there."""
    r, dr, ddr = bodies.derivatives(h)
    w = np.sqrt(1.0 + dr**2)
    x, y, z = np.moveaxis(c + s[..., None] * d, -1, 0)
    rho = np.hypot(x, y)
    gap = (rho - r - radius / w, z - h + radius * dr / w)
    outward = (x * d[..., 0] + y * d[..., 1]) / np.maximum(rho, 1e-9)
    bend = radius * ddr / w**3  # the normal turns along the wall
    return gap, (outward, -dr * (1.0 - bend), d[..., 2], -(1.0 - bend)), (1.0 / w, -dr / w)


def _solved(jacobian: tuple[Array, Array, Array, Array], gap: tuple[Array, Array]) -> Array:
    """Newton's step, no component longer than _LONGEST, (2, B, M)."""
    a, b, c, d = jacobian
    det = a * d - b * c
    det = np.where(np.abs(det) < 1e-6, np.copysign(1e-6, det), det)
    step = np.stack([b * gap[1] - d * gap[0], c * gap[0] - a * gap[1]]) / det
    return np.asarray(np.clip(step, -_LONGEST, _LONGEST))
