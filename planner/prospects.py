"""Where planned touches would land if the object were a little other than believed.

A plan is made for the believed object and carried out on the true one. Every candidate is
therefore followed along its approach to many objects drawn from the belief.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimator.axis import Axis
from estimator.belief import SampledObjects
from estimator.profile import SplineProfile
from estimator.singular import PlacedTriples
from estimator.surface import Geometry, SurfaceOfRevolution
from estimator.vectors import Array, Mask

BEFORE, BEHIND = 0.030, 0.025  # how far an approach goes, about the expected contact [m]
RIM = 0.02  # of the height at each end where a touch does not count as one of the wall


@dataclass(frozen=True, eq=False)
class Prospects:
    """Touches of N candidates with m fingers on B sampled objects, arrays (B, N, m).

    Args:
        geometry: Exact surface geometry where each approach meets the object, (B, N * m).
        theta, z, r, dr, ddr: Places and profiles there.
        hit: Whether the approach meets the wall within its stroke.
    """

    geometry: Geometry
    theta: Array
    z: Array
    r: Array
    dr: Array
    ddr: Array
    hit: Mask
    points: Array
    directions: Array

    @property
    def triples(self) -> PlacedTriples:
        return PlacedTriples(self.theta, self.z, self.r, self.dr, self.ddr)


def prospects(samples: SampledObjects, p_W: Array, n_W: Array) -> Prospects:
    """Follow approaches along -n to each sampled object.

    Args:
        p_W, n_W: Expected contacts and outward normals, (N, m, 3) [m], unit.
    """
    shape = p_W.shape[:2]
    p, n = p_W.reshape(-1, 3), n_W.reshape(-1, 3)
    rows = [_on_object(samples, b, p, n) for b in range(len(samples.points))]
    geometry = Geometry(*(np.stack(x) for x in zip(*(row[0] for row in rows), strict=True)))
    theta, z, r, dr, ddr, hit = (
        np.stack(x).reshape(-1, *shape) for x in zip(*(row[1] for row in rows), strict=True)
    )
    return Prospects(
        geometry, theta, z, r, dr, ddr, hit.astype(bool), samples.points, samples.directions
    )


def _on_object(
    samples: SampledObjects, b: int, p: Array, n: Array
) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
    profile = SplineProfile(samples.z, samples.radii[b])
    surface = SurfaceOfRevolution(Axis(samples.points[b], samples.directions[b]), profile)
    low, high = profile.z_range
    s = np.zeros(len(p))
    for _ in range(6):
        theta, rho, z = surface.cylindrical(p - s[:, None] * n)
        r, dr, _ = profile.derivatives(np.clip(z, low, high))
        rad = np.column_stack([np.cos(theta), np.sin(theta)]) @ surface.frame[:2]
        slope = -np.sum(n * rad, axis=1) + dr * (n @ surface.axis.direction)
        s = np.clip(s - (rho - r) / np.minimum(slope, -0.2), -1.5 * BEFORE, 1.5 * BEHIND)
    theta, rho, z = surface.cylindrical(p - s[:, None] * n)
    inset = RIM * (high - low)
    inside = np.clip(z, low, high)
    r, dr, ddr = profile.derivatives(inside)
    hit = (np.abs(rho - r) < 5e-4) & (s > -BEFORE) & (s < BEHIND)
    hit &= (z > low + inset) & (z < high - inset)
    g = surface.at(theta, inside)
    return (
        (g.p, g.n, g.k_theta, g.k_z, g.kappa_theta, g.kappa_z),
        (theta, inside, r, dr, ddr, hit.astype(np.float64)),
    )


def with_earlier(landed: Prospects, samples: SampledObjects, p_W: Array) -> PlacedTriples | None:
    """Triples of earlier contacts and candidates together, where that makes three, (B, N, 3).

    Args:
        p_W: Positions of the earlier contacts, (k, 3) [m].
    Returns:
        None unless k earlier contacts and the m new ones are three.
    """
    B, N, m = landed.theta.shape
    k = len(p_W)
    if k + m != 3:
        return None
    if k == 0:
        return landed.triples
    earlier = [_known_places(samples, b, p_W) for b in range(B)]
    columns = []
    for name, new in zip(PlacedTriples._fields, landed.triples, strict=True):
        known = np.array([getattr(places, name) for places in earlier])  # (B, k)
        columns.append(np.concatenate([np.repeat(known[:, None], N, axis=1), new], axis=-1))
    return PlacedTriples(*columns)


def _known_places(samples: SampledObjects, b: int, p_W: Array) -> PlacedTriples:
    profile = SplineProfile(samples.z, samples.radii[b])
    surface = SurfaceOfRevolution(Axis(samples.points[b], samples.directions[b]), profile)
    theta, _, z = surface.cylindrical(p_W)
    z = np.clip(z, *profile.z_range)
    return PlacedTriples(theta, z, *profile.derivatives(z))
