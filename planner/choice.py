"""Which touches: refuse the singular over the whole belief, rank the rest.

The rule "three contacts about 90 degrees apart in meridian, never opposite, avoiding shared
parallels and normals that meet on the axis" has three parts here. Singular triples are refused
with a margin that holds for nine in ten objects drawn from the belief. The corrected bound of
eqs (64)-(72) for the best *pair* prefers pairs near 90 degrees. The third contact follows what it
is worth: the expected error of the axis after the touches, misses included, and the odds that the
labels come out right.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from estimator.belief import Belief, SampledObjects
from estimator.bounds import AxisBound, SensorErrors, bound_from_directions
from estimator.contact import SensorNoise
from estimator.information import (
    Expected,
    contact_information,
    label_log_odds,
    predicted_covariance,
)
from estimator.prior import AxisPrior
from estimator.singular import SINGULARITIES, margins
from estimator.surface import Geometry
from estimator.vectors import Array, Index
from planner.candidates import Candidates
from planner.goal import Goal
from planner.prospects import Prospects, prospects, with_earlier

MARGIN = 0.08  # from every singularity, in nine of ten sampled objects
DOUBTFUL_OBJECTS = 0.1
BOUND_WEIGHT = 0.2
MISLABEL_COST = 4.0  # a wrong labelling is this much worse, as a logarithm of error
SHORT_LIST = 20
ODDS_OBJECTS = 2


@dataclass(frozen=True, eq=False)
class Ranking:
    """Candidates in order of merit, best first; arrays over them.

    Args:
        order: Indices into the candidates.
        cost: What the order goes by: the logarithm of the expected error in goals, and what the
            bound and doubtful labels add.
        angle, offset: Expected error of the axis after the touches [rad], [m].
        covariance: Predicted for the believed object, (N, 4, 4).
        pair_bound: Worst case of the axis from the best pair, eqs (64)-(72) corrected.
        margin: From the nearest singularity in nine of ten objects [-]; infinite for fewer than
            three contacts.
        nearest: That singularity in words.
        label_probability: That the labels come out right by these touches alone; NaN where that
            was not asked, or earlier contacts help.
        hit: Share of the touches that land.
        rejected: How many candidates fell here, by reason.
    """

    order: Index
    cost: Array
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
    belief: Belief,
    samples: SampledObjects,
    noise: SensorNoise,
    goal: Goal,
    *,
    margin: float = MARGIN,
    offset_guard: float = 0.0,
) -> Ranking:
    """Refuse and rank.

    Args:
        samples: Objects drawn from the belief.
        margin: Smallest margin from a singularity; zero ranks all.
        offset_guard: Common rotation of the directions that the expected error reckons with beside
            what the sensor admits [rad]; bound and predicted covariance are the sensor's own.
    """
    place = belief.surface.at(candidates.theta, candidates.z)
    landed = prospects(samples, place.p, place.n)
    common = float(np.hypot(noise.direction_offset, offset_guard))
    guarded = replace(noise, direction_offset=common)
    value, angle, offset = _expected_error(belief, landed, guarded, goal)
    covariance = _believed_covariance(belief, place, noise)
    bound, best_bound = _pair_bound(candidates.theta, place, noise)
    margins_at, nearest = _margins(belief, landed, samples)
    cost = np.log(value) + BOUND_WEIGHT * np.log(bound.angle / best_bound)
    kept = np.nonzero(margins_at >= margin)[0]
    order = kept[np.argsort(cost[kept], kind="stable")].astype(np.intp)
    short = order[:SHORT_LIST]
    probability = np.full(len(cost), np.nan)
    if len(short) and candidates.theta.shape[1] > 1 and not belief.contacts:
        probability[short] = _label_probability(belief, landed, short, noise)
        cost[short] += MISLABEL_COST * (1.0 - probability[short])
    order = np.concatenate([short[np.argsort(cost[short], kind="stable")], order[SHORT_LIST:]])
    return Ranking(
        order, cost, angle, offset, covariance, bound, margins_at, nearest, probability,
        landed.hit.mean(axis=(0, 2)), _fallen(margins_at, nearest, margin),
    )  # fmt: skip


def _expected_error(
    belief: Belief, landed: Prospects, noise: SensorNoise, goal: Goal
) -> tuple[Array, Array, Array]:
    """Geometric mean over objects: in goals, of direction [rad], of position [m].

    The mean of the logarithm is the expected information. A mean square would be ruled by the few
    objects that a finger misses, and would huddle the touches where nothing can be missed.
    """
    B, N, m = landed.theta.shape
    each = contact_information(landed.geometry, landed.points, landed.directions, noise)
    each = each.reshape(B, N, m, 5, 5) * landed.hit[..., None, None]
    after = predicted_covariance(each.sum(axis=2), belief.covariance, noise.direction_offset)
    offset2 = np.einsum("bnii->bn", after[..., :2, :2])
    angle2 = np.einsum("bnii->bn", after[..., 2:, 2:])
    squares = (angle2 / goal.angle**2 + offset2 / goal.offset**2, angle2, offset2)
    value, angle, offset = (np.exp(0.5 * np.log(x).mean(axis=0)) for x in squares)
    return value, angle, offset


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


def _margins(
    belief: Belief, landed: Prospects, samples: SampledObjects
) -> tuple[Array, tuple[str, ...]]:
    """Margin that nine of ten sampled objects keep, and what it is kept from.

    Of the triple that the touches make together with the contacts there already are; with more
    than three contacts in all no single triple has to be good.
    """
    N = landed.theta.shape[1]
    earlier = np.array([c.position for c in belief.contacts]).reshape(-1, 3)
    triples = with_earlier(landed, samples, earlier)
    if triples is None:
        return np.full(N, np.inf), ("",) * N
    low = np.quantile(margins(triples).values, DOUBTFUL_OBJECTS, axis=0)  # (N, K)
    nearest = np.argmin(low, axis=1)
    return low.min(axis=1), tuple(SINGULARITIES[k].words for k in nearest)


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
