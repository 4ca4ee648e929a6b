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
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
import tyro
from describe_hand import Options as DescribeOptions
from describe_hand import describe
from grasp_ending import Ending, ending, ending_record, grip_of, print_ending
from grasp_moves import act_motions, from_home, left_at
from grasp_report import belief_record, episode_of, print_round, raw_touches
from obstacle_file import read_obstacles
from output_files import require_writable, write_json
from rich.console import Console
from views import belief_by
from worlds import build_world, pose_in, print_object, sensor_in

from estimator.axis import angle_between, offset_at
from estimator.belief import Belief
from estimator.contact import Contact, Miss, SensorNoise
from estimator.readers.raw_files import write_raw
from estimator.sensors import sensor_noise
from estimator.surface import SurfaceOfRevolution
from hand_models import HandError, load_hand
from hand_models.hand import Hand
from planner.explore import Step, explore
from planner.goal import Goal
from planner.grasping.grasp import Friction, GraspOptions
from planner.messages import plan_document
from planner.options import PlannerOptions
from planner.plan import NoPlan, Probe
from planner.reaching.workspace import Workspace
from sim_sensor.objects import load_object
from sim_sensor.viewer.view import write_page
from sim_sensor.world import World

if TYPE_CHECKING:
    from sim_sensor.physics.mujoco_world import MujocoWorld


@dataclass(frozen=True)
class Options:
    """Command line of plan_grasp.py."""

    hand: str = "allegro_right"
    """Hand: one of hand_models/hands, or the path of a description (.toml)."""
    describe_hand: Path | None = None
    """Instead of all this, propose a description of the hand in this URDF or MJCF, into --out."""
    object: str = "can"
    """What is touched: a built-in name (can, bottle, cone, cup, barrel, jar-lid, knob, vase, egg,
    spindle, paper-lathe, sphere), a CSV file (r_mm,z_mm), a product's JSON or a mesh (stl, obj)."""
    sensor: str = "gel"
    """Tactile sensor. Readings with noise: ideal, fearing1988, robotworld, taxel, gel, gel-good,
    gel-poor. Raw signals, simulated and read: fearing-strain, gel-depth, taxel-array."""
    world: str = "own"
    """own, or MuJoCo with gel-depth pads, the object held (mujoco) or on a table (mujoco-table)."""
    view: str = "pose"
    """What is known before the first touch: a pose with its error, a depth camera's cloud of one
    side, or nothing but a box around the object."""
    prior_angle_deg: float = 15.0
    """How far the axis of a pose is off in direction."""
    prior_offset_mm: float = 15.0
    """How far it is off in position, beside the object's middle."""
    goal_angle_deg: float = 3.0
    """Stop when the direction is known within this with 95 % probability ..."""
    goal_offset_mm: float = 2.0
    """... and the position within this."""
    wrist_mm: tuple[float, float, float] | None = None
    """Where the arm holds the hand base, in the world; the object stands near (500, 0, 200).
    Not given, the arm reaches everywhere."""
    wrist_range_mm: float = 150.0
    """How far from there, along each axis, the arm can go; it turns the hand any way."""
    obstacles: Path | None = None
    """A TOML file of a table and boxes that the hand must not meet (scripts/obstacle_file.py)."""
    budget: int = 15
    """Largest number of touches."""
    grasp_heights_mm: tuple[float, float] | None = None
    """Lowest and highest contact of the grasp, along the believed axis from the object's believed
    middle. Not given, anywhere but the ends."""
    friction: float = 0.5
    """Coefficient of friction between fingertips and object."""
    seed: int = 0
    """Of everything random: the object's pose, the camera's error, the sensor's noise."""
    out: Path = Path("out")
    """Folder for plan.json, result.json and probes.html."""


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
        return describe(DescribeOptions(options.describe_hand, out=options.out))
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
    if not (np.isfinite(options.prior_angle_deg) and 0 < options.prior_angle_deg < 90):
        raise ValueError(f"--prior-angle-deg: expected 0 to 90, got {options.prior_angle_deg}")
    if not 0 < options.prior_offset_mm <= 1000:
        raise ValueError(f"--prior-offset-mm: expected 0 to 1000, got {options.prior_offset_mm}")
    if options.budget < 1:
        raise ValueError(f"--budget: expected at least one touch, got {options.budget}")
    if options.seed < 0:
        raise ValueError(f"--seed: expected a number >= 0, got {options.seed}")
    rng = np.random.default_rng(options.seed)
    surface = SurfaceOfRevolution(pose_in(options.world, rng), load_object(options.object))
    hand = load_hand(options.hand)
    return Scenario(
        surface=surface,
        belief=belief_by(
            options.view,
            surface,
            angle=np.deg2rad(options.prior_angle_deg),
            offset=1e-3 * options.prior_offset_mm,
            rng=rng,
        ),
        told=sensor_noise(options.sensor),
        world=build_world(options.world, hand, surface, options.sensor, rng),
        hand=hand,
        goal=Goal(np.deg2rad(options.goal_angle_deg), 1e-3 * options.goal_offset_mm),
        planner=from_home(hand, _planner_options(options)),
        grasp=_grasp_options(options),
    )


