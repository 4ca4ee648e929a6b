"""Estimate the axis of a surface of revolution from measured fingertip contacts.

The file holds positions, outward normals, principal directions and curvatures of two or more
contacts. Nobody says which direction is the meridian's and which the parallel's: that is found
along with the axis, and reported with its probability.

    {"unit": "m" | "mm" | "in",
     "contacts": [{"position": [x, y, z], "normal": [x, y, z],
                   "directions": [[x, y, z], [x, y, z]], "curvatures": [k1, k2]}, ...]}

Curvatures are per unit, null where the sensor saturated (flatter than it resolves).

Example: python scripts/estimate_axis.py tests/data/table8.json
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from estimator.estimate import AxisEstimate
from estimator.fusion import estimate_axis
from estimator.records import estimate_record, read_contacts
from estimator.sensors import sensor_noise


@dataclass(frozen=True)
class Options:
    """Command line of estimate_axis.py."""

    file: tyro.conf.Positional[Path]
    """JSON file of contacts."""
    sensor: str = "robotworld"
    """What the sensor is worth: ideal, fearing1988, robotworld, taxel, gel, gel-good, gel-poor.
    The default is the most cautious: directions share an offset of about ten degrees."""
    only: Annotated[tuple[int, ...], tyro.conf.arg(metavar="N")] = ()
    """Use only these contacts, counted from 1."""
    json: bool = False
    """Print the estimate as JSON (SI, radians) instead of tables."""


def main() -> int:
    options = tyro.cli(Options, description=__doc__)
    try:
        contacts = read_contacts(options.file, sensor_noise(options.sensor))
        wrong = [n for n in options.only if not 1 <= n <= len(contacts)]
        if wrong:
            raise ValueError(f"--only {wrong[0]}: the file holds contacts 1 to {len(contacts)}")
        chosen = [contacts[n - 1] for n in dict.fromkeys(options.only)] or contacts
        estimate = estimate_axis(chosen)
    except ValueError as error:
        print(f"estimate_axis: {error}", file=sys.stderr)
        return 2
    if options.json:
        print(json.dumps(estimate_record(estimate), indent=2))
    else:
        _print(estimate, len(chosen))
    return 0


def _print(estimate: AxisEstimate, count: int) -> None:
    console = Console()
    colour = {"determined": "green", "ambiguous": "yellow", "undetermined": "red"}
    console.print(
        f"[bold {colour[estimate.verdict]}]{estimate.verdict}[/] from {count} contacts "
        f"(fit p = {estimate.p_value:.2g})"
    )
    for reason in estimate.reasons:
        console.print(f"  {reason}")
    console.print("\n[bold]Axes that explain the contacts[/]", _hypotheses(estimate))
    console.print("[bold]Which row of each contact is the parallel's[/]", _labellings(estimate))


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
