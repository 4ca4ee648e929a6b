"""Things to touch: built-in profiles by name, profiles from a CSV of r,z rows, real products.

Every profile is twice differentiable and centred: z = 0 is at half height. Sizes are those of
things a hand takes hold of.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from estimator.profile import (
    PolynomialProfile,
    Profile,
    SplineProfile,
    barrel,
    cone,
    cylinder,
    sphere,
    spline_through,
)
from estimator.vectors import Array
from sim_sensor.mesh_objects import SUFFIXES, read_mesh
from sim_sensor.product_files import read_product

INCH = 0.0254
_UNITS = {"mm": 1e-3, "m": 1.0}
_FEWEST_POINTS = 4


LARGEST = 10.0  # radius or height of an object [m]


def _lathe_of_the_paper() -> PolynomialProfile:
    """r = -0.2078 + 0.6034 z - 0.07465 z^2 inches over z = 4.4 .. 6.6.

    The profile of Berkemeier & Fearing's lathe object, refitted from their Table 8; here in
    metres about the middle, z = 5.5 inches.
    """
    inches = np.polynomial.Polynomial([-0.2078, 0.6034, -0.07465])
    c0, c1, c2 = (float(inches.deriv(k)(5.5)) if k else float(inches(5.5)) for k in range(3))
    return PolynomialProfile((c0 * INCH, c1, 0.5 * c2 / INCH), (-1.1 * INCH, 1.1 * INCH))


def _through(height_mm: float, radii_mm: tuple[float, ...]) -> SplineProfile:
    """A spline through radii at equal steps of height, bottom first."""
    z = np.linspace(-0.5, 0.5, len(radii_mm)) * height_mm * 1e-3
    return spline_through(z, np.array(radii_mm) * 1e-3)


_OBJECTS: dict[str, Callable[[], Profile]] = {
    "can": lambda: cylinder(0.033, 0.115),
    "bottle": lambda: _through(
        190.0, (31.0, 33.0, 33.5, 33.5, 33.0, 32.0, 29.0, 23.5, 18.0, 15.0, 14.0)
    ),
    "cone": lambda: cone(0.030, -0.15, 0.120),
    "cup": lambda: cone(0.034, 0.13, 0.100),
    "barrel": lambda: barrel(0.038, 3.0, 0.120),
    "jar-lid": lambda: _through(60.0, (40.0, 39.8, 39.2, 38.2, 36.8)),
    "knob": lambda: _through(60.0, (20.0, 25.0, 28.0, 29.0, 28.0, 25.0, 20.0)),
    "vase": lambda: _through(180.0, (26.0, 33.0, 38.0, 39.0, 35.0, 28.0, 22.5, 21.5, 25.0)),
    "egg": lambda: _through(70.0, (15.0, 21.0, 24.5, 26.0, 26.0, 24.5, 21.5, 17.0, 11.0)),
    "spindle": lambda: _through(120.0, (21.0, 27.0, 31.0, 32.5, 31.0, 27.0, 21.0)),
    "sphere": lambda: sphere(0.035, 0.060),
    "paper-lathe": _lathe_of_the_paper,
}
OBJECTS: tuple[str, ...] = tuple(_OBJECTS)


def load_object(name_or_csv: str | Path) -> Profile:
    """A built-in object by name, the spline through the points of a CSV file, or a real product.

    The CSV file has the header `r_mm,z_mm` or `r_m,z_m` (columns in either order) and one row for
    each point, z rising or falling from row to row. The profile is moved along the axis so that
    z = 0 is at half height. A JSON file is a product (`sim_sensor.product_files`), a mesh
    somebody's scan (`sim_sensor.mesh_objects`).

    Args:
        name_or_csv: One of `OBJECTS`, or the path of a file.
    Returns:
        A `Scan` where there is a residual map.
    Raises:
        ValueError: Unknown name (lists the known ones), or a file whose header, numbers or order
            of points do not make a profile; the message says which line.
    """
    name = str(name_or_csv)
    if name in _OBJECTS:
        return _OBJECTS[name]()
    path = Path(name_or_csv)
    if path.is_file():
        profile = _read(path)
        if _size(profile) > LARGEST:
            raise ValueError(f"object {path}: larger than {LARGEST:g} m, is the unit right?")
        return profile
    if path.suffix.lower() in (".csv", ".json", *SUFFIXES):
        raise ValueError(f"object {name!r}: there is no such file")
    raise ValueError(
        f"object {name!r} is unknown; known are {', '.join(OBJECTS)}, "
        "or the path of a CSV file with the header r_mm,z_mm, a product's JSON file or a mesh"
    )


def _read(path: Path) -> Profile:
    """By its ending; what has none that is known is a CSV."""
    suffix = path.suffix.lower()
    if suffix in SUFFIXES:
        return read_mesh(path).scan
    return read_product(path) if suffix == ".json" else _read_profile(path)


def _size(profile: Profile) -> float:
    """The larger of radius and height [m]."""
    z = np.linspace(*profile.z_range, 201)
    return float(max(profile.derivatives(z)[0].max(), z[-1] - z[0]))


def _read_profile(path: Path) -> SplineProfile:
    """The spline through the points of a file, centred."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(_numbered_rows(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"object {path}: cannot be read as text ({error})") from None
    if not rows:
        raise ValueError(f"object {path}: the file is empty, expected the header r_mm,z_mm")
    columns, scale = _columns(path, *rows[0])
    points = np.array([_point(path, line, row, columns) for line, row in rows[1:]]).reshape(-1, 2)
    if len(points) < _FEWEST_POINTS:
        raise ValueError(
            f"object {path}: {_FEWEST_POINTS} points or more make a profile, got {len(points)}"
        )
    _require_rising(path, [line for line, _ in rows[1:]], points[:, 1])
    r, z = (scale * points[:: 1 if points[-1, 1] > points[0, 1] else -1]).T
    try:
        return spline_through(z - 0.5 * (z[0] + z[-1]), r)
    except ValueError as error:
        raise ValueError(f"object {path}: {error}") from None


