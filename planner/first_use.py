"""The first plan on a machine: two processes compile what it needs, in half the time of one."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np

from estimator import first_use, modes
from estimator.axis import Axis
from estimator.belief import coarse_belief, sample_objects
from estimator.compiled import has_code
from estimator.prior import coarse_prior
from hand_models.hand import Hand
from planner.choosing.pad_shapes import pad_shapes
from planner.choosing.prospects import prospects
from planner.hand_tools import hand_tools
from planner.kinematics.pulling import pull
from planner.motions.motion import plan_approaches
from planner.options import PlannerOptions
from planner.reaching.reach import Reach
from planner.reaching.solid import believed_solid
from planner.reaching.starts import Start


def compile_ahead(hand: Hand, options: PlannerOptions | None = None) -> None:
    """Compile what a plan needs, if this machine has not done so before.

    What is compiled is kept in the user's cache (`estimator.compiled`). The other process is
    `sys.executable`, which has to be a Python; without one this process compiles its own half, and
    the first plan the rest.
    """
    if has_code(modes.fill_modes) and has_code(pull):
        return
    other = _other_process()
    try:
        with first_use.uncollected():
            compile_kinematics(hand, options or PlannerOptions())
    finally:
        if other is not None:
            other.wait()


def _other_process() -> subprocess.Popen[bytes] | None:
    path = os.pathsep.join(entry or os.getcwd() for entry in sys.path)
    try:
        return subprocess.Popen(
            [sys.executable, "-m", first_use.__name__],
            env=dict(os.environ, PYTHONPATH=path),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
    except (OSError, TypeError):
        return None


def compile_kinematics(hand: Hand, options: PlannerOptions) -> None:
    """Lay a few placements on a small object, follow them to others like it, and reach one."""
    tools, rng = hand_tools(hand, options.reach), np.random.default_rng(0)
    axis = Axis(np.array([0.5, 0.0, 0.2]), np.array([0.0, 0.0, 1.0]))
    prior = coarse_prior(axis, angle=0.2, offset=0.01, radius=0.033, radius_sd=0.01)
    belief = coarse_belief(prior, (-0.05, 0.05))
    candidates = tools.candidates(belief.surface, min(3, len(hand.fingers)), count=60, rng=rng)
    if len(candidates) == 0:
        return
    place = belief.surface.at(candidates.theta, candidates.z)
    shapes = pad_shapes(
        tools.hand, candidates.fingers, candidates.q, candidates.R_WB, place.n,
        carried=False,
    )  # fmt: skip
    prospects(sample_objects(belief, 2, rng=rng), place.p, place.n, pad=tools.pad, shapes=shapes)
    names = tuple(hand.fingers[k].name for k in candidates.fingers[0])
    reach = tools.solver.solve(
        place.p[0], place.n[0], believed_solid(belief.surface), fingers=names, quick=True,
        starts=[Start(names, candidates.q[0], candidates.base(0))],
    )  # fmt: skip
    if isinstance(reach, Reach):
        plan_approaches(tools.solver.hand, reach)
