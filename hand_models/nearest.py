"""The nearest that a moving hand comes to a body, without asking every link at every waypoint.

Idea: a ball around each link and a box around the body bound their distance from below, for all
waypoints at once. Exact distances are asked in the order of the bounds until no bound is left that
could beat the least one found: few of thousands.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from hand_models.batch import BatchPlacements, batch_placements
from hand_models.bodies import Body, as_coal, distance_from
from hand_models.collision import HandCollision, LinkPair

Array = NDArray[np.float64]


def nearest_on_way(
    collision: HandCollision,
    q: Array,
    bases: Sequence[pin.SE3],
    body: Body,
    touching: Sequence[Collection[str] | None],
) -> LinkPair | None:
    """The link, or pad, that comes nearest to a body on all of a way.

    Args:
        q: (K, nq) joint positions.
        bases: (K,) poses of the hand base.
        touching: At each waypoint the fingers whose pads do not count; None where the body does
            not count at all.
    Returns:
        None where it counts nowhere.
    """
    rows = [k for k, those in enumerate(touching) if those is not None]
    ids = collision.meeting(body)
    if not rows or not ids:
        return None
    shapes = [collision.shapes.model.geometryObjects[i] for i in ids]
    placed = batch_placements(collision.hand, q[rows])
    bounds = _bounds(shapes, placed, [bases[k] for k in rows], body)
    for i, row in enumerate(rows):
        exempt = collision.pads_of(touching[row] or ())
        bounds[i, [column for column, shape in enumerate(ids) if shape in exempt]] = np.inf
    least, nearest = np.inf, None
    for flat in np.argsort(bounds, axis=None):
        i, column = divmod(int(flat), len(ids))
        if not bounds[i, column] < least:
            break
        X_WJ = bases[rows[i]] * _joint(placed, i, int(shapes[column].parentJoint))
        distance = _distance_within(shapes[column], X_WJ, body, least)
        if distance < least:
            least, nearest = distance, ids[column]
    return None if nearest is None else LinkPair(collision.part(nearest), body.name, least)


def _bounds(
    shapes: Sequence[pin.GeometryObject],
    placed: BatchPlacements,
    bases: Sequence[pin.SE3],
    body: Body,
) -> Array:
    """No more than the distance of S shapes from a body, (K, S) [m]; minus infinity where they may
    overlap."""
    joints, centres, radii = _balls(shapes)
    R = np.array([X.rotation for X in bases])
    p = np.array([X.translation for X in bases])
    in_world = np.einsum("kij,kmj->kmi", R, placed.points(joints, centres)) + p[:, None]
    in_body = (in_world - body.X_WO.translation) @ body.X_WO.rotation
    parts = body.parts if body.around is None else (body.around,)
    gaps = np.min([_from_part(part, in_body) for part in parts], axis=0) - radii
    return np.where(gaps > 0.0, gaps, -np.inf)


def _balls(shapes: Sequence[pin.GeometryObject]) -> tuple[NDArray[np.int64], Array, Array]:
    """A ball around each shape: joint (S,), centre there (S, 3) and radius (S,) [m]."""
    for shape in shapes:
        shape.geometry.computeLocalAABB()
    return (
        np.array([int(shape.parentJoint) for shape in shapes]),
        np.array([shape.placement * shape.geometry.aabb_center for shape in shapes]),
        np.array([float(shape.geometry.aabb_radius) for shape in shapes]),
    )


def _joint(placed: BatchPlacements, row: int, joint: int) -> pin.SE3:
    return pin.SE3(placed.rotations[row, joint], placed.positions[row, joint])


def _distance_within(shape: pin.GeometryObject, X_WJ: pin.SE3, body: Body, most: float) -> float:
    """Of a shape from a body; or any bound that is not below `most`, where it is not either."""
    at, there = as_coal(X_WJ * shape.placement), as_coal(body.X_WO)
    if body.around is not None:
        bound = distance_from(shape.geometry, at, (body.around,), there)
        if bound >= most:
            return bound
    return distance_from(shape.geometry, at, body.parts, there)


def _from_part(part: coal.CollisionGeometry, points: Array) -> Array:
    """No more than the distance of points (..., 3) from a convex part, in its frame."""
    if isinstance(part, coal.Halfspace):
        return np.asarray(points @ part.n - part.d)
    part.computeLocalAABB()
    low, high = part.aabb_local.min_, part.aabb_local.max_
    outside = np.maximum(np.maximum(low - points, points - high), 0.0)
    return np.asarray(np.linalg.norm(outside, axis=-1))
