"""What a plan is worth and what may go wrong with it, once its placement is found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from estimator.belief import sample_objects
from planner.choosing.choice import Ranking
from planner.choosing.optimum import certificate, value_of
from planner.choosing.prospects import Prospects
from planner.choosing.risk import risks
from planner.choosing.worth import Worth
from planner.options import PlannerOptions
from planner.plan_types import Plan

RISK_OBJECTS = 40


def judged(
    plan: Plan,
    worth: Worth,
    ranking: Ranking,
    i: int,
    *,
    scored: int,
    options: PlannerOptions,
    rng: np.random.Generator,
) -> Plan:
    """The plan with its risks, on objects it was not chosen by, and its certificate.

    Args:
        ranking, i: What it was chosen from, and which of them it is.
        scored: How many triples those were the best of.
    """
    others = sample_objects(worth.belief, RISK_OBJECTS, rng=rng.spawn(1)[0])
    unseen = replace(worth, samples=others)
    landed = _landed(plan, unseen)
    found = risks(unseen, landed, margin=options.margin)
    if not options.certify:
        return replace(plan, risks=found)
    choice = certificate(worth, ranking, i, scored=scored, margin=options.margin)
    return replace(plan, risks=found, choice=replace(choice, unseen=value_of(unseen, landed)))


def _landed(plan: Plan, worth: Worth) -> Prospects:
    """The plan's own touches, as its hand makes them."""
    theta, z = np.array([(probe.place.theta, probe.place.z) for probe in plan.probes]).T
    place = worth.belief.surface.at(theta[None], z[None])
    shapes = None
    if worth.hand is not None:
        names = [finger.name for finger in worth.hand.fingers]
        rows = np.array([[names.index(probe.finger) for probe in plan.probes]])
        R_WB = np.array(plan.reach.X_WB.rotation)[None]
        q, carried = plan.reach.q[None], len(plan.probes) == 1
        shapes = worth.shapes(place, rows, q, R_WB, carried=carried)
    behind = np.array([[probe.approach.overshoot for probe in plan.probes]])
    return worth.landed(place, shapes, behind=behind)
