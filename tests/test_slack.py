"""Slack makes every contact count as worse placed, and plan_grasp.py asks for it of real things."""

from dataclasses import replace

import numpy as np
import pytest
from plan_options import Options, planner_options
from worlds import SLACK, slack_in

from estimator.axis import Axis
from estimator.sensors import sensor_noise
from estimator.surface import SurfaceOfRevolution
from hand_models import load_hand
from planner.explore import explore
from planner.goal import Goal
from planner.options import PlannerOptions
from sim_sensor.camera import coarse_view
from sim_sensor.noise import simulated_sensor
from sim_sensor.objects import load_object
from sim_sensor.world import World

HAND = load_hand("allegro_right")


def first_step(slack):
    rng = np.random.default_rng(3)
    surface = SurfaceOfRevolution(Axis([0.5, 0.0, 0.2], [0.1, 0.0, 1.0]), load_object("can"))
    belief = coarse_view(surface, angle=0.26, offset=0.015, rng=rng)
    world = World(surface, simulated_sensor("gel").session(rng=rng), rng=rng)
    return next(
        explore(
            HAND, lambda probe: world.touch(probe.approach), belief, sensor_noise("gel"),
            goal=Goal(0.05, 0.002), budget=3, rng=np.random.default_rng(0),
            options=PlannerOptions(certify=False, slack=slack),
        )
    )  # fmt: skip


def test_contacts_count_as_worse_placed_and_the_plan_reckons_with_it():
    strict, slack = first_step(0.0), first_step(2e-3)
    felt = sensor_noise("gel").position
    for step, position in ((strict, felt), (slack, np.hypot(felt, 2e-3))):
        assert [c.noise.position for c in step.after.contacts] == pytest.approx(
            [position] * len(step.after.contacts)
        )
    assert slack.plan.offset > strict.plan.offset
    assert np.trace(slack.after.covariance) > np.trace(strict.after.covariance)


@pytest.mark.parametrize(
    ("world", "sensor", "name", "expected"),
    [
        ("own", "gel", "can", 0.0),
        ("own", "gel", "my_vase.csv", 0.0),
        ("own", "gel-depth", "can", SLACK),
        ("own", "gel", "folder/product.json", SLACK),
        ("own", "gel", "SCAN.STL", SLACK),
        ("mujoco", "gel-depth", "can", SLACK),
        ("mujoco-table", "gel-depth", "can", SLACK),
    ],
)
def test_slack_is_of_real_things(world, sensor, name, expected):
    assert slack_in(world, sensor, name) == expected
    options = Options(world=world, sensor=sensor, object=name)
    assert planner_options(options).slack == expected
    assert planner_options(replace(options, slack_mm=1.5)).slack == pytest.approx(1.5e-3)
    assert planner_options(replace(options, slack_mm=0.0)).slack == 0.0
