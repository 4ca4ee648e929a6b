"""Motions as messages: nothing is lost, and a ROS 2 controller finds the fields it knows."""

import json
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from hand_models import load_hand
from hand_models.collision import HandCollision, LinkPair
from planner.motions.motion_certificate import MotionCertificate
from planner.motions.timing import MotionLimits
from planner.motions.trajectory import Configuration, Guard
from planner.motions.transfer import movable_among, plan_transfer
from planner.reaching.reach_task import ReachOptions
from planner.reaching.solid import RevolvedSolid
from planner.trajectory_messages import (
    base_trajectory,
    certificate_record,
    joint_trajectory,
    trajectory_record,
)

HAND = load_hand("allegro_right")


@pytest.fixture(scope="module")
def trajectory():
    can = RevolvedSolid(pin.SE3.Identity(), np.array([-0.05, 0.05]), np.array([0.03, 0.03]))
    movable = movable_among(HAND, HandCollision(HAND), can, ReachOptions(), MotionLimits())
    begin = Configuration(HAND.middle, pin.SE3(np.eye(3), np.array([-0.4, 0.0, 0.2])))
    turned = pin.SE3(pin.rpy.rpyToMatrix(0.5, 1.0, -1.0), np.array([-0.3, 0.2, 0.3]))
    q = HAND.middle + 0.1 * (HAND.upper - HAND.middle)
    return plan_transfer(movable, begin, Configuration(q, turned), wanted=0.02).trajectory


def seconds(duration):
    assert 0 <= duration["nanosec"] < 10**9
    return duration["sec"] + 1e-9 * duration["nanosec"]


def test_a_record_holds_the_motion_to_a_micrometre(trajectory):
    record = json.loads(json.dumps(trajectory_record(trajectory), allow_nan=False))
    assert record["phase"] == "transfer"
    assert record["event"] is None
    np.testing.assert_allclose(record["times"], trajectory.times, atol=1e-6)
    np.testing.assert_allclose(record["joint_positions"], trajectory.q, atol=1e-6)
    np.testing.assert_allclose(record["joint_velocities"], trajectory.velocities, atol=1e-6)
    for told, X in zip(record["base_poses"], trajectory.bases, strict=True):
        x, y, z, w = told["quaternion_xyzw"]
        again = pin.SE3(pin.Quaternion(w, x, y, z).matrix(), np.array(told["position"]))
        assert again.isApprox(X, 2e-6)


def test_a_guard_is_told_as_the_event_that_ends_the_motion(trajectory):
    guarded = replace(trajectory, guard=Guard(("index",), 0.5, 1.25))
    event = trajectory_record(guarded)["event"]
    assert event == {"contact_of": ["index"], "force": 0.5, "expected_time": 1.25}


def test_joints_have_the_fields_of_trajectory_msgs(trajectory):
    message = joint_trajectory(HAND, trajectory)
    assert set(message) == {"header", "joint_names", "points"}
    assert message["joint_names"] == list(HAND.joint_names)
    for point, q, t in zip(message["points"], trajectory.q, trajectory.times, strict=True):
        assert set(point) == {
            "positions", "velocities", "accelerations", "effort", "time_from_start",
        }  # fmt: skip
        np.testing.assert_allclose(point["positions"], q, atol=1e-6)
        assert len(point["velocities"]) == len(q)
        assert seconds(point["time_from_start"]) == pytest.approx(t, abs=1e-9)


def test_the_base_has_the_fields_of_a_multi_dof_trajectory(trajectory):
    message = base_trajectory(trajectory)
    assert message["header"]["frame_id"] == "world"
    assert message["joint_names"] == ["hand_base"]
    last = message["points"][-1]["transforms"][0]
    end = trajectory.bases[-1].translation
    np.testing.assert_allclose([last["translation"][k] for k in "xyz"], end, atol=1e-6)
    turn = np.array([last["rotation"][k] for k in "xyzw"])
    assert np.linalg.norm(turn) == pytest.approx(1.0, abs=1e-8)
    times = [seconds(point["time_from_start"]) for point in message["points"]]
    assert np.all(np.diff(times) > 0.0)


def test_a_certificate_names_the_pairs():
    pairs = {"itself": LinkPair("a", "b", 0.002), "the table": LinkPair("c", "the table", 0.1)}
    record = certificate_record(MotionCertificate(7, 0.1, "joint_3", 0.9, 0.8, pairs))
    assert record["clearances"] == [
        {"between": ["a", "b"], "distance": 0.002},
        {"between": ["c", "the table"], "distance": 0.1},
    ]
