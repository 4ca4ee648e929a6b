"""Plan motions by the hundred among random obstacles, and look for anything that meets or hurries.

Each run draws an object, a coarse belief, a place where the hand is, sometimes a table and up to
three boxes about the object, and plans one placement with all its motions. Every waypoint, and the
middle between each two, is then looked at again with the hand's raw meshes (`raw_meshes`), the
limits with the positions' own differences. Candidates that were refused for their motion are
counted with the reasons they were given, and the motions are also run into the true object, which
the planner does not know: it has to be touched by guarded motions only.

Examples:
    python scripts/motion_study.py --runs 20
    python scripts/motion_study.py --runs 100 --hand allegro_left --out out/motions.jsonl
"""

from __future__ import annotations

import json
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import tyro
from motion_scenes import Scene, draw_scene
from output_files import require_writable, write_whole
from raw_meshes import RawMeshes
from rich.console import Console
from rich.table import Table
from scipy.stats import beta

from estimator.sensors import sensor_noise
from hand_models import HandError, load_hand
from hand_models.hand import Hand
from planner.goal import Goal
from planner.motions.timing import MotionLimits
from planner.motions.trajectory import Trajectory, between
from planner.options import PlannerOptions
from planner.plan import NoPlan, Plan, plan_probes
from planner.reaching.reach_task import ReachOptions

GOAL = Goal(float(np.deg2rad(3.0)), 2e-3)
MOTION_WORDS = ("approach:", "on the way", "no straight way out")


@dataclass(frozen=True)
class Options:
    """Command line of motion_study.py."""

    hand: str = "allegro_right"
    """Hand: a known name or the path of a description."""
    runs: int = 20
    """How many placements are planned."""
    seed: int = 0
    """Of the first run; each has its own."""
    out: Path | None = None
    """File for one JSON line per run."""


@dataclass
class Found:
    """What was found in one run."""

    seed: int
    object: str
    boxes: int
    table: bool
    planned: bool = False
    seconds: float = 0.0
    phases: list[str] = field(default_factory=list)
    went_round: bool = False
    waypoints: int = 0
    looked_at: int = 0
    meetings: list[str] = field(default_factory=list)
    beyond_limits: list[str] = field(default_factory=list)
    meets_truth: list[str] = field(default_factory=list)
    clearance: dict[str, float] = field(default_factory=dict)
    duration: float = 0.0
    refused: dict[str, int] = field(default_factory=dict)
    reason: str = ""


def main() -> int:
    options = tyro.cli(Options, description=__doc__)
    try:
        hand = load_hand(options.hand)
        if options.runs < 1:
            raise ValueError(f"--runs: expected at least one, got {options.runs}")
        if options.out is not None:
            require_writable(options.out.parent)
    except (HandError, ValueError) as error:
        print(f"motion_study: {error}", file=sys.stderr)
        return 2
    console, found, lines = Console(), [], b""
    for seed in range(options.seed, options.seed + options.runs):
        found.append(study(hand, seed))
        lines += json.dumps(vars(found[-1])).encode() + b"\n"
        if options.out is not None:
            write_whole(options.out, lines)
    console.print(report(found))
    bad = [one for one in found if one.meetings or one.beyond_limits]
    for one in bad:
        console.print(f"seed {one.seed}: {(one.meetings + one.beyond_limits)[:3]}")
    return 1 if bad else 0


def study(hand: Hand, seed: int) -> Found:
    """Plan one placement with its motions, and look at them again."""
    rng = np.random.default_rng([seed, 6])
    scene = draw_scene(hand, rng)
    found = Found(seed, scene.name, len(scene.boxes), scene.table is not None)
    plane = None if scene.table is None else (0.0, 0.0, 1.0, scene.table)
    reach = ReachOptions(starts=0, rescues=1, boxes=scene.boxes, table=plane)
    options = PlannerOptions(reach=reach, start=scene.start, certify=False)
    begun = time.process_time()
    try:
        plan = plan_probes(
            hand, scene.belief, sensor_noise("gel"), goal=GOAL, rng=rng, options=options
        )
    except NoPlan as error:
        found.refused, found.reason = refusals(error.funnel), str(error)
        return found
    found.seconds, found.planned = time.process_time() - begun, True
    found.refused = refusals(plan.funnel)
    look_at(hand, scene, plan, options.limits, found)
    return found


def refusals(funnel: tuple[tuple[str, int], ...]) -> dict[str, int]:
    """Candidates that reach certified and no motion was found for, by reason."""
    told = {}
    for words, count in funnel:
        reason = words.split("out of reach: ")[-1]
        if any(word in reason for word in MOTION_WORDS):
            told[reason] = told.get(reason, 0) + count
    return told


