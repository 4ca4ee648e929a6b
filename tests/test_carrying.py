"""Who moves the hand is asked for every motion in order, and may be stopped by the object."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from grasp_moves import from_home

from estimator.axis import Axis
from estimator.contact import Contact, Miss
from estimator.sensors import sensor_noise
from estimator.surface import SurfaceOfRevolution
from hand_models import load_hand
from planner.carrying import Stop
from planner.explore import explore
from planner.goal import Goal
from planner.messages import step_record
from planner.options import PlannerOptions
from sim_sensor.camera import coarse_view
from sim_sensor.noise import simulated_sensor
from sim_sensor.objects import load_object
from sim_sensor.world import World

HAND = load_hand("allegro_right")
GOAL = Goal(np.deg2rad(3.0), 2e-3)
OPTIONS = from_home(HAND, PlannerOptions(placements=400, certify=False))


class Robot:
    """Notes what it was asked for; stops the motions of a phase as often as it is told to."""

    def __init__(self, stops=0, phase="enter", feels=True):
        rng = np.random.default_rng(3)
        surface = SurfaceOfRevolution(Axis([0.5, 0.0, 0.2], [0.1, 0.0, 1.0]), load_object("can"))
        self.belief = coarse_view(surface, angle=np.deg2rad(15.0), offset=0.015, rng=rng)
        self.world = World(surface, simulated_sensor("gel").session(rng=rng), rng=rng)
        self.stops, self.phase, self.feels = stops, phase, feels
        self.asked, self.begins = [], []
        self.contact = None

    def touch(self, probe):
        self.asked.append("touch")
        felt = self.world.touch(probe.approach)
        return felt if isinstance(felt, Miss) else replace(felt, finger=probe.finger)

    def move(self, trajectory):
        self.asked.append(trajectory.phase)
        self.begins.append(trajectory.begin)
        if trajectory.phase != self.phase or self.stops == 0:
            return None
        self.stops -= 1
        if not self.feels:
            return Stop(trajectory, 0.5, "")
        return Stop(trajectory, 0.5, "index", replace(self.contact, finger="index"))

    def explore(self, *, budget=9, options=OPTIONS, move=True):
        steps = explore(
            HAND, self.touch, self.belief, sensor_noise("gel"), goal=GOAL, budget=budget,
            rng=np.random.default_rng(0), options=options, move=self.move if move else None,
        )  # fmt: skip
        return list(steps)


@pytest.fixture(scope="module")
def free():
    robot = Robot()
    return robot, robot.explore()


def test_motions_are_asked_for_in_order_each_where_the_last_one_ended(free):
    robot, steps = free
    wanted = []
    for step in steps:
        wanted += ["transfer", "enter", *["touch"] * len(step.plan.probes), "leave"]
    assert robot.asked == wanted
    assert all(step.stop is None for step in steps)
    at = OPTIONS.start
    for step in steps:
        motion = step.plan.motion
        for one in (motion.transfer, motion.enter):
            np.testing.assert_allclose(one.begin.q, at.q, atol=1e-6)
            assert np.linalg.norm(one.begin.X_WB.translation - at.X_WB.translation) < 1e-6
            at = one.end
        at = step.left
        np.testing.assert_allclose(motion.leave.end.q, at.q, atol=1e-6)


def test_without_a_mover_or_a_place_to_start_from_only_touches_are_asked_for():
    for options, move in ((OPTIONS, False), (replace(OPTIONS, start=None), True)):
        robot = Robot()
        steps = robot.explore(budget=3, options=options, move=move)
        assert set(robot.asked) == {"touch"}
        assert len(robot.asked) == steps[-1].touches


def test_what_stops_the_way_in_is_a_touch_and_the_plan_is_made_anew(free):
    felt = next(c for c in free[1][0].outcomes if isinstance(c, Contact))
    robot = Robot(stops=1)
    robot.contact = felt
    first, second, *_ = robot.explore()
    assert robot.asked[:4] == ["transfer", "enter", "transfer", "enter"]
    assert first.outcomes == () == first.probes
    assert (first.touches, first.felt) == (1, (("index", first.stop.felt),))
    assert len(first.after.contacts) == 1
    assert np.linalg.norm(first.after.axis.point - first.before.axis.point) > 1e-4
    np.testing.assert_array_equal(first.left.q, first.stop.trajectory.begin.q)
    np.testing.assert_allclose(robot.begins[2].q, robot.begins[1].q, atol=1e-6)
    assert second.stop is None
    told = json.loads(json.dumps(step_record(first), allow_nan=False))
    assert told["outcomes"] == []
    assert told["stopped"]["phase"] == "enter"
    assert told["stopped"]["contact"]["position"] == pytest.approx(list(felt.position))
    assert step_record(second)["stopped"] is None


@pytest.mark.parametrize("phase", ["enter", "transfer"])
def test_a_hand_that_is_always_stopped_and_feels_nothing_ends_with_its_budget(phase):
    robot = Robot(stops=100, phase=phase, feels=False)
    steps = robot.explore(budget=3)
    assert [step.touches for step in steps] == [1, 2, 3]
    assert all(step.felt == () and step.after is step.before for step in steps)
    assert not GOAL.met_by(steps[-1].after)
    assert "touch" not in robot.asked
    assert step_record(steps[0])["stopped"]["contact"] is None


def test_links_keep_farther_away_once_one_has_met_the_object():
    """Truth: the certificates; 1 mm is asked before, 4 and then 7 mm."""
    robot = Robot(stops=2, feels=False)
    steps = robot.explore(budget=6)
    clear = [step.plan.reach.certificate.links[1] for step in steps]
    assert clear[0] >= 1e-3
    assert clear[1] >= 4e-3
    assert clear[2] >= 7e-3


def test_a_surprise_that_nothing_has_confirmed_is_still_open_after_a_stop():
    """A belief that is contradicted, and then a stop that tells nothing."""
    robot = Robot()
    moved = SurfaceOfRevolution(Axis([0.5, 0.012, 0.2], [0.1, 0.0, 1.0]), load_object("can"))
    touch = robot.touch

    def bumped(probe):
        if robot.asked.count("touch") == 3:
            robot.world.surface = moved
        return touch(probe)

    robot.touch = bumped
    seen = []
    for step in explore(
        HAND, robot.touch, robot.belief, sensor_noise("gel"), goal=GOAL, budget=12,
        rng=np.random.default_rng(0), options=OPTIONS, move=robot.move,
    ):  # fmt: skip
        seen.append(step)
        if step.surprise is not None and step.stop is None:
            robot.stops, robot.phase, robot.feels = 1, "transfer", False
    surprised = next(k for k, step in enumerate(seen) if step.surprise is not None)
    assert not seen[surprised].settled
    assert seen[surprised + 1].stop is not None
    assert not seen[surprised + 1].settled
    assert seen[-1].settled


def test_nothing_stops_the_way_out(free):
    robot = Robot(stops=100, phase="leave", feels=False)
    steps = robot.explore()
    assert GOAL.met_by(steps[-1].after)
    assert all(step.stop is None for step in steps)
