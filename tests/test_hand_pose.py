"""A hand in a configuration: pads in the world, and how they move."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hand_models import Finger, HandError, HandPose, load_hand
from hand_models.hand import Array

STEP = 1e-5
ACCURACY = 1e-8
"""Central differences: STEP^2 times a third derivative of some 0.2 m, and rounding over STEP."""

HANDS = {name: load_hand(name) for name in ("allegro_right", "allegro_left")}

fractions = st.lists(
    st.one_of(st.sampled_from([0.0, 1e-9, 1.0 - 1e-9, 1.0]), st.floats(0.0, 1.0)),
    min_size=16,
    max_size=16,
)
twists = st.lists(st.floats(-3.0, 3.0), min_size=6, max_size=6)


def _pose(name: str, fraction: list[float], twist: list[float]) -> HandPose:
    hand = HANDS[name]
    q = hand.lower + np.array(fraction) * (hand.upper - hand.lower)
    return hand.at(q, pin.exp6(pin.Motion(np.array(twist))))


def _differences(pose: HandPose, finger: Finger) -> tuple[Array, Array]:
    """(3, nq) derivatives of a pad's centre and normal, by moving one joint at a time."""
    k = pose.hand.fingers.index(finger)
    columns = []
    for step in STEP * np.eye(len(pose.q)):
        ahead, behind = (pose.hand.at(pose.q + s, pose.X_WB) for s in (step, -step))
        columns.append(
            np.concatenate(
                [
                    ahead.pad_centres[k] - behind.pad_centres[k],
                    ahead.pad_normals[k] - behind.pad_normals[k],
                ]
            )
        )
    derivatives = np.transpose(columns) / (2 * STEP)
    return derivatives[:3], derivatives[3:]


@given(st.sampled_from(sorted(HANDS)), fractions, twists)
@settings(max_examples=40, deadline=None)
def test_pad_jacobians_agree_with_finite_differences_up_to_the_limits(
    name: str, fraction: list[float], twist: list[float]
) -> None:
    pose = _pose(name, fraction, twist)
    for k, finger in enumerate(pose.hand.fingers):
        centre_rates, normal_rates = _differences(pose, finger)
        turned = np.cross(pose.pad_turn_jacobian(finger), pose.pad_normals[k], axis=0, axisb=0)
        np.testing.assert_allclose(pose.pad_jacobian(finger), centre_rates, atol=ACCURACY)
        np.testing.assert_allclose(turned, normal_rates, atol=ACCURACY)


def test_a_pad_away_from_its_frames_origin_is_carried_by_the_turning() -> None:
    hand = load_hand("allegro_right")
    plain = hand.finger("thumb")
    moved = replace(plain.dome, centre=np.array([0.01, -0.02, 0.03]))
    offset = replace(plain, dome=moved)
    pose = replace(hand, fingers=(offset,)).at(hand.upper)
    centre_rates, _ = _differences(pose, offset)
    np.testing.assert_allclose(pose.pad_jacobian(offset), centre_rates, atol=ACCURACY)
    assert np.abs(pose.pad_jacobian(offset) - hand.at(hand.upper).pad_jacobian(plain)).max() > 1e-3


def test_a_stretched_finger_moves_its_pad_in_one_direction_only() -> None:
    """Straight along its sideways joint's axis: that joint moves it nowhere, the others one way."""
    hand = load_hand("allegro_right")
    in_thumb = np.isin(hand.joint_names, hand.finger("thumb").joints)
    pose = hand.at(np.where(in_thumb, hand.middle, 0.0))
    for name in ("index", "middle", "ring"):
        finger = hand.finger(name)
        singular_values = np.linalg.svd(pose.pad_jacobian(finger)[:, finger.q_indices])[1]
        assert singular_values[0] > 0.1
        assert singular_values[1] < 1e-12


def test_other_fingers_joints_do_not_move_a_pad() -> None:
    hand = load_hand("allegro_left")
    pose = hand.at(hand.middle)
    for finger in hand.fingers:
        others = np.setdiff1d(np.arange(hand.model.nq), finger.q_indices)
        assert not pose.pad_jacobian(finger)[:, others].any()
        assert not pose.pad_turn_jacobian(finger)[:, others].any()


def test_moving_the_base_moves_the_pads_rigidly() -> None:
    hand = load_hand("allegro_right")
    X_WB = pin.SE3(pin.rpy.rpyToMatrix(0.3, -1.2, 2.0), np.array([0.5, -0.1, 0.2]))
    at_home, moved = hand.at(hand.middle), hand.at(hand.middle, X_WB)
    for k, finger in enumerate(hand.fingers):
        np.testing.assert_allclose(moved.pad_centres[k], X_WB.act(at_home.pad_centres[k]))
        np.testing.assert_allclose(moved.pad_normals[k], X_WB.rotation @ at_home.pad_normals[k])
        assert moved.transform_tip_to_world(finger).isApprox(
            X_WB * at_home.transform_tip_to_world(finger), 1e-12
        )
        np.testing.assert_allclose(
            moved.pad_jacobian(finger), X_WB.rotation @ at_home.pad_jacobian(finger), atol=1e-15
        )


def test_a_pose_keeps_what_it_was_made_of() -> None:
    """Changing the arguments afterwards changes nothing, and the results are read-only."""
    hand = load_hand("allegro_right")
    q, X_WB = hand.middle.copy(), pin.SE3.Identity()
    pose = hand.at(q, X_WB)
    q[:] = 0.0
    X_WB.translation = np.ones(3)
    np.testing.assert_array_equal(pose.q, hand.middle)
    np.testing.assert_array_equal(pose.X_WB.translation, np.zeros(3))
    for array in (pose.q, pose.pad_centres, pose.pad_normals, hand.lower, hand.upper, hand.middle):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0


@pytest.mark.parametrize("q", [np.zeros(4), np.zeros((1, 16)), np.full(16, np.nan)])
def test_a_configuration_that_is_not_one_is_refused(q: Array) -> None:
    with pytest.raises(HandError, match="q must be 16 finite joint positions, got"):
        load_hand("allegro_right").at(q)
