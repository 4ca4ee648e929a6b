"""The class: surfaces of revolution, and the exact contact at a place on one, eqs (1)-(24).

The paper's frame O has the axis as its z, its origin at `axis.point`, its x along the first row
of `basis_across(direction)`. Normals point out of the object, convex curvature is positive.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimator.axis import Axis
from estimator.contact import Contact, SensorNoise
from estimator.profile import Profile
from estimator.vectors import Array, basis_across, frozen, unit


@dataclass(frozen=True)
class Place:
    """Where on the surface: meridian angle theta [rad] and height z along the axis [m]."""

    theta: float
    z: float


@dataclass(frozen=True, eq=False)
class Geometry:
    """Exact surface geometry at places, vectorised; world frame, shapes (..., 3) and (...).

    `k_theta` is tangent to the parallel, `k_z` to the meridian; `kappa_theta`, `kappa_z` are the
    curvatures along them. The simulator's truth: a `Contact` does not carry these names.
    """

    p: Array
    n: Array
    k_theta: Array
    k_z: Array
    kappa_theta: Array
    kappa_z: Array


@dataclass(frozen=True, eq=False)
class SurfaceOfRevolution:
    """A profile turned about an axis. Here the axis has an origin and a sense: z = 0 is at
    `axis.point` and z grows along `axis.direction`.
    """

    axis: Axis
    profile: Profile

    @property
    def frame(self) -> Array:
        """Rows x, y, z of the object frame O in the world, shape (3, 3)."""
        u = self.axis.direction
        return np.vstack([basis_across(u), u])

    def at(self, theta: Array, z: Array) -> Geometry:
        """Position, normal, directions and curvatures at places, eqs (1), (2), (16)-(20).

        Args:
            theta, z: Of equal (broadcastable) shapes [rad], [m].
        """
        theta, z = np.broadcast_arrays(np.asarray(theta, float), np.asarray(z, float))
        local, R = geometry_at(theta, z, *self.profile.derivatives(z)), self.frame
        return Geometry(
            p=self.axis.point + local.p @ R,
            n=local.n @ R,
            k_theta=local.k_theta @ R,
            k_z=local.k_z @ R,
            kappa_theta=local.kappa_theta,
            kappa_z=local.kappa_z,
        )

    def contact(self, place: Place, noise: SensorNoise) -> Contact:
        """The exact contact at one place, its directions in the order parallel, meridian.

        Whoever simulates a sensor shuffles them.
        """
        g = self.at(np.array(place.theta), np.array(place.z))
        return Contact(
            position=frozen(g.p),
            normal=frozen(unit(g.n)),
            directions=frozen(unit(np.vstack([g.k_theta, g.k_z]))),
            curvatures=frozen([g.kappa_theta, g.kappa_z]),
            noise=noise,
        )

    def place_of(self, point_W: Array) -> Place:
        """Meridian angle and height of a point; on the axis the angle is meaningless."""
        theta, _, z = self.cylindrical(point_W)
        return Place(float(theta), float(z))

    def cylindrical(self, points_W: Array) -> tuple[Array, Array, Array]:
        """Meridian angle [rad], distance from the axis [m] and height [m] of points (..., 3)."""
        local = (points_W - self.axis.point) @ self.frame.T
        x, y = local[..., 0], local[..., 1]
        return np.arctan2(y, x), np.hypot(x, y), local[..., 2]

    def signed_distance(self, points_W: Array) -> Array:
        """First-order distance to the solid, negative inside, flat caps at both ends [m].

        (rho - r)/sqrt(1 + r'^2) beside the wall, the usual corner rule at the rims. Exact on
        cylinder and cone walls; elsewhere its zero set is exact and its slope is one there.
        """
        _, rho, z = self.cylindrical(points_W)
        low, high = self.profile.z_range
        r, dr, _ = self.profile.derivatives(np.clip(z, low, high))
        wall = (rho - r) / np.sqrt(1.0 + dr**2)
        cap = np.maximum(low - z, z - high)
        corner = np.hypot(np.maximum(rho - r, 0.0), np.maximum(cap, 0.0))
        return np.where(cap > 0, corner, np.maximum(wall, cap))


def geometry_at(theta: Array, z: Array, r: Array, dr: Array, ddr: Array) -> Geometry:
    """Geometry about the z axis, from meridian angles, heights and r, r', r'' there."""
    c, s, zero, one = np.cos(theta), np.sin(theta), np.zeros_like(z), np.ones_like(z)
    w = np.sqrt(dr**2 + 1.0)
    return Geometry(
        p=np.stack([r * c, r * s, z], axis=-1),  # (1)
        n=np.stack([c, s, -dr], axis=-1) / w[..., None],  # (2)
        k_theta=np.stack([-s, c, zero], axis=-1),  # (17)
        k_z=np.stack([dr * c, dr * s, one], axis=-1) / w[..., None],  # (16)
        kappa_theta=1.0 / (r * w),  # (20)
        kappa_z=-ddr / w**3,  # (19)
    )


def axis_point_height(r: Array, dr: Array, z: Array) -> Array:
    """a_z = z + r r': where the normal meets the axis, eq. (21) [m]."""
    return np.asarray(z + r * dr)
