"""Whether a hand that loads makes sense: sizes of a hand, pads that move, pads on their links.

Wrong units and joints of no length give no error anywhere; they give plans that mean nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hand_models.dome import LEAST_AXIS
from hand_models.fields import HandError
from hand_models.geometry import link_points, pad_in_joint, points_moved_by

if TYPE_CHECKING:
    from hand_models.hand import Finger, Hand

Array = NDArray[np.float64]

SMALLEST_HAND, LARGEST_HAND = 0.02, 3.0  # farthest pad from the base of the first joint [m]
SMALLEST_LINK, LARGEST_LINK = 1e-3, 1.0  # extent of a link's mesh [m]
SMALLEST_PAD, LARGEST_PAD = 5e-4, 0.1  # radii [m]
_LEAST_MOVE = 1e-3  # of a pad per radian of all its joints together [m]
_ASKEW = 0.1  # cosine between axes of a dome
_OFF_LINK = 0.05  # of a pad from its link's mesh [m]
_POSTURES = 8


def check_sense(hand: Hand) -> None:
    """Refuse what can only be a mistake.

    Raises:
        HandError: A link, pad or hand of a size no hand has; a pad that hardly moves when the
            finger's joints do; a pad far from its link. Names it and says what to look at.
    """
    for index in range(hand.visual_model.ngeoms):
        _check_link(hand, index)
    for finger in hand.fingers:
        _check_dome(finger)
        _check_size(hand, finger)
        _check_motion(hand, finger)
        _check_place(hand, finger)


def _check_link(hand: Hand, index: int) -> None:
    extent = float(np.ptp(link_points(hand, index), axis=0).max())
    if not SMALLEST_LINK < extent < LARGEST_LINK:
        name = hand.visual_model.geometryObjects[index].name
        raise HandError(
            f"the mesh of '{name}' is {extent:.3g} m long{_units(extent)}: <mesh scale=...> makes"
            " metres"
        )


def _check_size(hand: Hand, finger: Finger) -> None:
    radius = finger.dome.radius
    if not SMALLEST_PAD < radius < LARGEST_PAD:
        raise HandError(
            f"finger '{finger.name}': pad_radius is {radius:g} m{_units(radius)}: expected"
            f" {SMALLEST_PAD:g} to {LARGEST_PAD:g} m"
        )
    pose = hand.at(hand.middle)
    centre = pose.pad_centres[hand.fingers.index(finger)]
    first = pose.data.oMi[hand.model.getJointId(finger.joints[0])].translation
    reach = float(np.linalg.norm(centre - first))
    if not SMALLEST_HAND < reach < LARGEST_HAND:
        raise HandError(
            f"finger '{finger.name}' is {reach:.3g} m long from its first joint to its pad"
            f"{_units(reach)}: lengths are metres, and links have some"
        )


def _check_dome(finger: Finger) -> None:
    """Axes of a size, at right angles, and a ball thick enough to take the least axis from."""
    dome, where = finger.dome, f"finger '{finger.name}'"
    lengths = np.linalg.norm(dome.axes, axis=1)
    for length in lengths:
        if not SMALLEST_PAD <= length < LARGEST_PAD:
            raise HandError(
                f"{where}: an axis of pad_axes is {length:g} m long{_units(length)}: expected"
                f" {SMALLEST_PAD:g} to {LARGEST_PAD:g} m"
            )
    cosines = np.abs(dome.axes @ dome.axes.T / np.outer(lengths, lengths)) - np.eye(len(lengths))
    if np.max(cosines, initial=0.0) > _ASKEW:
        raise HandError(f"{where}: pad_axes must be at right angles to each other")
    if not dome.is_sphere and dome.radius < 2.0 * LEAST_AXIS:
        raise HandError(
            f"{where}: pad_radius is {dome.radius:g} m: with pad_axes, at least"
            f" {2.0 * LEAST_AXIS:g} m"
        )


def _check_motion(hand: Hand, finger: Finger) -> None:
    """Each joint must move the pad somewhere in its range."""
    rng = np.random.default_rng(0)
    postures = rng.uniform(hand.lower, hand.upper, (_POSTURES, hand.model.nq))
    J = np.array([hand.at(q).pad_jacobian(finger)[:, finger.q_indices] for q in postures])
    moves = np.linalg.norm(J, axis=1).max(axis=0)
    still = [name for name, move in zip(finger.joints, moves, strict=True) if move < _LEAST_MOVE]
    if still:
        raise HandError(
            f"finger '{finger.name}': joint {', '.join(still)} does not move the pad (by less than"
            f" {1e3 * _LEAST_MOVE:g} mm per rad): a link of no length, or a wrong tip_frame or"
            " pad_centre"
        )


def _check_place(hand: Hand, finger: Finger) -> None:
    joint, centre, _ = pad_in_joint(hand, finger)
    points = points_moved_by(hand, joint)
    if not len(points):
        return  # the pad stands for itself
    off = float(np.linalg.norm(points - centre, axis=1).min()) - finger.pad_radius
    if off > _OFF_LINK:
        raise HandError(
            f"finger '{finger.name}': the pad is {off:.3g} m off the mesh of its link"
            f"{_units(off)}: pad_centre is in metres, in the frame of '{finger.tip_frame}'"
        )


def _units(length: float) -> str:
    """A hint where a thousand times more or less would be a hand's."""
    if length >= 1.0:
        return ", as if millimetres were taken for metres"
    if length < 1e-3:
        return ", as if metres were taken for kilometres" if length > 0.0 else ""
    return ""
