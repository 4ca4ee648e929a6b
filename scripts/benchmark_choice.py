"""The choice of contacts measured: against what is possible, criterion by criterion, and in time.

limits    the information of planned contacts on the true object, against the best there are and
          against random ones; position 0.5 mm, normal 2 deg, direction 5 deg, curvature 10 %
criteria  error of the axis after each round of three touches, under each criterion, from the same
          beliefs and seeds; candidates are random places, or what a hand reaches
times     where the time of a plan goes

Figures are medians with half their 95 % bootstrap intervals; the counts are objects or sessions.

Example: python scripts/benchmark.py choice --runs 20 --picture criteria.png
"""

from __future__ import annotations

import io
import json
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path

import numpy as np
from choice_limits import FAMILIES, Limits, limits
from choice_sessions import Point, Setting, session
from honesty import bootstrap
from output_files import require_writable, write_whole
from plan_times import PlanTimes, plan_times
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import track
from rich.table import Table

from estimator.sensors import sensor_noise
from estimator.side_by_side import available_cores
from hand_models import load_hand
from planner.choosing.criteria import Criterion
from sim_sensor.objects import load_object

CRITERIA: tuple[Criterion, ...] = ("information", "pair-bound", "d-optimal", "uniform", "random")
PARTS = ("limits", "criteria", "times")
TICKS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0)  # of the picture


@dataclass(frozen=True)
class Options:
    """Command line of `benchmark.py choice`."""

    parts: tuple[str, ...] = PARTS
    runs: int = 10
    """Objects per family, sessions per object and criterion, and plans that are timed."""
    objects: tuple[str, ...] = ("can", "cone", "barrel", "bottle", "paper-lathe")
    criteria: tuple[Criterion, ...] = CRITERIA
    sensor: str = "gel"
    hand: str = ""
    """Hand of the sessions; not given, a pad comes to any place along its normal."""
    prior_angle_deg: float = 15.0
    prior_offset_mm: float = 15.0
    common_deg: float = 0.0
    """Rotation of all directions by the sensor, told to nobody."""
    touches: int = 12
    """Made in each session, three a round."""
    jobs: int = 2
    """Sessions at the same time."""
    out: Path | None = None
    """Write every object and session into this file as JSON lines."""
    picture: Path | None = None
    """Error against touches for each criterion (PNG; needs matplotlib)."""


def main(options: Options) -> int:
    console = Console()
    try:
        _require_sane(options)
    except (ValueError, OSError) as error:
        print(f"benchmark: {error}", file=sys.stderr)
        return 2
    if "limits" in options.parts:
        found = _limits(options, console)
        console.print(_limits_table(found))
        _write(options.out, [asdict(one) for one in found])
    if "criteria" in options.parts:
        points = _sessions(options, console)
        console.print(_criteria_table(options, points))
        _write(options.out, [asdict(point) for point in points])
        if options.picture is not None:
            write_whole(options.picture, picture(options.criteria, points))
    if "times" in options.parts:
        hand = options.hand or "allegro_right"
        console.print(_times_table(plan_times(hand, options.sensor, options.objects, options.runs)))
    return 0


def _require_sane(options: Options) -> None:
    if not options.parts or not set(options.parts) <= set(PARTS):
        raise ValueError(f"--parts: expected some of {', '.join(PARTS)}")
    if min(options.runs, options.jobs) < 1 or not options.objects or not options.criteria:
        raise ValueError("--runs, --jobs, --objects, --criteria: expected at least one")
    if options.touches < 3 or options.touches % 3:
        raise ValueError(f"--touches: expected a multiple of 3, got {options.touches}")
    for name in options.objects:
        load_object(name)
    sensor_noise(options.sensor)
    if options.hand:
        load_hand(options.hand)
    for path in (options.out, options.picture):
        if path is not None:
            require_writable(path.parent)


def _write(path: Path | None, records: Sequence[dict[str, object]]) -> None:
    if path is not None:
        with path.open("a", encoding="utf-8") as file:
            file.writelines(json.dumps(record) + "\n" for record in records)


def _limits(options: Options, console: Console) -> list[Limits]:
    jobs = list(product(FAMILIES, range(options.runs)))
    with ProcessPoolExecutor(options.jobs) as pool:
        futures = [pool.submit(limits, *job) for job in jobs]
        wait = track(futures, "limits", len(jobs), console=console, transient=True)
        return [future.result() for future in wait]


def _sessions(options: Options, console: Console) -> list[Point]:
    setting = Setting(
        options.hand, options.sensor, options.prior_angle_deg, options.prior_offset_mm,
        options.common_deg, options.touches,
    )  # fmt: skip
    jobs = list(product(options.criteria, options.objects, range(options.runs)))
    points: list[Point] = []
    with ProcessPoolExecutor(options.jobs) as pool:
        futures = [pool.submit(session, setting, *job) for job in jobs]
        ended = as_completed(futures)
        for future in track(ended, "sessions", len(jobs), console=console, transient=True):
            points += future.result()
    return points


