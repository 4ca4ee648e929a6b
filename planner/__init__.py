"""Where to touch: contacts that this hand can make, chosen by what they would tell."""

from planner.carrying import Stop
from planner.explore import Step, explore
from planner.first_use import compile_ahead
from planner.goal import Goal
from planner.motions.surroundings import Box
from planner.motions.timing import MotionLimits
from planner.motions.trajectory import Configuration, Trajectory
from planner.options import PlannerOptions
from planner.plan import NoPlan, Plan, Probe, plan_probes
from planner.reaching.reach_task import ReachOptions
from planner.reaching.workspace import Workspace

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
    "Stop",
    "Trajectory",
    "Workspace",
    "compile_ahead",
    "explore",
    "plan_probes",
]
