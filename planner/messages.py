"""Plans and steps as JSON: SI, radians, joint names, poses as position and quaternion (x, y, z, w).

plan.json holds {"hand", "joint_names", "coupled_joints", "rounds": [plan, ...], "grasp": grasp or
null}; joint positions are those of `joint_names`, and a coupled joint {"joint", "follows",
"multiplier", "offset"} stands at multiplier times the position of `follows` plus offset; the fields
of a plan and of its probes are those of `plan_record` and `probe_record` below, those of a grasp
of `grasp_record`; what the hand does in time is in each one's "motion"
(`planner.trajectory_messages`).
"""

from __future__ import annotations

from typing import Any, SupportsFloat

import numpy as np
import pinocchio as pin

from estimator.contact import Contact, Miss
from estimator.records import axis_record, contact_record, estimate_record
from hand_models.hand import Hand
from planner.carrying import Stop
from planner.choosing.optimum import ChoiceCertificate
from planner.explore import Step
from planner.grasping.grasp_outcome import Grasp
from planner.plan import Plan, Probe
from planner.reaching.reach import Reach
from planner.trajectory_messages import motion_record


def plan_document(hand: Hand, plans: list[Plan], grasp: Grasp | None = None) -> dict[str, Any]:
    """All placements that were planned, in order, and the grasp at the end, if there is one."""
    return {
        "hand": hand.name,
        "joint_names": list(hand.joint_names),
        "coupled_joints": [vars(coupling) for coupling in hand.couplings],
        "units": {"length": "m", "angle": "rad"},
        "rounds": [plan_record(plan) for plan in plans],
        "grasp": None if grasp is None else grasp_record(hand, grasp),
    }


def plan_record(plan: Plan) -> dict[str, Any]:
    """One placement: probes, certificate, what was expected of it, what was refused."""
    reach = plan.reach
    return {
        "base_pose": pose_record(reach.X_WB),
        "joint_positions": reach.q.tolist(),
        "probes": [probe_record(probe) for probe in plan.probes],
        "reach": reach_record(reach),
        "retreat": {
            "joint_positions": plan.retreat.q.tolist(),
            "joint_path": plan.retreat.path.tolist(),
            "base_poses": [pose_record(X) for X in plan.retreat.bases],
            "clearance": plan.retreat.clearance,
            "wanted": plan.retreat.wanted,
        },
        "motion": None if plan.motion is None else motion_record(plan.motion),
        "bound": {"angle": _finite(plan.bound.angle), "position": _finite(plan.bound.position)},
        "expected_error": {"angle": _finite(plan.angle), "offset": _finite(plan.offset)},
        "predicted_covariance": plan.covariance.tolist(),
        "margin": _finite(plan.margin),
        "nearest_singularity": plan.nearest,
        "label_probability": _finite(plan.label_probability),
        "risks": [{"name": risk.name, "chance": risk.chance} for risk in plan.risks],
        "choice": None if plan.choice is None else _choice_record(plan.choice),
        "funnel": [{"reason": reason, "count": count} for reason, count in plan.funnel],
    }


def _choice_record(choice: ChoiceCertificate) -> dict[str, Any]:
    """Expected errors in goals, null where there is none."""
    return {name: _finite(value) for name, value in vars(choice).items()}


