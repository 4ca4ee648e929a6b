"""The planner measured where it matters: planned against random contacts, on the same beliefs.

For every object and seed the same true object, the same wrong belief and the same sensor are met
twice: by contacts the planner chose and by random contacts the same hand reaches. What counts is
the estimate after the first placement that felt three contacts.

Settings
    coarse   belief wrong by 15 deg and 15 mm
    weak     belief wrong by up to 60 deg and 40 mm; fingers often miss
    offset   coarse, and the sensor turns all directions by 8 deg without telling anybody
    told     the same, but planner and estimator know that there may be such an offset

Prints medians with 95 % bootstrap intervals; the counts are the runs.

Example: python scripts/benchmark.py touches --runs 20 --objects can bottle
"""

from __future__ import annotations

import contextlib
import json
import sys
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import track
from rich.table import Table

from estimator.axis import Axis, angle_between, offset_at
from estimator.belief import Belief, update
from estimator.contact import Contact, Miss, SensorNoise
from estimator.readings import UMBILIC
from estimator.sensors import sensor_noise
from estimator.singular import placed_triples, singularities
from estimator.surface import SurfaceOfRevolution
from hand_models import load_hand
from hand_models.hand import Hand
from planner.explore import explore
from planner.goal import Goal
from planner.options import Criterion, PlannerOptions
from planner.plan import NoPlan, Probe
from sim_sensor.camera import coarse_view
from sim_sensor.noise import simulated_sensor
from sim_sensor.objects import load_object
from sim_sensor.world import TouchRecord, World

SETTINGS = ("coarse", "weak", "offset", "told")
OFFSET = float(np.deg2rad(8.0))
CRITERIA: tuple[Criterion, ...] = ("information", "random")


@dataclass(frozen=True)
class Options:
    """Command line of `benchmark.py touches`."""

    runs: int = 20
    """Seeds per object, setting and criterion."""
    objects: tuple[str, ...] = ("can", "cone", "barrel", "bottle", "paper-lathe")
    settings: tuple[str, ...] = SETTINGS
    sensor: str = "gel"
    hand: str = "allegro_right"
    out: Path | None = None
    """Write every run as one JSON line into this file."""


@dataclass(frozen=True)
class Outcome:
    """One run: the estimate after the first three contacts."""

    setting: str
    criterion: str
    object: str
    seed: int
    contacts: int
    touches: int
    angle_deg: float
    offset_mm: float
    labels_right: bool
    singular: bool
    verdict: str


def main(options: Options) -> int:
    console = Console()
    try:
        _require_sane(options)
        for name in options.objects:
            load_object(name)
        sensor_noise(options.sensor)
        hand = load_hand(options.hand)
    except (ValueError, OSError) as error:
        print(f"benchmark: {error}", file=sys.stderr)
        return 2
    jobs = [
        (setting, criterion, name, seed)
        for setting in options.settings
        for criterion in CRITERIA
        for name in options.objects
        for seed in range(options.runs)
    ]
    outcomes = []
    for job in track(jobs, description="touching", console=console, transient=True):
        outcome = _run(hand, options.sensor, *job)
        outcomes.append(outcome)
        if options.out is not None:
            with options.out.open("a", encoding="utf-8") as file:
                file.write(json.dumps(asdict(outcome)) + "\n")
    for setting in options.settings:
        console.print(_table(setting, options.objects, outcomes))
    return 0


def _require_sane(options: Options) -> None:
    if not options.settings or not set(options.settings) <= set(SETTINGS):
        raise ValueError(f"--settings: expected some of {', '.join(SETTINGS)}")
    if options.runs < 1 or not options.objects:
        raise ValueError("--runs and --objects: expected at least one")
    if options.out is not None:
        options.out.open("a").close()


def _run(
    hand: Hand, sensor: str, setting: str, criterion: Criterion, name: str, seed: int
) -> Outcome:
    rng = np.random.default_rng([seed, 7])
    surface = SurfaceOfRevolution(
        Axis([0.5, 0.0, 0.2], [0.2 * rng.normal(), 0.2 * rng.normal(), 1.0]), load_object(name)
    )
    belief = _belief(surface, setting, rng)
    simulated = simulated_sensor(sensor)
    offset = OFFSET if setting in ("offset", "told") else None
    told = sensor_noise(sensor)
    if setting == "told":
        told = replace(told, direction_offset=OFFSET)
    session = simulated.session(rng=rng, direction_offset=offset)
    world = World(surface, session, rng=rng)
    after, touches = _first_three(hand, belief, told, world, criterion, seed)
    return _judge(after, touches, world, surface, (setting, criterion, name, seed))


def _belief(surface: SurfaceOfRevolution, setting: str, rng: np.random.Generator) -> Belief:
    if setting != "weak":
        return coarse_view(surface, angle=np.deg2rad(15.0), offset=0.015, rng=rng)
    angle = np.deg2rad(60.0) * np.sqrt(rng.uniform(0.01, 1.0))
    return coarse_view(surface, angle=angle, offset=0.04 * rng.uniform(0.1, 1.0), rng=rng)


