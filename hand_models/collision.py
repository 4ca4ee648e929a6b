"""The final check: exact distances between convex hulls, by coal.

Every visual mesh is replaced by its convex hull. Towards an object every pad is its sphere or the
front of its dome, and what a tip's mesh shows in there is dropped, so that a tip is round where it
touches.
Towards other links a tip is its whole hull: a sphere that fits the front of a slim tip stands out
of its sides. The optimiser works on other shapes (`hand_models.spheres`), so this check is
independent of it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from hand_models.bodies import Body, as_coal, distance_from
from hand_models.broadphase import Among, ShapeTree, start_afresh
from hand_models.collision_shapes import shapes_of
from hand_models.hand import Hand

Array = NDArray[np.float64]

NEAR = (8e-3, 20e-3, 50e-3)  # pairs of links as near as this are sought first [m]
NO_MISS = 1e-3  # margin with which the tree of boxes finds every pair that overlaps [m]


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
        self.shapes = shapes_of(hand)
        self._data = hand.model.createData()
        self._shape_data = pin.GeometryData(self.shapes.model)
        start_afresh(self._shape_data)
        self._geometries = [shape.geometry for shape in self.shapes.model.geometryObjects]
        self._roots = _roots(hand, self.shapes.model)
        self._trees: dict[float, ShapeTree] = {}
        self._placed: tuple[Array, list[coal.Transform3s]] | None = None

    def is_self_free(self, q: ArrayLike) -> bool:
        """Whether no two links overlap, by the distances of those that are near."""
        return all(distance > 0.0 for distance in self._tree(NO_MISS).near(q).values())

    def among(self, bodies: Iterable[tuple[Body, float]]) -> Among:
        """The same together with bodies, each with how far to keep away from it [m]."""
        told = ((body, self.meeting(body), margin) for body, margin in bodies)
        return Among(self.hand, self.shapes, told)

    def self_collisions(self, q: ArrayLike, *, nearer_than: float = 0.0) -> tuple[LinkPair, ...]:
        """Pairs of links nearer to each other than that, nearest first [m]."""
        distances = self._self_distances(q)
        order = [int(k) for k in np.argsort(distances) if distances[k] < nearer_than]
        return tuple(self._named(k, float(distances[k])) for k in order)

    def self_clearance(self, q: ArrayLike) -> LinkPair:
        """The two links nearest to each other; none, infinitely far, where no two could meet."""
        return self.nearest_links([np.asarray(q, dtype=np.float64)])

    def nearest_links(self, postures: Iterable[Array]) -> LinkPair:
        """The two links that come nearest to each other in any of some postures (nq,)."""
        least, nearest = np.inf, -1
        for q in postures:
            for pair, distance in self._near_pairs(q, least).items():
                if distance < least:
                    least, nearest = distance, pair
        return LinkPair("", "", np.inf) if nearest < 0 else self._named(nearest, least)

    def _near_pairs(self, q: Array, most: float) -> dict[int, float]:
        """Pairs of links and their distances: all that are nearer than `most`, and others."""
        for margin in NEAR:
            if most <= margin or most == np.inf:
                found = self._tree(margin).near(q)
                if found or most <= margin:
                    return found
        return dict(enumerate(self._self_distances(q).tolist()))

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
        placed, there = self._placements(q), as_coal(X_WB.inverse() * X_WO)
        links = [i for i in self.shapes.outer if i not in self.shapes.pads]
        distances, pads = (
            np.array([distance_from(self._geometries[i], placed[i], slices, there) for i in ids])
            for ids in (links, self.shapes.pads)
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
        placed, there = self._placements(q), as_coal(X_WB.inverse() * body.X_WO)
        exempt = self.pads_of(touching)
        around = body.parts if body.around is None else (body.around,)
        bounds = [
            (distance_from(self._geometries[i], placed[i], around, there), i)
            for i in self.meeting(body)
            if i not in exempt
        ]
        least, nearest = min(bounds)
        if body.around is not None:
            least = np.inf
            for bound, i in sorted(bounds):
                if bound > least:
                    break
                exact = distance_from(self._geometries[i], placed[i], body.parts, there)
                least, nearest = min((least, nearest), (exact, i))
        return LinkPair(self.part(nearest), body.name, least)

    def meeting(self, body: Body) -> list[int]:
        """Shapes that may meet a body: an arm's root cannot, where both are still."""
        return [i for i in self.shapes.outer if not (body.still and i in self._roots)]

    def pads_of(self, fingers: Collection[str]) -> set[int]:
        """The shapes that are these fingers' pads."""
        pads = zip(self.shapes.pads, self.hand.fingers, strict=True)
        return {i for i, finger in pads if finger.name in fingers}

    def root_in(self, body: Body) -> LinkPair | None:
        """What of an arm's root stands in a body, deepest; None where nothing does."""
        if not self._roots or self.hand.arm is None:
            return None
        placed, X_WA = self._placements(self.hand.home), self.hand.arm.X_WA
        there = as_coal(X_WA.inverse() * body.X_WO)
        depth, link = min(
            (distance_from(self._geometries[i], placed[i], body.parts, there), i)
            for i in self._roots
        )
        return LinkPair(self._link(link), body.name, depth) if depth < 0.0 else None

    def _placements(self, q: ArrayLike) -> list[coal.Transform3s]:
        """Where each shape is in B; kept until the joints move."""
        q = np.array(q, dtype=np.float64)
        if self._placed is None or not np.array_equal(q, self._placed[0]):
            pin.updateGeometryPlacements(
                self.hand.model, self._data, self.shapes.model, self._shape_data, q
            )
            self._placed = (q, [as_coal(X) for X in self._shape_data.oMg])
        return self._placed[1]

    def _tree(self, margin: float) -> ShapeTree:
        if margin not in self._trees:
            margins = [margin] * len(self.shapes.model.collisionPairs)
            self._trees[margin] = ShapeTree(self.hand.model, self.shapes.model, margins)
        return self._trees[margin]

    def _self_distances(self, q: ArrayLike) -> Array:
        pin.computeDistances(
            self.hand.model, self._data, self.shapes.model, self._shape_data, np.asarray(q)
        )
        return np.array([result.min_distance for result in self._shape_data.distanceResults])

    def _named(self, pair: int, distance: float) -> LinkPair:
        ids = self.shapes.model.collisionPairs[pair]
        return LinkPair(self._link(int(ids.first)), self._link(int(ids.second)), distance)

    def part(self, shape: int) -> str:
        """A pad by its finger, another shape by its link."""
        if shape in self.shapes.pads:
            return f"the pad of {self.hand.fingers[self.shapes.pads.index(shape)].name}"
        return self._link(shape)

    def _link(self, shape: int) -> str:
        frame = self.shapes.model.geometryObjects[shape].parentFrame
        return str(self.hand.model.frames[frame].name)


def _roots(hand: Hand, shapes: pin.GeometryModel) -> set[int]:
    """Shapes that no joint moves: those of an arm's root; the base of a hand alone moves."""
    if hand.arm is None:
        return set()
    return {i for i, shape in enumerate(shapes.geometryObjects) if int(shape.parentJoint) == 0}
