"""The kinematics of a Pinocchio model as CasADi expressions.

PyPI's Pinocchio comes without its CasADi bindings, so the chain of joints is multiplied out here,
from the model alone:  X_0i = X_0,parent(i) X_placement(i) X_joint(q_i).  Everything is SX, so that
CasADi differentiates it exactly and leaves structural zeros out.

A placement is a pair (R, p): rotation (3, 3) and position (3, 1) [m] in the model's world, which
for a `Hand` is the hand base B. A free base goes on top: p_W = R_WB @ p + p_WB.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np
import pinocchio as pin

from hand_models.finger import Finger
from hand_models.hand import Hand, HandError
from hand_models.joints import joint_motion

Placement = tuple[ca.SX, ca.SX]

_REVOLUTE = ("JointModelRX", "JointModelRY", "JointModelRZ", "JointModelRevoluteUnaligned")
_UNBOUNDED = (
    "JointModelRUBX",
    "JointModelRUBY",
    "JointModelRUBZ",
    "JointModelRevoluteUnboundedUnaligned",
)
_PRISMATIC = ("JointModelPX", "JointModelPY", "JointModelPZ", "JointModelPrismaticUnaligned")


def symbolic_joint_placements(model: pin.Model, q: ca.SX) -> list[Placement]:
    """Placements of all joints of a model, indexed like `model.joints`; the universe is first.

    Points fixed to a link follow as R @ point + p with the placement of the joint that moves it.

    Args:
        model: Revolute, unbounded revolute, prismatic and free-flyer joints, aligned or not, and
            composites of them, and joints that follow a revolute or prismatic one.
        q: (nq, 1) configuration in Pinocchio's order: [rad], [m]; (cos, sin) for an unbounded
            revolute joint; position and unit quaternion (x, y, z, w) for a free-flyer. Off the
            unit circle or sphere the rotations are not rotations; nothing is normalised.

    Raises:
        HandError: q has another shape, or a joint is of another type; names the joint.
    """
    if q.shape != (model.nq, 1):
        raise HandError(f"q must be ({model.nq}, 1) for this model, got {q.shape}")
    placements = [(ca.SX.eye(3), ca.SX.zeros(3))]
    for i in range(1, model.njoints):
        X_0P = _compose(placements[model.parents[i]], _constant(model.jointPlacements[i]))
        placements.append(_compose(X_0P, _joint_motion(model.joints[i], q, model.names[i])))
    return placements


def symbolic_frames(model: pin.Model, frame_names: Sequence[str]) -> ca.Function:
    """Function q -> (R_0, p_0, R_1, p_1, ...), the placements of the named frames.

    Args:
        model: As for `symbolic_joint_placements`.
        frame_names: Names of frames of the model; of a link and a joint of one name, the link.

    Raises:
        HandError: No such frame; lists those there are.
    """
    q = ca.SX.sym("q", model.nq)
    joint_placements = symbolic_joint_placements(model, q)
    outputs: list[ca.SX] = []
    names: list[str] = []
    for k, frame_name in enumerate(frame_names):
        frame = model.frames[_frame_id(model, frame_name)]
        outputs.extend(_compose(joint_placements[frame.parentJoint], _constant(frame.placement)))
        names.extend((f"R_{k}", f"p_{k}"))
    return ca.Function("frames", [q], outputs, ["q"], names)


def symbolic_pads(hand: Hand, q: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Pad centres [m] and pad normals in the hand base B, one column per finger.

    Args:
        hand: The hand.
        q: (nq, 1) joint positions.

    Returns:
        Two (3, F) matrices; the transposes of `HandPose.pad_centres` and `pad_normals` for a base
        at the identity. With a base (R_WB, p_WB):  R_WB @ centres + repmat(p_WB, 1, F).
    """
    centres, normals = [], []
    for finger, (R, p) in zip(hand.fingers, _tips(hand, q), strict=True):
        centres.append(R @ ca.SX(finger.pad_centre) + p)
        normals.append(R @ ca.SX(finger.pad_normal))
    return ca.horzcat(*centres), ca.horzcat(*normals)


def symbolic_balls(hand: Hand, q: ca.SX, fingers: Sequence[int], normals: ca.SX) -> ca.SX:
    """Centres in B of the balls that touch as pads do, the transpose of `HandPose.ball_centres`.

    Args:
        fingers: Rows of k fingers.
        normals: (3, k) outward normals of what they touch, in B.
    """
    tips = _tips(hand, q)
    columns = []
    for k, row in enumerate(fingers):
        (R, p), finger = tips[row], hand.fingers[row]
        columns.append(R @ _ball(finger, -R.T @ normals[:, k]) + p)
    return ca.horzcat(*columns)


