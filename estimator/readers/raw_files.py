"""Raw touches in a file: what the sensors reported, and where they were.

An .npz file with N touches of one kind of sensor:

| array         | shape        | unit, meaning                                                   |
|---------------|--------------|-----------------------------------------------------------------|
| `depth`       | (N, H, W)    | m, into the gel, NaN where a pixel is dead, *or*                 |
| `strains`     | (N, R, C)    | -, compressive positive (or N, of taxels), NaN where one is dead |
| `pixel_pitch` | ()           | m, with `depth` only                                             |
| `X_WS`        | (N, 4, 4)    | poses of the sensor in the world, rigid, translation in m        |
| `finger`      | (N,)         | names of the touching fingertips, optional                       |
| `sensor`      | ()           | kind of the sensor, such as "gel-depth", optional                |
| `pad_radius`  | ()           | m, of a domed pad, with `depth` only, optional (flat)            |

The frame S is the reader's (`estimator.readers.depth`, `estimator.readers.strain`). Nothing in the
file is run: pickled objects are refused.
"""

from __future__ import annotations

import contextlib
import os
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.vectors import Array, frozen

_KNOWN = ("depth", "strains", "pixel_pitch", "X_WS", "finger", "sensor", "pad_radius")
_RIGID = 1e-5


@dataclass(frozen=True, eq=False)
class RawTouches:
    """N touches with one kind of sensor; exactly one of depth and strains is given.

    Args:
        X_WS: Poses of the sensor, (N, 4, 4).
        depth: Images [m], (N, H, W).
        pixel_pitch: [m], with depth.
        strains: Compressive positive [-], or forces of taxels [N], of the whole array, (N, R, C).
        finger: N names, or none.
        sensor: Kind, empty if not said.
        pad_radius: Of a domed pad [m].
    Raises:
        ValueError: Anything that is not so; the message names the array.
    """

    X_WS: Array
    depth: Array | None = None
    pixel_pitch: float = float("nan")
    strains: Array | None = None
    finger: tuple[str, ...] = ()
    sensor: str = ""
    pad_radius: float = float("inf")

    def __post_init__(self) -> None:
        if (self.depth is None) == (self.strains is None):
            raise ValueError("expected either depth or strains, exactly one of them")
        N = len(self)
        if N == 0:
            raise ValueError("expected one touch or more, got none")
        _set(self, "X_WS", (N, 4, 4))
        _require_rigid(self.X_WS)
        if self.depth is not None:
            _set(self, "depth", (N, None, None))
            if not (np.isfinite(self.pixel_pitch) and self.pixel_pitch > 0.0):
                raise ValueError(f"pixel_pitch: expected > 0 [m], got {self.pixel_pitch}")
            if not self.pad_radius > 0.0:
                raise ValueError(f"pad_radius: expected > 0 [m] or inf, got {self.pad_radius}")
        else:
            _set(self, "strains", (N, None, None))
        if len(self.finger) not in (0, N):
            raise ValueError(f"finger: expected {N} names or none, got {len(self.finger)}")

    def __len__(self) -> int:
        signals = self.strains if self.depth is None else self.depth
        return 0 if signals is None else len(np.atleast_1d(signals))


def read_raw(path: str | Path) -> RawTouches:
    """Raw touches of an .npz file in the layout above.

    Raises:
        ValueError: No such file, not .npz, an array missing, unknown, of the wrong shape or of
            pickled objects, a pose that is not rigid; the message names the file and the array.
    """
    try:
        arrays = _arrays(Path(path))
        unknown = sorted(set(arrays) - set(_KNOWN))
        if unknown:
            raise ValueError(f"{unknown[0]} is unknown; known are {', '.join(_KNOWN)}")
        if "X_WS" not in arrays:
            raise ValueError("X_WS is missing: the sensor's pose in the world at each touch")
        if "depth" in arrays and "pixel_pitch" not in arrays:
            raise ValueError("pixel_pitch is missing: depth needs it [m]")
        return RawTouches(
            X_WS=arrays["X_WS"],
            depth=_optional(arrays, "depth"),
            pixel_pitch=_number(arrays, "pixel_pitch", float("nan")),
            strains=_optional(arrays, "strains"),
            finger=tuple(str(name) for name in np.atleast_1d(arrays.get("finger", []))),
            sensor=str(arrays.get("sensor", "")),
            pad_radius=_number(arrays, "pad_radius", float("inf")),
        )
    except ValueError as error:
        raise ValueError(f"raw touches {path}: {error}") from None


