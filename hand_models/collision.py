"""The final check: exact distances between convex hulls, by coal.

Every visual mesh is replaced by its convex hull. Towards an object every pad is its sphere, and
what a tip's mesh shows inside that sphere is dropped, so that a tip is round where it touches.
Towards other links a tip is its whole hull: a sphere that fits the front of a slim tip stands out
of its sides. The optimiser works on other shapes (`hand_models.spheres`), so this check is
independent of it.
"""

from __future__ import annotations

import warnings
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from hand_models.bodies import Body
from hand_models.collision_shapes import shapes_of
from hand_models.hand import Hand

Array = NDArray[np.float64]

_SIDES = 64  # of the polygon that stands for a parallel


@dataclass(frozen=True)
class LinkPair:
    """Two links and the distance between them, negative when they overlap [m]."""

    first: str
    second: str
    distance: float


@dataclass(frozen=True, eq=False)
class ObjectClearance:
    """Distances between a hand and an object, negative where they overlap.

    Attributes:
        links: Names of the links that have a shape, one per shape, pads left out.
        distances: Their distances [m].
        pads: (F,) distance of each finger's pad sphere; zero for a pad that touches [m].
    """

    links: tuple[str, ...]
    distances: Array
    pads: Array

    def nearest(self) -> tuple[str, float]:
        """Name and distance of the link nearest to the object, pads left out [m]."""
        i = int(np.argmin(self.distances))
        return self.links[i], float(self.distances[i])


class HandCollision:
    """Convex shapes of a hand, and the pairs of links that could meet.

    Links on one joint, parent and child, and grandparent and grandchild are not checked against
    each other: their hulls overlap at the joints by design.
    """

    def __init__(self, hand: Hand) -> None:
        self.hand = hand
        shapes = shapes_of(hand)
        self._shapes, self._outer, self._pad_ids = shapes.model, shapes.outer, shapes.pads
        self._data = hand.model.createData()
        self._shape_data = pin.GeometryData(self._shapes)
        _start_afresh(self._shape_data)
        self._geometries = [shape.geometry for shape in self._shapes.geometryObjects]
        self._roots = _roots(hand, self._shapes)
        self._placed: tuple[Array, list[coal.Transform3s]] | None = None

    def is_self_free(self, q: ArrayLike) -> bool:
        """Whether no two links overlap; stops at the first that do."""
        return not pin.computeCollisions(
            self.hand.model, self._data, self._shapes, self._shape_data, np.asarray(q), True
        )

    def self_collisions(self, q: ArrayLike, *, nearer_than: float = 0.0) -> tuple[LinkPair, ...]:
        """Pairs of links nearer to each other than that, nearest first [m]."""
        distances = self._self_distances(q)
        order = [int(k) for k in np.argsort(distances) if distances[k] < nearer_than]
        return tuple(self._named(k, float(distances[k])) for k in order)

    def self_clearance(self, q: ArrayLike) -> LinkPair:
        """The two links nearest to each other; none, infinitely far, where no two could meet."""
        distances = self._self_distances(q)
        if len(distances) == 0:
            return LinkPair("", "", np.inf)
        nearest = int(np.argmin(distances))
        return self._named(nearest, float(distances[nearest]))

    def object_clearance(
        self,
        q: ArrayLike,
        X_WB: pin.SE3,
        slices: Sequence[coal.CollisionGeometry],
        X_WO: pin.SE3,
    ) -> ObjectClearance:
        """Distances from every link to an object.

        Args:
            q: (nq,) joint positions.
            X_WB: Pose of the hand base.
            slices: Convex parts of the object in its frame O, e.g. from `revolved_slices`.
            X_WO: Pose of the object.
        """
        placed, there = self._placements(q), _transform(X_WB.inverse() * X_WO)
        links = [i for i in self._outer if i not in self._pad_ids]
        distances, pads = (
            np.array([self._distance(i, placed, slices, there) for i in ids])
            for ids in (links, self._pad_ids)
        )
        return ObjectClearance(tuple(self._link(i) for i in links), distances, pads)

    def nearest_to(
        self, q: ArrayLike, X_WB: pin.SE3, body: Body, *, touching: Collection[str] = ()
    ) -> LinkPair:
        """The link, or pad, nearest to a body.

        Args:
            q: (nq,) joint positions.
            X_WB: Pose of the hand base.
            body: The body.
            touching: Fingers whose pads do not count.
        """
        placed, there = self._placements(q), _transform(X_WB.inverse() * body.X_WO)
        pads = zip(self._pad_ids, self.hand.fingers, strict=True)
        exempt = {i for i, finger in pads if finger.name in touching}
        exempt |= self._roots if body.still else set()
        around = body.parts if body.around is None else (body.around,)
        bounds = [
            (self._distance(i, placed, around, there), i) for i in self._outer if i not in exempt
        ]
        least, nearest = min(bounds)
        if body.around is not None:
            least = np.inf
            for bound, i in sorted(bounds):
                if bound > least:
                    break
                exact = self._distance(i, placed, body.parts, there)
                least, nearest = min((least, nearest), (exact, i))
        return LinkPair(self._part(nearest), body.name, least)

    def root_in(self, body: Body) -> LinkPair | None:
        """What of an arm's root stands in a body, deepest; None where nothing does."""
        if not self._roots or self.hand.arm is None:
            return None
        placed, X_WA = self._placements(self.hand.home), self.hand.arm.X_WA
        there = _transform(X_WA.inverse() * body.X_WO)
        depth, link = min((self._distance(i, placed, body.parts, there), i) for i in self._roots)
        return LinkPair(self._link(link), body.name, depth) if depth < 0.0 else None

    def _placements(self, q: ArrayLike) -> list[coal.Transform3s]:
        """Where each shape is in B; kept until the joints move."""
        q = np.array(q, dtype=np.float64)
        if self._placed is None or not np.array_equal(q, self._placed[0]):
            pin.updateGeometryPlacements(
                self.hand.model, self._data, self._shapes, self._shape_data, q
            )
            self._placed = (q, [_transform(X) for X in self._shape_data.oMg])
        return self._placed[1]

    def _distance(
        self,
        shape: int,
        placed: list[coal.Transform3s],
        parts: Sequence[coal.CollisionGeometry],
        there: coal.Transform3s,
    ) -> float:
        geometry, at = self._geometries[shape], placed[shape]
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        nearest = np.inf
        for part in parts:
            result.clear()
            nearest = min(nearest, coal.distance(geometry, at, part, there, request, result))
        return float(nearest)

    def _self_distances(self, q: ArrayLike) -> Array:
        pin.computeDistances(
            self.hand.model, self._data, self._shapes, self._shape_data, np.asarray(q)
        )
        return np.array([result.min_distance for result in self._shape_data.distanceResults])

    def _named(self, pair: int, distance: float) -> LinkPair:
        ids = self._shapes.collisionPairs[pair]
        return LinkPair(self._link(int(ids.first)), self._link(int(ids.second)), distance)

    def _part(self, shape: int) -> str:
        """A pad by its finger, another shape by its link."""
        if shape in self._pad_ids:
            return f"the pad of {self.hand.fingers[self._pad_ids.index(shape)].name}"
        return self._link(shape)

    def _link(self, shape: int) -> str:
        frame = self._shapes.geometryObjects[shape].parentFrame
        return str(self.hand.model.frames[frame].name)


