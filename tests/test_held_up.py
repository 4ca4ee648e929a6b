"""Where things go wrong, a session ends well: the goal, or a clear verdict; no wrong axis."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from estimator.axis import Axis, angle_between, to_chart
from estimator.contact import Miss
from estimator.profile import cylinder
from estimator.sensors import SENSORS
from estimator.surface import SurfaceOfRevolution
from hand_models import load_hand
from planner.explore import explore
from planner.goal import Goal
from planner.messages import step_record
from planner.options import PlannerOptions
from planner.reaching.reach_task import ReachOptions
from planner.reaching.workspace import Workspace
from sim_sensor.camera import coarse_view
from sim_sensor.noise import simulated_sensor
from sim_sensor.objects import load_object
from sim_sensor.world import World

HAND = load_hand("allegro_right")
GOAL = Goal(np.deg2rad(3.0), 2e-3)
FAST = PlannerOptions(placements=500, certify=False)
FOUR_SIGMA = 24.5  # of chi-square with four degrees of freedom
BUDGET = 15


class Session:
    """A coarse view of an object, and a world that a test may meddle with."""

    def __init__(self, profile, seed):
        self.rng = np.random.default_rng([seed, 5])
        tilt = 0.2 * self.rng.normal(size=2)
        surface = SurfaceOfRevolution(Axis([0.5, 0.0, 0.2], [*tilt, 1.0]), profile)
        self.belief = coarse_view(surface, angle=np.deg2rad(15.0), offset=0.015, rng=self.rng)
        session = simulated_sensor("gel").session(rng=self.rng)
        self.world = World(surface, session, rng=self.rng)
        self.touches = 0

    def move(self, distance):
        """The object, by a distance in a random direction."""
        way = self.rng.normal(size=3)
        axis = self.world.surface.axis
        point = axis.point + distance * way / np.linalg.norm(way)
        self.world.surface = SurfaceOfRevolution(
            Axis(point, axis.direction), self.world.surface.profile
        )

    def touch(self, probe):
        self.touches += 1
        felt = self.world.touch(probe.approach, finger_axis_W=probe.approach.finger_axis)
        if isinstance(felt, Miss):
            return felt
        return replace(felt, finger=probe.finger, sensor="gel")

    def steps(self, *, seed, touch=None, options=FAST):
        return list(
            explore(
                HAND, touch or self.touch, self.belief, SENSORS["gel"],
                goal=GOAL, budget=BUDGET, rng=np.random.default_rng(seed), options=options,
            )
        )  # fmt: skip

    def wrong(self, last):
        """Whether the session ends sure of an axis that is not the object's."""
        belief, truth = last.after, self.world.surface.axis
        if last.surprise is not None or not GOAL.met_by(belief):
            return False
        x = to_chart(belief.axis, truth)
        far = angle_between(belief.axis, truth) > np.deg2rad(10.0)
        return bool(far or x @ np.linalg.solve(belief.covariance, x) > FOUR_SIGMA)


@pytest.mark.parametrize("seed", range(2))
def test_a_short_object_forces_one_parallel_and_is_still_told(seed):
    """A disc 20 mm high: all contacts on nearly one parallel, the goal is met all the same."""
    session = Session(cylinder(0.035, 0.02), seed)
    last = session.steps(seed=seed)[-1]
    assert GOAL.met_by(last.after)
    assert not session.wrong(last)


@pytest.mark.parametrize("seed", range(2))
def test_a_cylinder_is_told_although_an_axis_far_away_fits_too(seed):
    session = Session(load_object("can"), seed)
    last = session.steps(seed=seed)[-1]
    assert GOAL.met_by(last.after)
    assert not session.wrong(last)


def test_a_sphere_is_said_to_have_no_axis():
    session = Session(load_object("sphere"), 0)
    last = session.steps(seed=0)[-1]
    assert last.touches == BUDGET
    assert last.after.estimate.verdict == "undetermined"
    assert "umbilic" in GOAL.missing(last.after)


def one_side(X_WB):
    """A wrist that reaches 6 cm and 35 degrees around one place."""
    reach = ReachOptions(starts=0, rescues=1, workspace=Workspace(X_WB, 0.06, 0.6))
    return replace(FAST, reach=reach)


@pytest.mark.parametrize("seed", range(2))
def test_a_hand_that_reaches_one_side_only_meets_the_goal_or_says_why(seed):
    session = Session(load_object("can"), seed)
    free = Session(load_object("can"), seed).steps(seed=seed)[0].plan.reach.X_WB
    options = one_side(free)
    steps = session.steps(seed=seed, options=options)
    last = steps[-1]
    for step in steps:
        for probe in step.plan.probes:
            for X in probe.approach.bases:
                assert np.all(np.abs(X.translation - free.translation) < 0.06 + 0.031)
        X = step.plan.reach.X_WB
        assert np.linalg.norm(pin.log3(free.rotation.T @ X.rotation)) < 0.6 + 1e-3
    assert not session.wrong(last)
    assert GOAL.met_by(last.after) or GOAL.missing(last.after)


@pytest.mark.parametrize("seed", range(4))
def test_an_object_moved_by_3_mm_never_ends_in_a_wrong_axis(seed):
    session = Session(load_object("can"), seed)

    def touch(probe):
        if session.touches == 3:
            session.move(3e-3)
        return session.touch(probe)

    assert not session.wrong(session.steps(seed=seed, touch=touch)[-1])


def test_an_object_that_was_moved_is_told_to_the_user():
    """By 8 mm, which three touches cannot overlook; the axis is found where it is now."""
    session = Session(load_object("can"), 0)

    def touch(probe):
        if session.touches == 3:
            session.move(8e-3)
        return session.touch(probe)

    steps = session.steps(seed=0, touch=touch)
    assert "the object moved" in steps[1].surprise
    assert step_record(steps[1])["surprise"] == steps[1].surprise
    assert len(steps[1].after.contacts) < len(steps[0].after.contacts) + len(steps[1].outcomes)
    assert GOAL.met_by(steps[-1].after)
    assert steps[-1].surprise is None
    assert not session.wrong(steps[-1])


@pytest.mark.parametrize("seed", range(2))
def test_an_object_that_never_rests_is_not_believed(seed):
    """Moved by 5 mm before every touch: surprises or no goal, and no confident end."""
    session = Session(load_object("can"), seed)

    def touch(probe):
        session.move(5e-3)
        return session.touch(probe)

    steps = session.steps(seed=seed, touch=touch)
    assert any(step.surprise for step in steps) or not GOAL.met_by(steps[-1].after)
    assert not session.wrong(steps[-1])


@pytest.mark.parametrize("name", ["can", "bottle"])
def test_every_third_touch_missing_costs_touches_only(name):
    """The finger goes all the way, and the sensor says that there was nothing."""
    session = Session(load_object(name), 1)

    def touch(probe):
        felt = session.touch(probe)
        approach = probe.approach
        if session.touches % 3 == 0:
            return Miss(approach.tip_centres[-1], approach.pad_radius)
        return felt

    last = session.steps(seed=1, touch=touch)[-1]
    assert GOAL.met_by(last.after)
    assert not session.wrong(last)
