"""A second opinion on collisions: the hand's own meshes, triangle by triangle.

The planner keeps convex hulls and pad spheres apart; here are the meshes as they come, and the
believed object as a lathe mesh. Nothing of the planner's shapes is used. Only yes or no: how far
apart triangles are would take a hundred times as long.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import combinations

import coal
import numpy as np
import pinocchio as pin

from estimator.surface import SurfaceOfRevolution
from estimator.vectors import Array
from hand_models.hand import Hand
from planner.motions.surroundings import Box
from sim_sensor.viewer.meshes import lathe_mesh

OBJECT = "the object"


class RawMeshes:
    """A hand's visual meshes about an object, boxes and a table, as triangles.

    Neighbours and their neighbours on the hand overlap at the joints by design and do not count.

    Args:
        table: Height of a table; None for none [m].
    """

    def __init__(
        self,
        hand: Hand,
        surface: SurfaceOfRevolution,
        boxes: Sequence[Box] = (),
        table: float | None = None,
    ) -> None:
        self.hand, self._data = hand, hand.model.createData()
        self._links = hand.visual_model.copy()
        for pair in _apart(hand):
            self._links.addCollisionPair(pin.CollisionPair(*pair))
        self._placed = pin.GeometryData(self._links)
        self._bodies = [(box.name, coal.Box(*box.size), box.pose) for box in boxes]
        if table is not None:
            ground = pin.SE3(np.eye(3), np.array([0.0, 0.0, table - 0.5]))
            self._bodies.append(("the table", coal.Box(4.0, 4.0, 1.0), ground))
        self._bodies.append((OBJECT, _triangles(surface), pin.SE3.Identity()))

    def meeting(
        self, q: Array, X_WB: pin.SE3, *, touching: Collection[str] | None = ()
    ) -> tuple[str, str] | None:
        """Two things that meet, or None.

        Args:
            touching: Fingers whose last links are at the object; None if it does not count.
        """
        model, links = self.hand.model, self._links
        if pin.computeCollisions(model, self._data, links, self._placed, q, True):
            pairs = zip(links.collisionPairs, self._placed.collisionResults, strict=True)
            first = next(pair for pair, result in pairs if result.isCollision())
            names = [links.geometryObjects[int(i)].name for i in (first.first, first.second)]
            return names[0], names[1]
        at_object = {self._tip_joint(name) for name in touching or ()}
        for name, body, pose in self._bodies:
            if name == OBJECT and touching is None:
                continue
            for i, shape in enumerate(links.geometryObjects):
                if name == OBJECT and int(shape.parentJoint) in at_object:
                    continue
                if _meet(shape.geometry, X_WB * self._placed.oMg[i], body, pose):
                    return shape.name, name
        return None

    def _tip_joint(self, finger: str) -> int:
        frame = self.hand.model.frames[self.hand.finger(finger).tip_frame_id]
        return int(frame.parentJoint)


def _meet(
    a: coal.CollisionGeometry, X_WA: pin.SE3, b: coal.CollisionGeometry, X_WB: pin.SE3
) -> bool:
    result = coal.CollisionResult()
    at, there = (coal.Transform3s(X.rotation, X.translation) for X in (X_WA, X_WB))
    return bool(coal.collide(a, at, b, there, coal.CollisionRequest(), result))


def _apart(hand: Hand) -> list[tuple[int, int]]:
    """Pairs of meshes that are no neighbours, nor their neighbours."""
    parents = [int(parent) for parent in hand.model.parents]
    joints = [int(shape.parentJoint) for shape in hand.visual_model.geometryObjects]
    near = [{j, parents[j], parents[parents[j]]} for j in joints]
    return [
        (i, k)
        for i, k in combinations(range(len(joints)), 2)
        if joints[i] not in near[k] and joints[k] not in near[i]
    ]


def _triangles(surface: SurfaceOfRevolution) -> coal.BVHModelOBBRSS:
    mesh, made = lathe_mesh(surface, rings=48, segments=48), coal.BVHModelOBBRSS()
    made.beginModel(len(mesh.faces), len(mesh.vertices))
    for face in mesh.faces:
        made.addTriangle(*(mesh.vertices[k] for k in face))
    made.endModel()
    return made
