"""The symbolic kinematics are Pinocchio's, and say so where they cannot be."""

from __future__ import annotations

import importlib.metadata
from pathlib import Path

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from hand_models import (
    HandError,
    load_hand,
    symbolic_frames,
    symbolic_joint_placements,
    symbolic_pads,
)

ACCURACY = 1e-12
CONFIGURATIONS = 20

UNALIGNED_URDF = """
<robot name="unaligned">
  <link name="base"/><link name="a"/><link name="b"/><link name="c"/>
  <joint name="turn" type="revolute"><parent link="base"/><child link="a"/>
    <origin xyz="0.1 -0.2 0.3" rpy="0.4 0.5 -0.6"/><axis xyz="1 -2 3"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="spin" type="continuous"><parent link="a"/><child link="b"/>
    <origin xyz="-0.3 0.1 0.2" rpy="-1 2 0.3"/><axis xyz="3 2 -1"/></joint>
  <joint name="slide" type="prismatic"><parent link="b"/><child link="c"/>
    <origin xyz="0.2 0.2 0.1" rpy="0.1 0.2 0.3"/><axis xyz="-1 1 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
</robot>
"""


def _installed(urdf: str, root: pin.JointModel | None = None) -> pin.Model:
    for file in importlib.metadata.files("example-robot-data") or ():
        if file.name == urdf:
            path = str(Path(str(file.locate())).resolve())
            return pin.buildModelFromUrdf(path, root) if root else pin.buildModelFromUrdf(path)
    raise FileNotFoundError(urdf)


def _placement(rng: np.random.Generator) -> pin.SE3:
    return pin.exp6(pin.Motion(rng.normal(size=6)))


def _composite(rng: np.random.Generator) -> pin.Model:
    """A joint made of a slide, a turn and an unbounded turn, below and above plain joints."""
    parts = pin.JointModelComposite()
    for part in (
        pin.JointModelPrismaticUnaligned(np.array([0.6, 0.0, 0.8])),
        pin.JointModelRY(),
        pin.JointModelRUBX(),
    ):
        parts.addJoint(part, _placement(rng))
    model = pin.Model()
    parent = 0
    for name, joint in (("x", pin.JointModelPX()), ("many", parts), ("z", pin.JointModelRUBZ())):
        parent = model.addJoint(parent, joint, _placement(rng), name)
        model.addFrame(pin.Frame(f"on_{name}", parent, _placement(rng), pin.FrameType.OP_FRAME))
    return model


def _model(name: str, rng: np.random.Generator) -> pin.Model:
    if name in ("allegro_right", "allegro_left"):
        return load_hand(name).model
    if name == "unaligned":
        return pin.buildModelFromXML(UNALIGNED_URDF)
    if name == "composite":
        return _composite(rng)
    if name.startswith("free "):
        return _installed(name.removeprefix("free "), pin.JointModelFreeFlyer())
    return _installed(name)


MODELS = (
    "allegro_right",
    "allegro_left",
    "finger_edu.urdf",
    "panda.urdf",
    "ur5_robot.urdf",
    "kinova.urdf",
    "tiago.urdf",
    "free solo12.urdf",
    "free allegro_right_hand.urdf",
    "unaligned",
    "composite",
)


def _configuration(model: pin.Model, rng: np.random.Generator) -> np.ndarray:
    return pin.integrate(model, pin.neutral(model), rng.normal(scale=1.5, size=model.nv))


def _assert_same(found: ca.DM | np.ndarray, expected: np.ndarray, message: str = "") -> None:
    np.testing.assert_allclose(
        np.array(found), expected, rtol=0, atol=ACCURACY, equal_nan=False, err_msg=message
    )


@pytest.mark.parametrize("name", MODELS)
def test_symbolic_kinematics_agree_with_pinocchio_to_1e_12(name: str) -> None:
    rng = np.random.default_rng(1)
    model = _model(name, rng)
    data = model.createData()
    frames = symbolic_frames(model, [frame.name for frame in model.frames])
    for _ in range(CONFIGURATIONS):
        q = _configuration(model, rng)
        pin.framesForwardKinematics(model, data, q)
        outputs = frames(q)
        for k, frame in enumerate(model.frames):
            _assert_same(outputs[2 * k], data.oMf[k].rotation, frame.name)
            _assert_same(outputs[2 * k + 1], data.oMf[k].translation[:, None], frame.name)


