"""A hand of a Pinocchio model in MuJoCo: its joints with position actuators, links and pads.

The base is placed from outside (an arm that holds it ideally); gravity on the hand is compensated.
Links are the convex hulls of their visual meshes, pads are soft spheres; links do not collide with
each other, which the planner has checked on its own shapes.
"""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin

from estimator.vectors import Array
from hand_models.geometry import link_points, pad_in_joint
from hand_models.hand import Hand
from hand_models.joints import joint_motion, joint_motions
from sim_sensor.physics.mujoco_object import STOPS

BASE = "base"
ARMATURE = 2e-3  # of the gears [kg m^2] or [kg]
STIFFNESS = {True: 20.0, False: 2e4}  # of actuators: turning [Nm/rad], sliding [N/m]
DAMPING = {True: 1.0, False: 300.0}
STIFF_RATE = 50.0  # ... and this much faster for what a joint carries [1/s]
PAD_STIFFNESS, PAD_SOLIMP = 65.0, (0.5, 0.5, 1e-3, 0.5, 2.0)  # [1/s^2]: 0.5 N press it by 1.4 mm
FINGER_MASS = 0.18  # that a pad feels of its finger [kg]
_LIGHTEST = 1e-3  # link [kg]
_OWN_PAD = 1.08  # points of a tip's mesh within so many pad radii are the pad's own
_FLAT = 1e-3  # least extent of a hull, as a singular value [m]
_TOUCHABLE, _TOUCHES = 0, 1 | STOPS  # contype and conaffinity: a hand meets objects, not itself


def add_hand(spec: mujoco.MjSpec, hand: Hand, *, links: bool, object_mass: float = np.inf) -> None:
    """The hand as bodies of a spec: joints, actuators and pads under its own names.

    Args:
        links: With the links' hulls; without, only pads collide.
        object_mass: Of what is touched [kg]. MuJoCo's soft contacts give an acceleration, not a
            force, so that a gel of one stiffness is stated for the two masses that meet.
    """
    stiffness = PAD_STIFFNESS * (1.0 + FINGER_MASS / object_mass)
    base = spec.worldbody.add_body(name=BASE, mocap=True)
    bodies = [base]
    for j in range(1, hand.model.njoints):
        parent = bodies[hand.model.parents[j]]
        bodies.append(_add_joint(spec, parent, hand.model, j))
    for finger in hand.fingers:
        joint, centre, _ = pad_in_joint(hand, finger)
        bodies[joint].add_geom(
            name=pad_name(finger.name), type=mujoco.mjtGeom.mjGEOM_SPHERE, pos=centre,
            size=[finger.pad_radius, 0.0, 0.0], mass=_LIGHTEST, priority=1, condim=4,
            contype=_TOUCHABLE, conaffinity=_TOUCHES, friction=[1.0, 5e-3, 1e-4],
            solref=[-stiffness, -2.5 * np.sqrt(stiffness)], solimp=PAD_SOLIMP,
        )  # fmt: skip
    if links:
        _add_links(spec, hand, bodies)


def pad_name(finger: str) -> str:
    return f"pad/{finger}"


def link_name(geom: str) -> str:
    """The link's name in the description, from that of its geom here."""
    return geom.removeprefix("link/").rsplit("_", 1)[0]


def place_base(data: mujoco.MjData, X_WB: pin.SE3) -> None:
    """Put the hand's base where the arm holds it."""
    data.mocap_pos[0] = X_WB.translation
    mujoco.mju_mat2Quat(data.mocap_quat[0], np.ascontiguousarray(X_WB.rotation).ravel())


def joint_targets(hand: Hand, q: Array) -> Array:
    """Positions of all joints in the order of the actuators, (..., joints), for q (..., nq)."""
    return np.stack([motion.at(q) for motion in joint_motions(hand.model)], axis=-1)


def _add_joint(
    spec: mujoco.MjSpec, parent: mujoco.MjsBody, model: pin.Model, j: int
) -> mujoco.MjsBody:
    name, X, inertia = model.names[j], model.jointPlacements[j], model.inertias[j]
    body = parent.add_body(name=name, pos=X.translation, quat=_quat(X.rotation), gravcomp=1.0)
    body.explicitinertial = True
    body.mass, body.ipos = max(float(inertia.mass), _LIGHTEST), np.array(inertia.lever)
    about = np.asarray(inertia.inertia) + 1e-7 * np.eye(3)
    body.fullinertia = about[(0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)]
    motion = joint_motion(model.joints[j])
    turns = bool(np.linalg.norm(motion.angular) > 0.5)
    kind = mujoco.mjtJoint.mjJNT_HINGE if turns else mujoco.mjtJoint.mjJNT_SLIDE
    ends = motion.at(np.array([model.lowerPositionLimit, model.upperPositionLimit]))
    body.add_joint(
        name=name, type=kind, axis=motion.angular if turns else motion.linear, armature=ARMATURE,
        range=np.sort(ends), limited=mujoco.mjtLimited.mjLIMITED_TRUE,
    )  # fmt: skip
    carried = _carried(model, j, np.concatenate([motion.linear, motion.angular]))
    actuator = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    actuator.set_to_position(
        kp=STIFFNESS[turns] + STIFF_RATE**2 * carried,
        kv=DAMPING[turns] + 2.0 * STIFF_RATE * carried,
    )
    return body


def _carried(model: pin.Model, j: int, twist: Array) -> float:
    """What a joint has to move, stretched out [kg m^2] or [kg]: an arm is stiffer than a finger."""
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    below = [k for k in range(j, model.njoints) if j in list(model.supports[k])]
    moved = (data.oMi[j].actInv(data.oMi[k]).act(model.inertias[k]).matrix() for k in below)
    return float(twist @ np.sum(list(moved), axis=0) @ twist)


def _add_links(spec: mujoco.MjSpec, hand: Hand, bodies: list[mujoco.MjsBody]) -> None:
    for i, shape in enumerate(hand.visual_model.geometryObjects):
        points = _without_pads(hand, int(shape.parentJoint), link_points(hand, i))
        if (
            len(points) < 4
            or np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[-1] < _FLAT
        ):
            continue  # nothing is left of a tip beside its pad
        name = f"link/{shape.name}"
        mesh = spec.add_mesh(name=name)
        mesh.uservert, mesh.maxhullvert = points.ravel(), 64
        bodies[shape.parentJoint].add_geom(
            name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, mass=0.0,
            contype=_TOUCHABLE, conaffinity=_TOUCHES,
        )  # fmt: skip


def _without_pads(hand: Hand, joint: int, points: Array) -> Array:
    """Points of a link outside the pads on it: a tip is round where it touches."""
    for finger in hand.fingers:
        at, centre, _ = pad_in_joint(hand, finger)
        if at == joint:
            off = np.linalg.norm(points - centre, axis=1)
            points = points[off > _OWN_PAD * finger.pad_radius]
    return points


def _quat(R: Array) -> Array:
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, np.ascontiguousarray(R).ravel())
    return quat
