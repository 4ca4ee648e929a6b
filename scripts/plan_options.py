"""Command line of plan_grasp.py, and what it asks of planner and grasp."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pinocchio as pin
from obstacle_file import read_obstacles
from worlds import slack_in

from planner.grasping.grasp import Friction, GraspOptions
from planner.options import PlannerOptions
from planner.reaching.reach_task import ReachOptions
from planner.reaching.workspace import Workspace


@dataclass(frozen=True)
class Options:
    """Command line of plan_grasp.py."""

    hand: str = "allegro_right"
    """Hand: one of hand_models/hands, or the path of a description (.toml)."""
    describe_hand: Path | None = None
    """Instead of all this, propose a description of the hand in this URDF or MJCF, into --out."""
    describe_base: str | None = None
    """The link of it that is the palm, where the guess is wrong."""
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
    """Where something holds the hand base, in the world; the object stands near (500, 0, 200).
    Not given, as the hand's description says ([wrist] or [arm]), or else anywhere."""
    wrist_range_mm: float = 150.0
    """How far from there, along each axis, it can go; it turns the hand any way."""
    obstacles: Path | None = None
    """A TOML file of a table and boxes that the hand must not meet (scripts/obstacle_file.py)."""
    slack_mm: float | None = None
    """How far a contact may be from where a perfectly round object at rest would have it, beside
    the sensor's noise. Not given, 0.2 for real objects, raw signals and MuJoCo, and else 0."""
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


def require_sane(options: Options) -> None:
    """Raises ValueError with the option's name, its value and what is allowed."""
    if not (np.isfinite(options.prior_angle_deg) and 0 < options.prior_angle_deg < 90):
        raise ValueError(f"--prior-angle-deg: expected 0 to 90, got {options.prior_angle_deg}")
    if not 0 < options.prior_offset_mm <= 1000:
        raise ValueError(f"--prior-offset-mm: expected 0 to 1000, got {options.prior_offset_mm}")
    if options.budget < 1:
        raise ValueError(f"--budget: expected at least one touch, got {options.budget}")
    if options.slack_mm is not None and not 0.0 <= options.slack_mm < 10.0:
        raise ValueError(f"--slack-mm: expected 0 to 10, got {options.slack_mm}")
    if options.seed < 0:
        raise ValueError(f"--seed: expected a number >= 0, got {options.seed}")


def planner_options(options: Options) -> PlannerOptions:
    """The planner's defaults, within the arm's workspace, among the obstacles."""
    reach = replace(PlannerOptions().reach, **read_obstacles(options.obstacles))
    slack = slack_in(options.world, options.sensor, options.object)
    if options.slack_mm is not None:
        slack = 1e-3 * options.slack_mm
    if options.wrist_mm is None:
        return PlannerOptions(reach=reach, slack=slack)
    if not np.all(np.isfinite(options.wrist_mm)):
        raise ValueError(f"--wrist-mm: expected three finite numbers, got {options.wrist_mm}")
    X_WB = pin.SE3(np.eye(3), 1e-3 * np.array(options.wrist_mm))
    workspace = Workspace(X_WB, 1e-3 * options.wrist_range_mm, np.pi)
    return PlannerOptions(reach=replace(reach, workspace=workspace), slack=slack)


def grasp_options(options: Options, told: ReachOptions) -> GraspOptions:
    """The defaults, within the workspace and among the obstacles told of, at the user's heights."""
    heights = options.grasp_heights_mm
    if heights is not None and not heights[0] < heights[1]:
        raise ValueError(f"--grasp-heights-mm: expected low < high, got {heights}")
    if not (np.isfinite(options.friction) and options.friction > 0.0):
        raise ValueError(f"--friction: expected a number > 0, got {options.friction}")
    default = GraspOptions()
    return replace(
        default,
        reach=replace(default.reach, workspace=told.workspace, table=told.table, boxes=told.boxes),
        heights=None if heights is None else (1e-3 * heights[0], 1e-3 * heights[1]),
        friction=Friction(options.friction),
    )
