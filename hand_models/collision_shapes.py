"""A hand's convex shapes, and which of them could meet: what `hand_models.collision` asks about."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import combinations

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from hand_models.geometry import dome_in_joint, link_points, pad_in_joint, points_moved_by
from hand_models.hand import Finger, Hand, HandError

Array = NDArray[np.float64]

_ON_DOME = 1.5e-4  # points of a tip so far out of its dome are the dome's own [m]
_HULL_OPTIONS = "Qt"  # qhull must triangulate, or coal cuts faces of more than three corners short


class CollisionShapes:
    """Hulls and pads as one geometry model, and which of them meet what.

    Attributes:
        model: All shapes.
        outer: Ids of those that meet objects.
        inner: Ids of those that meet other links; of a pad whose link shows no mesh, itself.
        pads: Ids of the pads.
    """

    def __init__(self, hand: Hand) -> None:
        self.model = pin.GeometryModel()
        self.outer: list[int] = []
        self.inner: list[int] = []
        self.pads: list[int] = []
        whole = {self._add_link(hand, index) for index in range(hand.visual_model.ngeoms)}
        for finger in hand.fingers:
            self._add_pad(hand, finger, shown=pad_in_joint(hand, finger)[0] in whole)
        for i, j in _pairs(hand.model, self.model, self.inner):
            self.model.addCollisionPair(pin.CollisionPair(i, j))

    def _add_link(self, hand: Hand, index: int) -> int:
        """Adds one mesh; returns its joint if it shows a pad, else -1."""
        visual = hand.visual_model.geometryObjects[index]
        joint, points = int(visual.parentJoint), link_points(hand, index)
        inside = _inside_pads(hand, joint, points)
        outer = self._add_hull(visual, points[~inside])
        inner = self._add_hull(visual, points) if np.any(inside) else outer
        self.outer.extend(outer)
        self.inner.extend(inner)
        return joint if np.any(inside) and inner else -1

    def _add_hull(self, visual: pin.GeometryObject, points: Array) -> list[int]:
        if not _is_solid(points):
            return []
        name = f"{visual.name} {self.model.ngeoms}"
        return [_add(self.model, name, visual.parentJoint, visual.parentFrame, convex_hull(points))]

    def _add_pad(self, hand: Hand, finger: Finger, *, shown: bool) -> None:
        """A sphere; or a dome's front with what of its tip is there."""
        joint, _, normal = pad_in_joint(hand, finger)
        dome = dome_in_joint(hand, finger)
        at = pin.SE3(np.eye(3), dome.centre if dome.is_sphere else np.zeros(3))
        if dome.is_sphere:
            shape: coal.CollisionGeometry = coal.Sphere(dome.radius)
        else:
            tip = points_moved_by(hand, joint)
            front = dome.cap(normal) if len(tip) else dome.points
            shape = convex_hull(np.vstack([front, tip[dome.fronts(tip, normal, _ON_DOME)]]))
        pad = _add(self.model, f"pad of {finger.name}", joint, finger.tip_frame_id, shape, at)
        self.outer.append(pad)
        self.pads.append(pad)
        if not shown:
            self.inner.append(pad)


@lru_cache(maxsize=8)
def shapes_of(hand: Hand) -> CollisionShapes:
    """What takes tens of milliseconds and is only read afterwards."""
    return CollisionShapes(hand)


def _inside_pads(hand: Hand, joint: int, points: Array) -> NDArray[np.bool_]:
    """(N,) which of a joint's points are its pads' own."""
    inside = np.zeros(len(points), dtype=np.bool_)
    for finger in hand.fingers:
        at, _, normal = pad_in_joint(hand, finger)
        dome = dome_in_joint(hand, finger)
        if at != joint:
            continue
        if dome.is_sphere:
            inside |= np.linalg.norm(points - dome.centre, axis=1) <= 1.01 * dome.radius
        else:
            inside |= dome.fronts(points, normal, _ON_DOME)
    return inside


def _add(
    shapes: pin.GeometryModel,
    name: str,
    joint: int,
    frame: int,
    geometry: coal.CollisionGeometry,
    at: pin.SE3 | None = None,
) -> int:
    at = pin.SE3.Identity() if at is None else at
    shape = pin.GeometryObject(name, int(joint), int(frame), at, geometry)
    return int(shapes.addGeometryObject(shape))


def _pairs(
    model: pin.Model, shapes: pin.GeometryModel, ids: Sequence[int]
) -> list[tuple[int, int]]:
    """Pairs of shapes that are not neighbours in the chain of joints."""
    joints = {i: int(shapes.geometryObjects[i].parentJoint) for i in ids}

    def near(i: int, j: int) -> bool:
        """Whether j is i, its parent or its grandparent; the base has no parent but itself."""
        parent = int(model.parents[i]) if i else 0
        grandparent = int(model.parents[parent]) if parent else 0
        return j in (i, parent, grandparent)

    return [
        (i, j)
        for i, j in combinations(ids, 2)
        if not near(joints[i], joints[j]) and not near(joints[j], joints[i])
    ]


def _is_solid(points: Array) -> bool:
    return len(points) > 3 and np.linalg.matrix_rank(points[1:] - points[0], tol=1e-6) == 3


def convex_hull(points: Array) -> coal.ConvexBase:
    """Of points (N, 3).

    Raises:
        HandError: They are in one plane.
    """
    corners = coal.StdVec_Vec3s()
    for point in points:
        corners.append(point)
    try:
        return coal.Convex.convexHull(corners, True, _HULL_OPTIONS)
    except RuntimeError as error:
        raise HandError(f"no convex hull of {len(points)} points: {error}") from error
