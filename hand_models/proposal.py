"""Propose a description for a URDF or MJCF that has none, for its user to correct.

Fingers are the chains that part last: of all links, the one nearest to the tips from which several
chains of joints go out is the palm, and what moves last on each chain is a fingertip. Pads are
measured on the tips' meshes, and look the way the fingers close.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from hand_models.assembly import read_part
from hand_models.fields import HandError
from hand_models.pads import DOUBTFUL, PadFit, measure_pad
from hand_models.part import empty_part, grafted
from hand_models.sources import SourceDescription

Array = NDArray[np.float64]

_NAMES = ("thumb", "index", "middle", "ring", "little", "pinky")
_MESH = re.compile(r'filename\s*=\s*"package://([^"]+)"')


@dataclass(frozen=True)
class Proposal:
    """A description in TOML, and what its user should look at.

    Attributes:
        text: The description.
        base: The link taken for the palm.
        fingers: Names of the fingers found.
        doubts: What was guessed against the odds, one line each.
    """

    text: str
    base: str
    fingers: tuple[str, ...]
    doubts: tuple[str, ...]


def propose_description(file: Path, *, base: str | None = None) -> Proposal:
    """Describe the hand in a URDF (.urdf) or MJCF (.xml).

    Args:
        base: The palm; None looks for it.

    Raises:
        HandError: The file cannot be read, has no such link, or nothing in it moves.
    """
    file = file.resolve()
    if not file.is_file():
        raise HandError(f"'{file}' is not a file")
    folders = (_package_folder(file),)
    whole = read_part(SourceDescription(file, folders, base, (), {}))
    doubts = []
    if base is None:
        palms = _palms(whole.model)
        base = palms[0]
        if len(palms) > 1:
            doubts.append(f"fingers part at {', '.join(palms)}; {base} is taken, --base chooses")
    part = grafted(empty_part(), whole, base=base)
    tips = _tips(part.model)
    if not tips:
        raise HandError(f"no joint moves anything that hangs on '{base}'")
    tables = []
    names = _names([part.model.frames[tip].name for tip in tips])
    towards = _others(part.model, tips)
    for name, tip, other in zip(names, tips, towards, strict=True):
        fit = measure_pad(part, tip, towards=other)
        if fit.misfit > DOUBTFUL:
            doubts.append(f"{name}: no pad fits the tip better than {1e3 * fit.misfit:.1f} mm")
        tables.append(_table(name, part.model.frames[tip].name, fit))
    head = _head(file, folders[0], base)
    return Proposal("\n".join([head, *tables]), base, names, tuple(doubts))


def _package_folder(file: Path) -> Path:
    """The nearest folder above the file in which the first package:// mesh is found."""
    for mesh in _MESH.findall(file.read_text(encoding="utf-8", errors="replace")):
        for folder in file.parents:
            if (folder / mesh).is_file():
                return folder
    return file.parent


def _palms(model: pin.Model) -> list[str]:
    """Links at which several chains of joints part for the last time; the root if none does."""
    branching = [j for j in range(model.njoints) if len(model.children[j]) > 1]
    last = [j for j in branching if not any(j in _above(model, k) for k in branching)]
    return [_link_of(model, j) for j in last] or [_link_of(model, 0)]


def _above(model: pin.Model, joint: int) -> list[int]:
    return [int(j) for j in model.supports[joint]][:-1]


def _link_of(model: pin.Model, joint: int) -> str:
    """The link on a joint from which its children go out; the first on it if they do not agree."""
    below = [model.frames[model.getFrameId(model.names[j])] for j in model.children[joint]]
    parents = {_body_above(model, int(frame.parentFrame)) for frame in below}
    if len(parents) == 1:
        return str(model.frames[parents.pop()].name)
    return next(
        str(frame.name)
        for frame in model.frames
        if frame.parentJoint == joint and frame.type == pin.FrameType.BODY
    )


def _body_above(model: pin.Model, frame: int) -> int:
    while frame and model.frames[frame].type != pin.FrameType.BODY:
        frame = int(model.frames[frame].parentFrame)
    return frame


def _tips(model: pin.Model) -> list[int]:
    """For each joint that moves last on its chain, the farthest link on it."""
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    tips = []
    for joint in range(1, model.njoints):
        if len(model.children[joint]) == 0:
            links = [
                (float(np.linalg.norm(frame.placement.translation)), i)
                for i, frame in enumerate(model.frames)
                if frame.parentJoint == joint and frame.type == pin.FrameType.BODY
            ]
            tips.append(max(links)[1])
    return tips


def _others(model: pin.Model, tips: list[int]) -> list[Array | None]:
    """For each tip the middle of the others, in its frame, with all joints in mid-range."""
    if len(tips) == 1:
        return [None]
    data = model.createData()
    lower, upper = model.lowerPositionLimit, model.upperPositionLimit
    bounded = np.isfinite(lower) & np.isfinite(upper)
    middle = np.where(bounded, 0.5 * (np.where(bounded, lower, 0.0) + upper), 0.0)
    pin.framesForwardKinematics(model, data, middle)
    places = np.array([data.oMf[tip].translation for tip in tips])
    total = places.sum(axis=0)
    return [
        np.asarray(data.oMf[tip].actInv((total - place) / (len(tips) - 1)))
        for tip, place in zip(tips, places, strict=True)
    ]


def _names(links: list[str]) -> tuple[str, ...]:
    """The fingers' usual names where the links bear them, else what the links do not share."""
    found = [next((name for name in _NAMES if name in link.lower()), "") for link in links]
    if "" in found or len(set(found)) < len(found):
        return tuple(links)
    return tuple(found)


def _head(file: Path, folder: Path, base: str) -> str:
    packages = f'package_directories = ["{folder}"]\n' if folder != file.parent else ""
    return (
        f"# Proposed from {file.name}. Look at every pad: does its normal point out of the\n"
        "# fingertip, the way the finger touches? hand_models/hands/allegro_right.toml explains\n"
        f'# every field.\n\nname = "{file.stem}"\nsource = "{file}"\n{packages}base = "{base}"\n'
    )


def _table(name: str, link: str, fit: PadFit) -> str:
    dome = fit.dome
    axes = "" if dome.is_sphere else f"pad_axes = [{', '.join(map(_vector, dome.axes))}]\n"
    return (
        f'[[fingers]]\nname = "{name}"\ntip_frame = "{link}"\n'
        f"pad_centre = {_vector(dome.centre)}\npad_normal = {_vector(fit.normal)}\n{axes}"
        f"pad_radius = {dome.radius:.4f}  # fits the mesh to {1e3 * fit.misfit:.1f} mm\n"
    )


def _vector(v: Array) -> str:
    return f"[{', '.join(f'{c + 0.0:.4f}' for c in v)}]"
