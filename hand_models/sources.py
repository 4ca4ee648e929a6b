"""Which part of which model file a description means, and where that file is."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from hand_models.fields import HandError, numbers, optional_text, text, texts

SOURCE_KEYS = {"source", "distribution", "package_directories", "base", "without", "fixed"}
_ENDINGS = (".urdf", ".xml")


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


def read_source(table: Mapping[str, Any], folder: Path, where: str) -> SourceDescription:
    """The fields of a table that say where its model comes from.

    Args:
        folder: What relative paths are relative to, where no distribution is named.
        where: For messages.
    Raises:
        HandError: A field that is wrong, or a file or distribution that is not there.
    """
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
