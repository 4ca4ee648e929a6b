"""The independent check of a solution: Pinocchio's kinematics and coal's distances.

Nothing here was used to find the solution: its kinematics were CasADi's, its links were spheres
and its object a spline.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from hand_models.collision import HandCollision, LinkPair, ObjectClearance
from hand_models.hand import Hand
from hand_models.pads import pad_bulges
from planner.reaching.solid import RevolvedSolid

Array = NDArray[np.float64]

_TOUCH = 3e-4  # depth below which coal's polygons cannot tell touching from entering [m]
_AT_LIMIT = 2e-3  # a joint this near its limit is named as at it [rad]


@dataclass(frozen=True, eq=False)
class Certificate:
    """What was measured on one configuration.

    Attributes:
        position_residuals: (k,) between each pad's centre and its place above the contact [m].
        pad_angles: (k,) between each pad's normal and the inward surface normal [rad].
        limit_margin: Least distance of a joint from its limits, negative beyond [rad].
        self_pair: The two links nearest to each other, and their distance.
        links: What should not touch the object and is not fixed to a pad that does (idle pads are
            among it): the name of the nearest, and its distance [m].
        tip_links: The same of what is fixed to a touching pad, and so is near by nature.
        pads: (k,) distance of each touching pad from the object, zero if it just touches [m].
    """

    position_residuals: Array
    pad_angles: Array
    limit_margin: float
    self_pair: LinkPair
    links: tuple[str, float]
    tip_links: tuple[str, float]
    pads: Array

    @property
    def object_clearance(self) -> float:
        """Least distance between the object and what should not touch it [m]."""
        return min(self.links[1], self.tip_links[1])


@dataclass(frozen=True)
class Tolerances:
    """What a certificate must keep.

    Args:
        position: Largest position residual [m].
        cone: Largest pad angle [rad].
        self_clearance: Least distance between links [m].
        object_clearance: Least distance between object and links that do not touch [m]. What is
            fixed to a touching pad only has to be outside, but for what its mesh stands out of
            the pad that is planned with (`hand_models.pads.pad_bulges`).
        pad_depth: How deep a touching pad may be in the object, where it is hollow or where its
            mesh is more than its pad [m].
    """

    position: float
    cone: float
    self_clearance: float
    object_clearance: float
    pad_depth: float


def certify(
    hand: Hand,
    collision: HandCollision,
    q: Array,
    X_WB: pin.SE3,
    solid: RevolvedSolid,
    *,
    fingers: tuple[str, ...],
    points: Array,
    normals: Array,
) -> Certificate:
    """Measure one configuration against its contacts.

    Args:
        fingers: The finger of each contact.
        points, normals: (k, 3) contacts: surface points and outward normals in the world.
    """
    pose = hand.at(q, X_WB)
    order = [hand.fingers.index(hand.finger(name)) for name in fingers]
    radii = np.array([hand.fingers[i].pad_radius for i in order])
    gap = pose.ball_centres(order, normals) - (points + radii[:, None] * normals)
    cosine = -np.sum(pose.pad_normals[order] * normals, axis=1)
    clearance = collision.object_clearance(q, X_WB, solid.slices, solid.X_WO)
    links, tip_links = _nearest(hand, clearance, order)
    return Certificate(
        position_residuals=np.linalg.norm(gap, axis=1),
        pad_angles=np.arccos(np.clip(cosine, -1.0, 1.0)),
        limit_margin=float(np.min(np.minimum(q - hand.lower, hand.upper - q))),
        self_pair=collision.self_clearance(q),
        links=links,
        tip_links=tip_links,
        pads=clearance.pads[order],
    )


def _nearest(
    hand: Hand, clearance: ObjectClearance, touching: list[int]
) -> tuple[tuple[str, float], tuple[str, float]]:
    """Nearest of what is not fixed to a touching pad, and nearest of what is."""
    frames = hand.model.frames
    pad_joints = {frames[hand.fingers[i].tip_frame_id].parentJoint for i in touching}
    far, near = [("nothing", np.inf)], [("nothing", np.inf)]
    for link, distance in zip(clearance.links, clearance.distances, strict=True):
        joint = frames[hand.model.getFrameId(link, pin.FrameType.BODY)].parentJoint
        (near if joint in pad_joints else far).append((link, float(distance)))
    for i, distance in enumerate(clearance.pads):
        if i not in touching:
            far.append((f"pad of {hand.fingers[i].name}", float(distance)))
    return min(far, key=lambda pair: pair[1]), min(near, key=lambda pair: pair[1])


def faults(
    hand: Hand, found: Certificate, q: Array, fingers: tuple[str, ...], allowed: Tolerances
) -> Iterator[str]:
    """What the certificate does not keep, in words, the gravest kind first."""
    farthest = np.argsort(-found.position_residuals, kind="stable")
    for name, residual in ((fingers[i], found.position_residuals[i]) for i in farthest):
        if residual > allowed.position:
            far = f"{name} stays {1e3 * residual:.1f} mm from its contact"
            yield far + at_limits(hand, q, name)
    for name, angle in zip(fingers, found.pad_angles, strict=True):
        if angle > allowed.cone + 1e-3:
            yield (
                f"{name}: pad normal {np.degrees(angle):.0f} deg off (cone"
                f" {np.degrees(allowed.cone):.0f}){at_limits(hand, q, name)}"
            )
    beyond = np.maximum(hand.lower - q, q - hand.upper)
    if beyond.max() > 1e-6:
        joint = hand.joint_names[int(np.argmax(beyond))]
        yield f"{joint} is {beyond.max():.3f} rad beyond its limit"
    pair = found.self_pair
    if pair.distance < allowed.self_clearance:
        yield gap_in_words(pair)
    order = [hand.fingers.index(hand.finger(name)) for name in fingers]
    bulge = min(float(pad_bulges(hand, allowed.cone)[order].max()), allowed.pad_depth)
    for (link, distance), least in (
        (found.links, allowed.object_clearance),
        (found.tip_links, -_TOUCH - bulge),
    ):
        if distance < least:
            yield gap_in_words(LinkPair(link, "the object", distance))
    for name, depth in zip(fingers, -found.pads, strict=True):
        if depth > allowed.pad_depth:
            yield f"the pad of {name} is {1e3 * depth:.1f} mm too round for its hollow"


def gap_in_words(pair: LinkPair) -> str:
    """E.g. "link_2.0 and link_6.0 overlap by 1.3 mm"."""
    word = "overlap by" if pair.distance < 0.0 else "are only apart by"
    return f"{pair.first} and {pair.second} {word} {1e3 * abs(pair.distance):.1f} mm"


def at_limits(hand: Hand, q: Array, finger: str) -> str:
    """Joints of the finger that have no way left, as a clause."""
    stuck = [
        f"{name} at its {'lower' if q[i] - hand.lower[i] < _AT_LIMIT else 'upper'} limit"
        for name, i in zip(hand.finger(finger).joints, hand.finger(finger).q_indices, strict=True)
        if min(q[i] - hand.lower[i], hand.upper[i] - q[i]) < _AT_LIMIT
    ]
    return f", its {', '.join(stuck)}" if stuck else ""
