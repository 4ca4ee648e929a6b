"""Points of a link's shape, whatever kind of geometry the description gave it."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from hand_models.dome import Dome
from hand_models.fields import HandError

if TYPE_CHECKING:
    from hand_models.hand import Finger, Hand

Array = NDArray[np.float64]


def vertices(geometry: coal.CollisionGeometry) -> Array:
    """(N, 3) points of the geometry's frame whose convex hull is that of the geometry [m].

    Exact for meshes, convex polytopes and boxes; round primitives are sampled, their hull falls
    short by at most 1 % of their radius.

    Raises:
        HandError: A kind of geometry whose points are not known here.
    """
    if isinstance(geometry, coal.BVHModelBase):
        return np.asarray(geometry.vertices(), dtype=np.float64)
    if isinstance(geometry, coal.ConvexBase):
        return np.asarray(geometry.points(), dtype=np.float64)
    if isinstance(geometry, coal.Box):
        return np.asarray(np.array(list(product((-1.0, 1.0), repeat=3))) * geometry.halfSide)
    if isinstance(geometry, coal.Sphere):
        return float(geometry.radius) * _sphere_points()
    if isinstance(geometry, coal.Capsule):
        return _both_ends(geometry.radius * _sphere_points(), geometry.halfLength)
    if isinstance(geometry, coal.Cylinder):
        return _both_ends(geometry.radius * _circle_points(), geometry.halfLength)
    raise HandError(f"a link's shape is a {type(geometry).__name__}: expected a mesh or primitive")


def link_points(hand: Hand, index: int) -> Array:
    """(N, 3) points of visual shape `index` in the frame of the joint that moves it [m]."""
    shape = hand.visual_model.geometryObjects[index]
    X = shape.placement
    return np.asarray(vertices(shape.geometry) @ X.rotation.T + X.translation)


def points_moved_by(hand: Hand, joint: int) -> Array:
    """(N, 3) points of all visual shapes that a joint moves, in its frame [m]; none, (0, 3)."""
    shapes = hand.visual_model.geometryObjects
    own = [link_points(hand, i) for i, s in enumerate(shapes) if int(s.parentJoint) == joint]
    return np.vstack([np.zeros((0, 3)), *own])


def pad_in_joint(hand: Hand, finger: Finger) -> tuple[int, Array, Array]:
    """The joint that moves a pad, and the pad's centre and normal in that joint's frame."""
    frame = hand.model.frames[finger.tip_frame_id]
    X_JT: pin.SE3 = frame.placement
    return (
        int(frame.parentJoint),
        np.asarray(X_JT.act(finger.pad_centre)),
        np.asarray(X_JT.rotation @ finger.pad_normal),
    )


def dome_in_joint(hand: Hand, finger: Finger) -> Dome:
    """A pad's surface in the frame of the joint that moves it."""
    X_JT: pin.SE3 = hand.model.frames[finger.tip_frame_id].placement
    dome = finger.dome
    return Dome(np.asarray(X_JT.act(dome.centre)), dome.radius, dome.axes @ X_JT.rotation.T)


def _circle_points() -> Array:
    angle = np.linspace(0.0, 2.0 * np.pi, 32, endpoint=False)
    return np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)


def _sphere_points() -> Array:
    z = np.cos(np.linspace(0.0, np.pi, 17))[:, None, None]
    circle = _circle_points()[None]
    return np.asarray(np.sqrt(1.0 - z**2) * circle + z * [0.0, 0.0, 1.0]).reshape(-1, 3)


def _both_ends(points: Array, half_length: float) -> Array:
    return np.vstack([points + np.array([0.0, 0.0, end]) for end in (-half_length, half_length)])