def _first_three(
    hand: Hand, belief: Belief, told: SensorNoise, world: World, criterion: Criterion, seed: int
) -> tuple[Belief, int]:
    """The belief as soon as three contacts were felt, and the touches that took, at most nine."""

    def touch(probe: Probe) -> Contact | Miss:
        outcome = world.touch(probe.approach)
        return outcome if isinstance(outcome, Miss) else replace(outcome, noise=told)

    steps = explore(
        hand,
        touch,
        belief,
        told,
        goal=Goal(np.deg2rad(3.0), 2e-3),
        budget=9,
        rng=np.random.default_rng([seed, 1]),
        options=PlannerOptions(criterion=criterion),
    )
    outcomes: list[Contact | Miss] = []
    with contextlib.suppress(NoPlan):
        for step in steps:
            for outcome in step.outcomes:
                outcomes.append(outcome)
                if sum(isinstance(o, Contact) for o in outcomes) == 3:
                    return update(belief, outcomes), len(outcomes)
    return update(belief, outcomes), len(outcomes)


def _judge(
    after: Belief,
    touches: int,
    world: World,
    surface: SurfaceOfRevolution,
    job: tuple[str, str, str, int],
) -> Outcome:
    felt = [r for r in world.records if r.truth is not None][: len(after.contacts)]
    if len(felt) < 3 or after.estimate is None:
        return Outcome(*job, len(felt), touches, 90.0, 1e3, False, False, "no three contacts")
    middle = surface.axis.point + np.mean(surface.profile.z_range) * surface.axis.direction
    rows = after.estimate.best.parallel_rows
    return Outcome(
        *job,
        contacts=len(felt),
        touches=touches,
        angle_deg=float(np.rad2deg(angle_between(after.axis, surface.axis))),
        offset_mm=1e3 * offset_at(after.axis, surface.axis, middle),
        labels_right=all(_label_right(r, p) for r, p in zip(felt, rows, strict=True)),
        singular=_singular(surface, felt),
        verdict=after.estimate.verdict,
    )


def _label_right(record: TouchRecord, row_0: float) -> bool:
    """Whether the row believed to be the parallel's is the one nearer to the true parallel.

    A flat end or an umbilic has no directions, so nothing there can be taken wrongly.
    """
    assert isinstance(record.outcome, Contact)
    assert record.truth is not None
    if record.outcome.umbilicity < UMBILIC:
        return True
    nearer = int(np.argmax(np.abs(record.outcome.directions @ record.truth.k_theta)))
    return (row_0 > 0.5) == (nearer == 0)


def _singular(surface: SurfaceOfRevolution, felt: list[TouchRecord]) -> bool:
    """Whether the first three contacts are exactly singular on the true object."""
    if len(felt) < 3:
        return False
    p = np.array([r.truth.p for r in felt[:3] if r.truth is not None])
    theta, _, z = surface.cylindrical(p)
    z = np.clip(z, *surface.profile.z_range)
    triples = placed_triples(surface.profile, theta[None], z[None])
    return bool(singularities(triples, tolerance=1e-6).present.any())


def _table(setting: str, objects: tuple[str, ...], outcomes: list[Outcome]) -> Table:
    table = Table(title=f"{setting}: after the first three contacts", box=SIMPLE_HEAD)
    for heading in ("object", "contacts", "runs", "labels right", "median deg", "p95 deg",
                    "median mm", "touches", "singular", "determined"):  # fmt: skip
        table.add_column(heading, justify="left" if heading in ("object", "contacts") else "right")
    for name in (*objects, "all"):
        for criterion in CRITERIA:
            chosen = [
                o
                for o in outcomes
                if o.setting == setting
                and o.criterion == criterion
                and (name == "all" or o.object == name)
            ]
            touched = "planned" if criterion == "information" else "random"
            table.add_row(name, touched, *_row(chosen))
    return table


def _row(chosen: list[Outcome]) -> list[str]:
    angle = np.array([o.angle_deg for o in chosen])
    offset = np.array([o.offset_mm for o in chosen])
    return [
        str(len(chosen)),
        f"{100 * np.mean([o.labels_right for o in chosen]):.0f} %",
        _median(angle),
        f"{np.percentile(angle, 95):.1f}",
        _median(offset),
        f"{np.mean([o.touches for o in chosen]):.1f}",
        str(sum(o.singular for o in chosen)),
        f"{100 * np.mean([o.verdict == 'determined' for o in chosen]):.0f} %",
    ]


def _median(values: np.ndarray) -> str:
    """Median with its 95 % bootstrap interval."""
    rng = np.random.default_rng(0)
    medians = np.median(rng.choice(values, size=(400, len(values))), axis=1)
    low, high = np.percentile(medians, [2.5, 97.5])
    return f"{np.median(values):.2f} [{low:.2f}, {high:.2f}]"
