"""Motions hang together, keep their limits, meet nothing, and say why where there is none."""

from dataclasses import replace
from itertools import pairwise

import coal
import numpy as np
import pinocchio as pin
import pytest

from estimator.axis import Axis
from estimator.belief import coarse_belief
from estimator.prior import coarse_prior
from estimator.sensors import SENSORS
from hand_models import load_hand
from hand_models.collision import HandCollision
from planner.goal import Goal
from planner.motions.round_motion import plan_round
from planner.motions.surroundings import OBJECT, Box, object_body
from planner.motions.timing import PAUSE, STEP, MotionLimits, timed, travel
from planner.motions.trajectory import Configuration, between
from planner.motions.transfer import movable_among, plan_transfer
from planner.options import PlannerOptions
from planner.plan import plan_probes
from planner.reaching.reach_task import ReachOptions
from planner.reaching.solid import RevolvedSolid, believed_solid
from planner.reaching.workspace import Workspace

AXIS = Axis(np.array([0.5, 0.0, 0.2]), np.array([0.1, -0.1, 1.0]))
HAND = load_hand("allegro_right")
COLLISION = HandCollision(HAND)
LIMITS = MotionLimits()
FACING = pin.rpy.rpyToMatrix(0.0, 1.2, 0.0)
HOME = Configuration(HAND.middle, pin.SE3(FACING, np.array([0.15, 0.0, 0.45])))
BELIEF = coarse_belief(
    coarse_prior(AXIS, angle=0.26, offset=0.015, radius=0.033, radius_sd=0.008), (-0.06, 0.06)
)


def made(start, **more):
    return plan_probes(
        HAND,
        BELIEF,
        SENSORS["gel"],
        goal=Goal(np.deg2rad(3.0), 2e-3),
        rng=np.random.default_rng(3),
        options=PlannerOptions(placements=600, start=start, **more),
    )


@pytest.fixture(scope="module")
def plan():
    return made(HOME)


@pytest.fixture(scope="module")
def trajectories(plan):
    return plan.motion.trajectories


def near(a, b, turn=1e-6):
    return a.X_WB.isApprox(b.X_WB, 1e-6) and np.allclose(a.q, b.q, atol=turn)


def test_a_round_goes_in_touches_with_each_finger_and_goes_out(plan, trajectories):
    count = len(plan.probes)
    phases = [one.phase for one in trajectories]
    assert phases == ["transfer", "enter", *["approach", "withdraw"] * count, "leave"]
    assert near(trajectories[0].begin, HOME)
    left = trajectories[-1].end
    assert near(left, Configuration(plan.retreat.q, plan.retreat.bases[-1]))


def test_each_motion_begins_where_the_one_before_it_ended(trajectories):
    for before, after in pairwise(trajectories):
        if after.phase == "withdraw":
            touch = before.until(before.guard.expected)
            assert near(touch.end, after.begin, turn=1e-5)
        else:
            assert near(before.end, after.begin)


def test_motions_go_from_rest_to_rest_within_limits(trajectories):
    for one in trajectories:
        dt = np.diff(one.times)
        assert one.times[0] == 0.0
        assert dt.min() > 0.0
        assert np.abs(one.velocities[[0, -1]]).max() < 1e-6
        assert np.all(one.q >= HAND.lower)
        assert np.all(one.q <= HAND.upper)
        assert np.abs(np.diff(one.q, axis=0) / dt[:, None]).max() <= LIMITS.joint_speed
        gain = np.diff(one.velocities, axis=0) / dt[:, None]
        assert np.abs(gain).max() <= LIMITS.joint_acceleration
        p = np.array([X.translation for X in one.bases])
        slow = one.phase in ("enter", "leave")
        most = LIMITS.near_speed if slow else LIMITS.base_speed
        assert (np.linalg.norm(np.diff(p, axis=0), axis=1) / dt).max() <= most
        for a, b, step in zip(one.bases, one.bases[1:], dt, strict=False):
            turn = np.linalg.norm(pin.log3(a.rotation.T @ b.rotation))
            assert turn / step <= LIMITS.base_turn


def test_velocities_are_those_of_the_positions(trajectories):
    for one in trajectories:
        mean = 0.5 * (one.velocities[1:] + one.velocities[:-1]) * np.diff(one.times)[:, None]
        np.testing.assert_allclose(np.diff(one.q, axis=0), mean, atol=6e-3)


def test_waypoints_are_near_each_other(trajectories):
    for one in trajectories:
        assert travel(HAND, one.q, one.bases).max() < 1.5 * STEP
        assert np.diff(one.times).max() < 1.5 * PAUSE


