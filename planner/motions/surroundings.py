"""What a moving hand must not meet: the believed object, the table, boxes, and itself."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass

import coal
import numpy as np
import pinocchio as pin

from hand_models.bodies import Body
from hand_models.broadphase import Among
from hand_models.collision import HandCollision, LinkPair
from hand_models.nearest import nearest_on_way
from hand_models.slices import revolved_slices
from planner.motions.trajectory import Array
from planner.reaching.solid import RevolvedSolid

OBJECT, ITSELF = "the object", "itself"
ROOM = 3e-3  # from table and boxes in free space: half of what is between waypoints, and more [m]
_WIDER = 1.01  # than the object is what is around it [-]


@dataclass(frozen=True)
class Box:
    """An obstacle. Compares by value.

    Args:
        centre: In the world [m].
        size: Its edges [m].
        quaternion_xyzw: Its orientation.
        name: As it is called in a sentence.
    Raises:
        ValueError: An edge that is not positive, or a quaternion that is not of unit length.
    """

    centre: tuple[float, float, float]
    size: tuple[float, float, float]
    quaternion_xyzw: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    name: str = "a box"

    def __post_init__(self) -> None:
        if not np.all(np.isfinite(self.centre)):
            raise ValueError(f"{self.name}: centre must be finite, got {self.centre}")
        if not (np.all(np.isfinite(self.size)) and min(self.size) > 0.0):
            raise ValueError(f"{self.name}: expected three edges > 0 m, got {self.size}")
        if not abs(np.linalg.norm(self.quaternion_xyzw) - 1.0) < 1e-6:
            raise ValueError(f"{self.name}: expected a unit quaternion, {self.quaternion_xyzw}")

    @property
    def pose(self) -> pin.SE3:
        """Of its centre."""
        x, y, z, w = self.quaternion_xyzw
        return pin.SE3(pin.Quaternion(w, x, y, z).matrix(), np.array(self.centre))


@dataclass(frozen=True, eq=False)
class Surroundings:
    """A hand's links and what stands about it.

    Args:
        collision: The hand's convex shapes.
        object: The believed object.
        fixed: Table and boxes, whose place is known.
    """

    collision: HandCollision
    object: Body
    fixed: tuple[Body, ...] = ()

    def pairs(self, q: Array, X_WB: pin.SE3) -> Iterator[tuple[str, LinkPair]]:
        """The nearest pair with each thing: `ITSELF`, and each body."""
        yield ITSELF, self.collision.self_clearance(q)
        for body in (*self.fixed, self.object):
            yield body.name, self.collision.nearest_to(q, X_WB, body)

    def keeping(self, margin: float) -> Among:
        """What says at once whether all keeps `ROOM` from table and boxes, and so far from the
        object [m]."""
        return self.collision.among([*((body, ROOM) for body in self.fixed), (self.object, margin)])

    def nearest(
        self, q: Array, bases: Sequence[pin.SE3], touching: Sequence[Collection[str] | None]
    ) -> dict[str, LinkPair]:
        """The smallest distance to each thing over all waypoints, with the names.

        Args:
            q, bases: (K, nq) joints and K poses of the base.
            touching: At each, fingers whose pads may touch the object; None if it does not count.
        """
        moved = np.append(True, np.any(np.diff(q, axis=0) != 0.0, axis=1))
        found = [(ITSELF, self.collision.nearest_links(q[moved]))]
        nobody: list[Collection[str]] = [()] * len(q)
        for body, those in [*((body, nobody) for body in self.fixed), (self.object, touching)]:
            pair = nearest_on_way(self.collision, q, bases, body, those)
            if pair is not None:
                found.append((body.name, pair))
        return smallest(found)


def smallest(found: Iterable[tuple[str, LinkPair]]) -> dict[str, LinkPair]:
    """The nearest pair of each name: two boxes may have one."""
    nearest: dict[str, LinkPair] = {}
    for thing, pair in found:
        if thing not in nearest or pair.distance < nearest[thing].distance:
            nearest[thing] = pair
    return nearest


def surroundings(
    collision: HandCollision,
    solid: RevolvedSolid,
    table: tuple[float, float, float, float] | None = None,
    boxes: tuple[Box, ...] = (),
) -> Surroundings:
    """The believed object, and what stands about it.

    Args:
        table: (a, b, c, h): below a x + b y + c z = h is the table; None for none.
        boxes: Other obstacles.
    """
    return Surroundings(collision, object_body(solid), fixed_bodies(table, boxes))


def fixed_bodies(
    table: tuple[float, float, float, float] | None, boxes: tuple[Box, ...]
) -> tuple[Body, ...]:
    """Table and boxes, which stand as still as the root of an arm does."""
    fixed = [Body(box.name, (coal.Box(*box.size),), box.pose, still=True) for box in boxes]
    if table is not None:
        below = coal.Halfspace(np.array(table[:3]), table[3])
        fixed.insert(0, Body("the table", (below,), pin.SE3.Identity(), still=True))
    return tuple(fixed)


def object_body(solid: RevolvedSolid) -> Body:
    """The believed object, with the cylinder around it."""
    (tube,) = revolved_slices(solid.z[[0, -1]], np.full(2, _WIDER * float(solid.r.max())))
    return Body(OBJECT, solid.slices, solid.X_WO, tube)
