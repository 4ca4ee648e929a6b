"""Plan, touch, learn, and again: a generator that the caller bounds.

Where three fingers reach at once, they touch in one placement of the hand; where not, two or one
do, and the hand moves between. Where the object is so vaguely known that most placements would
miss with a finger, one finger feels for it first. Where several axes are left, or the first touches
meet the goal with nothing to confirm them, or placements agree and one more touch is likely to meet
it, a single touch follows (`planner.next_touch`). Touches that contradict earlier ones widen the
belief (`planner.surprise`), and others have to agree before the goal counts. What the hand meets on
its way in counts as a touch, and ends the placement (`planner.carrying`).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from estimator.belief import Belief
from estimator.contact import Contact, Miss, SensorNoise
from hand_models.hand import Hand
from planner.carrying import Move, Stop, Touch, carry_out
from planner.choosing.risk import MISSED
from planner.goal import Goal
from planner.motions.trajectory import Configuration
from planner.next_touch import next_touch
from planner.options import PlannerOptions
from planner.plan import NoPlan, Plan, Probe, plan_probes
from planner.surprise import Learnt, learn

UNLIKELY = 0.5  # chance of a miss from which a placement is not worth its three touches
CLEARER, CLEAREST = 3e-3, 7e-3  # added to links' clearance where one met the object, at most [m]
TELLING_TRIES = 6  # best single touches that are handed to the optimiser


@dataclass(frozen=True, eq=False)
class Step:
    """One placement of the hand: what was planned, felt and learnt.

    Args:
        plan: The probes.
        outcomes: A contact or a miss for each probe; none where a motion was stopped before.
        before, after: The belief.
        touches: Probes and stops so far.
        surprise: What the touches contradicted and what was done about it; None where nothing.
        stop: The motion that met something, and what was felt; None where all were carried out.
        settled: Whether later touches have confirmed what surprises left.
    """

    plan: Plan
    outcomes: tuple[Contact | Miss, ...]
    before: Belief
    after: Belief
    touches: int
    surprise: str | None = None
    stop: Stop | None = None
    settled: bool = True

    @property
    def probes(self) -> tuple[Probe, ...]:
        """Those of the plan that were made: all of them, or none."""
        return self.plan.probes[: len(self.outcomes)]

    @property
    def felt(self) -> tuple[tuple[str, Contact | Miss], ...]:
        """Each finger that touched or missed, in order; what stopped the hand, too."""
        if self.stop is not None:
            felt = self.stop.felt
            return () if felt is None else ((self.stop.finger, felt),)
        return tuple((p.finger, felt) for p, felt in zip(self.probes, self.outcomes, strict=True))

    @property
    def left(self) -> Configuration:
        """Where the hand is after it."""
        if self.stop is not None:
            return self.stop.trajectory.begin
        return Configuration(self.plan.retreat.path[-1], self.plan.retreat.bases[-1])


def explore(
    hand: Hand,
    touch: Touch,
    belief: Belief,
    sensor: SensorNoise,
    *,
    goal: Goal,
    budget: int,
    rng: np.random.Generator,
    options: PlannerOptions | None = None,
    move: Move | None = None,
) -> Iterator[Step]:
    """Touch until the axis is known well enough or the budget of touches is spent.

    Args:
        touch: Carries a probe out, there and back: a simulated sensor, a physics engine or a robot.
        budget: Largest number of probes and stops, misses included.
        move: Carries out what lies between probes, or says what stopped it; asked for what
            `options.start` lets the planner plan. None where somebody else moves the hand.
    Raises:
        NoPlan: The hand reaches nothing useful on the believed object.
        ValueError: A budget below one, or an arm whose root stands in an obstacle.
    """
    if budget < 1:
        raise ValueError(f"budget: expected at least one touch, got {budget}")
    options = options or PlannerOptions()
    learnt, touches, asked = Learnt(belief, restless=options.slack), 0, options.reach
    sensor = replace(sensor, position=float(np.hypot(sensor.position, options.slack)))
    while touches < budget and not (goal.met_by(learnt.belief) and learnt.settled):
        before = learnt.belief
        try:
            plan = _plan(hand, learnt, sensor, goal, budget - touches, rng, options)
        except NoPlan:
            if options.reach != asked:
                options = replace(options, reach=asked)  # nothing is as clear as it was to be
                continue
            if goal.met_by(before):
                return  # nothing to confirm it with is within reach
            raise
        outcomes, stop = carry_out(plan, touch, move)
        felt = outcomes if stop is None or stop.felt is None else (stop.felt,)
        touches += len(outcomes) if stop is None else 1
        learnt = learn(learnt, felt) if felt else learnt
        step = Step(
            plan, outcomes, before, learnt.belief, touches, learnt.surprise, stop, learnt.settled
        )
        if plan.motion is not None:
            options = replace(options, start=step.left)
        if stop is not None and stop.felt is None:
            options = _warier(options)
        yield step


def _warier(options: PlannerOptions) -> PlannerOptions:
    """Links farther from the object than before: one has met it."""
    clearance = min(options.reach.clearance + CLEARER, max(CLEAREST, options.reach.clearance))
    return replace(options, reach=replace(options.reach, clearance=clearance))


def _plan(
    hand: Hand,
    learnt: Learnt,
    sensor: SensorNoise,
    goal: Goal,
    left: int,
    rng: np.random.Generator,
    options: PlannerOptions,
) -> Plan:
    """One touch where one will do: to feel, to tell, to confirm; a placement otherwise."""
    belief = learnt.belief
    few = replace(options, tries=min(options.tries, TELLING_TRIES))
    if goal.met_by(belief):
        with suppress(NoPlan):  # where no single touch confirms it, a placement may
            return next_touch(hand, belief, sensor, goal=goal, rng=rng, options=few)
    if _ambiguous(belief) and options.criterion == "information":
        with suppress(NoPlan):
            return next_touch(hand, belief, sensor, goal=goal, rng=rng, options=few)
    if options.criterion == "information" and learnt.settled and goal.nearly_met_by(belief):
        with suppress(NoPlan):
            one_more = next_touch(hand, belief, sensor, goal=goal, rng=rng, options=few)
            if goal.would_be_met(belief, one_more.covariance):
                return one_more
    at_once = min(options.fingers_at_once, left)
    margin = options.margin if _fresh(belief) else 0.0
    this_time = replace(options, fingers_at_once=at_once, margin=margin)
    plan = plan_probes(hand, belief, sensor, goal=goal, rng=rng, options=this_time)
    if options.criterion != "information" or belief.contacts or plan.chance_of(MISSED) < UNLIKELY:
        return plan
    with suppress(NoPlan):
        feeling = next_touch(hand, belief, sensor, goal=goal, rng=rng, options=few)
        if feeling.chance_of(MISSED) < plan.chance_of(MISSED):
            return feeling
    return plan


def _ambiguous(belief: Belief) -> bool:
    return belief.estimate is not None and belief.estimate.verdict == "ambiguous"


def _fresh(belief: Belief) -> bool:
    """Whether the next triple has to fix the axis by itself, as far as the touches go."""
    return belief.estimate is None or belief.estimate.verdict != "determined"
