"""Estimate the axis of a surface of revolution from measured fingertip contacts.

The file holds positions, outward normals, principal directions and curvatures of two or more
contacts. Nobody says which direction is the meridian's and which the parallel's: that is found
along with the axis, and reported with its probability.

    {"unit": "m" | "mm" | "in",
     "contacts": [{"position": [x, y, z], "normal": [x, y, z],
                   "directions": [[x, y, z], [x, y, z]], "curvatures": [k1, k2],
                   "finger": "thumb", "sensor": "gel 1"}, ...]}

Curvatures are per unit, null where the sensor saturated (flatter than it resolves). Finger and
sensor may be left out; contacts that name the same one share its errors, which are estimated along.

With --raw the file holds what the sensors reported, depth images or strains with the pose of the
sensor at each touch (an .npz file; its layout stands in estimator/readers/raw_files.py), and is
read first.

Examples:
    python scripts/estimate_axis.py tests/data/table8.json
    python scripts/estimate_axis.py --raw out/raw.npz
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from estimator.assumptions import Assumptions
from estimator.contact import Contact, SensorNoise
from estimator.estimate import AxisEstimate
from estimator.fusion import estimate_axis
from estimator.readers.raw_files import read_raw
from estimator.readers.raw_sensors import RAW_SENSORS, raw_sensor, read_touches
from estimator.records import estimate_record, read_contacts
from estimator.sensors import sensor_noise

CAUTIOUS = "robotworld"
SUSPECT = 0.5  # probability of a gross error that is worth a word
SHARED = {  # what a nuisance is called, its unit in SI, digits
    "direction_offset": ("rotation of the directions, deg", 180.0 / np.pi, 1),
    "scale_offset": ("radii read too large by, %", 100.0, 1),
    "position_bias": ("shift of the positions (x y z), mm", 1e3, 2),
}


@dataclass(frozen=True)
class Options:
    """Command line of estimate_axis.py."""

    file: tyro.conf.Positional[Path | None] = None
    """JSON file of contacts."""
    raw: Path | None = None
    """In place of it, an .npz file of raw touches."""
    sensor: str | None = None
    """What the sensor is worth: ideal, fearing1988, robotworld, taxel, gel, gel-good, gel-poor.
    The default is the most cautious, robotworld: directions share an offset of about ten degrees.
    Of raw touches, how they are read: fearing-strain, gel-depth, taxel-array; default: as the file
    says."""
    direction_offset_deg: float | None = None
    """How far all directions of one sensor may be rotated alike; 0: not at all. Default: as the
    sensor says."""
    scale_offset_percent: float | None = None
    """By how much all radii of one sensor may be wrong alike; 0: not at all. Default: as the
    sensor says."""
    position_bias_mm: float | None = None
    """How far all positions of one finger may be shifted alike; 0: not at all. Default: as the
    sensor says."""
    gross_error: float = Assumptions().gross_error
    """Probability that a contact is grossly wrong, from five contacts up; 0 trusts them all."""
    slope_deg: float | None = None
    """Standard deviation of the profile's slope, for gently tapered objects. Default: any slope."""
    only: Annotated[tuple[int, ...], tyro.conf.arg(metavar="N")] = ()
    """Use only these contacts, counted from 1."""
    json: bool = False
    """Print the estimate as JSON (SI, radians) instead of tables."""


def main() -> int:
    options = tyro.cli(Options, description=__doc__)
    try:
        contacts, notes = _contacts(options)
        wrong = [n for n in options.only if not 1 <= n <= len(contacts)]
        if wrong:
            raise ValueError(f"--only {wrong[0]}: the file holds contacts 1 to {len(contacts)}")
        chosen = [contacts[n - 1] for n in dict.fromkeys(options.only)] or contacts
        estimate = estimate_axis(chosen, assumptions=_assumptions(options))
    except ValueError as error:
        print(f"estimate_axis: {error}", file=sys.stderr)
        return 2
    if options.json:
        print(json.dumps(estimate_record(estimate), indent=2))
    else:
        numbers = list(dict.fromkeys(options.only)) or list(range(1, len(contacts) + 1))
        for note in notes:
            print(note)
        _print(estimate, numbers)
    return 0