def _numbered_rows(lines: Iterator[str]) -> Iterator[tuple[int, list[str]]]:
    """Rows that are not blank, with the number of their line."""
    reader = csv.reader(lines)
    for row in reader:
        if any(cell.strip() for cell in row):
            yield reader.line_num, [cell.strip() for cell in row]


def _columns(path: Path, line: int, header: list[str]) -> tuple[tuple[int, int], float]:
    """Where r and z stand, and their unit in metres."""
    for unit, scale in _UNITS.items():
        if sorted(header) == [f"r_{unit}", f"z_{unit}"]:
            return (header.index(f"r_{unit}"), header.index(f"z_{unit}")), scale
    raise ValueError(
        f"object {path}, line {line}: expected the header r_mm,z_mm or r_m,z_m, "
        f"got {','.join(header)!r}"
    )


def _point(path: Path, line: int, row: list[str], columns: tuple[int, int]) -> tuple[float, float]:
    """One row as (r, z) in the file's unit."""
    if len(row) != 2:
        raise ValueError(f"object {path}, line {line}: expected 2 numbers, got {len(row)} cells")
    try:
        r, z = (float(row[column]) for column in columns)
    except ValueError:
        raise ValueError(
            f"object {path}, line {line}: expected two numbers, got {','.join(row)!r}"
        ) from None
    if not (np.isfinite(r) and np.isfinite(z)):
        raise ValueError(f"object {path}, line {line}: expected finite numbers, got {r:g}, {z:g}")
    if r <= 0:
        raise ValueError(f"object {path}, line {line}: radius must be positive, got {r:g}")
    return r, z


def _require_rising(path: Path, lines: list[int], z: Array) -> None:
    """Heights go one way from row to row: r(z) is a function."""
    sense = np.sign(z[-1] - z[0]) or 1.0
    back = np.nonzero(sense * np.diff(z) <= 0)[0]
    if len(back):
        i = int(back[0])
        raise ValueError(
            f"object {path}, line {lines[i + 1]}: the profile folds back, "
            f"z = {z[i + 1]:g} after {z[i]:g}"
        )
