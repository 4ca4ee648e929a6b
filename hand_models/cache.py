"""What takes seconds to compute from a hand and never changes, kept on disk.

The folder is the platform's place for caches of this user, or what the environment variable
`AXIS_BY_TOUCH_CACHE` says. Files are written whole or not at all; one that cannot be read is
computed again, and a folder that cannot be written to costs time, not success.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import sys
import tempfile
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hand_models.geometry import vertices
from hand_models.hand import Hand

Array = NDArray[np.float64]
Arrays = Mapping[str, NDArray[np.generic]]

CACHE_VARIABLE = "AXIS_BY_TOUCH_CACHE"


def cache_directory() -> Path:
    """Where cached arrays are kept; need not exist yet.

    `$AXIS_BY_TOUCH_CACHE`, else `axis-by-touch` below `$XDG_CACHE_HOME` or the platform's own
    cache folder (`~/.cache`, `~/Library/Caches`, `%LOCALAPPDATA%`).
    """
    if chosen := os.environ.get(CACHE_VARIABLE):
        return Path(chosen)
    return _user_caches() / "axis-by-touch"


def hand_fingerprint(hand: Hand, *settings: object) -> str:
    """Hexadecimal name for a hand's kinematics, meshes, pads and the settings given.

    Equal for equal content whatever file it came from; `settings` are told apart by their `repr`.
    """
    digest = hashlib.sha256(hand.model.saveToString().encode())
    for shape in hand.visual_model.geometryObjects:
        digest.update(repr((shape.name, int(shape.parentJoint))).encode())
        digest.update(np.ascontiguousarray(shape.placement.homogeneous).tobytes())
        digest.update(np.ascontiguousarray(vertices(shape.geometry)).tobytes())
    for finger in hand.fingers:
        pad = (*finger.pad_centre.tolist(), *finger.pad_normal.tolist(), finger.pad_radius)
        if not finger.dome.is_sphere:
            pad += (*finger.dome.centre.tolist(), finger.dome.radius, *finger.dome.axes.ravel())
        digest.update(repr((finger.name, finger.tip_frame, finger.joints, pad)).encode())
    digest.update(repr(settings).encode())
    return digest.hexdigest()[:24]


def cached_arrays(name: str, names: tuple[str, ...], build: Callable[[], Arrays]) -> Arrays:
    """The arrays of a cache file, or those `build` makes, which are then kept.

    Args:
        name: File name without ending; it must name everything the arrays depend on.
        names: The arrays that must be there.
        build: Called when the file is missing, damaged or lacks one of them.
    """
    file = cache_directory() / f"{name}.npz"
    arrays = _read(file, names)
    if arrays is None:
        arrays = build()
        _write(file, arrays)
    return arrays


def _user_caches() -> Path:
    if chosen := os.environ.get("XDG_CACHE_HOME"):
        return Path(chosen)
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local"))
    return Path.home() / ".cache"


def _read(file: Path, names: tuple[str, ...]) -> Arrays | None:
    try:
        with np.load(file, allow_pickle=False) as stored:
            return {name: stored[name] for name in names}
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None


def _write(file: Path, arrays: Arrays) -> None:
    """Whole or not at all: a half-written file never bears the final name."""
    temporary: str | None = None
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=file.parent, suffix=".part")
        with os.fdopen(handle, "wb") as stream:
            np.savez(stream, allow_pickle=False, **arrays)
        os.replace(temporary, file)
    except OSError:  # no space, no permission: the arrays are in hand all the same
        if temporary is not None:
            with contextlib.suppress(OSError):
                os.remove(temporary)