@pytest.mark.parametrize("name", MODELS)
def test_symbolic_jacobians_agree_with_pinocchio_to_1e_12(name: str) -> None:
    """d(p, R) along every tangent direction, against Pinocchio's twist (v, w): dR = [w]x R."""
    rng = np.random.default_rng(2)
    model = _model(name, rng)
    data = model.createData()
    q_symbol, frame = ca.SX.sym("q", model.nq), model.frames[model.nframes - 1]
    R, p = symbolic_frames(model, [frame.name])(q_symbol)
    along = ca.jacobian(ca.vertcat(p, ca.vec(R)), q_symbol)
    jacobian = ca.Function("tangent", [q_symbol], [along])
    for _ in range(CONFIGURATIONS):
        q = _configuration(model, rng)
        twist = pin.computeFrameJacobian(model, data, q, model.nframes - 1, pin.LOCAL_WORLD_ALIGNED)
        rotation = pin.updateFramePlacement(model, data, model.nframes - 1).rotation
        turned = [(pin.skew(w) @ rotation).ravel(order="F") for w in twist[3:].T]
        expected = np.vstack([twist[:3], np.transpose(turned)])
        found = np.array(jacobian(q)) @ pin.tangentMap(model, q)
        _assert_same(found, expected)


def test_joint_placements_are_indexed_like_the_models_joints() -> None:
    hand = load_hand("allegro_right")
    q_symbol = ca.SX.sym("q", hand.model.nq)
    placements = symbolic_joint_placements(hand.model, q_symbol)
    joints = ca.Function("joints", [q_symbol], [p for _, p in placements])
    expected = hand.at(hand.upper).data.oMi
    assert len(placements) == hand.model.njoints
    for found, placement in zip(joints(hand.upper), expected, strict=True):
        _assert_same(found, placement.translation[:, None])


@pytest.mark.parametrize("name", ["allegro_right", "allegro_left"])
def test_symbolic_pads_on_a_free_base_are_the_pads_of_the_posed_hand(name: str) -> None:
    rng = np.random.default_rng(3)
    hand = load_hand(name)
    q_symbol = ca.SX.sym("q", hand.model.nq)
    R_WB, p_WB = ca.SX.sym("R", 3, 3), ca.SX.sym("p", 3)
    centres, normals = symbolic_pads(hand, q_symbol)
    pads = ca.Function(
        "pads",
        [q_symbol, R_WB, p_WB],
        [R_WB @ centres + ca.repmat(p_WB, 1, len(hand.fingers)), R_WB @ normals],
    )
    for _ in range(CONFIGURATIONS):
        X_WB = _placement(rng)
        pose = hand.at(rng.uniform(hand.lower, hand.upper), X_WB)
        centres_W, normals_W = pads(pose.q, X_WB.rotation, X_WB.translation)
        _assert_same(centres_W, pose.pad_centres.T)
        _assert_same(normals_W, pose.pad_normals.T)


def test_a_pad_depends_on_its_own_fingers_joints_only() -> None:
    """Structural zeros are left out, or the planner's derivatives would be dense."""
    hand = load_hand("allegro_right")
    q_symbol = ca.SX.sym("q", hand.model.nq)
    centres, _ = symbolic_pads(hand, q_symbol)
    for k, finger in enumerate(hand.fingers):
        _, columns = ca.jacobian(centres[:, k], q_symbol).sparsity().get_triplet()
        assert set(columns) <= set(finger.q_indices.tolist())


@pytest.mark.parametrize(
    "joint",
    [
        pin.JointModelSpherical(),
        pin.JointModelSphericalZYX(),
        pin.JointModelPlanar(),
        pin.JointModelHX(0.1),
    ],
    ids=lambda joint: joint.shortname(),
)
def test_another_joint_type_is_refused_by_name(joint: pin.JointModel) -> None:
    model = pin.Model()
    model.addJoint(0, joint, pin.SE3.Identity(), "wrist")
    with pytest.raises(HandError, match=rf"joint 'wrist' is a {joint.shortname()}; .* revolute"):
        symbolic_joint_placements(model, ca.SX.sym("q", model.nq))


def test_a_configuration_of_another_size_is_refused() -> None:
    model = load_hand("allegro_right").model
    with pytest.raises(HandError, match=r"q must be \(16, 1\) for this model, got \(4, 1\)"):
        symbolic_joint_placements(model, ca.SX.sym("q", 4))


def test_an_unknown_frame_is_answered_with_the_frames_there_are() -> None:
    model = load_hand("allegro_right").model
    with pytest.raises(HandError, match=r"no frame 'tip'; its frames are .*link_15\.0_tip"):
        symbolic_frames(model, ["tip"])


def test_a_link_that_shares_its_name_with_a_joint_is_the_link() -> None:
    """Elsewhere in the chain the two are different places."""
    xml = UNALIGNED_URDF.replace('name="turn"', 'name="c"')
    model = pin.buildModelFromXML(xml)
    plain = pin.buildModelFromXML(UNALIGNED_URDF)
    q = _configuration(model, np.random.default_rng(4))
    R, p = symbolic_frames(model, ["c"])(q)
    expected = plain.createData()
    pin.framesForwardKinematics(plain, expected, q)
    tip = expected.oMf[plain.getFrameId("c")]
    _assert_same(R, tip.rotation)
    _assert_same(p, tip.translation[:, None])
