"""Hand descriptions: reading and checking the TOML file that makes a model a hand that feels.

`hands/allegro_right.toml` documents every field. Nothing here knows Pinocchio: a description is
checked for shape and sense, and its files are found; `hand.load_hand` checks it against the model.
"""

from __future__ import annotations

import importlib.resources
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from hand_models.carriers import (
    NOWHERE,
    ArmDescription,
    WristDescription,
    read_arm,
    read_wrist,
)
from hand_models.fields import (
    HandError,
    Vector,
    positive,
    refuse_unknown_keys,
    tables,
    text,
    unit_vector,
    vector,
    vectors,
)
from hand_models.sources import SOURCE_KEYS, SourceDescription, read_source

_HAND_KEYS = {*SOURCE_KEYS, "name", "copies", "arm", "wrist", "fingers"}
_COPY_KEYS = {"prefix", "position", "rotation_deg"}
_FINGER_KEYS = {"name", "tip_frame", "pad_centre", "pad_normal", "pad_radius", "pad_axes"}


@dataclass(frozen=True)
class FingerDescription:
    """One `[[fingers]]` table: where the pad is on the link `tip_frame` (frame T).

    Attributes:
        name: Unique among the hand's fingers.
        tip_frame: Name of the link that carries the pad.
        pad_centre: Middle of the pad, of its sphere if it is one, in T [m].
        pad_normal: Unit vector out of the pad, in T.
        pad_radius: Radius of the pad's sphere, or of the ball that is rolled over its axes [m].
        pad_axes: Half axes, in T [m]; none for a sphere (`hand_models.dome`).
    """

    name: str
    tip_frame: str
    pad_centre: Vector
    pad_normal: Vector
    pad_radius: float
    pad_axes: tuple[Vector, ...]


@dataclass(frozen=True)
class CopyDescription:
    """One `[[copies]]` table: the source once more, elsewhere.

    Attributes:
        prefix: Put before all its names.
        position: In the hand base B [m].
        rotation_deg: Roll, pitch, yaw about the fixed axes of B, as in a URDF [deg].
    """

    prefix: str
    position: Vector
    rotation_deg: Vector


@dataclass(frozen=True)
class HandDescription:
    """A checked description, its files found.

    Attributes:
        name: Name of the hand.
        source: Where its model comes from.
        copies: Where that stands; empty for once, at the hand base.
        arm: What carries it.
        wrist: How far something else does; with neither the hand is free.
        fingers: At least one.
    """

    name: str
    source: SourceDescription
    copies: tuple[CopyDescription, ...]
    arm: ArmDescription | None
    wrist: WristDescription | None
    fingers: tuple[FingerDescription, ...]


def known_hands() -> tuple[str, ...]:
    """Names of the hands that come with the package, for `load_hand`."""
    names = (entry.name for entry in _shipped().iterdir())
    return tuple(sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml")))


def read_description(name_or_path: str | Path) -> HandDescription:
    """Read and check the description of a known hand, or of the hand in a TOML file.

    Args:
        name_or_path: One of `known_hands()`, or the path of a file whose name ends in ".toml".

    Raises:
        HandError: Unknown name, missing file, or a field that is missing, unknown or wrong.
    """
    if str(name_or_path).endswith(".toml"):
        file: Traversable = Path(name_or_path)
        folder = Path(name_or_path).resolve().parent
    elif name_or_path in known_hands():
        file = _shipped() / f"{name_or_path}.toml"
        folder = Path()
    else:
        known = ", ".join(known_hands())
        raise HandError(
            f"unknown hand '{name_or_path}': known are {known}, or the path of a .toml description"
        )
    return _checked(_parse(file, str(name_or_path)), folder, str(name_or_path))


def _shipped() -> Traversable:
    return importlib.resources.files("hand_models") / "hands"


def _parse(file: Traversable, where: str) -> dict[str, Any]:
    try:
        return tomllib.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise HandError(f"{where}: cannot be read ({error.strerror})") from error
    except ValueError as error:  # not TOML, or not UTF-8
        raise HandError(f"{where}: not a TOML file ({error})") from error


def _checked(table: Mapping[str, Any], folder: Path, where: str) -> HandDescription:
    refuse_unknown_keys(table, _HAND_KEYS, where)
    if "arm" in table and "wrist" in table:
        raise HandError(f"{where}: the hand is held by [arm] or within [wrist], not both")
    return HandDescription(
        name=text(table, "name", where),
        source=read_source(table, folder, where),
        copies=_copies(table, where),
        arm=read_arm(table["arm"], folder, f"{where}: arm") if "arm" in table else None,
        wrist=read_wrist(table["wrist"], f"{where}: wrist") if "wrist" in table else None,
        fingers=_fingers(table, where),
    )


def _copies(table: Mapping[str, Any], where: str) -> tuple[CopyDescription, ...]:
    return tuple(
        _copy(entry, f"{where}: copies[{i}]")
        for i, entry in enumerate(tables(table, "copies", where))
    )


def _copy(table: Mapping[str, Any], where: str) -> CopyDescription:
    refuse_unknown_keys(table, _COPY_KEYS, where)
    return CopyDescription(
        prefix=text(table, "prefix", where),
        position=vector(table, "position", where, NOWHERE),
        rotation_deg=vector(table, "rotation_deg", where, NOWHERE),
    )


def _fingers(table: Mapping[str, Any], where: str) -> tuple[FingerDescription, ...]:
    entries = tables(table, "fingers", where)
    if not entries:
        raise HandError(f"{where}: fingers must be one or more [[fingers]] tables")
    fingers = tuple(_finger(entry, f"{where}: fingers[{i}]") for i, entry in enumerate(entries))
    names = [finger.name for finger in fingers]
    for name in names:
        if names.count(name) > 1:
            raise HandError(f"{where}: two fingers are named '{name}'; names must be unique")
    return fingers


def _finger(table: Mapping[str, Any], where: str) -> FingerDescription:
    refuse_unknown_keys(table, _FINGER_KEYS, where)
    return FingerDescription(
        name=text(table, "name", where),
        tip_frame=text(table, "tip_frame", where),
        pad_centre=vector(table, "pad_centre", where),
        pad_normal=unit_vector(table, "pad_normal", where),
        pad_radius=positive(table, "pad_radius", where),
        pad_axes=vectors(table, "pad_axes", where, most=3),
    )
