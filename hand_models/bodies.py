"""What a hand may meet, as convex parts."""

from __future__ import annotations

from dataclasses import dataclass

import coal
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
