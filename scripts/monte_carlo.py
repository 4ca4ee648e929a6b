"""The Monte Carlo behind the estimator's claims: honesty, efficiency, bias and more, with a seed.

Studies
    honesty     NEES, coverage, labels over families x sensors x 3, 4, 6, 10 contacts
    efficiency  root mean square error over the Cramer-Rao bound
    bias        a millimetre on each fingertip, modelled and not
    degenerate  touches that leave the axis open, and false alarms on well-placed ones
    scan        touches of a scanned product (--objects), whose directions err with heavy tails
    fuzz        anything a contact may hold: no NaN, no exception, no long run

Every figure comes with its count and its 95 % interval (Wilson for shares, bootstrap else).
Objects are cylinder, cone, barrel, vase, torus section and the paper's lathe object, radius 15 to
60 mm, in random poses; readings err as the estimator is told unless --structured.

Examples:
    python scripts/monte_carlo.py
    python scripts/monte_carlo.py --only honesty --sensors gel taxel --count 4800 --out mc.json
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import tyro
from bias_study import bias_study
from degenerate import degenerate_study
from fuzz import fuzz_study
from honesty import Interval, Share
from output_files import require_writable, write_whole
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table as RichTable
from scan import load_scan
from scan_study import scan_study
from studies import efficiency_study, honesty_study
from workload import Cell, Table, Workload

from estimator.fusion import estimate_axes
from estimator.sensors import SENSORS

WIDTH = 140  # of the tables, where the terminal has less
STUDIES: dict[str, tuple[Callable[[Workload], list[Table]], int]] = {
    "honesty": (honesty_study, 16800),
    "efficiency": (efficiency_study, 16800),
    "bias": (bias_study, 16800),
    "degenerate": (degenerate_study, 16800),
    "scan": (scan_study, 16800),
    "fuzz": (fuzz_study, 100000),
}


@dataclass(frozen=True)
class Options:
    """Command line of monte_carlo.py."""

    only: tuple[str, ...] = tuple(STUDIES)
    """Studies to run."""
    count: int | None = None
    """Runs of each study, spread over its cells; each has its own default."""
    seed: int = 0
    """Of everything random."""
    sensors: tuple[str, ...] = tuple(SENSORS)
    """Sensor classes."""
    structured: bool = False
    """Honesty: let readings err as real sensors of the class do, not as the estimator is told."""
    objects: Path | None = None
    """Folder of scanned objects (JSON); without it the study of a scan is left out."""
    out: Path | None = None
    """Write the tables into this file, as JSON."""


def main() -> int:
    options = tyro.cli(Options, description=__doc__)
    try:
        _require_sane(options)
    except (ValueError, OSError) as error:
        print(f"monte_carlo: {error}", file=sys.stderr)
        return 2
    console = Console(width=max(Console().width, WIDTH))
    tables = []
    for name in options.only:
        if name == "scan" and options.objects is None:
            console.print("scan: left out, --objects names no folder of scanned objects")
            continue
        for table in _run(name, options, console):
            tables.append(table)
            console.print(_printed(table))
    if options.out is not None:
        try:
            text = json.dumps(_document(options, tables), indent=1, allow_nan=False)
            write_whole(options.out, (text + "\n").encode())
        except OSError as error:
            print(f"monte_carlo: --out {options.out}: cannot be written ({error})", file=sys.stderr)
            return 2
    return 0


def _require_sane(options: Options) -> None:
    for option, given, known in (
        ("--only", options.only, tuple(STUDIES)),
        ("--sensors", options.sensors, tuple(SENSORS)),
    ):
        if not given or not set(given) <= set(known):
            raise ValueError(f"{option}: expected some of {', '.join(known)}")
    if options.count is not None and options.count < 1:
        raise ValueError(f"--count: expected at least one run, got {options.count}")
    if options.seed < 0:
        raise ValueError(f"--seed: expected a number >= 0, got {options.seed}")
    if options.objects is not None and "scan" in options.only:
        load_scan(options.objects)
    if options.out is not None:
        require_writable(options.out.parent)


def _run(name: str, options: Options, console: Console) -> list[Table]:
    study, usual = STUDIES[name]
    count = usual if options.count is None else options.count
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, TimeRemainingColumn(), console=console, transient=True) as progress:
        task = progress.add_task(name, total=count)
        work = Workload(
            estimate_axes,
            count,
            options.seed,
            options.sensors,
            options.structured,
            options.objects,
            lambda runs: progress.advance(task, runs),
        )
        return study(work)


def _printed(table: Table) -> RichTable:
    printed = RichTable(title=table.title, box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for heading, cell in table.rows[0].items():
        printed.add_column(heading, justify="left" if isinstance(cell, str) else "right")
    for row in table.rows:
        printed.add_row(*map(_in_words, row.values()))
    return printed


def _in_words(cell: Cell) -> str:
    """Intervals stand below their figure; shares in per cent; a dash where nothing was counted."""
    if isinstance(cell, Interval) and not np.isfinite(cell.value):
        return "-"
    if isinstance(cell, Share):
        return f"{100 * cell.value:.1f} %\n{100 * cell.low:.1f}-{100 * cell.high:.1f}"
    if isinstance(cell, Interval):
        return f"{cell.value:.4g}\n{cell.low:.3g}-{cell.high:.3g}"
    return f"{cell:.4g}" if isinstance(cell, float) else str(cell)


def _document(options: Options, tables: list[Table]) -> dict[str, object]:
    settings = {k: str(v) if isinstance(v, Path) else v for k, v in asdict(options).items()}
    return {
        "options": settings,
        "tables": [
            {
                "title": table.title,
                "rows": [{k: _plain(v) for k, v in row.items()} for row in table.rows],
            }
            for table in tables
        ],
    }


def _plain(cell: Cell) -> object:
    """For JSON, which knows no NaN."""
    if isinstance(cell, Interval):
        return {name: _plain(value) for name, value in cell._asdict().items()}
    return None if isinstance(cell, float) and not np.isfinite(cell) else cell


if __name__ == "__main__":
    sys.exit(main())
