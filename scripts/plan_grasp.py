"""Touch an unknown object with a real hand, find its axis, and plan a grasp around it.

A coarse camera is rehearsed: it believes an axis, a radius and a height, all somewhat wrong. The
hand plans three contacts it can make, touches the true object (which the planner never sees),
estimates the axis with its uncertainty, and touches again until the goal is met. Then it plans a
grasp of three or four fingers around the axis and says how surely it holds.

Writes plan.json (every placement with joint angles and approaches, and the grasp), result.json
(estimate, truth, one entry per round), probes.html (the animated hand, no server needed) and, for a
sensor of raw signals, raw.npz (what it reported; estimate_axis.py --raw reads it) into --out.

Exit status: 0 goal met, 1 not met (and why), 2 bad input or an object out of the hand's reach.

Examples:
    python scripts/plan_grasp.py
    python scripts/plan_grasp.py --object bottle --sensor taxel --seed 3
    python scripts/plan_grasp.py --object my_vase.csv --prior-angle-deg 30 --budget 20
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import tyro
from describe_hand import Options as DescribeOptions
from describe_hand import describe
from grasp_ending import Ending, ending, ending_record, grip_of, print_ending
from grasp_moves import act_motions, from_home, unconfirmed_by
from grasp_report import belief_record, episode_of, print_round, raw_touches
from obstacle_file import blocks
from output_files import require_writable, write_json
from plan_options import Options, grasp_options, planner_options, require_sane
from rich.console import Console
from views import belief_by
from worlds import (
    among_what_stands,
    build_world,
    hand_in,
    mover,
    pose_in,
    print_object,
    sensor_in,
)

from estimator.axis import angle_between, offset_at
from estimator.belief import Belief
from estimator.contact import Contact, Miss, SensorNoise
from estimator.readers.raw_files import write_raw
from estimator.sensors import sensor_noise
from estimator.surface import SurfaceOfRevolution
from hand_models import HandError
from hand_models.hand import Hand
from planner.explore import Step, explore
from planner.first_use import compile_ahead
from planner.goal import Goal
from planner.grasping.grasp import GraspOptions
from planner.hand_tools import require_room
from planner.messages import plan_document
from planner.options import PlannerOptions
from planner.plan import NoPlan, Probe
from sim_sensor.objects import load_object
from sim_sensor.viewer.view import write_page
from sim_sensor.world import World

if TYPE_CHECKING:
    from sim_sensor.physics.mujoco_world import MujocoWorld


FIRST_TIME = "looking for compiled code; the first time that takes half a minute ..."


@dataclass(frozen=True, eq=False)
class Scenario:
    """A true object and what is believed of it."""

    surface: SurfaceOfRevolution
    belief: Belief
    told: SensorNoise
    world: World | MujocoWorld
    hand: Hand
    goal: Goal
    planner: PlannerOptions
    grasp: GraspOptions


def main() -> int:
    options = tyro.cli(Options, description=__doc__)
    if options.describe_hand is not None:
        return describe(DescribeOptions(options.describe_hand, options.describe_base, options.out))
    console = Console()
    try:
        options = replace(options, sensor=sensor_in(options.world, options.sensor))
        scenario = _scenario(options)
        require_writable(options.out)
    except (ValueError, HandError) as error:
        print(f"plan_grasp: {error}", file=sys.stderr)
        return 2
    print_object(console, options.object)
    steps: list[Step] = []
    reason = ""
    try:
        for step in _rounds(scenario, options, console):
            steps.append(step)
            print_round(console, step, len(steps))
    except NoPlan as error:
        if not steps:
            print(f"plan_grasp: --object {options.object}: {error}", file=sys.stderr)
            return 2
        reason = f"{scenario.goal.missing(steps[-1].after)}; {error}"
    return _conclude(console, scenario, options, steps, reason)


def _scenario(options: Options) -> Scenario:
    require_sane(options)
    rng = np.random.default_rng(options.seed)
    surface = SurfaceOfRevolution(pose_in(options.world, rng), load_object(options.object))
    hand = hand_in(options.world, options.hand)
    if options.wrist_mm is not None and hand.arm is not None:
        raise ValueError(
            f"--wrist-mm: {hand.name} is held by its arm; its description says where that stands"
        )
    planner = from_home(hand, planner_options(options))
    planner = among_what_stands(options.world, surface, planner)
    require_room(hand, planner.reach)
    belief = belief_by(
        options.view,
        surface,
        angle=np.deg2rad(options.prior_angle_deg),
        offset=1e-3 * options.prior_offset_mm,
        rng=rng,
    )
    world = build_world(options.world, hand, surface, options.sensor, rng)
    return Scenario(
        surface=surface,
        belief=belief,
        told=sensor_noise(options.sensor),
        world=world,
        hand=hand,
        goal=Goal(np.deg2rad(options.goal_angle_deg), 1e-3 * options.goal_offset_mm),
        planner=planner,
        grasp=grasp_options(options, planner.reach),
    )


def _rounds(scenario: Scenario, options: Options, console: Console) -> Iterator[Step]:
    def touch(probe: Probe) -> Contact | Miss:
        felt = scenario.world.touch(probe.approach, finger_axis_W=probe.approach.finger_axis)
        if isinstance(felt, Miss):
            return felt
        return replace(felt, finger=probe.finger, sensor=options.sensor)

    steps = explore(
        scenario.hand,
        touch,
        scenario.belief,
        scenario.told,
        goal=scenario.goal,
        budget=options.budget,
        options=scenario.planner,
        rng=np.random.default_rng([options.seed, 1]),
        move=mover(scenario.world, options.sensor),
    )
    with console.status(FIRST_TIME):
        compile_ahead(scenario.hand, scenario.planner)
    while True:
        with console.status("planning and touching ..."):
            step = next(steps, None)
        if step is None:
            return
        yield step


def _conclude(
    console: Console, scenario: Scenario, options: Options, steps: list[Step], reason: str
) -> int:
    belief = steps[-1].after if steps else scenario.belief
    unconfirmed = unconfirmed_by(steps)
    met = scenario.goal.met_by(belief) and unconfirmed is None
    error = _error(belief, scenario.world.surface)
    console.print(
        f"\n[bold]Estimate against truth[/] after {steps[-1].touches if steps else 0} touches: "
        f"{error['angle_deg']:.2f} deg, {error['offset_mm']:.2f} mm off"
    )
    missing = scenario.goal.missing(belief) or unconfirmed
    reason = "" if met else reason or f"budget spent: {missing}"
    rng, end = np.random.default_rng([options.seed, 2]), Ending()
    if met:
        with console.status("planning the grasp ..."):
            grasp = replace(
                scenario.grasp, start=steps[-1].left if steps else scenario.planner.start
            )
            end = ending(scenario.hand, belief, scenario.world.surface, grasp, rng=rng)
        print_ending(console, end)
    truth = scenario.world.surface.axis
    result = {
        "goal_met": met,
        "reason": reason,
        **belief_record(belief, steps),
        "truth": {
            "axis": {"point": truth.point.tolist(), "direction": truth.direction.tolist()},
            "object": options.object,
            "world": options.world,
        },
        "error": error,
        "goal": {"angle_deg": options.goal_angle_deg, "offset_mm": options.goal_offset_mm},
        "grasp": ending_record(end),
    }
    try:
        written = _write(scenario, options, steps, end, result)
    except OSError as failure:
        print(f"plan_grasp: {options.out}: cannot be written ({failure})", file=sys.stderr)
        return 2
    console.print(f"Written: {options.out}/{', '.join(written)}")
    if met:
        console.print("[bold green]Goal met.[/]")
        return 0
    console.print(f"[bold red]Goal not met[/]: {reason}")
    return 1


def _error(belief: Belief, surface: SurfaceOfRevolution) -> dict[str, float]:
    """Of the direction, and of the position beside the true object's middle."""
    truth = surface.axis
    middle = truth.point + np.mean(surface.profile.z_range) * truth.direction
    return {
        "angle_deg": float(np.rad2deg(angle_between(belief.axis, truth))),
        "offset_mm": 1e3 * offset_at(belief.axis, truth, middle),
    }


def _write(
    scenario: Scenario, options: Options, steps: list[Step], end: Ending, result: dict[str, Any]
) -> list[str]:
    """The names of the files written; each is whole or not there."""
    out, world, written = options.out, scenario.world, ["plan.json", "result.json"]
    out.mkdir(parents=True, exist_ok=True)
    if steps:
        error = result["error"]
        words = f"{error['angle_deg']:.2f} deg and {error['offset_mm']:.2f} mm from the truth"
        episode = episode_of(
            world.surface, world, steps, words, options.sensor, grip_of(scenario.hand, end),
            partial(act_motions, scenario.hand, scenario.planner.limits),
            blocks(scenario.planner.reach, world.surface.axis.point),
        )  # fmt: skip
        write_page(out / "probes.html", scenario.hand, episode)
        written.append("probes.html")
    plans = plan_document(scenario.hand, [step.plan for step in steps], end.grasp)
    write_json(out / "plan.json", plans)
    write_json(out / "result.json", result)
    raw = raw_touches(options.sensor, steps, world)
    if raw is not None:
        write_raw(out / "raw.npz", raw)
        written.append("raw.npz")
    return written


if __name__ == "__main__":
    sys.exit(main())
