"""Measure a fingertip's pad from its mesh, and guess which way it looks.

A convex tip touches a plane of inward normal u at height h(u) = max p . u over its points p. A
sphere of centre c and radius r does so at c . u + r: the one whose heights are those of the tip for
all u within a cone about the pad's normal is a linear least squares problem. Where it leaves too
much, a ball rolled over an ellipsoid (`hand_models.dome`) is fitted the same way, which is not
linear. What is left over is how far a contact in that cone is misplaced along its normal.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from hand_models.dome import CONE, Dome, directions_about, nearest_sphere
from hand_models.dome_fit import fit_dome
from hand_models.fields import HandError
from hand_models.geometry import points_moved_by, vertices
from hand_models.joints import joint_motion
from hand_models.part import Part

if TYPE_CHECKING:
    from hand_models.hand import Hand

Array = NDArray[np.float64]

TILTS = tuple(np.radians([30.0, 45.0, 60.0, 90.0]))  # from the palm side towards the finger's end
GOOD = 1.2e-3  # misfit of a sphere: a patch of the tip that can be a pad [m]
EXACT = 1.5e-4  # ... beyond which the pad is no sphere [m]
DOUBTFUL = 5e-4  # misfit of a pad, sphere or dome, that its user should look at [m]
_DIRECTIONS = 400
_LOPSIDED = 0.1  # share of its range by which a joint must bend farther one way


@dataclass(frozen=True, eq=False)
class PadFit:
    """A pad in the frame of its link.

    Attributes:
        dome: Its surface.
        normal: (3,) unit vector out of it.
        misfit: Root mean square of tip less pad over the cone, along the normals [m].
    """

    dome: Dome
    normal: Array
    misfit: float


def fit_pad(points: Array, normal: Array, *, cone: float = CONE) -> PadFit:
    """The sphere that touches planes where the convex hull of the points does.

    Args:
        points: (N, 3) of the fingertip [m].
        normal: (3,) unit vector out of the middle of the pad.
        cone: About it [rad]; the sphere's radius is the worse determined the smaller it is.
    """
    u = directions_about(normal, cone, _DIRECTIONS)
    heights = (points @ u.T).max(axis=0)
    sphere = Dome(*nearest_sphere(u, heights), np.zeros((0, 3)))
    return PadFit(sphere, normal, _misfit(sphere, u, heights))


def refined(fit: PadFit, points: Array, *, cone: float = CONE) -> PadFit:
    """A fitted sphere as the dome that does better, where one is called for."""
    if fit.misfit < EXACT:
        return fit
    u = directions_about(fit.normal, cone, _DIRECTIONS)
    heights = (points @ u.T).max(axis=0)
    dome = fit_dome(u, heights, fit.dome)
    better = PadFit(dome, fit.normal, _misfit(dome, u, heights))
    return better if better.misfit < fit.misfit else fit


def _misfit(pad: Dome, u: Array, heights: Array) -> float:
    return float(np.sqrt(np.mean((heights - pad.heights(u)) ** 2)))


@lru_cache(maxsize=32)
def pad_bulges(hand: Hand, cone: float) -> Array:
    """How far each tip's mesh stands out of its pad's surface where it touches, (F,) [m].

    A touch along a normal u begins so much before the pad's does; zero where the pad is foremost,
    or where a tip has no mesh.

    Args:
        cone: Largest angle between u and the pad's normal [rad].
    """
    out = np.zeros(len(hand.fingers))
    for i, finger in enumerate(hand.fingers):
        frame = hand.model.frames[finger.tip_frame_id]
        points = points_moved_by(hand, int(frame.parentJoint))
        if len(points):
            in_tip = (points - frame.placement.translation) @ frame.placement.rotation
            u = directions_about(finger.pad_normal, cone, _DIRECTIONS)
            out[i] = max(np.max((in_tip @ u.T).max(axis=0) - finger.dome.heights(u)), 0.0)
    out.setflags(write=False)
    return out


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
    """The pad of a fingertip: its normal guessed from how the finger bends, its surface fitted.

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
    return refined(good[0] if good else min(fits, key=lambda fit: fit.misfit), points)


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