def _tips(hand: Hand, q: ca.SX) -> list[Placement]:
    """Placements of the fingers' tip frames in B."""
    joint_placements = symbolic_joint_placements(hand.model, q)
    frames = [hand.model.frames[finger.tip_frame_id] for finger in hand.fingers]
    return [_compose(joint_placements[f.parentJoint], _constant(f.placement)) for f in frames]


def _ball(finger: Finger, u: ca.SX) -> ca.SX:
    """b(u) of `hand_models.dome`; a constant for a sphere."""
    dome = finger.dome
    if dome.is_sphere:
        return ca.SX(finger.pad_centre)
    along = ca.SX(dome.spread) @ u
    return (
        ca.SX(dome.centre) + along / ca.sqrt(ca.dot(u, along))
        + (dome.ball - finger.pad_radius) * u
    )  # fmt: skip


def _frame_id(model: pin.Model, name: str) -> int:
    ids = [i for i, frame in enumerate(model.frames) if frame.name == name]
    if not ids:
        known = ", ".join(frame.name for frame in model.frames)
        raise HandError(f"the model has no frame '{name}'; its frames are {known}")
    links = [i for i in ids if model.frames[i].type == pin.FrameType.BODY]
    return (links or ids)[0]


def _joint_motion(joint: pin.JointModel, q: ca.SX, name: str) -> Placement:
    """Placement of a joint's moving side in its fixed side."""
    kind = joint.shortname()
    q_joint = q[joint.idx_q : joint.idx_q + joint.nq]
    if kind == "JointModelMimic":
        return _following_motion(joint, q)
    if kind in _REVOLUTE:
        return _rotation(_axis(joint), ca.cos(q_joint), ca.sin(q_joint)), ca.SX.zeros(3)
    if kind in _UNBOUNDED:
        return _rotation(_axis(joint), q_joint[0], q_joint[1]), ca.SX.zeros(3)
    if kind in _PRISMATIC:
        return ca.SX.eye(3), _axis(joint) * q_joint
    if kind == "JointModelFreeFlyer":
        return _quaternion_rotation(q_joint[3:6], q_joint[6]), q_joint[:3]
    if kind == "JointModelComposite":
        return _composite_motion(joint.extract(), q, name)
    raise HandError(
        f"joint '{name}' is a {kind}; symbolic kinematics knows revolute, unbounded revolute,"
        " prismatic, free-flyer and composite joints"
    )


def _following_motion(joint: pin.JointModel, q: ca.SX) -> Placement:
    """Of a joint that another one drives; its constant subspace tells its kind."""
    motion = joint_motion(joint)
    position = motion.multiplier * q[motion.q_index] + motion.offset
    R = _rotation(ca.SX(motion.angular), ca.cos(position), ca.sin(position))
    return (R if np.any(motion.angular) else ca.SX.eye(3)), ca.SX(motion.linear) * position


def _composite_motion(joint: pin.JointModelComposite, q: ca.SX, name: str) -> Placement:
    motion: Placement = (ca.SX.eye(3), ca.SX.zeros(3))
    for part, placement in zip(joint.joints, joint.jointPlacements, strict=True):
        motion = _compose(motion, _compose(_constant(placement), _joint_motion(part, q, name)))
    return motion


def _axis(joint: pin.JointModel) -> ca.SX:
    """Axis of a joint with one degree of freedom, from its constant motion subspace (v, w)."""
    linear, angular = np.split(np.asarray(joint.createData().S).ravel(), 2)
    return ca.SX(linear + angular)  # one of the two is zero


def _rotation(axis: ca.SX, cos: ca.SX, sin: ca.SX) -> ca.SX:
    """Rodrigues' formula."""
    return cos * ca.SX.eye(3) + sin * ca.skew(axis) + (1 - cos) * (axis @ axis.T)


def _quaternion_rotation(vector: ca.SX, scalar: ca.SX) -> ca.SX:
    """Rotation of a unit quaternion:  v -> v + 2 u x (u x v + w v)."""
    cross = ca.skew(vector)
    return ca.SX.eye(3) + 2 * (scalar * cross + cross @ cross)


def _constant(placement: pin.SE3) -> Placement:
    return ca.SX(placement.rotation), ca.SX(placement.translation)


def _compose(X_AB: Placement, X_BC: Placement) -> Placement:
    (R_AB, p_AB), (R_BC, p_BC) = X_AB, X_BC
    return R_AB @ R_BC, R_AB @ p_BC + p_AB
