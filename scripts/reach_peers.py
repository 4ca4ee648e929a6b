"""Other ways to put pads on contacts: SciPy's least squares, pink and mink, from given starts.

None of them knows a cone or an object: the cone is given to pink and mink by moving the wanted
orientation to its edge in every step, to SciPy as a residual; the object is looked at afterwards.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from hand_models.assembly import assembled
from hand_models.description import read_description
from hand_models.hand import Hand
from hand_models.part import Part, coupled, grafted
from planner.reaching.starts import Start

Array = np.ndarray
Guess = tuple[Array, pin.SE3]
Peer = Callable[[Start, Array, Array], Guess]

STEPS = 40
_TURN = 0.1  # an angle counts like its arc of this radius [m]
_EDGE = 0.97  # of the cone: where orientations are moved to


class ScipyPeer:
    """Bounded least squares over joints and base; residuals of places and of the cone."""

    def __init__(self, hand: Hand, cone: float) -> None:
        self._hand, self._cone = hand, cone

    def __call__(self, start: Start, targets: Array, normals: Array) -> Guess:
        hand = self._hand
        rows = [hand.fingers.index(hand.finger(name)) for name in start.fingers]

        def pose(x: Array) -> Guess:
            R = start.X_WB.rotation @ Rotation.from_rotvec(x[3:6]).as_matrix()
            return x[6:], pin.SE3(R, start.X_WB.translation + x[:3])

        def residuals(x: Array) -> Array:
            there = hand.at(*pose(x))
            place = (there.ball_centres(rows, normals) - targets).ravel()
            cosine = -np.sum(there.pad_normals[rows] * normals, axis=1)
            return np.concatenate([place, _TURN * np.maximum(np.cos(self._cone) - cosine, 0.0)])

        free = np.full(6, np.inf)
        bounds = (np.concatenate([-free, hand.lower]), np.concatenate([free, hand.upper]))
        q = np.clip(start.q, hand.lower + 1e-6, hand.upper - 1e-6)
        found = least_squares(
            residuals, np.concatenate([np.zeros(6), q]), bounds=bounds, xtol=1e-10, max_nfev=STEPS
        )
        return pose(found.x)


class PinkPeer:
    """pink's differential inverse kinematics, daqp below, on the hand with a free base."""

    def __init__(self, hand: Hand, cone: float) -> None:
        import pink

        self._pink, self._hand, self._cone = pink, hand, cone
        self._model = floating(hand).model
        self._tasks = {
            finger.name: pink.FrameTask(finger.tip_frame, 1.0, 0.05, lm_damping=1e-4)
            for finger in hand.fingers
        }

    def __call__(self, start: Start, targets: Array, normals: Array) -> Guess:
        pink, model = self._pink, self._model
        turn = pin.Quaternion(start.X_WB.rotation).coeffs()
        q = np.concatenate([start.X_WB.translation, turn, start.q])
        configuration = pink.Configuration(model, model.createData(), q)
        tasks = [self._tasks[name] for name in start.fingers]
        fingers = [self._hand.finger(name) for name in start.fingers]
        for _ in range(STEPS):
            for task, finger, target, normal in zip(tasks, fingers, targets, normals, strict=True):
                X = configuration.get_transform_frame_to_world(finger.tip_frame)
                task.set_target(moved(X, finger, target, normal, self._cone))
            v = pink.solve_ik(configuration, tasks, 1.0, solver="daqp", safety_break=False)
            configuration.integrate_inplace(v, 1.0)
            if np.linalg.norm(v) < 1e-7:
                break
        q = configuration.q
        return q[7:].copy(), pin.SE3(pin.Quaternion(q[3:7]).matrix(), q[:3])