def test_a_finger_approaches_slowly_and_its_contact_ends_it(plan, trajectories):
    approaches = [one for one in trajectories if one.phase == "approach"]
    for probe, one in zip(plan.probes, approaches, strict=True):
        row = HAND.fingers.index(HAND.finger(probe.finger))
        tips = np.array(
            [HAND.at(q, X).pad_centres[row] for q, X in zip(one.q, one.bases, strict=True)]
        )
        speed = np.linalg.norm(np.diff(tips, axis=0), axis=1) / np.diff(one.times)
        assert speed.max() <= LIMITS.touch_speed
        assert one.guard.fingers == (probe.finger,)
        assert one.guard.force == probe.approach.force_goal
        touch = one.at(one.guard.expected)
        centre = HAND.at(touch.q, touch.X_WB).pad_centres[row]
        n, radius = probe.expected.normal, HAND.finger(probe.finger).pad_radius
        np.testing.assert_allclose(centre, probe.expected.position + radius * n, atol=1e-4)


def test_the_same_arguments_give_the_same_motion(trajectories):
    for one, again in zip(trajectories, made(HOME).motion.trajectories, strict=True):
        np.testing.assert_array_equal(one.times, again.times)
        np.testing.assert_array_equal(one.q, again.q)


def test_without_a_place_to_start_from_no_motion_is_planned():
    assert made(None).motion is None


def test_a_base_that_is_fixed_stays_and_the_joints_lead_to_the_object(plan):
    X_WB = plan.reach.X_WB
    fixed = ReachOptions(workspace=Workspace(X_WB))
    solid = believed_solid(BELIEF.surface)
    movable = movable_among(HAND, COLLISION, solid, fixed, LIMITS)
    approaches = [probe.approach for probe in plan.probes]
    opened = max(  # of some open hands the one with most room beside the object
        (np.clip(HAND.middle - by, HAND.lower, HAND.upper) for by in np.linspace(0.0, 0.4, 5)),
        key=lambda q: COLLISION.object_clearance(q, X_WB, solid.slices, solid.X_WO).nearest()[1],
    )
    found = plan_round(movable, approaches, [plan.retreat], Configuration(opened, X_WB))
    assert found.enter is None
    assert found.leave is None
    assert found.certificate.faults == ()
    for one in found.trajectories:
        assert all(X.isApprox(X_WB, 1e-9) for X in one.bases)
    assert near(found.transfer.end, Configuration(plan.reach.q_standoff, X_WB))


def test_joints_alone_go_round_when_the_straight_line_would_make_links_meet():
    rng = np.random.default_rng(0)
    free = [q for q in rng.uniform(HAND.lower, HAND.upper, (40, 16)) if COLLISION.is_self_free(q)]
    begin, end = next(
        (a, b) for a, b in pairwise(free)
        if not all(COLLISION.is_self_free(a + u * (b - a)) for u in np.linspace(0.0, 1.0, 40))
    )  # fmt: skip
    fixed = ReachOptions(workspace=Workspace(HOME.X_WB))
    movable = movable_among(HAND, COLLISION, believed_solid(BELIEF.surface), fixed, LIMITS)
    ends = (Configuration(begin, HOME.X_WB), Configuration(end, HOME.X_WB))
    found = plan_transfer(movable, *ends, wanted=0.02)
    assert found.sampled
    assert near(found.trajectory.begin, ends[0])
    assert near(found.trajectory.end, ends[1])
    for time in np.linspace(0.0, found.trajectory.duration, 40):
        assert not raw_meshes_meet(found.trajectory.at(time).q, HOME.X_WB, [])


def raw_meshes_meet(q, X_WB, boxes):
    """Pinocchio on the meshes themselves, no hulls: the pairs of links that could meet, and boxes.

    Neighbours and their neighbours overlap at the joints by design.
    """
    shapes = HAND.visual_model.copy()
    joints = [int(shape.parentJoint) for shape in shapes.geometryObjects]
    above = {j: {j, int(HAND.model.parents[j]), int(HAND.model.parents[HAND.model.parents[j]])}
             for j in set(joints)}  # fmt: skip
    links = range(len(joints))
    apart = [
        (i, j) for i in links for j in links
        if i < j and joints[i] not in above[joints[j]] and joints[j] not in above[joints[i]]
    ]  # fmt: skip
    for box in boxes:
        shape = coal.Box(*box.size)
        k = shapes.addGeometryObject(
            pin.GeometryObject("box", 0, 0, X_WB.inverse() * box.pose, shape)
        )
        apart += [(i, int(k)) for i in links]
    for pair in apart:
        shapes.addCollisionPair(pin.CollisionPair(*pair))
    data = HAND.model.createData()
    return pin.computeCollisions(HAND.model, data, shapes, pin.GeometryData(shapes), q, True)


WALL = Box((0.32, 0.0, 0.3), (0.02, 0.24, 0.5), name="the wall")


def free_space(*boxes, table=None):
    rules = ReachOptions(boxes=boxes, table=table)
    return movable_among(HAND, COLLISION, believed_solid(BELIEF.surface), rules, LIMITS)


BEYOND = Configuration(HAND.middle, pin.SE3(FACING, np.array([0.30, -0.35, 0.35])))
ACROSS = Configuration(HAND.middle, pin.SE3(FACING, np.array([0.30, 0.35, 0.35])))


