"""One page that plays what happened, in one file: no server, no network.

The viewer is meshcat's, taken from the installed package; the scene is in its own command
messages. The page forbids itself every connection (Content-Security-Policy).
"""

from __future__ import annotations

import base64
import html
import importlib.resources
import json
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import umsgpack

from hand_models.hand import Hand
from sim_sensor.viewer import scene as colours
from sim_sensor.viewer.episode import Episode
from sim_sensor.viewer.page import PAGE
from sim_sensor.viewer.pictures import picture
from sim_sensor.viewer.scene import Scene, build_scene
from sim_sensor.viewer.timeline import captions

_LEGEND = (
    ("true object", colours.GHOST),
    ("true axis", colours.TRUTH),
    ("believed axis before, 95 % region", colours.BEFORE),
    ("believed axis after, 95 % region", colours.AFTER),
    ("contact: outward normal", colours.NORMAL),
    ("contact: two principal directions, not told apart", colours.DIRECTION),
    ("met nothing", colours.MISSED),
)
_ROOM = ("what stands about it", colours.ROOM)


def write_page(path: str | Path, hand: Hand, episode: Episode) -> Path:
    """Write the page that plays an episode with a hand's meshes.

    Opened with `#t=7.5` at the end of its address, the page waits at that second.

    Args:
        path: The file; it is written whole or not at all.
        hand: The hand whose configurations the acts hold.
        episode: What happened.
    Returns:
        The path.
    Raises:
        ValueError: The acts' configurations are not this hand's.
        OSError: The file cannot be written.
    """
    path = Path(path)
    for i, act in enumerate(episode.acts, start=1):
        if act.path.shape[1] != hand.model.nq:
            raise ValueError(
                f"act {i}: {hand.name} has {hand.model.nq} joint positions, "
                f"its path has {act.path.shape[1]}"
            )
    scene = build_scene(hand, episode)
    write_text(path, _render(scene, episode))
    return path


def _signals(scene: Scene, episode: Episode) -> list[dict[str, object]]:
    """The raw pictures and the time from which each is its finger's last."""
    return [
        {
            "time": beat.touch,
            "finger": act.finger,
            "words": act.signal.words,
            "image": picture(act.signal),
        }
        for act, beat in zip(episode.acts, scene.beats, strict=True)
        if act.signal is not None
    ]


def _render(scene: Scene, episode: Episode) -> str:
    """The page's text."""
    return page_text(
        scene,
        title=episode.title,
        legend=(*_LEGEND, _ROOM) if episode.room else _LEGEND,
        captions=captions(episode, scene.beats),
        signals=_signals(scene, episode),
    )


def page_text(
    scene: Scene,
    *,
    title: str,
    legend: Sequence[tuple[str, int]],
    captions: list[dict[str, Any]],
    signals: list[dict[str, Any]],
) -> str:
    """A scene as one page.

    Args:
        title: Above the legend.
        legend: Words and their colours, 0xRRGGBB.
        captions: What is said from which time on: "time" [s], "head", "body".
        signals: Raw pictures: "time" [s], "finger", "words", "image".
    """
    packed = [*scene.commands, scene.animation()]
    listed = "".join(
        f'<li><i style="background:#{color:06x}"></i>{html.escape(name)}</li>'
        for name, color in legend
    )
    parts = {
        "TITLE": html.escape(title),
        "LEGEND": listed,
        "VIEWER": _viewer(),
        "COMMANDS": _script([_packed(command) for command in packed]),
        "CAPTIONS": _script(captions),
        "MARKS": _script([beat.touch for beat in scene.beats]),
        "SIGNALS": _script(signals),
        "EYE": _script(scene.camera.eye.tolist()),
        "TARGET": _script(scene.camera.target.tolist()),
        "DURATION": _script(scene.duration),
    }
    head, *rest = PAGE.split("{{")
    text = [head]
    for piece in rest:  # one pass: what is put in is never searched again
        name, tail = piece.split("}}", 1)
        text += [parts[name], tail]
    return "".join(text)


def _viewer() -> str:
    """Meshcat's viewer, one script."""
    script = importlib.resources.files("meshcat") / "viewer" / "dist" / "main.min.js"
    return script.read_text(encoding="utf-8")


def _packed(command: dict[str, Any]) -> str:
    """One command as the viewer reads it; single precision is a micrometre at 10 m."""
    message = umsgpack.packb(command, force_float_precision="single")
    return base64.b64encode(message).decode("ascii")


def _script(value: object) -> str:
    """A value as JavaScript that cannot end its script element."""
    return json.dumps(value).replace("</", "<\\/").replace("<!--", "<\\!--")


def write_text(path: Path, text: str) -> None:
    """Write beside the target, then rename: never half a page."""
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".part")
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        os.chmod(name, 0o644)
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
