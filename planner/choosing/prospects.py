"""Where planned touches would land if the object were a little other than believed.

A plan is made for the believed object and carried out on the true one. Every candidate is
therefore followed along its approach to many objects drawn from the belief.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimator.belief import SampledObjects
from estimator.side_by_side import in_shares
from estimator.singular import PlacedTriples
from estimator.surface import Geometry, geometry_at
from estimator.vectors import Array, Mask
from planner.choosing.pad_shapes import PadShapes
from planner.choosing.sampled_surfaces import SampledSurfaces
from planner.kinematics.meeting import MET, fill_met
from planner.kinematics.meeting_domes import fill_met_by_domes

BEFORE, BEHIND = 0.030, 0.025  # how far an approach goes, about the expected contact [m]
STEPS = 6
EDGE = 1e-3  # radius that the rims of objects are taken to have [m]


@dataclass(frozen=True, eq=False)
class Prospects:
    """Touches of N candidates with m fingers on B sampled objects, arrays (B, N, m).

    Args:
        geometry: Exact surface geometry where each approach meets the object, (B, N * m).
        theta, z, r, dr, ddr: Places and profiles there; on a rim, slopes between the wall's and
            the flat end's, by which its parallel tells as much as any other.
        hit: Whether the approach meets wall or rim within its stroke.
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


def prospects(
    samples: SampledObjects,
    p_W: Array,
    n_W: Array,
    *,
    pad: float,
    shapes: PadShapes | None = None,
    behind: Array | float = BEHIND,
) -> Prospects:
    """Follow pads along -n to each sampled object.

    Args:
        p_W, n_W: Expected contacts and outward normals, (N, m, 3) [m], unit.
        pad: Radius of the pads; zero for points [m].
        shapes: Of pads that are domes; on rims they are taken for balls all the same.
        behind: How far the approaches go on behind the expected contacts, for all or (N, m) [m].
    """
    B, (N, m) = len(samples.points), p_W.shape[:2]
    surfaces = SampledSurfaces(samples)
    met = _met(surfaces, p_W.reshape(-1, 3), n_W.reshape(-1, 3), pad, shapes)
    s, theta, gap, height, dr, ddr = np.moveaxis(met, -1, 0)
    low, high = surfaces.profiles.z_range
    end = np.broadcast_to(behind, p_W.shape[:2]).ravel()
    hit = (gap < MET) & (s > -BEFORE) & (s < end) & (height >= low) & (height <= high)
    z = np.clip(height, low, high)
    places = (theta, z, surfaces.profiles.derivatives(z)[0], dr, ddr)
    geometry = surfaces.placed(geometry_at(*places))
    theta, z, r, dr, ddr = (x.reshape(B, N, m) for x in places)
    return Prospects(
        geometry, theta, z, r, dr, ddr, hit.reshape(B, N, m), samples.points, samples.directions
    )


def _met(
    surfaces: SampledSurfaces, p: Array, n: Array, pad: float, shapes: PadShapes | None
) -> Array:
    """What pads on lines p - s n (M, 3) meet, (B, M, 6) as `fill_met` has it."""
    objects, met = surfaces.objects, np.zeros((len(surfaces.objects.points), len(p), 6))
    z, pieces, origins = np.asarray(objects.z), surfaces.profiles.coefficients, objects.points
    lines = (np.ascontiguousarray(p), np.ascontiguousarray(n))
    range_s = np.array([-1.5 * BEFORE, 1.5 * BEHIND])

    def meet(part: slice) -> None:
        some = (z, pieces[part], origins[part], surfaces.frames[part], *lines)
        fill_met(*some, np.full(len(p), pad), range_s, STEPS, EDGE, met[part])
        if shapes is not None:
            domes = (shapes.balls.ravel(), shapes.spreads.reshape(-1, 3, 3))
            fill_met_by_domes(*some, *domes, shapes.spins.reshape(-1, 3), range_s, met[part])

    in_shares(meet, len(met))
    return met


def with_earlier(landed: Prospects, samples: SampledObjects, p_W: Array) -> PlacedTriples | None:
    """Triples of earlier contacts and candidates together, where that makes three, (B, N, 3).

    Args:
        p_W: Positions of the earlier contacts, (k, 3) [m].
    Returns:
        None unless k earlier contacts and the m new ones are three.
    """
    _, N, m = landed.theta.shape
    k = len(p_W)
    if k + m != 3:
        return None
    if k == 0:
        return landed.triples
    known = _known_places(SampledSurfaces(samples), p_W)
    columns = [
        np.concatenate([np.repeat(old[:, None], N, axis=1), new], axis=-1)
        for old, new in zip(known, landed.triples, strict=True)
    ]
    return PlacedTriples(*columns)


def _known_places(surfaces: SampledSurfaces, p_W: Array) -> PlacedTriples:
    """Places of contacts (k, 3) on each object, (B, k)."""
    theta, _, z = surfaces.cylindrical(p_W[None])
    z = np.clip(z, *surfaces.profiles.z_range)
    return PlacedTriples(theta, z, *surfaces.profiles.derivatives(z))
