"""A hand on an arm: one model, its root still, the hand where the arm brings it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from estimator.axis import Axis
from estimator.sensors import sensor_noise
from estimator.surface import SurfaceOfRevolution
from hand_models import HandError, load_hand
from hand_models.batch import batch_placements
from hand_models.collision import HandCollision
from hand_models.spheres import link_spheres
from planner.goal import Goal
from planner.options import PlannerOptions
from planner.plan import plan_probes
from planner.reaching.arm_poses import SEEDS, ArmPoses
from sim_sensor.camera import coarse_view
from sim_sensor.objects import load_object

HANDS = Path(__file__).parents[1] / "hand_models" / "hands"
ARMS = ["allegro_right_ur5", "allegro_right_panda"]


@pytest.fixture(scope="module", params=ARMS)
def hand(request):
    return load_hand(request.param)


@pytest.fixture(scope="module")
def inverse(hand):
    return ArmPoses(hand.arm)


def brought(inverse, R_WB, p_WB):
    """The best joints (N, n) for poses of the hand base, and whether they are near enough."""
    R, p = inverse.flange_poses(R_WB, p_WB)
    _, seeds = inverse.nearest(R, p)
    count, _, n = seeds.shape
    again = (np.repeat(x, SEEDS, axis=0) for x in (R, p))
    q, off = inverse.solved(seeds.reshape(-1, n), *again)
    best = off.reshape(count, SEEDS).argmin(axis=1) + SEEDS * np.arange(count)
    return q[best], off[best] < 1.0


def drawn(hand, count, seed=0):
    return np.random.default_rng(seed).uniform(hand.lower, hand.upper, (count, hand.model.nq))


def test_the_whole_is_the_hand_at_the_end_of_the_arm(hand):
    arm = hand.arm
    for q in drawn(hand, 5):
        whole = hand.at(q, arm.X_WA)
        alone = arm.hand.at(q[arm.hand_q_indices], arm.base_of_hand(q))
        np.testing.assert_allclose(whole.pad_centres, alone.pad_centres, atol=1e-12)
        np.testing.assert_allclose(whole.pad_normals, alone.pad_normals, atol=1e-12)


def test_joints_of_hand_and_arm_keep_their_names_and_limits(hand):
    arm = hand.arm
    names = np.array(hand.joint_names)
    assert tuple(names[arm.hand_q_indices]) == arm.hand.joint_names
    np.testing.assert_array_equal(hand.lower[arm.hand_q_indices], arm.hand.lower)
    np.testing.assert_array_equal(hand.upper[arm.q_indices], arm.model.upperPositionLimit)
    for mine, own in zip(hand.fingers, arm.hand.fingers, strict=True):
        assert mine.joints == own.joints
    assert not any("panda_finger" in name or "panda_hand" in name for name in hand.model.names)


def test_spheres_of_the_hand_ride_on_the_arm(hand):
    arm, spheres, alone = hand.arm, link_spheres(hand), link_spheres(hand.arm.hand)
    (q,) = drawn(hand, 1)
    X_WB = arm.base_of_hand(q)
    found = spheres.positions(batch_placements(hand, q[None]))[0]
    own = alone.positions(batch_placements(arm.hand, q[None, arm.hand_q_indices]))[0]
    np.testing.assert_allclose(found, own @ X_WB.rotation.T + X_WB.translation, atol=1e-12)


def test_the_arm_begins_free_of_itself(hand):
    assert HandCollision(hand).is_self_free(hand.home)


def test_most_poses_that_the_arm_can_take_are_found_again(hand, inverse):
    """Truth: poses from random postures. The optimiser needs them to a millimetre only."""
    q = drawn(hand, 100, seed=1)
    poses = [hand.arm.base_of_hand(row) for row in q]
    R = np.array([X.rotation for X in poses])
    p = np.array([X.translation for X in poses])
    found, reached = brought(inverse, R, p)
    assert reached.mean() > 0.85
    lower, upper = hand.arm.model.lowerPositionLimit, hand.arm.model.upperPositionLimit
    assert np.all((found >= lower) & (found <= upper))
    for row, X in zip(found[reached], [poses[i] for i in np.flatnonzero(reached)], strict=True):
        whole = hand.arm.joined(row, hand.arm.hand.middle)
        off = X.inverse() * hand.arm.base_of_hand(whole)
        assert np.linalg.norm(off.translation) < 5e-3


def test_a_pose_beyond_the_arm_is_not_reached(inverse):
    _, reached = brought(inverse, np.eye(3)[None], np.array([[3.0, 0.0, 0.0]]))
    assert not reached[0]


def test_touches_are_planned_with_the_arm(hand):
    surface = SurfaceOfRevolution(Axis([0.5, 0.0, 0.2], [0.05, 0.1, 1.0]), load_object("can"))
    rng = np.random.default_rng(0)
    belief = coarse_view(surface, angle=np.deg2rad(15.0), offset=0.015, rng=rng)
    options = PlannerOptions(placements=400, certify=False)
    plan = plan_probes(
        hand, belief, sensor_noise("gel"), goal=Goal(0.05, 0.002), rng=rng, options=options
    )
    assert len(plan.probes) == 3
    root = hand.arm.X_WA.homogeneous
    for probe in plan.probes:
        for X in probe.approach.bases:
            np.testing.assert_allclose(X.homogeneous, root, atol=1e-9)
        held = np.delete(probe.approach.path, hand.finger(probe.finger).q_indices, axis=1)
        assert np.ptp(held, axis=0).max() == 0.0  # the arm waits while a finger touches
    path = plan.retreat.path
    assert np.all((path >= hand.lower - 1e-9) & (path <= hand.upper + 1e-9))
    assert np.abs(np.diff(path, axis=0)).max() < 0.2
    way = np.array([hand.arm.base_of_hand(q).translation for q in path])
    along = way - way[0]
    assert np.linalg.norm(along[-1]) > 0.02
    across = along - np.outer(along @ along[-1], along[-1]) / (along[-1] @ along[-1])
    assert np.linalg.norm(across, axis=1).max() < 1e-3  # straight


@pytest.mark.parametrize(
    ("right", "wrong", "message"),
    [
        ('flange = "tool0"', 'flange = "tool"', "no link 'tool'; links are"),
        ('flange = "tool0"', "", "arm: key 'flange' is missing"),
        ('flange = "tool0"', 'flange = "tool0"\nmount = 1', "arm: unknown key 'mount'; allowed"),
        ("elbow_joint = 1.8", "elbow_joint = 18", "home has elbow_joint = 18; joints and limits"),
        ("elbow_joint = 1.8", "knee = 1", "home has knee = 1; joints and limits are shoulder_pan"),
    ],
)
def test_a_wrong_arm_is_told_in_one_line(tmp_path, right, wrong, message):
    toml = (HANDS / "allegro_right_ur5.toml").read_text()
    assert right in toml
    file = tmp_path / "hand.toml"
    file.write_text(toml.replace(right, wrong, 1))
    with pytest.raises(HandError, match=message) as refused:
        load_hand(file)
    assert "\n" not in str(refused.value)
