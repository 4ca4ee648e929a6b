"""Hand descriptions: reading and checking the TOML file that makes a URDF a hand that feels.

`hands/allegro_right.toml` documents every field. Nothing here knows Pinocchio: a description is
checked for shape and sense, and its files are found; `hand.load_hand` checks it against the model.
"""

from __future__ import annotations

import importlib.metadata
import importlib.resources
import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources.abc import Traversable
from pathlib import Path, PurePosixPath
from typing import Any

UNIT_TOLERANCE = 1e-3
"""A pad normal whose length is off by less was rounded by its writer, and is normalised."""

_HAND_KEYS = {"name", "source", "distribution", "package_directories", "fingers"}
_FINGER_KEYS = {"name", "tip_frame", "pad_centre", "pad_normal", "pad_radius"}


class HandError(ValueError):
    """A hand description, or a question to a hand, that cannot be answered; says what would be."""


@dataclass(frozen=True)
class FingerDescription:
    """One `[[fingers]]` table: where the pad is on the link `tip_frame` (frame T).

    Attributes:
        name: Unique among the hand's fingers.
        tip_frame: Name of the URDF link that carries the pad.
        pad_centre: Centre of the pad's sphere, in T [m].
        pad_normal: Unit vector out of the pad, in T.
        pad_radius: Radius of the pad's sphere [m].
    """

    name: str
    tip_frame: str
    pad_centre: tuple[float, float, float]
    pad_normal: tuple[float, float, float]
    pad_radius: float


@dataclass(frozen=True)
class HandDescription:
    """A checked description, its files found.

    Attributes:
        name: Name of the hand.
        urdf: The URDF file; exists.
        package_directories: Folders in which the URDF's meshes are looked up.
        fingers: At least one.
    """

    name: str
    urdf: Path
    package_directories: tuple[Path, ...]
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
    _refuse_unknown_keys(table, _HAND_KEYS, where)
    source = PurePosixPath(_text(table, "source", where))
    if source.suffix != ".urdf":
        raise HandError(f"{where}: source '{source}' must be a .urdf file")
    if "distribution" in table:
        folder = _distribution_folder(_text(table, "distribution", where), source, where)
    urdf = folder / source
    if not urdf.is_file():
        raise HandError(f"{where}: source '{urdf}' is not a file")
    return HandDescription(
        name=_text(table, "name", where),
        urdf=urdf,
        package_directories=_package_directories(table, folder, where),
        fingers=_fingers(table, where),
    )


def _package_directories(table: Mapping[str, Any], folder: Path, where: str) -> tuple[Path, ...]:
    entries = table.get("package_directories", ["."])
    if not isinstance(entries, list) or not all(isinstance(entry, str) for entry in entries):
        raise HandError(f"{where}: package_directories must be a list of paths, got {entries!r}")
    directories = tuple(folder / entry for entry in entries)
    for directory in directories:
        if not directory.is_dir():
            raise HandError(f"{where}: package directory '{directory}' is not a folder")
    return directories


def _distribution_folder(distribution: str, source: PurePosixPath, where: str) -> Path:
    """Folder below which an installed distribution keeps `source`.

    The distribution's own record of its files is asked, because such wheels hold data only: there
    is no module to import, and the packager's prefix before `source` is not ours to know.
    """
    try:
        files = importlib.metadata.files(distribution) or []
    except importlib.metadata.PackageNotFoundError as error:
        raise HandError(f"{where}: distribution '{distribution}' is not installed") from error
    tail = source.parts
    for file in files:
        if file.parts[-len(tail) :] == tail:
            return Path(str(file.locate())).resolve().parents[len(tail) - 1]
    raise HandError(f"{where}: distribution '{distribution}' has no file '{source}'")


def _fingers(table: Mapping[str, Any], where: str) -> tuple[FingerDescription, ...]:
    entries = table.get("fingers", [])
    tables = isinstance(entries, list) and all(isinstance(entry, dict) for entry in entries)
    if not tables or not entries:
        raise HandError(f"{where}: fingers must be one or more [[fingers]] tables")
    fingers = tuple(_finger(entry, f"{where}: fingers[{i}]") for i, entry in enumerate(entries))
    names = [finger.name for finger in fingers]
    for name in names:
        if names.count(name) > 1:
            raise HandError(f"{where}: two fingers are named '{name}'; names must be unique")
    return fingers


def _finger(table: Mapping[str, Any], where: str) -> FingerDescription:
    _refuse_unknown_keys(table, _FINGER_KEYS, where)
    return FingerDescription(
        name=_text(table, "name", where),
        tip_frame=_text(table, "tip_frame", where),
        pad_centre=_vector(table, "pad_centre", where),
        pad_normal=_unit_vector(table, "pad_normal", where),
        pad_radius=_positive(table, "pad_radius", where),
    )


def _refuse_unknown_keys(table: Mapping[str, Any], allowed: set[str], where: str) -> None:
    for key in table.keys() - allowed:
        raise HandError(f"{where}: unknown key '{key}'; allowed are {', '.join(sorted(allowed))}")


def _required(table: Mapping[str, Any], key: str, where: str) -> Any:
    if key not in table:
        raise HandError(f"{where}: key '{key}' is missing")
    return table[key]


def _text(table: Mapping[str, Any], key: str, where: str) -> str:
    value = _required(table, key, where)
    if not isinstance(value, str) or not value:
        raise HandError(f"{where}: {key} must be a non-empty string, got {value!r}")
    return value


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _vector(table: Mapping[str, Any], key: str, where: str) -> tuple[float, float, float]:
    value = _required(table, key, where)
    if not isinstance(value, list) or len(value) != 3 or not all(map(_is_number, value)):
        raise HandError(f"{where}: {key} must be three finite numbers, got {value!r}")
    x, y, z = map(float, value)
    return x, y, z


def _unit_vector(table: Mapping[str, Any], key: str, where: str) -> tuple[float, float, float]:
    x, y, z = _vector(table, key, where)
    length = math.hypot(x, y, z)
    if abs(length - 1.0) > UNIT_TOLERANCE:
        raise HandError(
            f"{where}: {key} must be a unit vector to {UNIT_TOLERANCE:g}, its length is {length:g}"
        )
    return x / length, y / length, z / length


def _positive(table: Mapping[str, Any], key: str, where: str) -> float:
    value = _required(table, key, where)
    if not _is_number(value) or value <= 0.0:
        raise HandError(f"{where}: {key} must be a positive number of metres, got {value!r}")
    return float(value)
