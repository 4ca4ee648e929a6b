"""Runs of mujoco_study.py: planned touches that should meet, and sessions in both worlds."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from grasp_moves import from_home, unconfirmed_by
from worlds import SLACK, among_what_stands, build_world, mover, pose_in

from estimator.axis import angle_between, offset_at
from estimator.band import ProfileBand
from estimator.belief import Belief, coarse_belief
from estimator.contact import Contact, Miss
from estimator.prior import coarse_prior
from estimator.sensors import sensor_noise
from estimator.surface import SurfaceOfRevolution
from hand_models import load_hand
from hand_models.hand import Hand
from planner.explore import Step, explore
from planner.goal import Goal
from planner.options import PlannerOptions
from planner.plan import NoPlan, Plan, Probe, plan_probes
from sim_sensor.camera import coarse_view
from sim_sensor.objects import load_object
from sim_sensor.physics.mujoco_models import Models, Standing, build_models
from sim_sensor.physics.mujoco_world import SENSOR, MujocoRecord, MujocoWorld
from sim_sensor.world import World

NODES = 41  # of a profile that is known
ANGLE, OFFSET = float(np.deg2rad(15.0)), 15e-3  # of the camera, the main job's default
GOAL = Goal(float(np.deg2rad(3.0)), 2e-3)
BUDGET = 15


@dataclass(frozen=True)
class Touch:
    """One touch planned by somebody who knows the object; lengths in millimetres.

    Args:
        off: MuJoCo's contact from the planned one; NaN where it met nothing.
        bumped: What else met the object on the way.
    """

    object: str
    seed: int
    finger: str
    off: float
    force: float
    bumped: tuple[str, ...]


@dataclass(frozen=True)
class Session:
    """One session with the default goal; errors against where the object is at the end.

    Args:
        why: What is missing where the goal is not met.
        surprises: Rounds that contradicted earlier ones.
        bumped: Touches on whose way something else met the object.
        stops: Motions between touches that the object ended.
        moved: Of the object, all touches together [mm].
    """

    world: str
    object: str
    seed: int
    met: bool
    touches: int
    angle_deg: float
    offset_mm: float
    why: str
    surprises: int
    bumped: int
    moved: float
    unpressed: int
    stops: int


def exact_belief(surface: SurfaceOfRevolution) -> Belief:
    """The object as it is, known to a hundredth of a millimetre."""
    z = np.linspace(*surface.profile.z_range, NODES)
    r = surface.profile.derivatives(z)[0]
    prior = coarse_prior(
        surface.axis, angle=1e-4, offset=1e-5, radius=float(r.mean()), radius_sd=1e-5
    )
    band = ProfileBand(z, r, 1e-10 * np.eye(NODES))
    belief = coarse_belief(prior, (float(z[0]), float(z[-1])))
    return replace(belief, band=band, prior_band=band)


def planned_touches(hand: str, name: str, seed: int) -> Iterator[Touch]:
    """The touches of one plan from an exact belief, carried out in MuJoCo.

    Raises:
        NoPlan: The hand reaches nothing useful.
    """
    rng = np.random.default_rng([seed, 3])
    surface = SurfaceOfRevolution(pose_in("mujoco", rng), load_object(name))
    plan = _plan(hand, surface, rng)
    world = MujocoWorld(
        _hand(hand), surface, rng=rng, models=_models(hand, name, None), noisy=False
    )
    for probe in plan.probes:
        world.touch(probe.approach, finger_axis_W=probe.approach.finger_axis)
        told = world.records[-1]
        met = np.full(3, np.nan) if told.met is None else told.met
        off = 1e3 * float(np.linalg.norm(met - probe.expected.position))
        yield Touch(name, seed, probe.finger, off, told.force, told.bumped)


def session(hand: str, name: str, seed: int, world: str, *, mass: float = 0.3) -> Session:
    """The main job without its grasp, the same object and camera in every world.

    Args:
        mass: Of an object that stands on a table [kg].
    """
    rng = np.random.default_rng(seed)
    surface = SurfaceOfRevolution(pose_in(world, rng), load_object(name))
    belief = coarse_view(surface, angle=ANGLE, offset=OFFSET, rng=rng)
    here = _world(hand, name, surface, world, mass, rng)
    steps: list[Step] = []
    reason = ""
    try:
        for step in carried_out(hand, here, belief, seed, kind=world):
            steps.append(step)
    except NoPlan as error:
        reason = str(error)
    return _told(here, name, seed, world, belief, steps, reason)


def _plan(hand: str, surface: SurfaceOfRevolution, rng: np.random.Generator) -> Plan:
    belief = exact_belief(surface)
    return plan_probes(_hand(hand), belief, sensor_noise(SENSOR), goal=GOAL, rng=rng)


def carried_out(
    hand: str, world: World | MujocoWorld, belief: Belief, seed: int, *, kind: str = "mujoco"
) -> Iterator[Step]:
    """A session with the default goal; where the world can, every motion is carried out.

    Args:
        kind: Of the world: on a table, that is told of.
    """
    options = from_home(_hand(hand), PlannerOptions(certify=False, slack=SLACK))
    options = among_what_stands(kind, world.surface, options)

    def touch(probe: Probe) -> Contact | Miss:
        felt = world.touch(probe.approach, finger_axis_W=probe.approach.finger_axis)
        if isinstance(felt, Miss):
            return felt
        return replace(felt, finger=probe.finger, sensor=SENSOR)

    return explore(
        _hand(hand), touch, belief, sensor_noise(SENSOR), goal=GOAL, budget=BUDGET,
        rng=np.random.default_rng([seed, 1]), move=mover(world, SENSOR),
        options=options,
    )  # fmt: skip


def _told(
    world: World | MujocoWorld,
    name: str,
    seed: int,
    kind: str,
    belief: Belief,
    steps: list[Step],
    reason: str,
) -> Session:
    last = steps[-1].after if steps else belief
    open_question = unconfirmed_by(steps)
    surface = world.surface
    middle = surface.axis.point + np.mean(surface.profile.z_range) * surface.axis.direction
    met = GOAL.met_by(last) and open_question is None
    records = [r for r in world.records if isinstance(r, MujocoRecord)]
    return Session(
        world=kind,
        object=name,
        seed=seed,
        met=met,
        touches=len(world.records),
        angle_deg=float(np.rad2deg(angle_between(last.axis, surface.axis))),
        offset_mm=1e3 * offset_at(last.axis, surface.axis, middle),
        why="" if met else "; ".join(filter(None, (GOAL.missing(last), open_question, reason))),
        surprises=sum(step.surprise is not None for step in steps),
        bumped=sum(bool(r.bumped) for r in records),
        moved=1e3 * sum(r.moved for r in records),
        unpressed=sum(r.met is not None and not r.reached for r in records),
        stops=sum(step.stop is not None for step in steps),
    )


def _world(
    hand: str,
    name: str,
    surface: SurfaceOfRevolution,
    world: str,
    mass: float,
    rng: np.random.Generator,
) -> World | MujocoWorld:
    if world == "own":
        return build_world(world, _hand(hand), surface, SENSOR, rng)
    standing = Standing(mass) if world == "mujoco-table" else None
    models = _models(hand, name, standing)
    return MujocoWorld(_hand(hand), surface, rng=rng, standing=standing, models=models)


@lru_cache
def _hand(name: str) -> Hand:
    return load_hand(name).with_balls()


@lru_cache(maxsize=32)
def _models(hand: str, name: str, standing: Standing | None) -> Models:
    """Of an object anywhere: an octree takes seconds."""
    upright = pose_in("mujoco-table", np.random.default_rng(0))
    return build_models(_hand(hand), SurfaceOfRevolution(upright, load_object(name)), standing)
