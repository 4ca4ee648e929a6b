"""Links as unions of spheres: what an optimiser can keep out of an object smoothly.

Each link's convex hull is covered by spheres inside it, grown by an overhang. A sphere whose
centre lies at depth d below the hull's nearest face gets radius d + overhang; points of the hull's
surface are covered when they are less than the slack outside a sphere. Centres are chosen greedily
from a grid, the points that few spheres can cover (edges, corners) first, and then thinned.
Both errors are therefore bounded by construction: the spheres stand out by at most the overhang,
and the hull stands out of the spheres by at most the slack (up to
0.5 mm more between the sampled points). Only beside a pad the overhang gives way, so that it is
the pad that touches a plane in front of it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull
from scipy.spatial.distance import cdist

from hand_models.batch import BatchPlacements, IntArray
from hand_models.cache import cached_arrays, hand_fingerprint
from hand_models.dome import CONE, Dome, directions_about
from hand_models.geometry import dome_in_joint, link_points, pad_in_joint
from hand_models.hand import Hand

Array = NDArray[np.float64]

_GRID = 4e-3  # between candidate centres [m]
_SAMPLE = 2.5e-3  # mean distance of the surface points to be covered [m]
_THINNEST = 2e-3  # a centre is at least this deep in its link [m]
_FRONT = np.radians(20.0)  # about a pad's normal, where no overhang may stand before the pad
_FRONTS = 300  # directions in which a sphere has to stay behind a dome, ...
_BEHIND = 5e-4  # ... by so much [m]
_VERSION = 5  # of the algorithm; part of the cache's key
_FIELDS = ("joints", "centres", "radii", "link_indices", "finger_indices", "is_pad")


@dataclass(frozen=True, eq=False)
class LinkSpheres:
    """Spheres that cover a hand's links, fixed in its joints' frames.

    Attributes:
        joints: (M,) joint that moves the sphere; 0 is the hand base.
        centres: (M, 3) in that joint's frame [m].
        radii: (M,) [m].
        links: M names of the links (frames) covered.
        finger_indices: (M,) which of the hand's fingers has its pad on the same joint, else -1.
        is_pad: (M,) whether the sphere is a pad, or stands for one that is a dome.
        overhang: Largest distance by which a sphere stands out of its link's hull [m].
        slack: Largest distance by which a hull stands out of the spheres [m].
    """

    joints: IntArray
    centres: Array
    radii: Array
    links: tuple[str, ...]
    finger_indices: IntArray
    is_pad: NDArray[np.bool_]
    overhang: float
    slack: float

    def positions(self, placements: BatchPlacements) -> Array:
        """(N, M, 3) centres in the hand base frame B for N configurations [m]."""
        return placements.points(self.joints, self.centres)


def link_spheres(hand: Hand, *, overhang: float = 3e-3, slack: float = 2e-3) -> LinkSpheres:
    """Cover the hand's visual meshes by spheres; kept in the cache, see `hand_models.cache`.

    An arm that carries the hand is not covered.

    Args:
        overhang: How far a sphere may stand out of its link [m].
        slack: How far a link may stand out of its spheres [m]. Their sum sets the count: about
            370 spheres for the Allegro hand at 3 + 2 mm, 600 at 2 + 2 mm.
    """
    if hand.arm is not None:
        return _of_hand_on_arm(hand, link_spheres(hand.arm.hand, overhang=overhang, slack=slack))
    key = hand_fingerprint(hand, "spheres", _VERSION, overhang, slack)
    arrays = cached_arrays(f"spheres-{key}", _FIELDS, lambda: _cover_hand(hand, overhang, slack))
    for array in arrays.values():
        array.setflags(write=False)
    names = [frame.name for frame in hand.model.frames]
    return LinkSpheres(
        joints=arrays["joints"].astype(np.int64),
        centres=arrays["centres"].astype(np.float64),
        radii=arrays["radii"].astype(np.float64),
        links=tuple(names[int(i)] for i in arrays["link_indices"]),
        finger_indices=arrays["finger_indices"].astype(np.int64),
        is_pad=arrays["is_pad"].astype(np.bool_),
        overhang=overhang,
        slack=slack,
    )


def _of_hand_on_arm(hand: Hand, alone: LinkSpheres) -> LinkSpheres:
    """The spheres of the hand alone, on the joints of the whole; the arm itself has none.

    It is long and rarely near: the final check on hulls sees it.
    """
    assert hand.arm is not None
    names = list(hand.arm.hand.model.names)
    flange = hand.arm.model.frames[hand.arm.flange_id]
    X_JB = flange.placement * hand.arm.X_FB  # hand base in the arm's last joint
    last = hand.model.getJointId(hand.arm.model.names[flange.parentJoint])
    joints = [int(hand.model.getJointId(names[j])) if j else int(last) for j in alone.joints]
    centres = alone.centres.copy()
    on_base = alone.joints == 0
    centres[on_base] = centres[on_base] @ X_JB.rotation.T + X_JB.translation
    centres.setflags(write=False)
    return replace(alone, joints=np.array(joints, dtype=np.int64), centres=centres)


def _cover_hand(hand: Hand, overhang: float, slack: float) -> dict[str, NDArray[np.generic]]:
    pads: dict[int, _Pad] = {}
    columns: list[tuple[int, Array, float, int, int, bool]] = []
    for i, finger in enumerate(hand.fingers):
        joint, centre, normal = pad_in_joint(hand, finger)
        pads[joint] = _Pad(i, dome_in_joint(hand, finger), normal)
        columns.append((joint, centre, finger.pad_radius, finger.tip_frame_id, i, True))
    done: dict[bytes, tuple[Array, Array]] = {}  # fingers repeat the same links
    for index, shape in enumerate(hand.visual_model.geometryObjects):
        joint, points = int(shape.parentJoint), link_points(hand, index)
        pad = pads.get(joint)
        key = points.tobytes() + (b"" if pad is None else pad.key)
        if key not in done:
            done[key] = _cover_link(points, overhang, slack, pad)
        for centre, radius in zip(*done[key], strict=True):
            finger_index = -1 if pad is None else pad.finger_index
            columns.append(
                (joint, centre, float(radius), int(shape.parentFrame), finger_index, False)
            )
    joints, centres, radii, links, fingers, is_pad = zip(*columns, strict=True)
    values = (joints, np.vstack(centres), radii, links, fingers, is_pad)
    return {name: np.asarray(value) for name, value in zip(_FIELDS, values, strict=True)}


@dataclass(frozen=True, eq=False)
class _Pad:
    """A pad in its joint's frame."""

    finger_index: int
    dome: Dome
    normal: Array

    @property
    def key(self) -> bytes:
        """All that a cover depends on."""
        radius, axes = np.array([self.dome.radius]), self.dome.axes
        return b"".join(x.tobytes() for x in (self.dome.centre, axes, radius, self.normal))

    def covers(self, points: Array, slack: float) -> NDArray[np.bool_]:
        """Which points are left to the pad's own sphere; a dome's tip is covered like any link."""
        off = np.linalg.norm(points - self.dome.centre, axis=1)
        return np.asarray((off <= self.dome.radius + slack) & self.dome.is_sphere)

    def bounded(self, radii: Array, centres: Array, depth: Array) -> Array:
        """Radii no larger than lets spheres stay behind the planes that the pad is to touch.

        Args:
            depth: Of the centres in their link [m].
        """
        if self.dome.is_sphere:
            return np.minimum(radii, np.maximum(depth, self._room(centres)))
        u = directions_about(self.normal, CONE, _FRONTS)
        room = (self.dome.heights(u) - centres @ u.T).min(axis=1)
        return np.asarray(np.clip(room - _BEHIND, 1e-4, radii))

    def _room(self, points: Array) -> Array:
        """Of spheres behind the planes that a ball touches within a cone about its normal."""
        offset = points - self.dome.centre
        length = np.maximum(np.linalg.norm(offset, axis=1), 1e-9)
        angle = np.arccos(np.clip(offset @ self.normal / length, -1.0, 1.0))
        return np.asarray(self.dome.radius - length * np.cos(np.maximum(angle - _FRONT, 0.0)))


