"""The peers of the reach benchmark move the same hand, and solve what a posture already solves."""

from __future__ import annotations

import logging

import numpy as np
import pinocchio as pin
import pytest
from reach_peers import MinkPeer, PinkPeer, ScipyPeer, floating_mjcf, moved
from reach_triples import LEAST_GAP, SPREAD, targets

from hand_models import load_hand
from planner.reaching.starts import Start

CONE = float(np.radians(40.0))


@pytest.fixture(scope="module")
def hand():
    return load_hand("trifinger_edu")


def test_the_copy_for_mujoco_moves_as_the_hand(hand):
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(floating_mjcf(hand))
    data = mujoco.MjData(model)
    q = np.random.default_rng(0).uniform(hand.lower, hand.upper)
    for name, value in zip(hand.joint_names, q, strict=True):
        data.joint(name).qpos[0] = value
    mujoco.mj_kinematics(model, data)
    pose = hand.at(q)
    for finger in hand.fingers:
        expected = pose.transform_tip_to_world(finger)
        site = data.site(f"tip {finger.name}")
        np.testing.assert_allclose(site.xpos, expected.translation, atol=1e-9)
        np.testing.assert_allclose(site.xmat.reshape(3, 3), expected.rotation, atol=1e-9)


@pytest.mark.parametrize(
    ("peer", "module"), [(ScipyPeer, "scipy"), (PinkPeer, "pink"), (MinkPeer, "mink")]
)
def test_a_peer_finds_a_posture_again_from_beside_it(hand, peer, module):
    pytest.importorskip(module)
    logging.getLogger().setLevel(logging.ERROR)
    rng = np.random.default_rng(1)
    middle, half = hand.middle, 0.3 * (hand.upper - hand.lower)
    X_WB = pin.SE3(pin.exp3(np.array([0.3, -0.2, 0.5])), np.array([0.1, 0.2, 0.3]))
    q = middle + half * rng.uniform(-1.0, 1.0, len(middle))
    there = hand.at(q, X_WB)
    names = tuple(finger.name for finger in hand.fingers)
    start = Start(names, q + rng.normal(0.0, 0.02, len(q)), X_WB)
    found = hand.at(*peer(hand, CONE)(start, there.pad_centres, -there.pad_normals))
    np.testing.assert_allclose(found.pad_centres, there.pad_centres, atol=1e-4)
    assert np.all(np.sum(found.pad_normals * there.pad_normals, axis=1) > np.cos(CONE) - 1e-6)


def test_a_pad_outside_the_cone_is_turned_to_its_edge_and_no_farther(hand):
    finger = hand.fingers[0]
    X = hand.at(hand.middle).transform_tip_to_world(finger)
    pad = X.rotation @ finger.pad_normal
    across = np.linalg.svd(pad[None])[2][1]
    for angle in np.radians([20.0, 60.0, 120.0]):
        normal = -(np.cos(angle) * pad + np.sin(angle) * across)
        wanted = moved(X, finger, np.array([0.1, 0.2, 0.3]), normal, CONE)
        left = np.arccos(-(wanted.rotation @ finger.pad_normal) @ normal)
        assert left == pytest.approx(min(angle, 0.97 * CONE), abs=1e-6)
        np.testing.assert_allclose(wanted.act(finger.pad_centre), [0.1, 0.2, 0.3], atol=1e-12)


def test_targets_are_on_cylinders_of_20_to_60_mm_and_apart():
    for target in targets(50, 0):
        radius = np.linalg.norm(target.points[:, :2], axis=1)
        assert 0.02 <= radius[0] <= 0.06
        np.testing.assert_allclose(radius, radius[0])
        assert np.all(np.abs(target.points[:, 2]) <= SPREAD)
        theta = np.sort(np.arctan2(target.normals[:, 1], target.normals[:, 0]))
        gaps = np.diff(theta, append=theta[0] + 2.0 * np.pi)
        assert gaps.min() > LEAST_GAP - 1e-9
