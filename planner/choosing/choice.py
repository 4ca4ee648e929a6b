"""Which touches: refuse the singular over the whole belief, rank the rest.

The rule "three contacts about 90 degrees apart in meridian, never opposite, avoiding shared
parallels and normals that meet on the axis" has three parts here. Singular triples are refused
with a margin that holds for three in four objects drawn from the belief. The corrected bound of
eqs (64)-(72) for the best *pair* prefers pairs near 90 degrees. The third contact follows what it
is worth: the expected error of the axis after the touches, misses and a rotation of the directions
that nobody was told of included, and the odds that the labels come out right. Other criteria are
for comparison (`planner.choosing.criteria`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimator.belief import Belief
from estimator.bounds import AxisBound, SensorErrors, bound_from_directions
from estimator.contact import SensorNoise
from estimator.information import (
    Expected,
    contact_information,
    label_log_odds,
    predicted_covariance,
)
from estimator.prior import AxisPrior
from estimator.singular import SINGULARITIES
from estimator.surface import Geometry
from estimator.vectors import Array, Index
from planner.candidates import Candidates
from planner.choosing.criteria import REFUSING, Criterion, Merits, costs
from planner.choosing.prospects import Prospects
from planner.choosing.worth import Worth

MARGIN = 0.08  # from every singularity, in three of four sampled objects
MISLABEL_COST = 4.0  # a wrong labelling is this much worse, as a logarithm of error
SHORT_LIST = 12  # candidates whose label odds are asked
ODDS_OBJECTS = 2


@dataclass(frozen=True, eq=False)
class Ranking:
    """Candidates in order of merit, best first; arrays over them.

    Args:
        touches: How many each candidate makes.
        order: Indices into the candidates.
        cost: What the order goes by, by the criterion; `information` takes the logarithm of the
            expected error and what the bound and doubtful labels add.
        value: Expected error of the axis after the touches, in goals.
        angle, offset: Expected error of the axis after the touches [rad], [m].
        covariance: Predicted for the believed object, (N, 4, 4).
        pair_bound: Worst case of the axis from the best pair, eqs (64)-(72) corrected.
        margin: From the nearest singularity in three of four objects [-]; infinite for fewer than
            three contacts.
        nearest: That singularity in words.
        label_probability: That the labels come out right by these touches alone; NaN where that
            was not asked, or earlier contacts help.
        hit: Share of the touches that land.
        rejected: How many candidates fell here, by reason.
    """

    touches: int
    order: Index
    cost: Array
    value: Array
    angle: Array
    offset: Array
    covariance: Array
    pair_bound: AxisBound
    margin: Array
    nearest: tuple[str, ...]
    label_probability: Array
    hit: Array
    rejected: tuple[tuple[str, int], ...]


def rank(
    candidates: Candidates,
    worth: Worth,
    *,
    margin: float = MARGIN,
    criterion: Criterion = "information",
    rng: np.random.Generator | None = None,
) -> Ranking:
    """Refuse and rank.

    Args:
        worth: By what touches are valued; bound and predicted covariance do not reckon with its
            untold rotation.
        margin: Smallest margin from a singularity; zero ranks all, and so do the criteria that
            refuse nothing.
        rng: For the criterion `random` only.
    """
    belief, noise, goal = worth.belief, worth.noise, worth.goal
    place = belief.surface.at(candidates.theta, candidates.z)
    shapes = worth.shapes(
        place, candidates.fingers, candidates.q, candidates.R_WB,
        carried=candidates.fingers.shape[1] == 1,
    )  # fmt: skip
    landed = worth.landed(place, shapes)
    after = worth.covariances(landed)
    value, angle, offset = _expected_error(after)
    bound, best_bound = _pair_bound(candidates.theta, place, noise)
    low = worth.least_margins(landed)
    margins_at, nearest = low.min(axis=1), _named(low)
    merits = Merits(candidates.theta, candidates.z, value, after, bound, best_bound, belief, goal)
    cost = costs(criterion, merits, rng)
    least = margin if criterion in REFUSING else 0.0
    kept = np.nonzero(margins_at >= least)[0]
    order = kept[np.argsort(cost[kept], kind="stable")].astype(np.intp)
    probability = np.full(len(cost), np.nan)
    if criterion == "information" and candidates.theta.shape[1] > 1 and not belief.contacts:
        order = _by_labels(order, cost, probability, belief, landed, noise)
    return Ranking(
        candidates.theta.shape[1], order, cost, value, goal.angle * angle, goal.offset * offset,
        _believed_covariance(belief, place, noise), bound, margins_at, nearest, probability,
        landed.hit.mean(axis=(0, 2)), _fallen(margins_at, nearest, least),
    )  # fmt: skip


def _expected_error(after: Array) -> tuple[Array, Array, Array]:
    """Geometric mean over objects, in goals: of both, of direction, of position, each (N,).

    The mean of the logarithm is the expected information. A mean square would be ruled by the few
    objects that a finger misses, and would huddle the touches where nothing can be missed.

    Args:
        after: Covariances after the touches, in goals, (B, N, 4, 4).
    """
    offset2 = np.einsum("bnii->bn", after[..., :2, :2])
    angle2 = np.einsum("bnii->bn", after[..., 2:, 2:])
    value, angle, offset = (
        np.exp(0.5 * np.log(x).mean(axis=0)) for x in (angle2 + offset2, angle2, offset2)
    )
    return value, angle, offset


def _by_labels(
    order: Index, cost: Array, probability: Array, belief: Belief, landed: Prospects,
    noise: SensorNoise,
) -> Index:  # fmt: skip
    """The order with the short list's label odds asked and charged; fills both arrays there."""
    short = order[:SHORT_LIST]
    if len(short):
        probability[short] = _label_probability(belief, landed, short, noise)
        cost[short] += MISLABEL_COST * (1.0 - probability[short])
    again = short[np.argsort(cost[short], kind="stable")]
    return np.concatenate([again, order[SHORT_LIST:]])