class MinkPeer:
    """mink's, on MuJoCo, daqp below; hands without coupled joints."""

    def __init__(self, hand: Hand, cone: float) -> None:
        import mink
        import mujoco

        if hand.couplings:
            raise ValueError("the copy of the model for MuJoCo has no coupled joints")
        self._mink, self._hand, self._cone = mink, hand, cone
        self._model = mujoco.MjModel.from_xml_string(floating_mjcf(hand))
        self._limits = [mink.ConfigurationLimit(self._model)]
        self._tasks = {
            finger.name: mink.FrameTask(f"tip {finger.name}", "site", 1.0, 0.05, lm_damping=1e-4)
            for finger in hand.fingers
        }

    def __call__(self, start: Start, targets: Array, normals: Array) -> Guess:
        mink = self._mink
        x, y, z, w = pin.Quaternion(start.X_WB.rotation).coeffs()
        q = np.concatenate([start.X_WB.translation, [w, x, y, z], start.q])
        configuration = mink.Configuration(self._model, q)
        tasks = [self._tasks[name] for name in start.fingers]
        fingers = [self._hand.finger(name) for name in start.fingers]
        for _ in range(STEPS):
            for task, finger, target, normal in zip(tasks, fingers, targets, normals, strict=True):
                there = configuration.get_transform_frame_to_world(f"tip {finger.name}", "site")
                X = pin.SE3(there.as_matrix())
                wanted = moved(X, finger, target, normal, self._cone)
                task.set_target(mink.SE3.from_matrix(wanted.homogeneous))
            v = mink.solve_ik(configuration, tasks, 1.0, "daqp", limits=self._limits)
            configuration.integrate_inplace(v, 1.0)
            if np.linalg.norm(v) < 1e-7:
                break
        q = configuration.q
        turn = pin.Quaternion(q[3], q[4], q[5], q[6]).matrix()
        return q[7:].copy(), pin.SE3(turn, q[:3])


def moved(X_WT: pin.SE3, finger: Any, target: Array, normal: Array, cone: float) -> pin.SE3:
    """The tip with its pad on the target, turned into the cone the short way if it is outside."""
    n = X_WT.rotation @ finger.pad_normal
    angle = float(np.arccos(np.clip(-n @ normal, -1.0, 1.0)))
    R = X_WT.rotation
    if angle > _EDGE * cone:
        axis = np.cross(n, -normal)
        axis /= max(float(np.linalg.norm(axis)), 1e-9)
        R = pin.exp3((angle - _EDGE * cone) * axis) @ R
    return pin.SE3(R, target - R @ finger.ball_along(-R.T @ normal))


def floating(hand: Hand) -> Part:
    """The hand's model behind a free-flyer."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
    frame = model.addJointFrame(joint, 0)
    body = pin.Frame("base", joint, frame, pin.SE3.Identity(), pin.FrameType.BODY)
    model.addFrame(body)
    part = assembled(read_description(hand.name))
    return coupled(grafted(Part(model, pin.GeometryModel()), part, link="base"))


def floating_mjcf(hand: Hand) -> str:
    """The hand's kinematics as MJCF: joints, limits, a site for each tip; no shapes."""
    model = hand.model
    tips: dict[int, list[str]] = {}
    for finger in hand.fingers:
        frame = model.frames[finger.tip_frame_id]
        site = f'<site name="tip {finger.name}" {_placed(frame.placement)}/>'
        tips.setdefault(int(frame.parentJoint), []).append(site)

    def body(joint: int) -> str:
        data = model.joints[joint].createData()
        linear, angular = np.split(np.asarray(data.S).ravel(), 2)
        kind, axis = ("hinge", angular) if np.any(angular) else ("slide", linear)
        i = model.joints[joint].idx_q
        low, high = hand.lower[i], hand.upper[i]
        inside = "".join([*tips.get(joint, []), *(body(int(c)) for c in model.children[joint])])
        return (
            f'<body {_placed(model.jointPlacements[joint])}><inertial pos="0 0 0" mass="1"'
            f' diaginertia="1 1 1"/><joint name="{model.names[joint]}" type="{kind}"'
            f' axis="{_numbers(axis)}" range="{low:.9f} {high:.9f}" limited="true"/>{inside}</body>'
        )

    hands = "".join(body(int(child)) for child in model.children[0])
    return (
        '<mujoco><compiler angle="radian"/><worldbody><body><freejoint/>'
        f'<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>{hands}</body></worldbody></mujoco>'
    )


def _placed(X: pin.SE3) -> str:
    x, y, z, w = pin.Quaternion(X.rotation).coeffs()
    return f'pos="{_numbers(X.translation)}" quat="{_numbers([w, x, y, z])}"'


def _numbers(values: Any) -> str:
    return " ".join(f"{float(v):.12g}" for v in values)