def test_nothing_in_the_way_is_passed_straight():
    found = plan_transfer(free_space(), HOME, BEYOND, wanted=0.03)
    assert not found.sampled
    moved = [X.translation for X in found.trajectory.bases]
    way = np.subtract(moved, moved[0])
    along = (way @ way[-1])[:, None] * way[-1] / (way[-1] @ way[-1])
    np.testing.assert_allclose(way, along, atol=1e-6)


def test_a_wall_is_gone_round_and_the_meshes_themselves_do_not_touch_it():
    found = plan_transfer(free_space(WALL), BEYOND, ACROSS, wanted=0.03)
    assert found.sampled
    assert found.certificate.nearest[WALL.name].distance > 0.0
    assert found.certificate.nearest[OBJECT].distance > 0.0
    path = found.trajectory
    for time in np.linspace(0.0, path.duration, 60):  # also between the waypoints
        place = path.at(time)
        assert not raw_meshes_meet(place.q, place.X_WB, [WALL])
    straight = BEYOND.q, between(BEYOND.X_WB, ACROSS.X_WB, np.linspace(0.0, 1.0, 30))
    assert any(raw_meshes_meet(straight[0], X, [WALL]) for X in straight[1])


def test_a_hand_that_stands_in_something_is_told_so():
    shelf = Box((0.15, 0.0, 0.45), (0.1, 0.1, 0.1), name="the shelf")
    found = plan_transfer(free_space(shelf), HOME, BEYOND, wanted=0.03)
    assert "the shelf overlap by" in found
    assert found.endswith("where it starts")


def test_a_hand_that_is_walled_in_is_told_what_is_in_the_way(monkeypatch):
    monkeypatch.setattr("planner.motions.transfer.CHECKS", 300)
    cage = Box((0.4, -0.1, 0.4), (0.02, 3.0, 3.0), name="the cage")
    end = Configuration(HAND.middle, pin.SE3(FACING, np.array([0.8, 0.0, 0.35])))
    found = plan_transfer(free_space(cage), HOME, end, wanted=0.03)
    assert "and the cage overlap by" in found
    assert "no way round in 300 configurations" in found


def test_a_doctored_trajectory_is_found_out(plan, trajectories):
    solid = believed_solid(BELIEF.surface)
    movable = movable_among(HAND, COLLISION, solid, ReachOptions(), LIMITS)
    leave = trajectories[-1]
    assert movable.certify(leave).faults == ()
    q = leave.q.copy()
    q[3, 5] = HAND.upper[5] + 0.1
    beyond = movable.certify(replace(leave, q=q)).faults
    assert beyond[0] == f"{HAND.joint_names[5]} is 0.100 rad beyond its limit"
    hasty = movable.certify(replace(leave, times=0.2 * leave.times)).faults
    assert any("speed is" in fault for fault in hasty)
    inside = pin.SE3(leave.bases[3].rotation, AXIS.point)
    meets = movable.certify(replace(leave, bases=(*leave.bases[:3], inside, *leave.bases[4:])))
    assert any("and the object overlap by" in fault for fault in meets.faults)


@pytest.mark.parametrize("name", ["joint_speed", "base_acceleration", "touch_speed"])
def test_a_limit_that_is_not_positive_is_refused(name):
    with pytest.raises(ValueError, match=f"{name}: expected a limit > 0, got 0"):
        MotionLimits(**{name: 0.0})


def test_a_box_without_size_or_with_a_bent_quaternion_is_refused():
    with pytest.raises(ValueError, match="expected three edges > 0 m"):
        Box((0.0, 0.0, 0.0), (0.1, 0.0, 0.1))
    with pytest.raises(ValueError, match="expected a unit quaternion"):
        Box((0.0, 0.0, 0.0), (0.1, 0.1, 0.1), (1.0, 1.0, 0.0, 0.0))


def test_a_path_that_does_not_move_has_no_trajectory():
    q = np.repeat(HAND.middle[None], 3, axis=0)
    assert timed(HAND, "transfer", q, (HOME.X_WB,) * 3, LIMITS) is None


def test_the_nearest_link_is_the_same_with_and_without_the_tube_around_the_object():
    z = np.linspace(-0.06, 0.06, 41)
    X_WO = pin.SE3(FACING, np.array(AXIS.point))
    solid = RevolvedSolid(X_WO, z, 0.03 + 0.01 * np.sin(60 * z))
    rng = np.random.default_rng(5)
    for _ in range(40):
        q = rng.uniform(HAND.lower, HAND.upper)
        X_WB = pin.SE3(pin.exp3(rng.normal(size=3)), AXIS.point + 0.15 * rng.normal(size=3))
        near = COLLISION.nearest_to(q, X_WB, object_body(solid))
        every = COLLISION.object_clearance(q, X_WB, solid.slices, solid.X_WO)
        assert near.distance == min(every.distances.min(), every.pads.min())
