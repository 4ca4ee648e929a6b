"""Motions as JSON, and as the messages a robot's controllers take.

`joint_trajectory` and `base_trajectory` have the shapes of ROS 2's trajectory_msgs/JointTrajectory
and trajectory_msgs/MultiDOFJointTrajectory: their fields by name, ready for
`rosidl_runtime_py.set_message_fields`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from hand_models.collision import LinkPair
from hand_models.hand import Hand
from planner.grasping.grasp_travel import GraspMotion
from planner.motions.motion_certificate import MotionCertificate
from planner.motions.round_motion import RoundMotion
from planner.motions.trajectory import Array, Trajectory

DIGITS = 6  # of an angle or length: a microradian, a micrometre
WORLD, BASE = "world", "hand_base"


def motion_record(motion: RoundMotion | GraspMotion) -> dict[str, Any]:
    """All trajectories of a placement or a grasp in order, and their certificate."""
    return {
        "trajectories": [trajectory_record(one) for one in motion.trajectories],
        "goes_round": motion.sampled,
        "certificate": certificate_record(motion.certificate),
    }


def trajectory_record(trajectory: Trajectory) -> dict[str, Any]:
    """Waypoints in time; `event` is the contact that ends the motion before its last waypoint."""
    guard = trajectory.guard
    moves = not trajectory.bases[0].isApprox(trajectory.bases[-1], 1e-9)
    return {
        "phase": trajectory.phase,
        "times": _rounded(trajectory.times),
        "joint_positions": _rounded(trajectory.q),
        "joint_velocities": _rounded(trajectory.velocities),
        "base_poses": [
            {"position": p, "quaternion_xyzw": turn}
            for p, turn in map(_pose, trajectory.bases if moves else trajectory.bases[:1])
        ],
        "event": None
        if guard is None
        else {
            "contact_of": list(guard.fingers),
            "force": guard.force,
            "expected_time": guard.expected,
        },
    }


def certificate_record(found: MotionCertificate) -> dict[str, Any]:
    """What was measured over all waypoints."""
    return {
        "waypoints": found.waypoints,
        "joint_limit_margin": found.limit_margin,
        "joint_nearest_its_limit": found.limit_joint,
        "speed_share": found.speed,
        "acceleration_share": found.acceleration,
        "clearances": [_pair(pair) for pair in found.nearest.values()],
    }


def joint_trajectory(hand: Hand, trajectory: Trajectory) -> dict[str, Any]:
    """The joints, as trajectory_msgs/JointTrajectory."""
    return {
        "header": _header(BASE),
        "joint_names": list(hand.joint_names),
        "points": [
            {
                "positions": q,
                "velocities": v,
                "accelerations": [],
                "effort": [],
                "time_from_start": _duration(float(t)),
            }
            for t, q, v in zip(
                trajectory.times, _rounded(trajectory.q), _rounded(trajectory.velocities),
                strict=True,
            )
        ],
    }  # fmt: skip


def base_trajectory(trajectory: Trajectory) -> dict[str, Any]:
    """The hand base in the world, as trajectory_msgs/MultiDOFJointTrajectory."""
    return {
        "header": _header(WORLD),
        "joint_names": [BASE],
        "points": [
            {
                "transforms": [_transform(X)],
                "velocities": [],
                "accelerations": [],
                "time_from_start": _duration(float(t)),
            }
            for t, X in zip(trajectory.times, trajectory.bases, strict=True)
        ],
    }


def _transform(X: pin.SE3) -> dict[str, Any]:
    p, turn = _pose(X)
    return {
        "translation": dict(zip("xyz", p, strict=True)),
        "rotation": dict(zip("xyzw", turn, strict=True)),
    }


def _header(frame: str) -> dict[str, Any]:
    return {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": frame}


def _duration(seconds: float) -> dict[str, int]:
    whole, rest = divmod(round(1e9 * seconds), 10**9)
    return {"sec": int(whole), "nanosec": int(rest)}


def _pair(pair: LinkPair) -> dict[str, Any]:
    return {"between": [pair.first, pair.second], "distance": pair.distance}


def _pose(X: pin.SE3) -> tuple[list[float], list[float]]:
    """Position and quaternion, the latter exact enough to stay of unit length."""
    return _rounded(X.translation), np.round(pin.Quaternion(X.rotation).coeffs(), 9).tolist()


def _rounded(values: Array) -> Any:
    return np.round(values, DIGITS).tolist()
