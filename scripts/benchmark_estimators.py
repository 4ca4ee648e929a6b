"""Our estimator against others on the same contacts: accuracy and time, as ratios.

For every number of contacts all settings (object x sensor x arc) are drawn anew, in random poses,
and each estimator meets the same contacts. A ratio above 1 says that the other is worse or slower
than ours, one at a time. Intervals are 95 %, bootstrap over the problems. An estimator that needs
more contacts has no figures; one that finds nothing where it applies is 90 deg off.

Needs pyransac3d: pip install -e '.[benchmark]'
"""

from __future__ import annotations

import importlib.util
import json
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path

import numpy as np
from benchmark_problems import ARCS, BATCH, CONTESTANTS, OBJECTS, OURS, Setting, draw_problems
from benchmark_scores import FAR_DEG, Figures, Interval, Scores, figures_of, joined, score_all
from output_files import write_whole
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import track
from rich.table import Table

from estimator.fusion import estimate_axes, estimate_axis
from estimator.sensors import sensor_noise

REPEATS = 5  # of what is timed as a whole
SINGLES = 50  # problems timed one by one


@dataclass(frozen=True)
class Options:
    """Command line of `benchmark.py estimators`."""

    runs: int = 20
    """Problems for each setting and number of contacts."""
    contacts: tuple[int, ...] = (3, 4, 6, 10, 20, 50)
    """Numbers of contacts."""
    objects: tuple[str, ...] = tuple(OBJECTS)
    sensors: tuple[str, ...] = ("fearing1988", "gel")
    arcs: tuple[str, ...] = tuple(ARCS)
    """How far around the contacts lie, in degrees: 240, 360."""
    batch: int = 2000
    """Triples in the batch whose rate is measured."""
    seed: int = 0
    """Of everything random."""
    out: Path | None = None
    """Write all figures, also those of each setting, into this file as JSON."""


@dataclass(frozen=True)
class Speed:
    """Medians over repeats, on one core."""

    batch: int
    triples_per_second: float
    ms_for_a_triple: float
    ms_for_ten: float


def main(options: Options) -> int:
    try:
        _require_sane(options)
    except ValueError as error:
        print(f"benchmark: {error}", file=sys.stderr)
        return 2
    console = Console()
    settings = [Setting(*way) for way in product(options.objects, options.sensors, options.arcs)]
    jobs = [(n, i) for n in options.contacts for i in range(len(settings))]
    found: dict[tuple[int, int], dict[str, Scores]] = {}
    for n, i in track(jobs, description="estimating", console=console, transient=True):
        rng = np.random.default_rng([options.seed, n, i])
        problems = draw_problems(settings[i], n, options.runs, rng=rng)
        found[n, i] = score_all(problems, rng)
    figures: list[Figures] = []
    for n in options.contacts:
        each = [found[n, i] for i in range(len(settings))]
        pooled = figures_of(n, "all", {name: joined([e[name] for e in each]) for name in each[0]})
        console.print(_table(n, options.runs * len(settings), pooled))
        figures += pooled
        for setting, scores in zip(settings, each, strict=True):
            figures += figures_of(n, "-".join(asdict(setting).values()), scores)
    speed = _speed(settings[-1], options)
    console.print(_speed_table(settings[-1], speed))
    return _written(options, figures, speed)


def _require_sane(options: Options) -> None:
    for option, given, known in (
        ("--objects", options.objects, OBJECTS),
        ("--arcs", options.arcs, ARCS),
    ):
        if not given or not set(given) <= set(known):
            raise ValueError(f"{option}: expected some of {', '.join(known)}")
    if not options.sensors:
        raise ValueError("--sensors: expected at least one")
    for sensor in options.sensors:
        sensor_noise(sensor)
    if not options.contacts or not all(3 <= n <= 100 for n in options.contacts):
        raise ValueError("--contacts: expected numbers from 3 to 100")
    if options.runs < 1 or options.batch < 1 or options.seed < 0:
        raise ValueError("--runs, --batch: expected at least one; --seed: at least zero")
    if options.out is not None and not options.out.absolute().parent.is_dir():
        raise ValueError(f"--out {options.out}: there is no such folder")
    if importlib.util.find_spec("pyransac3d") is None:
        raise ValueError("pyransac3d is not installed: pip install -e '.[benchmark]'")


