"""Triangles for the page: the true object, the tube of a believed axis, the links of a hand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from estimator.surface import SurfaceOfRevolution
from estimator.vectors import Array, basis_across, frozen
from hand_models.geometry import vertices
from sim_sensor.scanned import wall_points
from sim_sensor.viewer.episode import CHI2_95_OF_2, BelievedAxis

LARGEST_TUBE = 0.09  # wider would hide everything else [m]


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles.

    Args:
        vertices: Shape (V, 3) [m].
        faces: Indices of vertices, shape (F, 3).
    """

    vertices: Array
    faces: NDArray[np.int64]


def lathe_mesh(surface: SurfaceOfRevolution, *, rings: int = 64, segments: int = 64) -> Mesh:
    """The true object with its two caps, in the world."""
    z = np.linspace(*surface.profile.z_range, rings)
    theta = np.linspace(0.0, 2.0 * np.pi, segments, endpoint=False)
    wall = wall_points(surface, theta, z[:, None]).reshape(-1, 3)
    ends = surface.axis.point + np.outer(z[[0, -1]], surface.axis.direction)
    around = np.arange(segments)
    nxt = np.roll(around, -1)
    bottom, top = rings * segments, rings * segments + 1
    last = (rings - 1) * segments
    caps = [
        np.stack([np.full(segments, bottom), nxt, around], axis=1),
        np.stack([np.full(segments, top), last + around, last + nxt], axis=1),
    ]
    return Mesh(frozen(np.vstack([wall, ends])), np.vstack([_ring_faces(rings, segments), *caps]))


def tube_mesh(
    belief: BelievedAxis, along: tuple[float, float], *, rings: int = 33, segments: int = 32
) -> Mesh:
    """Where the axis passes with 95 % probability at each height: an elliptic tube.

    Each ring is the 95 % ellipse of the axis's place across itself at that height; it is widest
    far from where the axis was touched. Radii above `LARGEST_TUBE` are drawn with that.

    Args:
        along: Lengths from `axis.point` where the tube begins and ends [m].
    """
    s = np.linspace(*along, rings)
    variance, across = np.linalg.eigh(belief.covariance_across(s))
    radii = np.minimum(np.sqrt(CHI2_95_OF_2 * np.maximum(variance, 0.0)), LARGEST_TUBE)
    theta = np.linspace(0.0, 2.0 * np.pi, segments, endpoint=False)
    circle = np.stack([np.cos(theta), np.sin(theta)])
    # the symmetric root, so that rings do not twist against each other
    ellipses = (across * radii[:, None, :]) @ np.swapaxes(across, 1, 2) @ circle
    u = belief.axis.direction
    middles = belief.axis.point + np.outer(s, u)
    vertices = middles[:, None] + np.swapaxes(ellipses, 1, 2) @ basis_across(u)
    return Mesh(frozen(vertices.reshape(-1, 3)), _ring_faces(rings, segments))


def link_mesh(geometry: pin.GeometryObject) -> Mesh:
    """Triangles of a link's shape in its own frame; of a primitive's convex hull."""
    shape = geometry.geometry
    if not hasattr(shape, "tri_indices"):
        return hull_mesh(vertices(shape))
    triangles = (shape.tri_indices(i) for i in range(shape.num_tris))
    faces = np.array([[t[0], t[1], t[2]] for t in triangles], dtype=np.int64)
    return Mesh(frozen(shape.vertices()), faces.reshape(-1, 3))


def hull_mesh(points: Array) -> Mesh:
    """The hull's triangles, all turned outwards."""
    hull = ConvexHull(points)
    corners = points[hull.simplices]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = np.einsum("fi,fi->f", normals, hull.equations[:, :3]) < 0.0
    faces = np.where(inward[:, None], hull.simplices[:, ::-1], hull.simplices)
    return Mesh(frozen(points), faces.astype(np.int64))


def _ring_faces(rings: int, segments: int) -> NDArray[np.int64]:
    """Two triangles for each cell between neighbouring rings."""
    ring, a = np.meshgrid(np.arange(rings - 1), np.arange(segments), indexing="ij")
    b = np.roll(a, -1, axis=1)
    p, q = ring * segments + a, ring * segments + b
    r, s = p + segments, q + segments
    return np.stack([p, q, s, p, s, r], axis=-1).reshape(-1, 3)
