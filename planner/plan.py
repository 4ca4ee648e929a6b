"""The front door: probes that this hand can make, chosen by what they would tell."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from estimator.belief import Belief, sample_objects
from estimator.bounds import AxisBound
from estimator.contact import SensorNoise
from estimator.surface import Place, SurfaceOfRevolution
from estimator.vectors import Index, frozen
from hand_models.hand import Hand
from planner.candidates import Candidates
from planner.choosing.choice import Ranking, rank
from planner.choosing.sweep import FROM, swept, with_swept
from planner.choosing.worth import Worth
from planner.funnel import Funnel
from planner.goal import Goal
from planner.hand_tools import HandTools, hand_tools
from planner.judging import judged
from planner.motions.motion import Approach, approach_by_base, approach_fault, plan_approaches
from planner.motions.retreat import Retreat
from planner.motions.round_motion import RoundMotion, plan_round
from planner.motions.transfer import movable_among
from planner.options import PlannerOptions
from planner.plan_types import NoPlan, Plan, Probe
from planner.reaching.reach import Reach, Unreachable
from planner.reaching.solid import RevolvedSolid, believed_solid
from planner.reaching.starts import Start

__all__ = ["NoPlan", "Plan", "Probe", "plan_preferred", "plan_probes"]

Preference = Callable[[Candidates, Ranking], Index]

REFINED = 6  # of the best placements are handed to the optimiser, where none settles without


class _Made(NamedTuple):
    """A placement made exact: certified, with the ways to the contacts and out."""

    reach: Reach
    approaches: tuple[Approach, ...]
    retreat: Retreat
    motion: RoundMotion | None


def plan_probes(
    hand: Hand,
    belief: Belief,
    sensor: SensorNoise,
    *,
    goal: Goal,
    rng: np.random.Generator,
    options: PlannerOptions | None = None,
) -> Plan:
    """The most useful touches that one placement of this hand can make.

    Idea: postures of the hand are laid onto the believed surface (`candidates`), singular triples
    are refused over samples of the belief and the rest ranked by expected error, label odds and
    pair bound (`choice`), and the best are made exact and certified (`reach`) until one holds,
    with approaches before and beyond the contacts (`motion`). Where no three fingers reach, two
    are tried, then one.

    Raises:
        NoPlan: Not even a single touch is left; its funnel says why.
    """
    options = options or PlannerOptions()
    # A finger of one joint cannot go along a normal: the arm does, for one finger at a time.
    nimble = sum(len(finger.joints) > 1 for finger in hand.fingers)
    most = max(1, min(options.fingers_at_once, nimble))
    counts = range(most, 0, -1)
    return plan_preferred(hand, belief, sensor, counts, goal=goal, rng=rng, options=options)


def plan_preferred(
    hand: Hand,
    belief: Belief,
    sensor: SensorNoise,
    counts: Iterable[int],
    *,
    goal: Goal,
    rng: np.random.Generator,
    options: PlannerOptions,
    prefer: Preference | None = None,
) -> Plan:
    """The first number of fingers that some placement can touch with.

    Args:
        counts: Numbers of fingers, in order.
        prefer: Puts the ranked candidates in an order of its own; None keeps the ranking's.
    Raises:
        NoPlan: No placement with any of them.
    """
    tools = hand_tools(hand, options.reach)
    funnel: Funnel = ()
    for count in counts:
        found = _best_placement(tools, belief, sensor, goal, options, count, rng, prefer)
        if isinstance(found, Plan):
            return _with_funnel(found, funnel)
        funnel += found
    raise NoPlan(funnel)


def _best_placement(
    tools: HandTools,
    belief: Belief,
    sensor: SensorNoise,
    goal: Goal,
    options: PlannerOptions,
    count: int,
    rng: np.random.Generator,
    prefer: Preference | None,
) -> Plan | Funnel:
    """The best placement with `count` fingers that reach certifies, or what refused them all."""
    candidates = tools.candidates(belief.surface, count, count=options.placements, rng=rng)
    funnel = tuple((f"{count} fingers: {reason}", n) for reason, n in candidates.rejected)
    if len(candidates) == 0:
        return funnel
    samples = sample_objects(belief, options.objects, rng=rng)
    worth = Worth(
        belief, samples, sensor, goal, options.grasp_height,
        untold=options.offset_guard, pad=tools.pad, hand=tools.hand,
    )  # fmt: skip
    rank_all = partial(
        rank, worth=worth, margin=options.margin, criterion=options.criterion, rng=rng
    )
    ranking, scored = rank_all(candidates), 0
    if options.sweep and tools.arm is None and count == 3 and options.criterion == "information":
        more, scored = swept(
            tools.hand, tools.postures, tools.spheres, candidates, ranking.order[:FROM], worth,
            cone=options.reach.cone, is_self_free=tools.collision.is_self_free, rng=rng,
        )  # fmt: skip
        candidates, ranking = with_swept(candidates, ranking, more, rank_all, tries=options.tries)
    if prefer is not None:
        ranking = replace(ranking, order=prefer(candidates, ranking))
    funnel += tuple((f"{count} fingers: singular: {words}", n) for words, n in ranking.rejected)
    solid = believed_solid(belief.surface)
    failures: dict[int, str] = {}
    best = ranking.order[: options.tries].tolist()
    for i, quick in [*((i, True) for i in best), *((i, False) for i in best[:REFINED])]:
        made = _made(tools, belief, options, solid, candidates, i, quick=quick)
        if isinstance(made, _Made):
            funnel += _refused(count, failures)
            plan = _plan(belief.surface, sensor, candidates, ranking, i, made, funnel)
            return judged(plan, worth, ranking, i, scored=scored, options=options, rng=rng)
        failures[i] = made
    return funnel + _refused(count, failures)


def _refused(count: int, failures: dict[int, str]) -> Funnel:
    """Reasons of the candidates that were tried in vain, with their numbers."""
    reasons = Counter(failures.values())
    return tuple((f"{count} fingers: out of reach: {why}", n) for why, n in reasons.items())


def _made(
    tools: HandTools,
    belief: Belief,
    options: PlannerOptions,
    solid: RevolvedSolid,
    candidates: Candidates,
    i: int,
    *,
    quick: bool,
) -> _Made | str:
    """A certified reach with the ways to it and out, or the reason why there is none."""
    place = belief.surface.at(candidates.theta[i], candidates.z[i])
    names = tuple(tools.hand.fingers[k].name for k in candidates.fingers[i])
    start = Start(names, candidates.q[i], candidates.base(i))
    solver = tools.solver if len(names) > 1 else tools.single
    by_base = len(names) == 1 and tools.arm is None
    reach = solver.solve(
        place.p,
        place.n,
        solid,
        fingers=names,
        starts=[start],
        motion="arm" if by_base else "fingers",
        quick=quick,
    )
    if isinstance(reach, Unreachable):
        return reach.reason
    if by_base:
        ways: tuple[Approach, ...] = (approach_by_base(tools.hand, reach),)
        out = tools.ways_out(belief, replace(reach, X_WB=ways[0].bases[0]))
    else:
        ways, out = plan_approaches(solver.hand, reach), tools.ways_out(belief, reach)
        fault = approach_fault(tools.collision, ways, options.reach.least_overshoot)
        if fault:
            return fault
    gentle = tuple(replace(way, force_goal=options.force_goal) for way in ways)
    if options.start is None:
        return _Made(reach, gentle, out[0], None)
    movable = movable_among(tools.hand, tools.collision, solid, tools.rules, options.limits)
    motion = plan_round(movable, gentle, out, options.start)
    return motion if isinstance(motion, str) else _Made(reach, gentle, motion.retreat, motion)


def _plan(
    surface: SurfaceOfRevolution,
    sensor: SensorNoise,
    candidates: Candidates,
    ranking: Ranking,
    i: int,
    made: _Made,
    funnel: Funnel,
) -> Plan:
    reach = made.reach
    probes = []
    for j, approach in enumerate(made.approaches):
        place = Place(float(candidates.theta[i, j]), float(candidates.z[i, j]))
        expected = surface.contact(place, sensor)
        probes.append(Probe(approach.finger, place, expected, reach.q, approach))
    return Plan(
        probes=tuple(probes),
        reach=reach,
        bound=AxisBound(
            frozen(ranking.pair_bound.position[i]), frozen(ranking.pair_bound.angle[i])
        ),
        covariance=frozen(ranking.covariance[i]),
        angle=float(ranking.angle[i]),
        offset=float(ranking.offset[i]),
        margin=float(ranking.margin[i]),
        nearest=ranking.nearest[i],
        label_probability=float(ranking.label_probability[i]),
        funnel=funnel,
        retreat=made.retreat,
        motion=made.motion,
    )


def _with_funnel(plan: Plan, before: Funnel) -> Plan:
    return plan if not before else replace(plan, funnel=before + plan.funnel)
