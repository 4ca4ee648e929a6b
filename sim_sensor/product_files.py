"""Real products as JSON files: a profile in millimetres, a scan with its residual map.

    {"name": ..., "profile": {"z_mm": [...], "r_mm": [...]},
     "residual_map_mm": {"r_minus_profile": [[...], ...]}}          the map may be missing

Heights rise; the map has rows by height from the lowest and columns by meridian angle from zero,
each cell's value at its middle. Other keys (source, licence, statistics) are the writer's own.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from estimator.profile import SplineProfile, spline_through
from estimator.vectors import Array
from sim_sensor.scanned import Scan, scan_of


def read_product(path: Path) -> SplineProfile | Scan:
    """The product's profile, z = 0 at half height; a `Scan` where the file has a residual map.

    Raises:
        ValueError: Not such a file; names the field.
    """
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise ValueError(f"object {path}: cannot be read as JSON ({error})") from None
    try:
        return product_of(record, path.stem)
    except ValueError as error:
        raise ValueError(f"object {path}: {error}") from None


def product_of(record: Any, name: str) -> SplineProfile | Scan:
    """The same from the file's content; `name` where it says none."""
    table = _table(record, "the file")
    curve = _table(table.get("profile"), "profile")
    z, r = (_numbers(curve, key, 1) for key in ("z_mm", "r_mm"))
    if z.shape != r.shape or not len(z):
        raise ValueError(f"profile: z_mm and r_mm need equal lengths, got {len(z)} and {len(r)}")
    profile = spline_through(1e-3 * (z - 0.5 * (z[0] + z[-1])), 1e-3 * r)
    if "residual_map_mm" not in table:
        return profile
    cells = _numbers(_table(table["residual_map_mm"], "residual_map_mm"), "r_minus_profile", 2)
    if np.abs(cells).max(initial=0.0) > 0.2 * r.min():
        raise ValueError("residual_map_mm: larger than a fifth of the radius, is the unit right?")
    return scan_of(str(table.get("name", name)), profile, 1e-3 * cells)


def _table(value: Any, what: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise ValueError(f'{what}: expected an object with keys, as in {{"profile": {{...}}}}')
    return value


def _numbers(table: dict[str, Any], key: str, ndim: int) -> Array:
    if key not in table:
        raise ValueError(f"{key} is missing; there are {', '.join(sorted(table)) or 'no keys'}")
    try:
        values = np.array(table[key], dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{key}: expected numbers") from None
    if values.ndim != ndim or not np.all(np.isfinite(values)):
        shape = "a list" if ndim == 1 else "rows of equal length"
        raise ValueError(f"{key}: expected finite numbers, {shape}")
    return values