def _believed_covariance(belief: Belief, place: Geometry, noise: SensorNoise) -> Array:
    """Covariance after touches that land where the believed object says, (N, 4, 4)."""
    N, m = place.kappa_z.shape
    flat = Geometry(*(x.reshape(1, N * m, *x.shape[2:]) for x in vars(place).values()))
    axis = belief.axis
    each = contact_information(flat, axis.point[None], axis.direction[None], noise)
    total = each.reshape(N, m, 5, 5).sum(axis=1)
    return predicted_covariance(total, belief.covariance, noise.direction_offset)


def _pair_bound(theta: Array, place: Geometry, noise: SensorNoise) -> tuple[AxisBound, float]:
    """Bounds of the best pair of each candidate, and the angle of a pair 90 degrees apart."""
    errors = SensorErrors.from_noise(noise, place.kappa_theta.mean(), place.kappa_z.mean())
    radius = 1.0 / place.kappa_theta.mean()
    ideal = float(bound_from_directions(radius, np.pi / 2, errors).angle)
    if theta.shape[1] < 2:
        nothing = np.full(len(theta), np.inf)
        return AxisBound(nothing, np.full(len(theta), np.pi / 2)), ideal
    i, j = np.triu_indices(theta.shape[1], k=1)
    separation = np.abs(np.angle(np.exp(1j * (theta[:, i] - theta[:, j]))))
    pairs = bound_from_directions(radius, separation, errors)
    best = np.argmin(pairs.angle, axis=1)[:, None]
    return AxisBound(
        np.take_along_axis(np.asarray(pairs.position), best, axis=1)[:, 0],
        np.take_along_axis(np.asarray(pairs.angle), best, axis=1)[:, 0],
    ), ideal


def _named(low: Array) -> tuple[str, ...]:
    """The singularity nearest to each candidate in words, "" where none can be."""
    if low.shape[1] < len(SINGULARITIES):
        return ("",) * len(low)
    return tuple(SINGULARITIES[k].words for k in np.argmin(low, axis=1))


def _label_probability(
    belief: Belief, landed: Prospects, chosen: Index, noise: SensorNoise
) -> Array:
    """Mean over a few objects of 1 / (1 + exp(-log odds)), (len(chosen),)."""
    B, N, m = landed.theta.shape
    prior = AxisPrior(belief.axis, belief.covariance, belief.prior.radius, belief.prior.radius_sd)
    objects = np.arange(min(ODDS_OBJECTS, B))
    b, c = (x.ravel() for x in np.meshgrid(objects, chosen, indexing="ij"))

    def pick(x: Array) -> Array:
        return np.asarray(x.reshape(B, N, m, *x.shape[2:])[b, c])

    geometry = Geometry(*(pick(x) for x in vars(landed.geometry).values()))
    expected = Expected(geometry, landed.points[b], landed.directions[b])
    odds = label_log_odds(expected, noise, prior)
    right = 1.0 / (1.0 + np.exp(-np.clip(odds, -50.0, 50.0)))
    mean = right.reshape(len(objects), len(chosen)).mean(axis=0)
    return np.asarray(mean)


def _fallen(
    margins_at: Array, nearest: tuple[str, ...], margin: float
) -> tuple[tuple[str, int], ...]:
    counts: dict[str, int] = {}
    for value, words in zip(margins_at, nearest, strict=True):
        if value < margin:
            counts[words] = counts.get(words, 0) + 1
    return tuple(sorted(counts.items(), key=lambda item: -item[1]))