def _speed(setting: Setting, options: Options) -> Speed:
    """Of ours: many triples at once, and one problem after the other."""
    rng = np.random.default_rng([options.seed, 1])
    triples = draw_problems(setting, 3, options.batch, rng=rng).sets
    tens = draw_problems(setting, 10, min(SINGLES, options.batch), rng=rng).sets
    singles = min(SINGLES, options.batch)
    in_batch = _median_seconds(lambda _: estimate_axes(triples), range(REPEATS))
    one = [triples.take(i) for i in range(singles)]
    ten = [tens.take(i) for i in range(singles)]
    return Speed(
        batch=len(triples),
        triples_per_second=len(triples) / in_batch,
        ms_for_a_triple=1e3 * _median_seconds(lambda i: estimate_axis(one[i]), range(singles)),
        ms_for_ten=1e3 * _median_seconds(lambda i: estimate_axis(ten[i]), range(singles)),
    )


def _median_seconds(work: Callable[[int], object], turns: range) -> float:
    work(0)  # warm
    seconds = []
    for i in turns:
        start = time.perf_counter()
        work(i)
        seconds.append(time.perf_counter() - start)
    return float(np.median(seconds))


def _table(n: int, problems: int, figures: list[Figures]) -> Table:
    table = Table(title=f"{n} contacts, {problems} problems", box=SIMPLE_HEAD, padding=0)
    table.add_column("estimator")
    for heading in ("deg off", "mm", f">{FAR_DEG:g} deg", "error/ours", "ms", "time/ours"):
        table.add_column(heading, justify="right", no_wrap=True)
    rows = {f.estimator: f for f in figures}
    for name in dict.fromkeys((OURS, BATCH, *CONTESTANTS)):
        table.add_row(name, *(_cells(rows[name]) if name in rows else "------"))
    return table


def _cells(row: Figures) -> list[str]:
    return [
        _spread(row.angle_deg),
        f"{row.offset_mm:.2f}",
        f"{100 * row.far:.0f} %",
        _spread(row.error_ratio),
        f"{row.ms:.3g}",
        f"{row.time_ratio:.3g}",
    ]


def _spread(interval: Interval) -> str:
    middle, low, high = (f"{x:.1f}" if x >= 10 else f"{x:.2f}" for x in interval)
    return f"{middle} [{low}, {high}]"


def _speed_table(setting: Setting, speed: Speed) -> Table:
    where = f"{setting.object}, {setting.sensor}, {setting.arc} deg"
    table = Table(title=f"ours, medians on one core ({where})", box=SIMPLE_HEAD)
    table.add_column(f"triples, {speed.batch} at once", justify="right")
    table.add_column("one triple", justify="right")
    table.add_column("ten contacts", justify="right")
    table.add_row(
        f"{speed.triples_per_second:.0f} /s",
        f"{speed.ms_for_a_triple:.3g} ms",
        f"{speed.ms_for_ten:.3g} ms",
    )
    return table


def _written(options: Options, figures: list[Figures], speed: Speed) -> int:
    if options.out is None:
        return 0
    settings = {k: str(v) if isinstance(v, Path) else v for k, v in asdict(options).items()}
    document = {
        "options": settings,
        "figures": [asdict(f) for f in figures],
        "speed": asdict(speed),
    }
    try:
        write_whole(options.out, (json.dumps(document, indent=1, allow_nan=False) + "\n").encode())
    except OSError as error:
        print(f"benchmark: --out {options.out}: cannot be written ({error})", file=sys.stderr)
        return 2
    return 0
