"""The page's scene as viewer commands: what stands there, and what moves or appears when.

Everything is put into meshcat's own command messages; no server and no browser is needed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from estimator.contact import Contact
from estimator.vectors import Array, frozen, unit
from hand_models.hand import Hand
from sim_sensor.viewer.episode import Act, BelievedAxis, Episode
from sim_sensor.viewer.meshes import lathe_mesh, link_mesh, tube_mesh
from sim_sensor.viewer.timeline import Beat, Posture, end_of, postures, schedule
from sim_sensor.viewer.viewer_commands import (
    Command,
    set_ball,
    set_box,
    set_mesh,
    set_pose,
    set_property,
    set_stick,
)

BEFORE, AFTER, GHOST, TRUTH, ROOM = 0xE69F00, 0x009E73, 0x7FA6C9, 0x1F3A5F, 0x9A8C7A
NORMAL, DIRECTION, TOUCH, MISSED = 0x1F4FD8, 0xCC0E8F, 0x111111, 0xD62728
_STICK, _NORMAL_LENGTH, _AXIS_RADIUS = 0.022, 0.030, 0.0010  # [m]
_XRAY: dict[str, Any] = {"opacity": 0.9, "depthTest": False}  # seen through the fingers


@dataclass(frozen=True, eq=False)
class Track:
    """One property of one node in time.

    Args:
        path: Of the node.
        property: "position", "quaternion" or "visible".
        kind: The viewer's name of its type.
        keys: Times [s] and values.
    """

    path: str
    property: str
    kind: str
    keys: tuple[tuple[float, Any], ...]


@dataclass(frozen=True, eq=False)
class Camera:
    """Where the picture is taken from at first.

    Args:
        eye: World [m], shape (3,).
        target: What is in the middle of the picture, world [m], shape (3,).
    """

    eye: Array
    target: Array


@dataclass(frozen=True, eq=False)
class Scene:
    """What a page shows.

    Args:
        commands: Viewer commands that set the stage.
        tracks: What changes in time.
        beats: Times of the acts.
        duration: Of the whole [s].
        camera: Where it is seen from at first.
    """

    commands: tuple[Command, ...]
    tracks: tuple[Track, ...]
    beats: tuple[Beat, ...]
    duration: float
    camera: Camera

    def animation(self) -> Command:
        """All tracks as one viewer command; every clip lasts as long as the whole."""
        clips: dict[str, list[Command]] = {}
        for track in self.tracks:
            keys = [{"time": float(t), "value": value} for t, value in track.keys]
            keys.append({"time": self.duration, "value": keys[-1]["value"]})
            lowered = {"name": f".{track.property}", "type": track.kind, "keys": keys}
            clips.setdefault(track.path, []).append(lowered)
        return {
            "type": "set_animation",
            "path": "",
            "options": {"play": True, "repetitions": 1},
            "animations": [
                {"path": path, "clip": {"fps": 1, "name": "default", "tracks": tracks}}
                for path, tracks in clips.items()
            ],
        }


def build_scene(hand: Hand, episode: Episode) -> Scene:
    """The hand, the true object as a ghost, beliefs and contacts, with their times."""
    beats = schedule(episode.acts)
    duration = end_of(episode, beats) + 2.0
    frames = postures(hand.model, episode, beats)
    stage = [*room(), *_blocks(episode), *links(hand), *_truth(episode)]
    tracks = [*hand_tracks(hand, frames)]
    for i, (act, beat) in enumerate(zip(episode.acts, beats, strict=True)):
        end = None if i == len(beats) - 1 else beat.end
        stage += _belief(f"/belief/{i}/before", act.before, BEFORE, episode)
        stage += _belief(f"/belief/{i}/after", act.after, AFTER, episode)
        stage += _outcome(f"/touched/{i}", act)
        tracks += [
            _shown(f"/belief/{i}/before", beat.start, beat.retreat),
            _shown(f"/belief/{i}/after", beat.touch, end),
            _shown(f"/touched/{i}", beat.touch),
        ]
    camera = _camera(hand, episode)
    return Scene(tuple(stage), tuple(tracks), beats, duration, camera)


def hand_tracks(hand: Hand, frames: tuple[Posture, ...]) -> Iterator[Track]:
    """The base in the world, and every link that a joint moves in the base."""
    data, visual = hand.model.createData(), pin.GeometryData(hand.visual_model)
    placements: dict[str, list[pin.SE3]] = {}
    for frame in frames:
        pin.updateGeometryPlacements(hand.model, data, hand.visual_model, visual, frame.q)
        for shape, X_BG in zip(hand.visual_model.geometryObjects, visual.oMg, strict=True):
            placements.setdefault(_link_path(shape), []).append(pin.SE3(X_BG))
    placements["/hand"] = [frame.X_WB for frame in frames]
    times = [frame.time for frame in frames]
    for path, poses in placements.items():
        yield Track(path, "position", "vector3", _keys(times, [_position(X) for X in poses]))
        yield Track(path, "quaternion", "quaternion", _keys(times, [_quaternion(X) for X in poses]))


def _keys(times: list[float], values: list[list[float]]) -> tuple[tuple[float, Any], ...]:
    """Without keys in the middle of a rest: two equal neighbours say as much as many."""
    keep = [
        i
        for i, value in enumerate(values)
        if i in (0, len(values) - 1) or not value == values[i - 1] == values[i + 1]
    ]
    return tuple((times[i], values[i]) for i in keep)


def _position(X: pin.SE3) -> list[float]:
    return [float(v) for v in X.translation]


def _quaternion(X: pin.SE3) -> list[float]:
    return [float(v) for v in pin.Quaternion(X.rotation).coeffs()]


def _shown(path: str, start: float, end: float | None = None) -> Track:
    """Visible from `start` on, until `end` if there is one."""
    hidden_first = ((0.0, False),) if start > 0 else ()
    hidden_last = ((end, False),) if end is not None else ()
    return Track(path, "visible", "bool", (*hidden_first, (start, True), *hidden_last))


def links(hand: Hand) -> Iterator[Command]:
    """The hand's visual meshes, in its base."""
    for shape in hand.visual_model.geometryObjects:
        grey = float(np.mean(shape.meshColor[:3]))
        color = 0xD9B99B if grey > 0.5 else 0x4A4F57
        yield set_mesh(_link_path(shape), link_mesh(shape), color, flatShading=True)


