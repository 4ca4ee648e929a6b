"""MuJoCo carries planned motions out in their own time, and what is in the way ends them."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("mujoco", minversion="3.9")

from grasp_moves import from_home
from mujoco_sessions import carried_out
from worlds import mover

from estimator.axis import Axis, angle_between
from estimator.contact import Contact
from estimator.sensors import sensor_noise
from estimator.surface import SurfaceOfRevolution
from estimator.vectors import Array
from hand_models import load_hand
from planner.goal import Goal
from planner.options import PlannerOptions
from planner.plan import Plan, plan_probes
from sim_sensor.camera import coarse_view
from sim_sensor.objects import load_object
from sim_sensor.physics.mujoco_follow import Followed
from sim_sensor.physics.mujoco_world import MujocoWorld

HAND = load_hand("allegro_right")
GOAL = Goal(np.deg2rad(3.0), 2e-3)
OPTIONS = from_home(HAND, PlannerOptions(placements=400, certify=False))
SURFACE = SurfaceOfRevolution(Axis([0.5, 0.0, 0.2], [0.1, -0.1, 1.0]), load_object("can"))


BELIEF = coarse_view(SURFACE, angle=np.deg2rad(15.0), offset=0.015, rng=np.random.default_rng(0))


@functools.cache
def planned() -> Plan:
    return plan_probes(
        HAND, BELIEF, sensor_noise("gel-depth"), goal=GOAL,
        rng=np.random.default_rng(0), options=OPTIONS,
    )  # fmt: skip


def world_where_believed(*, shift: Array | None = None) -> MujocoWorld:
    """The can where it is believed, or beside that."""
    axis = BELIEF.axis
    there = Axis(axis.point + (np.zeros(3) if shift is None else shift), axis.direction)
    return MujocoWorld(HAND, replace(SURFACE, axis=there), rng=np.random.default_rng(0))


def test_a_motion_through_free_space_ends_where_it_was_planned_to() -> None:
    """Truth: Pinocchio's pads at the trajectory's end."""
    world, motion = world_where_believed(), planned().motion
    for way in (motion.transfer, motion.enter):
        told = world.follow(way)
        assert not told.ended
        assert told.time == pytest.approx(way.duration)
        assert told.lag < 0.05
        assert told.bumped == ()
    pose = HAND.at(motion.enter.end.q, motion.enter.end.X_WB)
    for finger, centre in zip(HAND.fingers, pose.pad_centres, strict=True):
        assert np.linalg.norm(world._data.geom(f"pad/{finger.name}").xpos - centre) < 2e-3
    assert world.records == ()


def stopped(*, by_pad: bool) -> tuple[MujocoWorld, Followed]:
    """The first of some shifts of the object with which a pad, or a link, ends the way in."""
    rng = np.random.default_rng(0)
    for _ in range(40):
        world = world_where_believed(shift=rng.uniform(-0.04, 0.04, 3) * [1.0, 1.0, 0.0])
        told = world.follow(planned().motion.enter)
        if told.ended and bool(told.finger) == by_pad:
            return world, told
    raise AssertionError("no shift of the object does that")


def test_a_pad_that_meets_the_object_on_the_way_in_feels_where_it_is() -> None:
    """Truth: the true surface; afterwards the hand is where the motion began."""
    world, told = stopped(by_pad=True)
    enter = planned().motion.enter
    assert 0.0 < told.time < enter.duration
    assert isinstance(told.contact, Contact)
    assert abs(world.surface.signed_distance(told.contact.position)) < 1.5e-3
    assert len(world.records) == 1
    assert world.records[0].outcome is told.contact
    begin = HAND.at(enter.begin.q, enter.begin.X_WB)
    for finger, centre in zip(HAND.fingers, begin.pad_centres, strict=True):
        assert np.linalg.norm(world._data.geom(f"pad/{finger.name}").xpos - centre) < 3e-3


def test_a_link_that_meets_it_ends_the_motion_and_feels_nothing() -> None:
    world, told = stopped(by_pad=False)
    assert told.bumped
    assert (told.finger, told.press, told.contact) == ("", None, None)
    assert world.records == ()
    stop = mover(world, "gel-depth")(planned().motion.enter)
    assert (stop.finger, stop.felt) == ("", None)


def test_the_way_out_is_gone_to_its_end_whatever_it_meets() -> None:
    """The object is put where the hand goes through it."""
    leave = planned().motion.leave
    way = leave.end.X_WB.translation - leave.begin.X_WB.translation
    world = world_where_believed(shift=0.03 * way / np.linalg.norm(way))
    told = world.follow(leave)
    assert told.bumped
    assert not told.ended
    assert told.time == pytest.approx(leave.duration)


@pytest.mark.parametrize("seed", [0, 1])
def test_sessions_in_which_every_motion_is_carried_out_meet_their_goal(seed: int) -> None:
    rng = np.random.default_rng(seed)
    world = MujocoWorld(HAND, SURFACE, rng=rng)
    belief = coarse_view(SURFACE, angle=np.deg2rad(15.0), offset=0.015, rng=rng)

    steps = list(carried_out(HAND.name, world, belief, seed))
    assert GOAL.met_by(steps[-1].after)
    assert angle_between(steps[-1].after.axis, SURFACE.axis) < np.deg2rad(4.0)
    assert len(world.followed) >= 2 * len(steps)
    assert len(world.records) == sum(len(step.felt) for step in steps)
    assert max(told.lag for told in world.followed) < 0.05
