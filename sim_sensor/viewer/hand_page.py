"""A page that shows a hand as it is described: every finger moves in turn, its pad drawn on it.

Made for the user of a new description: a pad in the wrong place, or a normal that looks into the
finger, is seen at once.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from estimator.vectors import Array, frozen, unit
from hand_models.hand import Finger, Hand
from sim_sensor.viewer.meshes import hull_mesh
from sim_sensor.viewer.scene import Camera, Scene, Track, hand_tracks, links, room
from sim_sensor.viewer.timeline import Posture
from sim_sensor.viewer.view import page_text, write_text
from sim_sensor.viewer.viewer_commands import Command, set_ball, set_mesh, set_stick

PAD, NORMAL = 0xE69F00, 0x1F4FD8
_LEGEND = (("pad", PAD), ("pad's normal, out of the finger", NORMAL))
_TURN = 3.0  # for each finger [s]
_FRAMES = 24  # for each finger
_SWING = 0.45  # share of each joint's range to either side of its middle


def write_hand_page(path: str | Path, hand: Hand) -> Path:
    """Write the page of a hand; it needs no server and no network.

    Raises:
        OSError: The file cannot be written.
    """
    path = Path(path)
    text = page_text(
        _scene(hand), title=hand.name, legend=_LEGEND, captions=_captions(hand), signals=[]
    )
    write_text(path, text)
    return path


def _scene(hand: Hand) -> Scene:
    frames = _frames(hand)
    stage = [*room(), *links(hand)]
    for finger in hand.fingers:
        stage += _pad(finger)
    tracks = (*hand_tracks(hand, frames), *_pad_tracks(hand, frames))
    return Scene(tuple(stage), tracks, (), frames[-1].time, _camera(hand))


def _frames(hand: Hand) -> tuple[Posture, ...]:
    """Finger after finger swings about the middle of its range."""
    frames = []
    for k, finger in enumerate(hand.fingers):
        for phase in np.linspace(0.0, 1.0, _FRAMES, endpoint=False):
            q = hand.middle.copy()
            span = (hand.upper - hand.lower)[finger.q_indices]
            q[finger.q_indices] += _SWING * np.sin(2.0 * np.pi * phase) * span
            frames.append(Posture(_TURN * (k + phase), frozen(q), pin.SE3.Identity()))
    end = _TURN * len(hand.fingers)
    return (*frames, Posture(end, hand.middle, pin.SE3.Identity()))


def _pad(finger: Finger) -> Iterator[Command]:
    """In the fingertip's frame, which the tracks move."""
    path, dome = f"/pads/{finger.name}", finger.dome
    if dome.is_sphere:
        yield from set_ball(f"{path}/ball", dome.centre, dome.radius, PAD, opacity=0.55)
    else:
        yield set_mesh(f"{path}/dome", hull_mesh(dome.cap(finger.pad_normal)), PAD, opacity=0.55)
    centre = dome.touched(finger.pad_normal)
    end = centre + 0.03 * finger.pad_normal
    yield from set_stick(f"{path}/normal", centre, end, NORMAL, 0.0015)


def _pad_tracks(hand: Hand, frames: tuple[Posture, ...]) -> Iterator[Track]:
    poses = [hand.at(frame.q) for frame in frames]
    for finger in hand.fingers:
        placed = [pose.transform_tip_to_world(finger) for pose in poses]
        turns = [pin.Quaternion(X.rotation).coeffs().tolist() for X in placed]
        moved = [X.translation.tolist() for X in placed]
        for name, kind, values in (
            ("position", "vector3", moved),
            ("quaternion", "quaternion", turns),
        ):
            keys = tuple(zip((frame.time for frame in frames), values, strict=True))
            yield Track(f"/pads/{finger.name}", name, kind, keys)


def _camera(hand: Hand) -> Camera:
    """On the side that the pads look to, a little above, all of the hand in the picture."""
    pose = hand.at(hand.middle)
    low, high = _box(hand, pose.pad_centres)
    target, size = 0.5 * (low + high), float(np.linalg.norm(high - low))
    side = pose.pad_normals.sum(axis=0) + np.array([0.3, 0.2, 0.3])
    return Camera(frozen(target + 1.2 * size * unit(side)), frozen(target))


def _box(hand: Hand, pads: Array) -> tuple[Array, Array]:
    data, visual = hand.model.createData(), pin.GeometryData(hand.visual_model)
    pin.updateGeometryPlacements(hand.model, data, hand.visual_model, visual, hand.middle)
    points = np.vstack([pads, *(X.translation for X in visual.oMg)])
    return points.min(axis=0) - 0.02, points.max(axis=0) + 0.02


def _captions(hand: Hand) -> list[dict[str, Any]]:
    """What each finger is, while it moves."""
    said = []
    for k, finger in enumerate(hand.fingers):
        normal = ", ".join(f"{c:.2f}" for c in finger.pad_normal)
        body = (
            f"moved by {', '.join(finger.joints)}\n"
            f"pad on {finger.tip_frame}: {finger.dome.in_words}, normal ({normal})"
        )
        said.append({"time": _TURN * k, "head": finger.name, "body": body})
    return said
