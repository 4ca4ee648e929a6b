"""Where a plan's time goes: candidates, choice, reach, approaches, checks.

Whole plans are timed as they are, on one core and on all, after a plan that compiles and loads
everything; the shares are a profiler's on one core, whose own cost favours none of the parts much.
"""

from __future__ import annotations

import cProfile
import pstats
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from estimator.axis import Axis
from estimator.belief import Belief
from estimator.sensors import sensor_noise
from estimator.side_by_side import available_cores, on_cores
from estimator.surface import SurfaceOfRevolution
from hand_models import load_hand
from hand_models.hand import Hand
from planner.goal import Goal
from planner.options import PlannerOptions
from planner.plan import NoPlan, plan_probes
from sim_sensor.camera import coarse_view
from sim_sensor.objects import load_object

Job = tuple[str, int]  # object, seed
GOAL = Goal(float(np.deg2rad(3.0)), 2e-3)
PARTS: dict[str, tuple[tuple[str, str], ...]] = {  # (module, function)
    "candidates": (("candidates", "placement_candidates"), ("candidates", "single_candidates")),
    "choice": (("choice", "rank"),),
    "reach": (("reach", "solve"),),
    "approaches": (("motion", "plan_approaches"), ("motion", "approach_by_base")),
    "risks": (("risk", "risks"),),
    "certificate": (("optimum", "certificate"),),
}


@dataclass(frozen=True)
class PlanTimes:
    """Seconds of each plan on one core and on all, and the mean share of each part [-]."""

    seconds: tuple[float, ...]
    on_all: tuple[float, ...]
    shares: dict[str, float]


def plan_times(
    hand_name: str, sensor: str, objects: tuple[str, ...], plans: int, *, certify: bool = True
) -> PlanTimes:
    """First plans from coarse views, timed and then made again under the profiler."""
    hand, options = load_hand(hand_name), PlannerOptions(certify=certify)
    jobs = [(objects[seed % len(objects)], seed) for seed in range(plans)]
    _plan(hand, sensor, options, jobs[0])
    one, every = (
        _timed(partial(_plan, hand, sensor, options), jobs, cores)
        for cores in (1, available_cores())
    )
    profiler = cProfile.Profile()
    with on_cores(1):
        for job in jobs:
            profiler.runcall(_plan, hand, sensor, options, job)
    return PlanTimes(one, every, _shares(pstats.Stats(profiler)))


def _timed(plan: Callable[[Job], None], jobs: list[Job], cores: int) -> tuple[float, ...]:
    seconds = []
    with on_cores(cores):
        for job in jobs:
            start = time.perf_counter()
            plan(job)
            seconds.append(time.perf_counter() - start)
    return tuple(seconds)


def _plan(hand: Hand, sensor: str, options: PlannerOptions, job: Job) -> None:
    name, seed = job
    rng = np.random.default_rng([seed, 41])
    try:
        plan_probes(
            hand, _view(name, rng), sensor_noise(sensor), goal=GOAL, rng=rng, options=options
        )
    except NoPlan:
        return


def _view(name: str, rng: np.random.Generator) -> Belief:
    axis = Axis([0.5, 0.0, 0.2], [0.2 * rng.normal(), 0.2 * rng.normal(), 1.0])
    surface = SurfaceOfRevolution(axis, load_object(name))
    return coarse_view(surface, angle=np.deg2rad(15.0), offset=0.015, rng=rng)


def _shares(stats: pstats.Stats) -> dict[str, float]:
    spent: dict[tuple[str, str], float] = {}
    for (file, _, function), (_, _, _, cumulative, _) in stats.stats.items():  # type: ignore[attr-defined]
        path = Path(file)
        if "planner" in path.parts:
            spent[path.stem, function] = spent.get((path.stem, function), 0.0) + cumulative
    whole = spent["plan", "plan_probes"]
    shares = {
        part: sum(spent.get(place, 0.0) for place in places) / whole
        for part, places in PARTS.items()
    }
    return shares | {"the rest": 1.0 - sum(shares.values())}
