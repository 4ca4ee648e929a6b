"""The worlds that plan_grasp.py can touch: our own, and MuJoCo's with the object held or standing.

    own            the true surface in closed form; any sensor
    mujoco         a physics engine moves the hand, the object is held; pads are balls of gel
    mujoco-table   the same, but the object stands upright on a table and can be pushed

MuJoCo is installed with the extra `mujoco`; nothing here imports it unless it is asked for.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console

from estimator.axis import Axis
from estimator.readers.raw_sensors import RAW_SENSORS, RawSensor, raw_sensor
from estimator.surface import SurfaceOfRevolution
from hand_models import load_hand
from hand_models.hand import Hand
from planner.carrying import Move, Stop
from planner.motions.surroundings import Box
from planner.motions.trajectory import Trajectory
from planner.options import PlannerOptions
from sim_sensor.mesh_objects import SUFFIXES, read_mesh
from sim_sensor.noise import simulated_sensor
from sim_sensor.signals.raw_sense import raw_sense
from sim_sensor.world import World

if TYPE_CHECKING:
    from sim_sensor.physics.mujoco_world import MujocoWorld

WORLDS = ("own", "mujoco", "mujoco-table")
SLACK = 0.2e-3  # of real things, of raw signals, and of what a touch moves on a table [m]
_DEFAULT, _OF_MUJOCO = "gel", "gel-depth"


def sensor_in(world: str, sensor: str) -> str:
    """The sensor that a world mounts when this one is asked for.

    Raises:
        ValueError: Unknown world, or a sensor that it does not have.
    """
    if world not in WORLDS:
        raise ValueError(f"--world {world!r} is unknown; known are {', '.join(WORLDS)}")
    if world == "own":
        return sensor
    if sensor not in (_DEFAULT, _OF_MUJOCO):
        raise ValueError(f"--world {world}: its pads are {_OF_MUJOCO}, not --sensor {sensor}")
    return _OF_MUJOCO


def hand_in(world: str, name: str) -> Hand:
    """A hand as it is in that world: in MuJoCo its pads are balls of gel.

    Raises:
        HandError: As `load_hand`.
    """
    hand = load_hand(name)
    return hand if world == "own" else hand.with_balls()


def slack_in(world: str, sensor: str, name: str) -> float:
    """How far contacts may be from where a perfectly round object at rest would have them [m]."""
    real = Path(name).suffix.lower() in (".json", *SUFFIXES)
    return SLACK if real or world != "own" or sensor in RAW_SENSORS else 0.0


def pose_in(world: str, rng: np.random.Generator) -> Axis:
    """A nearly upright object; upright where it stands by itself."""
    tilt = 0.2 * rng.normal(size=2)
    return Axis([0.5, 0.0, 0.2], [*(tilt if world != "mujoco-table" else 0.0 * tilt), 1.0])


def build_world(
    world: str, hand: Hand, surface: SurfaceOfRevolution, sensor: str, rng: np.random.Generator
) -> World | MujocoWorld:
    """The world around an object.

    Raises:
        ValueError: MuJoCo is not installed.
    """
    if world == "own":
        if sensor in RAW_SENSORS:
            return World(surface, raw_sense(sensor, surface, rng=rng), rng=rng, hand=hand)
        return World(surface, simulated_sensor(sensor).session(rng=rng), rng=rng, hand=hand)
    try:
        from sim_sensor.physics.mujoco_models import Standing
        from sim_sensor.physics.mujoco_world import MujocoWorld
    except ImportError as error:
        raise ValueError(f"--world {world}: needs the extra 'mujoco' ({error})") from None
    standing = Standing() if world == "mujoco-table" else None
    return MujocoWorld(hand, surface, rng=rng, standing=standing)


def among_what_stands(
    world: str, surface: SurfaceOfRevolution, options: PlannerOptions
) -> PlannerOptions:
    """The planner's options with the table that the object stands on.

    Raises:
        ValueError: MuJoCo is not installed.
    """
    if world != "mujoco-table":
        return options
    try:
        from sim_sensor.physics.mujoco_object import BOARD_SIZE, board
    except ImportError as error:
        raise ValueError(f"--world {world}: needs the extra 'mujoco' ({error})") from None
    centre = board(surface)
    table = Box((centre[0], centre[1], centre[2]), BOARD_SIZE, name="the table")
    reach = replace(options.reach, boxes=(*options.reach.boxes, table))
    return replace(options, reach=reach)


def mover(world: World | MujocoWorld, sensor: str) -> Move | None:
    """Who carries motions between touches out: MuJoCo. Our own world knows no hand."""
    if isinstance(world, World):
        return None

    def move(trajectory: Trajectory) -> Stop | None:
        told = world.follow(trajectory)
        if not told.ended:
            return None
        if told.contact is None:
            return Stop(trajectory, told.time, "")
        felt = replace(told.contact, finger=told.finger, sensor=sensor)
        return Stop(trajectory, told.time, told.finger, felt)

    return move


def print_object(console: Console, name: str) -> None:
    """How far a user's mesh is from what everything here believes in."""
    if Path(name).suffix.lower() in SUFFIXES:
        console.print(f"[bold]Object[/] {read_mesh(Path(name)).words}")


def raw_sensor_of(world: World | MujocoWorld, sensor: str) -> RawSensor:
    """The raw sensor as it is mounted: pads of a hand in MuJoCo have the hand's own radius."""
    return raw_sensor(sensor) if isinstance(world, World) else world.sensor
