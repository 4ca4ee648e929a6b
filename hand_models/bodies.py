"""What a hand may meet, as convex parts, and how far a shape is from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import coal
import numpy as np
import pinocchio as pin


@dataclass(frozen=True, eq=False)
class Body:
    """Something a hand may meet, as convex parts.

    Args:
        name: As it is called in a sentence, e.g. "the object".
        parts: In the body's frame.
        X_WO: Pose of that frame in the world.
        around: A convex shape that holds all parts, to pass over what is far; None for one part.
        still: Whether it never moves: what is as still as it, an arm's root, cannot meet it.
    """

    name: str
    parts: tuple[coal.CollisionGeometry, ...]
    X_WO: pin.SE3
    around: coal.CollisionGeometry | None = None
    still: bool = False


def distance_from(
    shape: coal.CollisionGeometry,
    at: coal.Transform3s,
    parts: Sequence[coal.CollisionGeometry],
    there: coal.Transform3s,
) -> float:
    """Of a convex shape from the nearest of some parts, negative where they overlap [m]."""
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    nearest = np.inf
    for part in parts:
        result.clear()
        nearest = min(nearest, coal.distance(shape, at, part, there, request, result))
    return float(nearest)


def as_coal(X: pin.SE3) -> coal.Transform3s:
    """A pose as coal takes it."""
    return coal.Transform3s(X.rotation, X.translation)
