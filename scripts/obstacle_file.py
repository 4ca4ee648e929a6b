"""What stands about the object, from a TOML file: a table and boxes, in millimetres and degrees.

table_mm = 20            # height of a table; leave it out for none
[[box]]
name = "the shelf"       # as it is called in a sentence
centre_mm = [350, 200, 150]
size_mm = [300, 20, 300]
yaw_deg = 30             # about the vertical; 0 if left out
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from estimator.vectors import Array, basis_across
from planner.motions.surroundings import Box
from planner.reaching.reach_task import ReachOptions
from sim_sensor.viewer.episode import Block

SHOWN_TABLE = (0.8, 0.8, 0.01)  # a table is shown as a board of this size [m]
TABLE, BOX = {"table_mm", "box"}, {"name", "centre_mm", "size_mm", "yaw_deg"}


def read_obstacles(path: Path | None) -> dict[str, Any]:
    """Table and boxes, as `ReachOptions` takes them; nothing for no file.

    Raises:
        ValueError: A file that cannot be read, or what is wrong in it.
    """
    if path is None:
        return {}
    try:
        told = tomllib.loads(path.read_text(encoding="utf-8"))
        _known(told, TABLE)
        boxes = tuple(_box(one, k) for k, one in enumerate(told.get("box", []), start=1))
        plane = None
        if "table_mm" in told:
            plane = (0.0, 0.0, 1.0, 1e-3 * _numbers(told, "table_mm", ())[0])
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, ValueError) as error:
        raise ValueError(f"--obstacles {path}: {error}") from None
    return {"table": plane, "boxes": boxes}


def blocks(reach: ReachOptions, object_W: Array) -> tuple[Block, ...]:
    """Table and boxes as the page shows them; the table is a board below the object.

    Args:
        object_W: Where the object is, (3,) [m].
    """
    shown = [Block(box.pose, np.array(box.size)) for box in reach.boxes]
    if reach.table is not None:
        n, height = np.array(reach.table[:3]), reach.table[3]
        below = object_W - (object_W @ n - height + 0.5 * SHOWN_TABLE[2]) * n
        across = basis_across(n)
        R = np.column_stack([across[0], across[1], n])
        shown.append(Block(pin.SE3(R, below), np.array(SHOWN_TABLE)))
    return tuple(shown)


def _box(told: Mapping[str, Any], number: int) -> Box:
    _known(told, BOX)
    half = 0.5 * np.deg2rad(_numbers(told, "yaw_deg", (), missing=0.0)[0])
    centre, size = (_numbers(told, key, (3,)) for key in ("centre_mm", "size_mm"))
    return Box(
        centre=(1e-3 * centre[0], 1e-3 * centre[1], 1e-3 * centre[2]),
        size=(1e-3 * size[0], 1e-3 * size[1], 1e-3 * size[2]),
        quaternion_xyzw=(0.0, 0.0, float(np.sin(half)), float(np.cos(half))),
        name=str(told.get("name", f"box {number}")),
    )


def _known(told: Mapping[str, Any], keys: set[str]) -> None:
    for key in told:
        if key not in keys:
            raise ValueError(f"{key} is unknown; known are {', '.join(sorted(keys))}")


def _numbers(
    told: Mapping[str, Any], key: str, shape: tuple[int, ...], missing: float | None = None
) -> list[float]:
    value = told.get(key, missing)
    try:
        values = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        values = np.array(np.nan)
    if values.shape != shape or not np.all(np.isfinite(values)):
        wanted = "a finite number" if shape == () else f"{shape[0]} finite numbers"
        raise ValueError(f"{key}: expected {wanted}, got {value}")
    return [float(v) for v in np.atleast_1d(values)]