def _link_path(shape: pin.GeometryObject) -> str:
    return f"/hand/{shape.name}"


def _truth(episode: Episode) -> Iterator[Command]:
    """The true object, translucent, and its axis."""
    yield set_mesh("/truth/object", lathe_mesh(episode.surface), GHOST, opacity=0.28)
    reach = episode.half_height + 0.03
    u = episode.surface.axis.direction
    yield from set_stick(
        "/truth/axis", episode.centre - reach * u, episode.centre + reach * u, TRUTH, 0.6e-3
    )


def _blocks(episode: Episode) -> Iterator[Command]:
    """What stands about the object; translucent, so that it hides nothing."""
    for k, block in enumerate(episode.room):
        path = f"/room/{k}"
        yield set_box(path, block.size, ROOM, opacity=0.3)
        yield set_pose(path, block.X_WC.rotation, block.X_WC.translation)


def _belief(path: str, belief: BelievedAxis, color: int, episode: Episode) -> Iterator[Command]:
    """The believed axis as a line, and its 95 % region as a tube."""
    u = belief.axis.direction
    s = float((episode.centre - belief.axis.point) @ u)
    along = s - episode.half_height - 0.02, s + episode.half_height + 0.02
    ends = [belief.axis.point + at * u for at in along]
    yield set_mesh(f"{path}/region", tube_mesh(belief, along), color, opacity=0.18)
    yield from set_stick(f"{path}/axis", ends[0], ends[1], color, _AXIS_RADIUS)


def _outcome(path: str, act: Act) -> Iterator[Command]:
    """A contact's point, normal and two directions; a red ball where a finger met nothing."""
    if act.outcome is None:
        return
    if not isinstance(act.outcome, Contact):
        tip, radius = act.outcome.tip, act.outcome.radius
        yield from set_ball(f"{path}/miss", tip, radius, MISSED, opacity=0.4)
        return
    p, n = act.outcome.position, act.outcome.normal
    yield from set_ball(f"{path}/point", p, 0.0026, TOUCH, **_XRAY)
    yield from set_stick(f"{path}/normal", p, p + _NORMAL_LENGTH * n, NORMAL, 0.0012, **_XRAY)
    for i, k in enumerate(act.outcome.directions):
        begin, end = p - 0.5 * _STICK * k, p + 0.5 * _STICK * k
        yield from set_stick(f"{path}/direction{i}", begin, end, DIRECTION, 0.0012, **_XRAY)


def room() -> Iterator[Command]:
    """A light background and no grid."""
    for node in ("/Grid", "/Axes"):
        yield set_property(node, "visible", False)
    yield set_property("/Background", "top_color", [0.96, 0.97, 0.99])
    yield set_property("/Background", "bottom_color", [0.80, 0.84, 0.89])


def _hand_place(hand: Hand, act: Act) -> Array:
    """Of the hand's own base in the world as an act begins; an arm may carry it."""
    X_WB = act.bases[0] if hand.arm is None else hand.arm.base_of_hand(act.path[0])
    return np.asarray(X_WB.translation)


def _camera(hand: Hand, episode: Episode) -> Camera:
    """Beside the line from the object to the hand, raised, on the side that is touched.

    From the other side, or from higher up, where something stands in between.
    """
    behind = np.mean([_hand_place(hand, act) for act in episode.acts], axis=0) - episode.centre
    side = np.cross([0.0, 0.0, 1.0], behind)
    side = unit(side) if np.linalg.norm(side) > 0.02 else np.array([0.0, -1.0, 0.0])
    touched = np.mean([_place(act, episode) for act in episode.acts], axis=0) - episode.centre
    side *= 1.0 if touched @ side >= 0 else -1.0
    # a little below the middle: the caption covers the bottom of the picture
    target = episode.centre + 0.3 * behind - np.array([0.0, 0.0, 0.04])
    comes = any(act.motion is not None for act in episode.acts)  # from farther away
    distance = episode.half_height + (0.52 if comes else 0.40)
    eyes = [
        target + distance * unit(sign * side + 0.3 * unit(behind) + np.array([0.0, 0.0, up]))
        for up in (0.4, 1.0)
        for sign in (1.0, -1.0)
    ]
    free = (eye for eye in eyes if not _covered(episode, eye))
    return Camera(frozen(next(free, eyes[0])), frozen(target))


def _covered(episode: Episode, eye: Array) -> bool:
    """Whether something stands between an eye and the object."""
    on_the_way = eye + np.linspace(0.0, 0.95, 60)[:, None] * (episode.centre - eye)
    for block in episode.room:
        in_block = (on_the_way - block.X_WC.translation) @ block.X_WC.rotation
        if np.any(np.all(np.abs(in_block) < 0.5 * block.size, axis=1)):
            return True
    return False


def _place(act: Act, episode: Episode) -> Array:
    """Where it touched, or meant to."""
    if act.outcome is None:
        return episode.centre
    return act.outcome.position if isinstance(act.outcome, Contact) else act.outcome.tip
