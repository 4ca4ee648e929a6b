"""The front door: probes that this hand can make, chosen by what they would tell."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np
import pinocchio as pin

from estimator.belief import Belief, sample_objects
from estimator.bounds import AxisBound
from estimator.contact import Contact, SensorNoise
from estimator.surface import Place, SurfaceOfRevolution
from estimator.vectors import Array, frozen
from hand_models.hand import Hand
from hand_models.postures import Postures, posture_library
from hand_models.spheres import LinkSpheres, link_spheres
from planner.candidates import Candidates, placement_candidates, single_candidates
from planner.choice import Ranking, rank
from planner.goal import Goal
from planner.motion import Approach, approach_by_base, plan_approaches
from planner.optimum import ChoiceCertificate, certificate
from planner.options import PlannerOptions
from planner.reach import Reach, ReachSolver, Unreachable
from planner.reach_task import ReachOptions
from planner.risk import Risk, risks
from planner.solid import RevolvedSolid
from planner.starts import Start
from planner.worth import Worth, guarded

Funnel = tuple[tuple[str, int], ...]

SOLID_HEIGHTS = 101
RISK_OBJECTS = 40


@dataclass(frozen=True, eq=False)
class Probe:
    """One touch to make.

    Args:
        finger: Which finger.
        place: Where on the believed surface.
        expected: The contact if the object is as believed (first row the parallel's).
        q: Joint positions with the pad on the contact [rad].
        approach: The way there, and beyond, should the object be farther away.
    """

    finger: str
    place: Place
    expected: Contact
    q: Array
    approach: Approach


@dataclass(frozen=True, eq=False)
class Plan:
    """Probes of one placement of the hand, in order, and why these.

    Args:
        probes: One for each finger that touches.
        reach: Joint angles and base pose with all pads on their contacts, certified.
        bound: Worst case of the axis from the best pair of the probes.
        covariance: Of the axis after the probes, if the object is as believed, (4, 4).
        angle, offset: Expected error of the axis after them, over the belief [rad], [m].
        margin: From the nearest singularity, in nine of ten objects; inf below three contacts.
        nearest: That singularity in words.
        label_probability: That the labels come out right; NaN where it was not computed.
        funnel: How many candidates there were, and what refused the others.
        risks: What is at least 5 % likely to leave the axis untold, the likeliest first.
        choice: How good these touches are among all that there are; None where not asked.
    """

    probes: tuple[Probe, ...]
    reach: Reach
    bound: AxisBound
    covariance: Array
    angle: float
    offset: float
    margin: float
    nearest: str
    label_probability: float
    funnel: Funnel
    risks: tuple[Risk, ...] = ()
    choice: ChoiceCertificate | None = None


class NoPlan(Exception):
    """Nothing that this hand reaches would do.

    Attributes:
        funnel: What refused the candidates, with counts, in order.
    """

    def __init__(self, funnel: Funnel) -> None:
        self.funnel = funnel
        told = ", ".join(f"{reason} {count}" for reason, count in funnel if count)
        super().__init__(
            f"no placement of the hand makes good contacts: {told}. A wider pad cone, a larger "
            "workspace, or an object nearer to the hand would help"
        )


@dataclass(frozen=True, eq=False)
class _Tools:
    """What is built once per hand and options."""

    hand: Hand
    postures: Postures
    spheres: LinkSpheres
    solver: ReachSolver


@lru_cache(maxsize=8)
def _tools(hand: Hand, options: ReachOptions) -> _Tools:
    return _Tools(hand, posture_library(hand), link_spheres(hand), ReachSolver(hand, options))


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
    tools = _tools(hand, options.reach)
    funnel: Funnel = ()
    for count in range(min(options.fingers_at_once, len(hand.fingers)), 0, -1):
        found = _best_placement(tools, belief, sensor, goal, options, count, rng)
        if isinstance(found, Plan):
            return _with_funnel(found, funnel)
        funnel += found
    raise NoPlan(funnel)


def _best_placement(
    tools: _Tools,
    belief: Belief,
    sensor: SensorNoise,
    goal: Goal,
    options: PlannerOptions,
    count: int,
    rng: np.random.Generator,
) -> Plan | Funnel:
    """The best placement with `count` fingers that reach certifies, or what refused them all."""
    candidates = _candidates(tools, belief.surface, options, count, rng)
    funnel = tuple((f"{count} fingers: {reason}", n) for reason, n in candidates.rejected)
    if len(candidates) == 0:
        return funnel
    samples = sample_objects(belief, options.objects, rng=rng)
    ranking = rank(
        candidates, belief, samples, sensor, goal,
        margin=options.margin, offset_guard=options.offset_guard, height=options.grasp_height,
        criterion=options.criterion, rng=rng,
    )  # fmt: skip
    funnel += tuple((f"{count} fingers: singular: {words}", n) for words, n in ranking.rejected)
    solid = _solid(belief.surface)
    failures: dict[str, int] = {}
    for i in ranking.order[: options.tries].tolist():
        made = _made(tools, belief.surface, solid, candidates, i)
        if isinstance(made, tuple):
            refused = tuple((f"{count} fingers: out of reach: {r}", n) for r, n in failures.items())
            plan = _plan(belief.surface, sensor, candidates, ranking, i, made, funnel + refused)
            worth = Worth(
                belief, samples, guarded(sensor, options.offset_guard), goal, options.grasp_height
            )
            return _judged(plan, worth, ranking, i, options, rng)
        failures[made] = failures.get(made, 0) + 1
    return funnel + tuple((f"{count} fingers: out of reach: {r}", n) for r, n in failures.items())


def _judged(
    plan: Plan,
    worth: Worth,
    ranking: Ranking,
    i: int,
    options: PlannerOptions,
    rng: np.random.Generator,
) -> Plan:
    """The plan with its risks, on objects it was not chosen by, and its certificate."""
    others = sample_objects(worth.belief, RISK_OBJECTS, rng=rng.spawn(1)[0])
    theta, z = np.array([(probe.place.theta, probe.place.z) for probe in plan.probes]).T
    found = risks(replace(worth, samples=others), theta, z, margin=options.margin)
    choice = certificate(worth, ranking, i, margin=options.margin) if options.certify else None
    return replace(plan, risks=found, choice=choice)


def _candidates(
    tools: _Tools,
    surface: SurfaceOfRevolution,
    options: PlannerOptions,
    count: int,
    rng: np.random.Generator,
) -> Candidates:
    make = single_candidates if count == 1 else partial(placement_candidates, fingers_at_once=count)
    return make(
        tools.hand,
        tools.postures,
        tools.spheres,
        surface,
        cone=options.reach.cone,
        workspace=options.reach.workspace,
        count=options.placements,
        rng=rng,
    )


def _solid(surface: SurfaceOfRevolution) -> RevolvedSolid:
    """The believed object as the optimiser's obstacle."""
    z = np.linspace(*surface.profile.z_range, SOLID_HEIGHTS)
    X_WO = pin.SE3(np.ascontiguousarray(surface.frame.T), np.array(surface.axis.point))
    return RevolvedSolid(X_WO, z, surface.profile.derivatives(z)[0])


def _made(
    tools: _Tools,
    surface: SurfaceOfRevolution,
    solid: RevolvedSolid,
    candidates: Candidates,
    i: int,
) -> tuple[Reach, tuple[Approach, ...]] | str:
    """A certified reach with its approaches, or the reason why there is none."""
    place = surface.at(candidates.theta[i], candidates.z[i])
    names = tuple(tools.hand.fingers[k].name for k in candidates.fingers[i])
    start = Start(names, candidates.q[i], candidates.base(i))
    several = len(names) > 1
    reach = tools.solver.solve(
        place.p,
        place.n,
        solid,
        fingers=names,
        starts=[start],
        motion="fingers" if several else "arm",
    )
    if isinstance(reach, Unreachable):
        return reach.reason
    if several:
        return reach, tuple(plan_approaches(tools.hand, reach))
    return reach, (approach_by_base(tools.hand, reach),)


def _plan(
    surface: SurfaceOfRevolution,
    sensor: SensorNoise,
    candidates: Candidates,
    ranking: Ranking,
    i: int,
    made: tuple[Reach, tuple[Approach, ...]],
    funnel: Funnel,
) -> Plan:
    reach, approaches = made
    probes = []
    for j, approach in enumerate(approaches):
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
    )


def _with_funnel(plan: Plan, before: Funnel) -> Plan:
    return plan if not before else replace(plan, funnel=before + plan.funnel)