def _cover_link(
    points: Array, overhang: float, slack: float, pad: _Pad | None
) -> tuple[Array, Array]:
    """Centres (K, 3) and radii (K,) for one link's points; what the pad covers is left to it."""
    hull = ConvexHull(points)
    surface = _surface_points(points, hull)
    if pad is not None:
        surface = surface[~pad.covers(surface, slack)]
    centres = _grid_points(points)
    depth = -(centres @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1)
    # A plate thinner than the grid still gets its middle layer, if a thin one.
    deep = depth > min(_THINNEST, 0.5 * float(depth.max()))
    centres, depth, radii = centres[deep], depth[deep], depth[deep] + overhang
    if pad is not None:
        radii = pad.bounded(radii, centres, depth)
    chosen = _greedy_cover(cdist(surface, centres) <= radii + slack)
    return centres[chosen], radii[chosen]


def _greedy_cover(covers: NDArray[np.bool_]) -> list[int]:
    """Columns that together cover every row that any column covers, rare rows first."""
    weights = 1.0 / np.maximum(covers.sum(axis=1), 1)
    matrix = covers.astype(np.float64)
    gain = weights @ matrix
    left = covers.any(axis=1)
    chosen: list[int] = []
    while left.any():
        column = int(np.argmax(gain))
        new = left & covers[:, column]
        gain -= weights[new] @ matrix[new]
        left &= ~new
        chosen.append(column)
    times = covers[:, chosen].sum(axis=1)
    for column in list(chosen):  # later columns may have made an early one needless
        if np.all(times[covers[:, column]] > 1):
            times = times - covers[:, column]
            chosen.remove(column)
    return chosen


def _surface_points(points: Array, hull: ConvexHull) -> Array:
    """The hull's corners, and points spread evenly over its faces."""
    corners = points[hull.simplices]
    sides = corners[:, 1:] - corners[:, :1]
    area = 0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    rng = np.random.default_rng(0)
    count = int(np.ceil(area.sum() / _SAMPLE**2))
    face = rng.choice(len(area), count, p=area / area.sum())
    spread = np.einsum("nk,nkc->nc", rng.dirichlet(np.ones(3), count), corners[face])
    return np.vstack([points[hull.vertices], spread])


def _grid_points(points: Array) -> Array:
    low, high = points.min(axis=0), points.max(axis=0)
    axes = [
        np.linspace(a, b, 2 * int(np.ceil((b - a) / _GRID / 2)) + 1)  # odd: the middle is on it
        for a, b in zip(low, high, strict=True)
    ]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