def _planner_options(options: Options) -> PlannerOptions:
    """The planner's defaults, within the arm's workspace, among the obstacles."""
    reach = replace(PlannerOptions().reach, **read_obstacles(options.obstacles))
    if options.wrist_mm is None:
        return PlannerOptions(reach=reach)
    if not np.all(np.isfinite(options.wrist_mm)):
        raise ValueError(f"--wrist-mm: expected three finite numbers, got {options.wrist_mm}")
    X_WB = pin.SE3(np.eye(3), 1e-3 * np.array(options.wrist_mm))
    workspace = Workspace(X_WB, 1e-3 * options.wrist_range_mm, np.pi)
    return PlannerOptions(reach=replace(reach, workspace=workspace))


def _grasp_options(options: Options) -> GraspOptions:
    """The defaults, within the arm's workspace, at the user's heights."""
    heights = options.grasp_heights_mm
    if heights is not None and not heights[0] < heights[1]:
        raise ValueError(f"--grasp-heights-mm: expected low < high, got {heights}")
    if not (np.isfinite(options.friction) and options.friction > 0.0):
        raise ValueError(f"--friction: expected a number > 0, got {options.friction}")
    default, told = GraspOptions(), _planner_options(options).reach
    return replace(
        default,
        reach=replace(default.reach, workspace=told.workspace, table=told.table, boxes=told.boxes),
        heights=None if heights is None else (1e-3 * heights[0], 1e-3 * heights[1]),
        friction=Friction(options.friction),
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
    )
    while True:
        with console.status("planning and touching (the first time, compiling for a minute) ..."):
            step = next(steps, None)
        if step is None:
            return
        yield step


def _conclude(
    console: Console, scenario: Scenario, options: Options, steps: list[Step], reason: str
) -> int:
    belief = steps[-1].after if steps else scenario.belief
    unconfirmed = steps[-1].surprise if steps else None
    met = scenario.goal.met_by(belief) and unconfirmed is None
    surface = scenario.world.surface
    truth = surface.axis
    middle = truth.point + np.mean(surface.profile.z_range) * truth.direction
    error = {
        "angle_deg": float(np.rad2deg(angle_between(belief.axis, truth))),
        "offset_mm": 1e3 * offset_at(belief.axis, truth, middle),
    }
    console.print(
        f"\n[bold]Estimate against truth[/] after {steps[-1].touches if steps else 0} touches: "
        f"{error['angle_deg']:.2f} deg, {error['offset_mm']:.2f} mm off"
    )
    missing = scenario.goal.missing(belief) or unconfirmed
    reason = "" if met else reason or f"budget spent: {missing}"
    rng, end = np.random.default_rng([options.seed, 2]), Ending()
    if met:
        with console.status("planning the grasp ..."):
            grasp = replace(scenario.grasp, start=left_at(steps, scenario.planner.start))
            end = ending(scenario.hand, belief, surface, grasp, rng=rng)
        print_ending(console, end)
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
    plans = plan_document(scenario.hand, [step.plan for step in steps], end.grasp)
    try:
        options.out.mkdir(parents=True, exist_ok=True)
        if steps:
            words = f"{error['angle_deg']:.2f} deg and {error['offset_mm']:.2f} mm from the truth"
            episode = episode_of(
                surface, scenario.world, steps, words, options.sensor,
                grip_of(scenario.hand, end),
                partial(act_motions, scenario.hand, scenario.planner.limits),
            )  # fmt: skip
            write_page(options.out / "probes.html", scenario.hand, episode)
        write_json(options.out / "plan.json", plans)
        write_json(options.out / "result.json", result)
        raw = raw_touches(options.sensor, steps, scenario.world)
        if raw is not None:
            write_raw(options.out / "raw.npz", raw)
    except OSError as failure:
        print(f"plan_grasp: {options.out}: cannot be written ({failure})", file=sys.stderr)
        return 2
    also = ", probes.html" * bool(steps) + ", raw.npz" * (raw is not None)
    console.print(f"Written: {options.out}/plan.json, result.json{also}")
    if met:
        console.print("[bold green]Goal met.[/]")
        return 0
    console.print(f"[bold red]Goal not met[/]: {reason}")
    return 1


if __name__ == "__main__":
    sys.exit(main())
