"""Plans and steps as JSON: SI, radians, joint names, poses as position and quaternion (x, y, z, w).

plan.json holds {"hand", "joint_names", "rounds": [plan, ...]}; the fields of a plan and of its
probes are those of `plan_record` and `probe_record` below.
"""

from __future__ import annotations

from typing import Any, SupportsFloat

import numpy as np
import pinocchio as pin

from estimator.contact import Contact, Miss
from estimator.records import axis_record, contact_record, estimate_record
from hand_models.hand import Hand
from planner.explore import Step
from planner.optimum import ChoiceCertificate
from planner.plan import Plan, Probe


def plan_document(hand: Hand, plans: list[Plan]) -> dict[str, Any]:
    """All placements that were planned, in order."""
    return {
        "hand": hand.name,
        "joint_names": list(hand.joint_names),
        "units": {"length": "m", "angle": "rad"},
        "rounds": [plan_record(plan) for plan in plans],
    }


def plan_record(plan: Plan) -> dict[str, Any]:
    """One placement: probes, certificate, what was expected of it, what was refused."""
    reach = plan.reach
    return {
        "base_pose": pose_record(reach.X_WB),
        "joint_positions": reach.q.tolist(),
        "probes": [probe_record(probe) for probe in plan.probes],
        "reach": {
            "position_residual": reach.position_residual,
            "pad_angle": reach.pad_angle,
            "joint_limit_margin": reach.limit_margin,
            "self_clearance": reach.self_clearance,
            "object_clearance": reach.object_clearance,
            "solver": reach.solver,
        },
        "retreat": {
            "joint_positions": plan.retreat.q.tolist(),
            "base_poses": [pose_record(X) for X in plan.retreat.bases],
            "clearance": plan.retreat.clearance,
            "wanted": plan.retreat.wanted,
        },
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
            for probe, outcome in zip(step.plan.probes, step.outcomes, strict=True)
        ],
        "surprise": step.surprise,
        "expected_error": {"angle": step.plan.angle, "offset": step.plan.offset},
        "axis": axis_record(step.after.hypotheses[0]),
        "estimate": estimate_record(estimate) if estimate is not None else None,
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
