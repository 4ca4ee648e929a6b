"""The one contact that is worth most now.

While several axes are possible, that is the contact which tells them apart: every place that a
finger reaches is tried by what the estimator would say after it, were each axis in turn the right
one (`estimator.telling`). With one axis left it is the contact that leaves the least expected
error. Where time counts, the gain is taken per second of motion.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from estimator.belief import Belief
from estimator.contact import SensorNoise
from estimator.telling import telling_worth
from estimator.vectors import Array, Index
from hand_models.hand import Hand
from planner.candidates import Candidates
from planner.choosing.choice import Ranking
from planner.goal import Goal
from planner.options import PlannerOptions
from planner.plan import Plan, Probe, plan_preferred

TRIED = 40  # best candidates by expected error that are tried for what they tell apart
SPEED, TURN, JOINT = 0.25, 1.0, 1.0  # of base and joints [m/s], [rad/s], [rad/s]
TOUCHING = 3.0  # stand-off, guarded stroke and retreat [s]


def next_touch(
    hand: Hand,
    belief: Belief,
    sensor: SensorNoise,
    *,
    goal: Goal,
    rng: np.random.Generator,
    options: PlannerOptions | None = None,
    per_second: bool = False,
    start: Probe | None = None,
) -> Plan:
    """The most useful single contact.

    Args:
        per_second: Whether gains count per second of motion, by path length and speeds of an
            ordinary arm (0.25 m/s, 1 rad/s).
        start: Where the hand is, as the last probe left it; None: all ways are taken as long.
    Returns:
        A plan of one probe.
    Raises:
        NoPlan: No finger reaches the believed surface.
    """
    options = options or PlannerOptions()
    options = replace(options, margin=0.0, criterion="information", certify=False)
    seconds = _travel(start) if per_second and start is not None else None

    def prefer(candidates: Candidates, ranking: Ranking) -> Index:
        gain = _gain(belief, candidates, ranking, goal)
        if seconds is not None:
            taken = seconds(candidates)[ranking.order]
            worst = np.min(gain[np.isfinite(gain)], initial=0.0)
            gain = (gain - worst + 1e-3) / (TOUCHING + taken)
        return np.asarray(ranking.order[np.argsort(-gain, kind="stable")])

    return plan_preferred(
        hand, belief, sensor, (1,), goal=goal, rng=rng, options=options, prefer=prefer
    )


def _gain(belief: Belief, candidates: Candidates, ranking: Ranking, goal: Goal) -> Array:
    """What each candidate is worth, in the ranking's order: log odds, or log of error."""
    order = ranking.order
    told = np.full(len(order), -np.inf)
    if belief.estimate is not None and belief.estimate.verdict == "ambiguous":
        first = order[:TRIED]
        place = belief.surface.at(candidates.theta[first, 0], candidates.z[first, 0])
        worth = telling_worth(
            belief.hypotheses, belief.contacts, np.asarray(place.p), prior=belief.prior
        )
        if worth is not None:
            told[: len(first)] = worth * ranking.hit[first]
            return told
    C = belief.covariance
    now = 0.5 * np.log(np.trace(C[2:, 2:]) / goal.angle**2 + np.trace(C[:2, :2]) / goal.offset**2)
    return np.asarray(now - ranking.cost[order])


def _travel(start: Probe) -> Callable[[Candidates], Array]:
    """Seconds from where the last probe began to each candidate: the slowest of arm and joints."""
    X, q = start.approach.bases[0], start.approach.path[0]

    def seconds(candidates: Candidates) -> Array:
        way = np.linalg.norm(candidates.p_WB - X.translation, axis=1) / SPEED
        cosine = (np.einsum("ij,nij->n", X.rotation, candidates.R_WB) - 1.0) / 2.0
        turn = np.arccos(np.clip(cosine, -1.0, 1.0)) / TURN
        joints = np.max(np.abs(candidates.q - q), axis=1) / JOINT
        return np.asarray(np.maximum(np.maximum(way, turn), joints))

    return seconds