def grasp_record(hand: Hand, grasp: Grasp) -> dict[str, Any]:
    """A grasp: the way in, joint angles open and closed, contacts, and how surely it holds."""
    return {
        "hand": hand.name,
        "joint_names": list(hand.joint_names),
        "fingers": list(grasp.fingers),
        "base_pose": pose_record(grasp.X_WB),
        "approach": [pose_record(X) for X in grasp.approach],
        "pregrasp_joint_positions": grasp.q_pregrasp.tolist(),
        "joint_positions": grasp.q_grasp.tolist(),
        "closing": {
            "joint_path": grasp.path.tolist(),
            "contact_index": grasp.contact_index,
            "before": grasp.closings.before[0].tolist(),
            "behind": grasp.closings.behind[0].tolist(),
        },
        "contacts": [
            {"finger": finger, "position": p.tolist(), "normal": n.tolist()}
            for finger, p, n in zip(grasp.fingers, grasp.points, grasp.normals, strict=True)
        ],
        "quality": {
            "force_closure_probability": grasp.probability,
            "clear_probability": grasp.clear,
            "samples": grasp.samples,
            "expected_wrench_margin": grasp.margin,
            "wrench_margin_5_percent": grasp.margin_5,
            "wrench_margin_as_believed": grasp.as_believed.margin,
            "friction": grasp.friction.coefficient,
            "torque_length": grasp.friction.torque_length,
        },
        "reach": reach_record(grasp.reach),
        "motion": None if grasp.motion is None else motion_record(grasp.motion),
        "funnel": [{"reason": reason, "count": count} for reason, count in grasp.funnel],
    }


def reach_record(reach: Reach) -> dict[str, Any]:
    """The certificate of a posture."""
    return {
        "position_residual": reach.position_residual,
        "pad_angle": reach.pad_angle,
        "joint_limit_margin": reach.limit_margin,
        "self_clearance": _finite(reach.self_clearance),
        "object_clearance": reach.object_clearance,
        "solver": reach.solver,
    }


def probe_record(probe: Probe) -> dict[str, Any]:
    """One touch: finger, place, expected contact, and the approach as joint waypoints."""
    approach = probe.approach
    return {
        "finger": probe.finger,
        "place": {"theta": probe.place.theta, "z": probe.place.z},
        "expected_contact": {
            "position": probe.expected.position.tolist(),
            "normal": probe.expected.normal.tolist(),
        },
        "joint_positions": probe.q.tolist(),
        "approach": {
            "base_poses": [pose_record(X) for X in approach.bases],
            "joint_path": approach.path.tolist(),
            "tip_path": approach.tip_centres.tolist(),
            "contact_index": approach.contact_index,
            "standoff": approach.standoff,
            "overshoot": approach.overshoot,
            "force_goal": approach.force_goal,
        },
    }


def step_record(step: Step) -> dict[str, Any]:
    """One round as it went: what each finger felt, and what is believed after it."""
    estimate = step.after.estimate
    return {
        "touches": step.touches,
        "outcomes": [
            outcome_record(probe.finger, outcome)
            for probe, outcome in zip(step.probes, step.outcomes, strict=True)
        ],
        "stopped": None if step.stop is None else stop_record(step.stop),
        "surprise": step.surprise,
        "settled": step.settled,
        "expected_error": {"angle": step.plan.angle, "offset": step.plan.offset},
        "axis": axis_record(step.after.hypotheses[0]),
        "estimate": estimate_record(estimate) if estimate is not None else None,
    }


def stop_record(stop: Stop) -> dict[str, Any]:
    """A motion that met something, and the contact that a finger felt, which counts as a touch."""
    return {
        "phase": stop.trajectory.phase,
        "time": stop.time,
        "finger": stop.finger or None,
        "contact": None if stop.felt is None else contact_record(stop.felt),
    }


def outcome_record(finger: str, outcome: Contact | Miss) -> dict[str, Any]:
    """A contact as it was read, or a miss."""
    if isinstance(outcome, Miss):
        return {"finger": finger, "miss": {"tip": outcome.tip.tolist(), "radius": outcome.radius}}
    return {"finger": finger, "contact": contact_record(outcome)}


def pose_record(X: pin.SE3) -> dict[str, list[float]]:
    """Position [m] and quaternion x, y, z, w."""
    return {
        "position": X.translation.tolist(),
        "quaternion_xyzw": pin.Quaternion(X.rotation).coeffs().tolist(),
    }


def _finite(value: SupportsFloat) -> float | None:
    """JSON has no infinity and no NaN: null says that there is no such number."""
    value = float(value)
    return value if np.isfinite(value) else None
