"""Sessions of touches under one criterion: the same object, belief, sensor and seeds for each.

Without a hand every criterion picks from the same kind of candidates, three random places around
the believed object, and a pad comes straight along the believed normal; so the choice alone is
compared. With a hand the candidates are what it reaches.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from estimator.axis import Axis, angle_between, offset_at
from estimator.belief import Belief, sample_objects, update
from estimator.contact import Contact, Miss, SensorNoise
from estimator.sensors import sensor_noise
from estimator.surface import SurfaceOfRevolution
from estimator.vectors import Array
from hand_models import load_hand
from hand_models.hand import Hand
from planner.candidates import END_MARGIN, Candidates
from planner.choosing.choice import MARGIN, rank
from planner.choosing.criteria import Criterion
from planner.choosing.prospects import BEFORE, BEHIND
from planner.choosing.worth import Worth
from planner.explore import explore
from planner.goal import Goal
from planner.options import OFFSET_GUARD, PlannerOptions
from planner.plan import NoPlan, Probe
from sim_sensor.camera import coarse_view
from sim_sensor.noise import simulated_sensor
from sim_sensor.objects import load_object
from sim_sensor.world import World

GOAL = Goal(float(np.deg2rad(0.2)), 0.1e-3)  # not to be met: all touches are made
PAD = 0.008  # radius of a pad without a hand [m]
PLACES = 300  # candidates without a hand
OBJECTS = 16  # drawn from the belief


@dataclass(frozen=True)
class Setting:
    """What a session meets.

    Args:
        hand: A hand's name, "" for none.
        angle_deg, offset_mm: How wrong the first belief is.
        common_deg: Rotation of all directions by the sensor, told to nobody.
        touches: How many are made.
    """

    hand: str
    sensor: str
    angle_deg: float
    offset_mm: float
    common_deg: float
    touches: int


@dataclass(frozen=True)
class Point:
    """How wrong the axis is after some touches."""

    criterion: Criterion
    object: str
    seed: int
    touches: int
    angle_deg: float
    offset_mm: float
    determined: bool


@dataclass(frozen=True, eq=False)
class _Straight:
    """A pad that comes straight along a normal."""

    tip_centres: Array
    pad_radius: float = PAD


def session(setting: Setting, criterion: Criterion, name: str, seed: int) -> list[Point]:
    """The error after each round of three touches."""
    rng = np.random.default_rng([seed, 31])
    axis = Axis([0.5, 0.0, 0.2], [0.2 * rng.normal(), 0.2 * rng.normal(), 1.0])
    surface = SurfaceOfRevolution(axis, load_object(name))
    angle, offset = np.deg2rad(setting.angle_deg), 1e-3 * setting.offset_mm
    belief = coarse_view(surface, angle=angle, offset=offset, rng=rng)
    common = float(np.deg2rad(setting.common_deg)) or None
    feeling = simulated_sensor(setting.sensor).session(rng=rng, direction_offset=common)
    world = World(surface, feeling, rng=rng)
    told = sensor_noise(setting.sensor)
    own = np.random.default_rng([seed, 32])
    beliefs = _by_hand if setting.hand else _anywhere
    points = []
    with suppress(NoPlan):
        for touches, after in beliefs(setting, criterion, belief, world, told, own):
            points.append(_point(criterion, name, seed, touches, after, surface))
    return points


def _anywhere(
    setting: Setting, criterion: Criterion, belief: Belief, world: World, told: SensorNoise,
    rng: np.random.Generator,
) -> Iterator[tuple[int, Belief]]:  # fmt: skip
    for touches in range(3, setting.touches + 1, 3):
        candidates = _places(belief.surface, rng)
        samples = sample_objects(belief, OBJECTS, rng=rng)
        fresh = belief.estimate is None or belief.estimate.verdict != "determined"
        worth = Worth(belief, samples, told, GOAL, untold=OFFSET_GUARD, pad=PAD)
        margin = MARGIN if fresh else 0.0
        ranking = rank(candidates, worth, margin=margin, criterion=criterion, rng=rng)
        best = int(ranking.order[0])
        place = belief.surface.at(candidates.theta[best], candidates.z[best])
        felt = [_felt(world, p, n, told) for p, n in zip(place.p, place.n, strict=True)]
        belief = update(belief, felt)
        yield touches, belief


def _places(surface: SurfaceOfRevolution, rng: np.random.Generator) -> Candidates:
    """Random triples of places, no hand asked."""
    low, high = surface.profile.z_range
    inset = END_MARGIN * (high - low)
    theta = rng.uniform(-np.pi, np.pi, (PLACES, 3))
    z = rng.uniform(low + inset, high - inset, (PLACES, 3))
    nowhere = np.zeros((PLACES, 3))
    turned = np.tile(np.eye(3), (PLACES, 1, 1))
    fingers = np.tile(np.arange(3), (PLACES, 1))
    return Candidates(fingers, nowhere, turned, nowhere, theta, z, nowhere, ())


def _felt(world: World, p: Array, n: Array, told: SensorNoise) -> Contact | Miss:
    ends = np.stack([p + (BEFORE + PAD) * n, p - (BEHIND - PAD) * n])
    outcome = world.touch(_Straight(ends))
    return outcome if isinstance(outcome, Miss) else replace(outcome, noise=told)


@lru_cache
def _hand(name: str) -> Hand:
    return load_hand(name)


def _by_hand(
    setting: Setting, criterion: Criterion, belief: Belief, world: World, told: SensorNoise,
    rng: np.random.Generator,
) -> Iterator[tuple[int, Belief]]:  # fmt: skip
    def touch(probe: Probe) -> Contact | Miss:
        outcome = world.touch(probe.approach)
        return outcome if isinstance(outcome, Miss) else replace(outcome, noise=told)

    options = PlannerOptions(criterion=criterion, certify=False)
    steps = explore(
        _hand(setting.hand), touch, belief, told,
        goal=GOAL, budget=setting.touches, rng=rng, options=options,
    )  # fmt: skip
    for step in steps:
        yield step.touches, step.after


def _point(
    criterion: Criterion, name: str, seed: int, touches: int, belief: Belief,
    surface: SurfaceOfRevolution,
) -> Point:  # fmt: skip
    middle = surface.axis.point + np.mean(surface.profile.z_range) * surface.axis.direction
    return Point(
        criterion, name, seed, touches,
        float(np.rad2deg(angle_between(belief.axis, surface.axis))),
        1e3 * offset_at(belief.axis, surface.axis, middle),
        belief.estimate is not None and belief.estimate.verdict == "determined",
    )  # fmt: skip
