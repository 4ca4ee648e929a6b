"""Hand descriptions: reading and checking the TOML file that makes a model a hand that feels.

`hands/allegro_right.toml` documents every field. Nothing here knows Pinocchio: a description is
checked for shape and sense, and its files are found; `hand.load_hand` checks it against the model.
"""

from __future__ import annotations

import importlib.metadata
import importlib.resources
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources.abc import Traversable
from pathlib import Path, PurePosixPath
from typing import Any

from hand_models.fields import (
    HandError,
    Vector,
    numbers,
    optional_text,
    positive,
    refuse_unknown_keys,
    tables,
    text,
    texts,
    unit_vector,
    vector,
)

_SOURCE_KEYS = {"source", "distribution", "package_directories", "base", "without", "fixed"}
_HAND_KEYS = {*_SOURCE_KEYS, "name", "copies", "arm", "fingers"}
_ARM_KEYS = {
    *_SOURCE_KEYS, "prefix", "flange", "position", "rotation_deg", "at", "at_rotation_deg", "home",
}  # fmt: skip
_COPY_KEYS = {"prefix", "position", "rotation_deg"}
_FINGER_KEYS = {"name", "tip_frame", "pad_centre", "pad_normal", "pad_radius"}
_ENDINGS = (".urdf", ".xml")
_NOWHERE: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class FingerDescription:
    """One `[[fingers]]` table: where the pad is on the link `tip_frame` (frame T).

    Attributes:
        name: Unique among the hand's fingers.
        tip_frame: Name of the link that carries the pad.
        pad_centre: Centre of the pad's sphere, in T [m].
        pad_normal: Unit vector out of the pad, in T.
        pad_radius: Radius of the pad's sphere [m].
    """

    name: str
    tip_frame: str
    pad_centre: Vector
    pad_normal: Vector
    pad_radius: float


@dataclass(frozen=True)
class SourceDescription:
    """The part of a model file that is meant.

    Attributes:
        file: A URDF, or an MJCF if it ends in ".xml"; exists.
        package_directories: Folders in which the URDF's meshes are looked up.
        base: The link all else hangs on; None takes the whole.
        without: Links that are left out, with all that hangs on them.
        fixed: Joints that are held, and where [rad], [m].
    """

    file: Path
    package_directories: tuple[Path, ...]
    base: str | None
    without: tuple[str, ...]
    fixed: Mapping[str, float]


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
class ArmDescription:
    """The `[arm]` table: what carries the hand.

    Attributes:
        source: Where its model comes from.
        prefix: Put before its names, where they are the hand's, too.
        flange: The link the hand is mounted on.
        position, rotation_deg: Of the hand base in the flange [m], [deg].
        at, at_rotation_deg: Of the arm's root in the world [m], [deg].
        home: Where its joints begin, by name, mid-range for the others [rad], [m].
    """

    source: SourceDescription
    prefix: str
    flange: str
    position: Vector
    rotation_deg: Vector
    at: Vector
    at_rotation_deg: Vector
    home: Mapping[str, float]


@dataclass(frozen=True)
class HandDescription:
    """A checked description, its files found.

    Attributes:
        name: Name of the hand.
        source: Where its model comes from.
        copies: Where that stands; empty for once, at the hand base.
        arm: What carries it; None leaves the hand free.
        fingers: At least one.
    """

    name: str
    source: SourceDescription
    copies: tuple[CopyDescription, ...]
    arm: ArmDescription | None
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
    return HandDescription(
        name=text(table, "name", where),
        source=_source(table, folder, where),
        copies=_copies(table, where),
        arm=_arm(table["arm"], folder, f"{where}: arm") if "arm" in table else None,
        fingers=_fingers(table, where),
    )


def _source(table: Mapping[str, Any], folder: Path, where: str) -> SourceDescription:
    source = PurePosixPath(text(table, "source", where))
    if source.suffix not in _ENDINGS:
        raise HandError(f"{where}: source '{source}' must be a .urdf file, or an MJCF .xml file")
    distribution = optional_text(table, "distribution", where)
    if distribution is not None:
        folder = _distribution_folder(distribution, source, where)
    file = folder / source
    if not file.is_file():
        raise HandError(f"{where}: source '{file}' is not a file")
    directories = tuple(
        folder / entry for entry in texts(table, "package_directories", where, ["."])
    )
    for directory in directories:
        if not directory.is_dir():
            raise HandError(f"{where}: package directory '{directory}' is not a folder")
    return SourceDescription(
        file,
        directories,
        optional_text(table, "base", where),
        tuple(texts(table, "without", where, [])),
        numbers(table, "fixed", where),
    )


def _distribution_folder(distribution: str, source: PurePosixPath, where: str) -> Path:
    """Folder below which an installed distribution keeps `source`.

    The distribution's own record of its files is asked, because such wheels hold data only: there
    is no module to import, and the packager's prefix before `source` is not ours to know.
    """
    try:
        files = importlib.metadata.files(distribution) or []
    except importlib.metadata.PackageNotFoundError as error:
        raise HandError(
            f"{where}: distribution '{distribution}' is not installed: pip install {distribution}"
        ) from error
    tail = source.parts
    for file in files:
        if file.parts[-len(tail) :] == tail:
            return Path(str(file.locate())).resolve().parents[len(tail) - 1]
    raise HandError(f"{where}: distribution '{distribution}' has no file '{source}'")


def _copies(table: Mapping[str, Any], where: str) -> tuple[CopyDescription, ...]:
    return tuple(
        _copy(entry, f"{where}: copies[{i}]")
        for i, entry in enumerate(tables(table, "copies", where))
    )


def _copy(table: Mapping[str, Any], where: str) -> CopyDescription:
    refuse_unknown_keys(table, _COPY_KEYS, where)
    return CopyDescription(
        prefix=text(table, "prefix", where),
        position=vector(table, "position", where, _NOWHERE),
        rotation_deg=vector(table, "rotation_deg", where, _NOWHERE),
    )


def _arm(table: object, folder: Path, where: str) -> ArmDescription:
    if not isinstance(table, dict):
        raise HandError(f"{where} must be a table, [arm], got {table!r}")
    refuse_unknown_keys(table, _ARM_KEYS, where)
    return ArmDescription(
        source=_source(table, folder, where),
        prefix=optional_text(table, "prefix", where) or "",
        flange=text(table, "flange", where),
        position=vector(table, "position", where, _NOWHERE),
        rotation_deg=vector(table, "rotation_deg", where, _NOWHERE),
        at=vector(table, "at", where, _NOWHERE),
        at_rotation_deg=vector(table, "at_rotation_deg", where, _NOWHERE),
        home=numbers(table, "home", where),
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
    )
