"""The planner measured where it matters: on the hand, against random contacts and an oracle.

For every family and seed the same random object, the same wrong belief and the same sensor are met
by every arm (`touch_sessions`).

Arms
    planned  the planner;  rule  the paper's 90-degree rule;  random  anything the hand reaches
    oracle   the first placement planned by somebody who knows the object

Settings
    coarse   belief wrong by 15 deg and 15 mm
    weak     belief wrong by up to 60 deg and 40 mm; fingers often miss
    offset   coarse, and the sensor turns all directions by 8 deg without telling anybody
    told     the same, but planner and estimator know that there may be such an offset

Prints medians and shares with half their 95 % intervals; the counts are the runs.

Example: python scripts/benchmark.py touches --runs 20 --families cone vase
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from honesty import Interval, bootstrap, proportion
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scenarios import FAMILIES
from touch_sessions import ARMS, SETTINGS, Job, Outcome, run

from estimator.sensors import sensor_noise
from estimator.vectors import Array
from hand_models import load_hand
from planner.choosing.choice import MARGIN


@dataclass(frozen=True)
class Options:
    """Command line of `benchmark.py touches`."""

    runs: int = 20
    """Seeds per family, setting and arm."""
    families: tuple[str, ...] = FAMILIES
    settings: tuple[str, ...] = SETTINGS
    arms: tuple[str, ...] = ("planned", "random")
    sensor: str = "gel"
    hand: str = "allegro_right"
    budget: int = 18
    """Largest number of touches of a session."""
    jobs: int = 1
    """Sessions at the same time."""
    seed: int = 0
    """The first; the others count on."""
    out: Path | None = None
    """Write every run as one JSON line into this file."""


def main(options: Options) -> int:
    console = Console()
    try:
        _require_sane(options)
    except (ValueError, OSError) as error:
        print(f"benchmark: {error}", file=sys.stderr)
        return 2
    jobs = [
        Job(options.hand, options.sensor, setting, arm, family, seed, options.budget)
        for seed in range(options.seed, options.seed + options.runs)
        for setting in options.settings
        for arm in options.arms
        for family in options.families
    ]
    outcomes: list[Outcome] = []
    with ProcessPoolExecutor(options.jobs) as pool:
        futures = [pool.submit(run, job) for job in jobs]
        for future in track(
            as_completed(futures), "touching", len(jobs), console=console, transient=True
        ):
            outcomes.append(future.result())
            if options.out is not None:
                with options.out.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(asdict(outcomes[-1])) + "\n")
    for setting in options.settings:
        for table in tables(setting, options.arms, options.families, outcomes):
            console.print(table)
    return 0


def _require_sane(options: Options) -> None:
    for name, chosen, known in (
        ("--settings", options.settings, SETTINGS),
        ("--arms", options.arms, tuple(ARMS)),
        ("--families", options.families, FAMILIES),
    ):
        if not chosen or not set(chosen) <= set(known):
            raise ValueError(f"{name}: expected some of {', '.join(known)}")
    if min(options.runs, options.budget, options.jobs) < 1 or options.seed < 0:
        raise ValueError("--runs, --budget and --jobs: expected at least one; --seed: 0 or more")
    sensor_noise(options.sensor)
    load_hand(options.hand)
    if options.out is not None:
        options.out.open("a").close()


def tables(
    setting: str, arms: tuple[str, ...], families: tuple[str, ...], outcomes: list[Outcome]
) -> tuple[Table, ...]:
    """How well the axis is known early on, and how sessions end.

    As soon as three contacts are felt: median errors; right labels, also after one more touch where
    they were not. One placement more: root mean square errors. `< 0.08`: share of triples that came
    so near to a singularity.
    """
    parts = (
        ("with three contacts", ("deg", "p95", "mm", "labels %", "soon %"), _early),
        ("after one placement more, rms", ("deg", "mm"), _later),
        ("sessions to 3 deg and 2 mm",
         ("goal met %", "touches", "mean", "wrong", f"< {MARGIN:g}", "plan s"), _ends),
    )  # fmt: skip
    return tuple(
        _filled(_table(f"{setting}: {title}", ("family", "arm", "runs", *headings)), row, chosen)
        for title, headings, row in parts
        for chosen in [_cells(setting, arms, families, outcomes)]
    )


Cells = list[tuple[str, str, list[Outcome]]]


def _cells(
    setting: str, arms: tuple[str, ...], families: tuple[str, ...], outcomes: list[Outcome]
) -> Cells:
    """Family, arm and their outcomes; "all" families last."""
    mine = [o for o in outcomes if o.job.setting == setting]
    return [
        (family, arm, [o for o in mine if o.job.arm == arm and family in (o.job.family, "all")])
        for family in (*families, "all")
        for arm in arms
    ]


def _filled(table: Table, row: Callable[[list[Outcome]], list[str]], cells: Cells) -> Table:
    for family, arm, chosen in cells:
        table.add_row(family, arm, str(len(chosen)), *row(chosen))
    return table


def _table(title: str, headings: tuple[str, ...]) -> Table:
    table = Table(title=title, box=SIMPLE_HEAD, pad_edge=False, collapse_padding=True)
    for heading in headings:
        side = "left" if heading in ("family", "arm") else "right"
        table.add_column(heading, justify=side, no_wrap=True)
    return table


def _early(chosen: list[Outcome]) -> list[str]:
    deg, mm = (_values(chosen, name) for name in ("first_deg", "first_mm"))
    return [
        _figure(bootstrap(deg, np.median)),
        f"{np.percentile(deg, 95):.1f}" if len(deg) else "-",
        _figure(bootstrap(mm, np.median)),
        _share([o.labels for o in chosen]),
        _share([o.labels_soon for o in chosen]),
    ]


def _later(chosen: list[Outcome]) -> list[str]:
    return [_figure(bootstrap(_values(chosen, f"second_{unit}"), _rms)) for unit in ("deg", "mm")]


def _ends(chosen: list[Outcome]) -> list[str]:
    """A session that never met its goal took more touches than any that did."""
    touches = np.array([o.touches if o.met else np.inf for o in chosen])
    margin, seconds = (_values(chosen, name) for name in ("margin", "plan_seconds"))
    made = np.array([o.touches for o in chosen])
    return [
        _share([o.met for o in chosen]),
        f"{np.median(touches):.0f}" if len(touches) else "-",
        f"{made.mean():.1f}" if len(made) else "-",
        f"{sum(o.wrong for o in chosen)}",
        f"{100 * np.mean(margin < MARGIN):.1f} %" if len(margin) else "-",
        f"{np.median(seconds):.2f}" if len(seconds) else "-",
    ]


def _values(chosen: list[Outcome], name: str) -> Array:
    values = np.array([getattr(o, name) for o in chosen], dtype=float)
    return values[np.isfinite(values)]


def _rms(values: Array, axis: int) -> Array:
    return np.asarray(np.sqrt(np.mean(values**2, axis=axis)))


def _share(hits: list[bool]) -> str:
    share = proportion(np.array(hits, dtype=bool))
    return f"{100 * share.value:.0f} ±{50 * (share.high - share.low):.0f}"


def _figure(figure: Interval) -> str:
    if not np.isfinite(figure.value):
        return "-"
    return f"{figure.value:.2f} ±{0.5 * (figure.high - figure.low):.2f}"