def revolved_slices(z: ArrayLike, r: ArrayLike) -> tuple[coal.ConvexBase, ...]:
    """A surface of revolution as convex slices, one between each two heights, axis along +z.

    A slice is a frustum with 64 sides, half outside and half inside the true parallel: off by
    at most 0.06 % of the radius. Between heights the profile is taken as straight.

    Args:
        z: (K,) ascending heights, at least two [m].
        r: (K,) radii, positive [m].

    Raises:
        ValueError: Heights not ascending, radii not positive, or of other shapes.
    """
    z, r = np.asarray(z, dtype=np.float64), np.asarray(r, dtype=np.float64)
    if z.ndim != 1 or z.shape != r.shape or len(z) < 2:
        raise ValueError(f"z and r must be of one shape (K,), K >= 2, got {z.shape} and {r.shape}")
    if not (np.all(np.diff(z) > 0.0) and np.all(r > 0.0) and np.isfinite(z).all()):
        raise ValueError("z must be ascending and finite, and r positive")
    angle = np.linspace(0.0, 2.0 * np.pi, _SIDES, endpoint=False)
    reach = 0.5 * (1.0 + 1.0 / np.cos(np.pi / _SIDES))  # between in- and circumscribed
    circle = reach * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    rings = [np.column_stack([a * circle, np.full(_SIDES, b)]) for a, b in zip(r, z, strict=True)]
    return tuple(_frustum(np.vstack(pair)) for pair in pairwise(rings))


def _frustum(corners: Array) -> coal.ConvexBase:
    """Of a lower and an upper ring; ten times faster than to search its hull."""
    points = coal.StdVec_Vec3s()
    points.extend(corners)
    return coal.Convex(points, _frustum_faces())


@lru_cache(maxsize=1)
def _frustum_faces() -> coal.StdVec_Triangle:
    """Corners of its triangles: the sides, the lower end, the upper end; normals outward."""
    faces, n = coal.StdVec_Triangle(), _SIDES
    for i, j in ((i, (i + 1) % n) for i in range(n)):
        faces.append(coal.Triangle(i, j, n + i))
        faces.append(coal.Triangle(j, n + j, n + i))
    for i in range(1, n - 1):
        faces.append(coal.Triangle(0, i + 1, i))
        faces.append(coal.Triangle(n, n + i, n + i + 1))
    return faces


def _roots(hand: Hand, shapes: pin.GeometryModel) -> set[int]:
    """Shapes that no joint moves: those of an arm's root; the base of a hand alone moves."""
    if hand.arm is None:
        return set()
    return {i for i, shape in enumerate(shapes.geometryObjects) if int(shape.parentJoint) == 0}


def _start_afresh(data: pin.GeometryData) -> None:
    """Every query from scratch: Pinocchio's default starts from the last answer, and so misses
    deep overlaps of round hulls, one posture in two thousand on the Allegro hand."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # the old switch overrules the new one
        for requests in (data.collisionRequests, data.distanceRequests):
            for request in requests:
                request.enable_cached_gjk_guess = False
                request.gjk_initial_guess = coal.GJKInitialGuess.DefaultGuess


def _transform(X: pin.SE3) -> coal.Transform3s:
    return coal.Transform3s(X.rotation, X.translation)