def _contacts(options: Options) -> tuple[list[Contact], list[str]]:
    """The contacts of either kind of file, and what the reader says of raw touches."""
    if (options.file is None) == (options.raw is None):
        raise ValueError("expected one file: of contacts (JSON), or of raw touches (--raw)")
    if options.file is not None:
        return list(read_contacts(options.file, _noise(options, options.sensor or CAUTIOUS))), []
    assert options.raw is not None
    touches = read_raw(options.raw)
    name = options.sensor or touches.sensor
    if not name:
        raise ValueError(f"--sensor: {options.raw} does not say which; {', '.join(RAW_SENSORS)}")
    sensor = replace(raw_sensor(name), expected=_noise(options, name))
    readings = read_touches(touches, sensor)
    notes = [
        f"touch {number}: {'; '.join(reading.flags)}"
        for number, reading in enumerate(readings, start=1)
        if reading.flags
    ]
    return [r.contact for r in readings if r.contact is not None], notes


def _noise(options: Options, sensor: str) -> SensorNoise:
    """The sensor's noise, with what the options say of the errors its readings share."""
    shared = {
        "direction_offset": ("--direction-offset-deg", options.direction_offset_deg, np.pi / 180),
        "scale_offset": ("--scale-offset-percent", options.scale_offset_percent, 1e-2),
        "position_bias": ("--position-bias-mm", options.position_bias_mm, 1e-3),
    }
    asked = {}
    for name, (option, value, unit) in shared.items():
        if value is not None:
            if not 0.0 <= value < np.inf:
                raise ValueError(f"{option} {value:g}: expected a number >= 0")
            asked[name] = value * unit
    return replace(sensor_noise(sensor), **asked)


def _assumptions(options: Options) -> Assumptions:
    if not 0.0 <= options.gross_error < 0.5:
        raise ValueError(f"--gross-error {options.gross_error:g}: expected within [0, 0.5)")
    slope = options.slope_deg
    if slope is not None and not 0.0 < slope < 90.0:
        raise ValueError(f"--slope-deg {slope:g}: expected within (0, 90)")
    return Assumptions(
        gross_error=options.gross_error, slope=None if slope is None else float(np.deg2rad(slope))
    )


def _print(estimate: AxisEstimate, numbers: list[int]) -> None:
    console = Console()
    colour = {"determined": "green", "ambiguous": "yellow", "undetermined": "red"}
    console.print(
        f"[bold {colour[estimate.verdict]}]{estimate.verdict}[/] from {len(numbers)} contacts "
        f"(fit p = {estimate.p_value:.2g})"
    )
    for reason in estimate.reasons:
        console.print(f"  {reason}")
    for line in _suspects(estimate, numbers):
        console.print(f"  {line}")
    if estimate.nuisances:
        console.print("\n[bold]Errors that contacts share[/]", _nuisances(estimate))
    console.print("\n[bold]Axes that explain the contacts[/]", _hypotheses(estimate))
    console.print("[bold]Which row of each contact is the parallel's[/]", _labellings(estimate))


def _suspects(estimate: AxisEstimate, numbers: list[int]) -> list[str]:
    """Contacts that may be grossly wrong, by their numbers in the file."""
    return [
        f"[yellow]contact {number} may be grossly wrong (P {p:.2f}): touch there again[/]"
        for number, p in zip(numbers, estimate.gross_errors, strict=True)
        if p > SUSPECT
    ]


def _nuisances(estimate: AxisEstimate) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for heading in ("of", "error", "found", "sd"):
        table.add_column(heading, justify="right" if heading in ("found", "sd") else "left")
    for nuisance in estimate.nuisances:
        words, unit, digits = SHARED[nuisance.name]
        table.add_row(
            nuisance.owner or "all",
            words,
            " ".join(f"{unit * x:.{digits}f}" for x in nuisance.mean),
            " ".join(f"{unit * x:.{digits}f}" for x in nuisance.sd),
        )
    return table


def _hypotheses(estimate: AxisEstimate) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for heading in ("P", "through, mm", "direction", "sd, deg", "sd, mm", "offset, deg"):
        table.add_column(heading, justify="right", no_wrap=True)
    for h in estimate.hypotheses[:5]:
        sd = np.sqrt(np.diag(h.covariance))
        table.add_row(
            f"{h.probability:.3f}",
            " ".join(f"{1e3 * x:.1f}" for x in h.axis.point),
            " ".join(f"{x:.3f}" for x in h.axis.direction),
            " ".join(f"{x:.1f}" for x in np.rad2deg(sd[2:])),
            " ".join(f"{1e3 * x:.2f}" for x in sd[:2]),
            f"{np.rad2deg(h.direction_offset):.1f}",
        )
    return table


def _labellings(estimate: AxisEstimate) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column("labelling")
    table.add_column("P", justify="right")
    for labelling, probability in estimate.labellings[:5]:
        table.add_row(str(labelling), f"{probability:.3f}")
    return table


if __name__ == "__main__":
    sys.exit(main())
