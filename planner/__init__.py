"""Where to touch: contacts that this hand can make, chosen by what they would tell."""

from planner.explore import Step, explore
from planner.goal import Goal
from planner.options import PlannerOptions
from planner.plan import NoPlan, Plan, Probe, plan_probes
from planner.reach_task import ReachOptions
from planner.surroundings import Box
from planner.timing import MotionLimits
from planner.trajectory import Configuration, Trajectory
from planner.workspace import Workspace

__all__ = [
    "Box",
    "Configuration",
    "Goal",
    "MotionLimits",
    "NoPlan",
    "Plan",
    "PlannerOptions",
    "Probe",
    "ReachOptions",
    "Step",
    "Trajectory",
    "Workspace",
    "explore",
    "plan_probes",
]
