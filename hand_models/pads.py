"""Measure a fingertip's pad from its mesh, and guess which way it looks.

A convex tip touches a plane of inward normal u at height h(u) = max p . u over its points p, and a
sphere of centre c and radius r does so at c . u + r. The pad is the sphere whose heights are those
of the tip for all u within a cone about the pad's normal: a linear least squares problem. What is
left over is how far a contact in that cone is misplaced along its normal by taking the sphere.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from hand_models.fields import HandError
from hand_models.geometry import pad_in_joint, points_moved_by, vertices
from hand_models.joints import joint_motion
from hand_models.part import Part

if TYPE_CHECKING:
    from hand_models.hand import Hand

Array = NDArray[np.float64]

CONE = float(np.radians(40.0))
TILTS = tuple(np.radians([30.0, 45.0, 60.0, 90.0]))  # from the palm side towards the finger's end
GOOD = 1.2e-3  # misfit of a pad [m]
SMALLEST, LARGEST = 3e-3, 25e-3  # radii of pads [m]
_DIRECTIONS = 400
_LOPSIDED = 0.1  # share of its range by which a joint must bend farther one way


@dataclass(frozen=True, eq=False)
class PadFit:
    """A pad in the frame of its link.

    Attributes:
        centre: (3,) of the sphere [m].
        normal: (3,) unit vector out of it.
        radius: Of the sphere [m].
        misfit: Root mean square of tip less sphere over the cone, along the normals [m].
    """

    centre: Array
    normal: Array
    radius: float
    misfit: float


def fit_pad(points: Array, normal: Array, *, cone: float = CONE) -> PadFit:
    """The sphere that touches planes where the convex hull of the points does.

    Args:
        points: (N, 3) of the fingertip [m].
        normal: (3,) unit vector out of the middle of the pad.
        cone: About it [rad]; the sphere's radius is the worse determined the smaller it is.
    """
    u = _cap(normal, cone)
    heights = (points @ u.T).max(axis=0)
    rows = np.column_stack([u, np.ones(len(u))])
    *centre, radius = np.linalg.lstsq(rows, heights, rcond=None)[0]
    bounded = float(np.clip(radius, SMALLEST, LARGEST))
    if bounded != radius:  # a flat or pointed tip: the best sphere of a radius that can be planned
        centre = np.linalg.lstsq(u, heights - bounded, rcond=None)[0]
    misfit = heights - u @ np.asarray(centre) - bounded
    return PadFit(np.asarray(centre), normal, bounded, float(np.sqrt(np.mean(misfit**2))))


@lru_cache(maxsize=32)
def pad_bulges(hand: Hand, cone: float) -> Array:
    """How far each tip's mesh stands out of its pad's sphere where it touches, (F,) [m].

    A touch along a normal u begins so much before the sphere's does; zero where the sphere is
    foremost, or where a tip has no mesh.

    Args:
        cone: Largest angle between u and the pad's normal [rad].
    """
    out = np.zeros(len(hand.fingers))
    for i, finger in enumerate(hand.fingers):
        joint, centre, normal = pad_in_joint(hand, finger)
        points, u = points_moved_by(hand, joint), _cap(normal, cone)
        if len(points):
            out[i] = max(np.max((points @ u.T).max(axis=0) - u @ centre) - finger.pad_radius, 0.0)
    out.setflags(write=False)
    return out


def _cap(normal: Array, cone: float) -> Array:
    """(M, 3) unit vectors spread evenly over the cap within a cone about the normal."""
    k = np.arange(_DIRECTIONS) + 0.5
    z = 1.0 - (1.0 - np.cos(cone)) * k / _DIRECTIONS
    turn = np.pi * (1.0 + np.sqrt(5.0)) * k  # the golden angle
    across = np.linalg.svd(normal[None])[2][1:]
    circle = np.cos(turn)[:, None] * across[0] + np.sin(turn)[:, None] * across[1]
    return np.asarray(np.sqrt(1.0 - z**2)[:, None] * circle + z[:, None] * normal)


def tip_points(part: Part, frame: int) -> Array:
    """(N, 3) points of a link's shapes in its frame [m]; of all that moves with it if it has none.

    Raises:
        HandError: Nothing that moves with the link has a shape.
    """
    model, shapes = part.model, part.shapes.geometryObjects
    joint = model.frames[frame].parentJoint
    own = [shape for shape in shapes if shape.parentFrame == frame]
    chosen = own or [shape for shape in shapes if shape.parentJoint == joint]
    if not chosen:
        raise HandError(f"link '{model.frames[frame].name}' has no mesh to measure a pad on")
    X_TJ = model.frames[frame].placement.inverse()
    parts = []
    for shape in chosen:
        X = X_TJ * shape.placement
        parts.append(vertices(shape.geometry) @ X.rotation.T + X.translation)
    return np.vstack(parts)


def measure_pad(part: Part, frame: int, *, towards: Array | None = None) -> PadFit:
    """The pad of a fingertip: its normal guessed from how the finger bends, its sphere fitted.

    The last joint that moves the link closes the finger towards the farther of its limits, or,
    where it bends both ways alike or slides, towards the other fingertips. The pad looks that way,
    tilted towards the finger's end: by 30 degrees, as a pad that faces the palm touches little,
    and by more where the tip is round at its end only. A gripper's jaw looks straight ahead.

    Args:
        frame: Of the link that is the fingertip.
        towards: (3,) middle of the other fingertips, in the link's frame; None if there are none.
    """
    points = tip_points(part, frame)
    origin, axis, linear = _last_joint(part, frame)
    away = points - origin
    distal = _unit(_across(away[np.argmax(np.linalg.norm(away, axis=1))], axis))
    closing = _unit(np.cross(axis, distal) + linear)
    sense = _sense(part.model, frame)
    if sense == 0.0:
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        sense = 1.0 if towards is None or (towards - middle) @ closing >= 0.0 else -1.0
    distal = _across(distal, closing) if np.any(linear) else distal
    across = _unit(_across(sense * closing, distal))
    tilts = (0.0,) if np.any(linear) else TILTS
    fits = [fit_pad(points, np.cos(t) * across + np.sin(t) * distal) for t in tilts]
    good = [fit for fit in fits if fit.misfit < GOOD]
    return good[0] if good else min(fits, key=lambda fit: fit.misfit)


def _last_joint(part: Part, frame: int) -> tuple[Array, Array, Array]:
    """Origin, axis and direction of travel of the joint that moves a link, in its frame.

    Raises:
        HandError: Nothing moves it.
    """
    link = part.model.frames[frame]
    if link.parentJoint == 0:
        raise HandError(f"no joint moves link '{link.name}', so it is no fingertip")
    X_TJ = link.placement.inverse()
    motion = joint_motion(part.model.joints[link.parentJoint])
    return X_TJ.translation, X_TJ.rotation @ motion.angular, X_TJ.rotation @ motion.linear


def _sense(model: pin.Model, frame: int) -> float:
    """+1 or -1: which way a link's joint bends; 0 if both ways alike, or if it slides."""
    joint = model.joints[model.frames[frame].parentJoint]
    lower, upper = (
        float(q[joint.idx_q]) for q in (model.lowerPositionLimit, model.upperPositionLimit)
    )
    if np.any(joint_motion(joint).linear) or abs(upper + lower) <= _LOPSIDED * (upper - lower):
        return 0.0
    return float(np.sign(upper + lower))


def _across(v: Array, axis: Array) -> Array:
    return np.asarray(v - (v @ axis) * axis)


def _unit(v: Array) -> Array:
    return np.asarray(v / max(float(np.linalg.norm(v)), 1e-12))
