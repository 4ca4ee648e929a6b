"""Plan, touch, learn, and again: a generator that the caller bounds."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from estimator.belief import Belief, update
from estimator.contact import Contact, Miss, SensorNoise
from hand_models.hand import Hand
from planner.goal import Goal
from planner.options import PlannerOptions
from planner.plan import Plan, Probe, plan_probes

Touch = Callable[[Probe], Contact | Miss]


@dataclass(frozen=True, eq=False)
class Step:
    """One placement of the hand: what was planned, felt and learnt.

    Args:
        plan: The probes.
        outcomes: A contact or a miss for each probe.
        before, after: The belief.
        touches: All probes made so far.
    """

    plan: Plan
    outcomes: tuple[Contact | Miss, ...]
    before: Belief
    after: Belief
    touches: int


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
) -> Iterator[Step]:
    """Touch until the axis is known well enough or the budget of touches is spent.

    Args:
        touch: Carries a probe out: a simulated sensor, a physics engine or a robot.
        budget: Largest number of probes, misses included.
    Raises:
        NoPlan: The hand reaches nothing useful on the believed object.
        ValueError: A budget below one.
    """
    if budget < 1:
        raise ValueError(f"budget: expected at least one touch, got {budget}")
    options = options or PlannerOptions()
    touches = 0
    while touches < budget and not goal.met_by(belief):
        at_once = min(options.fingers_at_once, budget - touches)
        this_time = replace(
            options, fingers_at_once=at_once, margin=options.margin if _fresh(belief) else 0.0
        )
        plan = plan_probes(hand, belief, sensor, goal=goal, rng=rng, options=this_time)
        outcomes = tuple(touch(probe) for probe in plan.probes)
        touches += len(outcomes)
        after = update(belief, outcomes)
        yield Step(plan, outcomes, belief, after, touches)
        belief = after


def _fresh(belief: Belief) -> bool:
    """Whether the next triple has to fix the axis by itself, as far as the touches go."""
    return belief.estimate is None or belief.estimate.verdict != "determined"
