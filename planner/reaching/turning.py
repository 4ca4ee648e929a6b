"""Placements on a surface of revolution turned about its axis, which changes nothing but the room.

What the fingers reach of the object stays the same; where the base is, and whether links are in
the table or a box, does not. So of all turns that one is taken which the room leaves free and the
base's workspace is nearest to.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.side_by_side import in_shares
from estimator.surface import SurfaceOfRevolution
from estimator.vectors import Array, Mask
from hand_models.batch import batch_placements
from hand_models.hand import Hand
from hand_models.spheres import LinkSpheres
from planner.motions.surroundings import Box
from planner.reaching.clear import INTRUSION

Plane = tuple[float, float, float, float]


@dataclass(frozen=True)
class Room:
    """What stands about the object.

    Args:
        table: (a, b, c, h): below a x + b y + c z = h is the table; None for none.
        boxes: Other obstacles.
    """

    table: Plane | None = None
    boxes: tuple[Box, ...] = ()

    @property
    def is_empty(self) -> bool:
        return self.table is None and not self.boxes

    def distance(self, points: Array) -> Array:
        """Of points (..., 3) from the nearest thing, negative within; infinite in an empty room."""
        things = [np.full(points.shape[:-1], np.inf)]
        if self.table is not None:
            things.append(points @ np.array(self.table[:3]) - self.table[3])
        for box in self.boxes:
            local = (points - box.pose.translation) @ box.pose.rotation
            beyond = np.abs(local) - 0.5 * np.array(box.size)
            outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=-1)
            things.append(outside + np.minimum(beyond.max(axis=-1), 0.0))
        return np.asarray(np.min(things, axis=0))


def evenly(count: int) -> Array:
    """(count,) turns about the axis; the first is none [rad]."""
    return np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)


def turned(
    surface: SurfaceOfRevolution, R_OB: Array, p_OB: Array, angles: Array
) -> tuple[Array, Array]:
    """Poses of the base in the world after each turn, (T, N, 3, 3), (T, N, 3)."""
    turns = Rotation.from_rotvec(angles[:, None] * [0.0, 0.0, 1.0]).as_matrix()
    R_WO = np.einsum("ji,tjk->tik", surface.frame, turns)
    R_WB = np.einsum("tij,njk->tnik", R_WO, R_OB)
    return R_WB, surface.axis.point + np.einsum("tij,nj->tni", R_WO, p_OB)


def clear_turns(
    room: Room, hand: Hand, spheres: LinkSpheres, q: Array, R_WB: Array, p_WB: Array
) -> Mask:
    """Which of N postures at T poses each keep their link spheres out of table and boxes, (T, N).

    Coarsely: by all but `INTRUSION`, which reach will remove.

    Args:
        q, R_WB, p_WB: (N, nq), (T, N, 3, 3), (T, N, 3).
    """
    if room.is_empty:
        return np.ones(p_WB.shape[:2], dtype=np.bool_)
    local = spheres.positions(batch_placements(hand, q))
    clear = np.empty(p_WB.shape[:2], dtype=np.bool_)

    def look(turns: slice) -> None:
        for t in range(turns.start, turns.stop):
            centres = np.einsum("nij,nmj->nmi", R_WB[t], local, optimize=True) + p_WB[t][:, None]
            clear[t] = np.all(room.distance(centres) > spheres.radii - INTRUSION, axis=1)

    in_shares(look, len(clear))
    return clear
