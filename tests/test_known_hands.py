"""Every hand that comes with the package: kinematics, coupled joints, pads, and a first plan."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from functools import lru_cache

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from estimator.axis import Axis
from estimator.sensors import sensor_noise
from estimator.surface import SurfaceOfRevolution
from hand_models import HandError, known_hands, load_hand, symbolic_pads
from hand_models.assembly import read_part
from hand_models.batch_pads import batch_pads
from hand_models.collision import HandCollision
from hand_models.description import read_description
from hand_models.pads import measure_pad
from hand_models.part import Part
from planner.goal import Goal
from planner.options import PlannerOptions
from planner.plan import plan_probes
from sim_sensor.camera import coarse_view
from sim_sensor.objects import load_object

NEW = [name for name in known_hands() if not name.startswith("allegro")]


@lru_cache
def hand_named(name):
    try:
        return load_hand(name)
    except HandError as error:
        if "is not installed" not in str(error):
            raise
        pytest.skip(str(error))


def drawn(hand, count, seed=0):
    rng = np.random.default_rng(seed)
    return rng.uniform(hand.lower, hand.upper, (count, hand.model.nq))


def test_five_hands_come_from_packages_that_install_offline():
    from_wheel = {"allegro_left", "allegro_right", "dex3_right", "psyonic_right", "trifinger_edu"}
    assert from_wheel <= set(known_hands())
    assert {hand_named(name).model.nq for name in from_wheel} == {16, 7, 6, 9}


@pytest.mark.parametrize("name", NEW)
def test_all_forms_of_the_kinematics_agree_with_pinocchio_to_1e_12(name):
    hand = hand_named(name)
    q = drawn(hand, 5)
    symbol = ca.SX.sym("q", hand.model.nq)
    symbolic = ca.Function("pads", [symbol], [*symbolic_pads(hand, symbol)])
    many = batch_pads(hand, q)
    for k, row in enumerate(q):
        pose = hand.at(row)
        centres, normals = (np.array(x).T for x in symbolic(row))
        for found in (centres, many.centres[k]):
            np.testing.assert_allclose(found, pose.pad_centres, atol=1e-12)
        for found in (normals, many.normals[k]):
            np.testing.assert_allclose(found, pose.pad_normals, atol=1e-12)
        for f, finger in enumerate(hand.fingers):
            np.testing.assert_allclose(many.moves[k, f], pose.pad_jacobian(finger), atol=1e-12)
            np.testing.assert_allclose(many.turns[k, f], pose.pad_turn_jacobian(finger), atol=1e-12)


@pytest.mark.parametrize("name", NEW)
def test_jacobians_are_the_differences_of_the_pads(name):
    hand, step = hand_named(name), 1e-6
    (q,) = drawn(hand, 1)
    moves = batch_pads(hand, q[None]).moves[0]
    for i in range(hand.model.nq):
        more, less = (hand.at(q + s * np.eye(len(q))[i]).pad_centres for s in (step, -step))
        np.testing.assert_allclose(moves[:, :, i], (more - less) / (2 * step), atol=1e-8)


def test_a_coupled_finger_moves_as_its_mimic_tag_says():
    """Truth: the same URDF with all joints free, the followers set by hand."""
    hand = hand_named("psyonic_right")
    free = pin.buildModelFromUrdf(str(read_description("psyonic_right").source.file))
    assert {c.joint: (c.follows, round(c.multiplier, 8)) for c in hand.couplings} == {
        f"Right_{f}_q2": (f"Right_{f}_q1", 1.05851325) for f in ("index", "middle", "ring", "pinky")
    }
    tags = {
        joint.get("name"): joint.find("mimic")
        for joint in ElementTree.parse(read_description("psyonic_right").source.file).iter("joint")
    }
    (q,) = drawn(hand, 1)
    told = hand.all_joints(q)
    assert len(told) == 10
    assert hand.joint_names == tuple(name for name in told if tags[name] is None)
    q_free = pin.neutral(free)
    for name, value in zip(hand.joint_names, q, strict=True):
        q_free[free.joints[free.getJointId(name)].idx_q] = value
    for name in set(told) - set(hand.joint_names):
        driver = told[name.replace("q2", "q1")]
        value = 1.05851325 * driver + 0.72349796
        assert told[name] == pytest.approx(value)
        q_free[free.joints[free.getJointId(name)].idx_q] = value
    data = free.createData()
    pin.framesForwardKinematics(free, data, q_free)
    X_0B = data.oMf[free.getFrameId("Right_thumb_base")]
    pose = hand.at(q)
    for finger in hand.fingers:
        X_0T = data.oMf[free.getFrameId(finger.tip_frame)]
        found = pose.transform_tip_to_world(finger).homogeneous
        np.testing.assert_allclose(found, (X_0B.inverse() * X_0T).homogeneous, atol=1e-12)


def test_a_driving_joint_keeps_its_follower_within_limits():
    hand = hand_named("psyonic_right")
    at = hand.joint_names.index("Right_index_q1")
    assert hand.upper[at] == pytest.approx((2.6586 - 0.72349796) / 1.05851325)
    assert hand.all_joints(hand.upper)["Right_index_q2"] == pytest.approx(2.6586)


def test_copies_stand_at_120_degrees_of_each_other():
    hand = hand_named("trifinger_edu")
    q = np.tile(drawn(hand, 1)[0, :3], 3)
    centres = hand.at(q).pad_centres
    third = pin.utils.rotate("z", np.radians(120.0))
    np.testing.assert_allclose(centres[1:], centres[:2] @ third.T, atol=1e-5)


def test_an_mjcf_moves_as_in_mujoco():
    hand = hand_named("shadow")
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_path(str(read_description("shadow").source.file))
    data = mujoco.MjData(model)
    for q in drawn(hand, 5):
        for name, value in zip(hand.joint_names, q, strict=True):
            data.joint(name).qpos[0] = value
        mujoco.mj_kinematics(model, data)
        base = data.body("robot0:palm")
        for finger in hand.fingers:
            tip = data.body(finger.tip_frame)
            found = hand.at(q).transform_tip_to_world(finger)
            R = base.xmat.reshape(3, 3)
            np.testing.assert_allclose(found.translation, R.T @ (tip.xpos - base.xpos), atol=1e-12)
            np.testing.assert_allclose(found.rotation, R.T @ tip.xmat.reshape(3, 3), atol=1e-12)


@pytest.mark.parametrize("name", known_hands())
def test_described_pads_are_those_of_the_meshes(name):
    hand = hand_named(name)
    part = Part(hand.model, hand.visual_model)
    by_maker = name.startswith("allegro")  # balls of 12 mm; their mesh has a skin of about 1 mm
    for finger in hand.fingers:
        fit = measure_pad(part, finger.tip_frame_id)
        assert fit.misfit < 1.2e-3
        u = finger.pad_normal
        described = finger.dome.touched(u)
        np.testing.assert_allclose(fit.dome.touched(u), described, atol=2e-3 if by_maker else 3e-4)
        if not finger.name.startswith("finger"):  # of three alike, each bends both ways
            assert fit.normal @ finger.pad_normal > 0.999


@pytest.mark.parametrize("name", NEW)
def test_a_hand_is_free_of_itself_in_many_postures(name):
    hand = hand_named(name)
    collision = HandCollision(hand)
    free = np.array([collision.is_self_free(q) for q in drawn(hand, 200)])
    assert free.mean() > 0.1
    apart = [collision.self_clearance(q).distance > 0.0 for q in drawn(hand, 200)]
    np.testing.assert_array_equal(free, apart)


def test_what_is_cut_out_of_a_robot_stands_as_it_did_there():
    source = read_description("dex3_right").source
    whole = read_part(replace(source, base=None))
    hand = hand_named("dex3_right")
    data = whole.model.createData()
    q_whole = pin.neutral(whole.model)
    (q,) = drawn(hand, 1)
    for name, value in zip(hand.joint_names, q, strict=True):
        q_whole[whole.model.joints[whole.model.getJointId(name)].idx_q] = value
    pin.framesForwardKinematics(whole.model, data, q_whole)
    X_0B = data.oMf[whole.model.getFrameId(source.base)]
    for finger in hand.fingers:
        X_0T = data.oMf[whole.model.getFrameId(finger.tip_frame, pin.FrameType.BODY)]
        found = hand.at(q).transform_tip_to_world(finger).homogeneous
        np.testing.assert_allclose(found, (X_0B.inverse() * X_0T).homogeneous, atol=1e-12)


@pytest.mark.parametrize("name", ["dex3_right", "psyonic_right", "trifinger_edu"])
def test_every_hand_plans_touches(name):
    hand = hand_named(name)
    surface = SurfaceOfRevolution(Axis([0.5, 0.0, 0.2], [0.05, 0.1, 1.0]), load_object("can"))
    rng = np.random.default_rng(0)
    belief = coarse_view(surface, angle=np.deg2rad(15.0), offset=0.015, rng=rng)
    options = PlannerOptions(tries=6, placements=600, certify=False)
    plan = plan_probes(
        hand, belief, sensor_noise("gel"), goal=Goal(0.05, 0.002), rng=rng, options=options
    )
    assert plan.reach.position_residual < 1e-4
    for probe in plan.probes:
        finger = hand.finger(probe.finger)
        row, normal = hand.fingers.index(finger), probe.expected.normal
        path = probe.approach
        at = min(path.contact_index, len(path.bases) - 1)
        pose = hand.at(path.path[path.contact_index], path.bases[at])
        touched = probe.expected.position + finger.pad_radius * normal
        np.testing.assert_allclose(pose.ball_centres([row], [normal])[0], touched, atol=3e-4)