def _limits_table(found: list[Limits]) -> Table:
    table = Table(title="limits: no hand, Fisher information", box=SIMPLE_HEAD, pad_edge=False)
    headings = ("family", "n", "best deg", "mm", "right / best", "coarse / best", "random / best",
                "6 right / 12 random", "6 coarse / 12 random")  # fmt: skip
    _columns(table, *headings)
    for family in (*FAMILIES, "all"):
        some = [one for one in found if family in (one.family, "all")]
        value = {
            name: np.array([getattr(one, name)[0] for one in some])
            for name in ("best", "right", "right_6", "coarse", "coarse_6", "random_3", "random_12")
        }
        table.add_row(
            family, str(len(some)),
            f"{np.rad2deg(np.median([one.best[1] for one in some])):.2f}",
            f"{1e3 * np.median([one.best[2] for one in some]):.2f}",
            *(_median(value[name] / value["best"]) for name in ("right", "coarse", "random_3")),
            *(_median(value[name] / value["random_12"]) for name in ("right_6", "coarse_6")),
        )  # fmt: skip
    return table


def _criteria_table(options: Options, points: list[Point]) -> Table:
    title = f"criteria: {options.sensor}, {options.hand or 'no hand'}, belief wrong by "
    title += f"{options.prior_angle_deg:g} deg and {options.prior_offset_mm:g} mm"
    table = Table(title=title, box=SIMPLE_HEAD, pad_edge=False)
    _columns(table, "criterion", "touches", "n", "median deg", "p95", "median mm", "p95", "sure")
    for criterion, touches in product(options.criteria, range(3, options.touches + 1, 3)):
        some = [p for p in points if (p.criterion, p.touches) == (criterion, touches)]
        if not some:
            continue
        angle, offset = np.array([(p.angle_deg, p.offset_mm) for p in some]).T
        table.add_row(
            criterion, str(touches), str(len(some)), _median(angle),
            f"{np.percentile(angle, 95):.2f}", _median(offset), f"{np.percentile(offset, 95):.2f}",
            f"{100 * np.mean([p.determined for p in some]):.0f} %",
        )  # fmt: skip
    return table


def _times_table(times: PlanTimes) -> Table:
    median, tail = 1e3 * np.percentile(times.seconds, (50, 95))
    shared, shared_tail = 1e3 * np.percentile(times.on_all, (50, 95))
    title = (
        f"{len(times.seconds)} plans on one core: median {median:.0f} ms, p95 {tail:.0f} ms; "
        f"on {available_cores()}: {shared:.0f} ms, {shared_tail:.0f} ms"
    )
    table = Table(title=title, box=SIMPLE_HEAD, pad_edge=False)
    _columns(table, "part", "share", "ms of the median")
    for part, share in times.shares.items():
        table.add_row(part, f"{100 * share:.0f} %", f"{share * median:.0f}")
    return table


def _columns(table: Table, *headings: str) -> None:
    for heading in headings:
        left = heading in ("family", "criterion", "part")
        table.add_column(heading, justify="left" if left else "right", no_wrap=len(heading) < 9)


def _median(values: np.ndarray) -> str:
    value, low, high = bootstrap(values, np.median)
    return f"{value:.2f} ±{0.5 * (high - low):.2f}"


def picture(criteria: Sequence[Criterion], points: list[Point]) -> bytes:
    """Median error against touches, quartiles shaded, as PNG."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.8), layout="constrained")
    counts = sorted({p.touches for p in points if p.touches % 3 == 0})
    for axes, name, words in zip(
        figure.subplots(1, 2),
        ("angle_deg", "offset_mm"),
        ("direction, deg", "position, mm"),
        strict=True,
    ):
        for criterion in criteria:
            some = [
                [getattr(p, name) for p in points if (p.criterion, p.touches) == (criterion, n)]
                for n in counts
            ]
            low, middle, high = np.array([np.percentile(x, (25, 50, 75)) for x in some if x]).T
            shown = [n for n, x in zip(counts, some, strict=True) if x]
            (line,) = axes.plot(shown, middle, marker="o", ms=3, label=criterion)
            axes.fill_between(shown, low, high, color=line.get_color(), alpha=0.08, lw=0)
        axes.set(xlabel="touches", ylabel=f"error of the {words}", yscale="log", xticks=counts)
        axes.set_yticks([t for t in TICKS if axes.get_ylim()[0] < t < axes.get_ylim()[1]])
        axes.yaxis.set_major_formatter("{x:g}")
        axes.minorticks_off()
        axes.grid(alpha=0.3)
    figure.axes[0].legend(fontsize=8)
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=130)
    return file.getvalue()