def write_raw(path: str | Path, touches: RawTouches) -> None:
    """Write the layout above, whole or not at all.

    Raises:
        OSError: The folder cannot be written.
    """
    path = Path(path)
    arrays: dict[str, Any] = {"X_WS": touches.X_WS}
    if touches.depth is not None:
        arrays |= {"depth": touches.depth, "pixel_pitch": touches.pixel_pitch}
        if np.isfinite(touches.pad_radius):
            arrays["pad_radius"] = touches.pad_radius
    if touches.strains is not None:
        arrays["strains"] = touches.strains
    if touches.finger:
        arrays["finger"] = np.array(touches.finger, dtype=np.str_)
    if touches.sensor:
        arrays["sensor"] = np.array(touches.sensor, dtype=np.str_)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            np.savez_compressed(file, **arrays)
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        raise


def _arrays(path: Path) -> dict[str, NDArray[Any]]:
    """All arrays of the file."""
    try:
        file = np.load(path, allow_pickle=False)
        if not isinstance(file, np.lib.npyio.NpzFile):
            raise ValueError("expected an .npz file of named arrays, got a single array")
        with file:
            return {name: file[name] for name in file.files}
    except FileNotFoundError:
        raise ValueError("there is no such file") from None
    except (OSError, zipfile.BadZipFile, EOFError, KeyError) as error:
        raise ValueError(f"cannot be read as .npz ({error})") from None
    except ValueError as error:
        if "pickle" in str(error).lower():
            raise ValueError(
                "holds pickled objects or is no .npz file; save plain arrays"
            ) from None
        raise


def _optional(arrays: dict[str, NDArray[Any]], name: str) -> Array | None:
    return arrays.get(name)


def _number(arrays: dict[str, NDArray[Any]], name: str, default: float) -> float:
    if name not in arrays:
        return default
    value = arrays[name]
    if value.size != 1 or not np.issubdtype(value.dtype, np.number):
        raise ValueError(f"{name}: expected one number, got shape {value.shape}, {value.dtype}")
    return float(np.real(value.reshape(()).item()))


def _set(touches: RawTouches, name: str, shape: tuple[int | None, ...]) -> None:
    """Check one array and keep a read-only copy in float64."""
    values = np.asarray(getattr(touches, name))
    if not (np.issubdtype(values.dtype, np.floating) or np.issubdtype(values.dtype, np.integer)):
        raise ValueError(f"{name}: expected real numbers, got {values.dtype}")
    matches = len(values.shape) == len(shape) and all(
        want is None or want == have for want, have in zip(shape, values.shape, strict=True)
    )
    if not matches:
        wanted = ", ".join("any" if n is None else str(n) for n in shape)
        raise ValueError(f"{name}: expected shape ({wanted}), got {values.shape}")
    object.__setattr__(touches, name, frozen(values))


def _require_rigid(X: Array) -> None:
    R = X[:, :3, :3]
    with np.errstate(invalid="ignore"):
        off = np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
        good = (off < _RIGID) & (np.linalg.det(np.nan_to_num(R)) > 0.0)
        good &= np.all(np.isfinite(X), axis=(1, 2)) & np.all(X[:, 3] == [0, 0, 0, 1], axis=1)
    if not np.all(good):
        raise ValueError(
            f"X_WS: expected rigid poses (rotation, translation, last row 0 0 0 1), "
            f"touch {int(np.argmin(good)) + 1} is not one"
        )