def look_at(hand: Hand, scene: Scene, plan: Plan, limits: MotionLimits, found: Found) -> None:
    """Every waypoint and the middle between each two, with raw meshes."""
    motion = plan.motion
    assert motion is not None
    believed = RawMeshes(hand, scene.belief.surface, scene.boxes, scene.table)
    true = RawMeshes(hand, scene.truth)
    found.went_round, found.waypoints = motion.sampled, motion.certificate.waypoints
    found.clearance = {k: pair.distance for k, pair in motion.certificate.nearest.items()}
    for one in motion.trajectories:
        found.phases.append(one.phase)
        found.duration += one.duration
        found.beyond_limits += beyond(hand, one, limits)
        meets_truth = False
        for at, q, X_WB in places(one):
            found.looked_at += 1
            met = believed.meeting(q, X_WB, touching=_touching(one, at))
            if met is not None:
                found.meetings.append(f"{one.phase} at {at:.2f} s: {met[0]} meets {met[1]}")
            if one.phase in ("transfer", "enter") and not meets_truth:
                meets_truth = true.meeting(q, X_WB) is not None
        if meets_truth:
            found.meets_truth.append(one.phase)


def places(one: Trajectory) -> Iterator[tuple[float, Any, pin.SE3]]:
    """Waypoints and the middles between them."""
    middle = 0.5 * (one.q[1:] + one.q[:-1])
    for k in range(len(one)):
        yield float(one.times[k]), one.q[k], one.bases[k]
        if k + 1 < len(one):
            half = between(one.bases[k], one.bases[k + 1], np.array([0.5]))[0]
            yield float(0.5 * (one.times[k] + one.times[k + 1])), middle[k], half


def _touching(one: Trajectory, at: float) -> tuple[str, ...] | None:
    """Behind its contact a finger is not where the object is believed."""
    expected = None if one.guard is None else one.guard.expected
    return None if expected is not None and at > expected else one.touching


def beyond(hand: Hand, one: Trajectory, limits: MotionLimits) -> list[str]:
    """Limits that the positions and times themselves do not keep."""
    dt = np.diff(one.times)[:, None]
    said = []
    if np.any(one.q < hand.lower) or np.any(one.q > hand.upper):
        said.append(f"{one.phase}: a joint beyond its limit")
    if np.any(np.abs(np.diff(one.q, axis=0) / dt) > limits.joint_speeds(hand) + 1e-9):
        said.append(f"{one.phase}: a joint too fast")
    if np.any(np.abs(np.diff(one.velocities, axis=0) / dt) > limits.joint_acceleration + 1e-6):
        said.append(f"{one.phase}: a joint gains speed too fast")
    p = np.array([X.translation for X in one.bases])
    if np.any(np.linalg.norm(np.diff(p, axis=0), axis=1) / dt[:, 0] > limits.base_speed + 1e-9):
        said.append(f"{one.phase}: the base too fast")
    return said


def report(found: list[Found]) -> Table:
    """Counts, and what was never seen with how often it could be all the same."""
    planned = [one for one in found if one.planned]
    motions = sum(len(one.phases) for one in planned)
    looked = sum(one.looked_at for one in planned)
    met = sum(len(one.meetings) > 0 for one in planned)
    table = Table(title=f"{len(found)} runs, {len(planned)} planned, {motions} motions")
    for heading, justify in (("what", "left"), ("count", "right")):
        table.add_column(heading, justify=justify)  # type: ignore[arg-type]
    blind, guarded = (
        sum(phase in one.meets_truth for one in planned) for phase in ("transfer", "enter")
    )
    refused = Counter[str]()
    for one in found:
        refused.update(one.refused)
    rows = [
        ("postures looked at with raw meshes", f"{looked}"),
        ("runs with a collision", _share(met, len(planned))),
        ("runs beyond a limit", _share(sum(bool(o.beyond_limits) for o in planned), len(planned))),
        ("transfers that went round something", f"{sum(one.went_round for one in planned)}"),
        ("free motions that meet the true object", _share(blind, len(planned))),
        ("guarded ways in that meet it", _share(guarded, len(planned))),
        ("candidates refused for their motion", f"{sum(refused.values())}"),
        ("of them without a reason", f"{sum(n for words, n in refused.items() if not words)}"),
        ("duration of a round, median [s]", f"{np.median([o.duration for o in planned]):.1f}"),
        ("planning, median [s CPU]", f"{np.median([o.seconds for o in planned]):.1f}"),
    ]  # fmt: skip
    for row in rows:
        table.add_row(*row)
    for words, count in refused.most_common(8):
        table.add_row(f"  refused: {words}", f"{count}")
    for one in found:
        if not one.planned:
            table.add_row(f"  seed {one.seed}: {one.reason[:160]}", "no plan")
    return table


def _share(count: int, of: int) -> str:
    """With its 95 % interval (Clopper and Pearson)."""
    low = beta.ppf(0.025, count, of - count + 1) if count else 0.0
    high = beta.ppf(0.975, count + 1, of - count) if count < of else 1.0
    return f"{count} of {of} [{100 * low:.1f}, {100 * high:.1f}] %"


if __name__ == "__main__":
    sys.exit(main())
