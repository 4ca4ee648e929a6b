"""By what candidates are put in order: the planner's criterion and those it is compared with.

criterion     puts first
information   the least expected error of the axis over the belief, a little of the pair's bound
pair-bound    the best pair by the paper's bound, corrected: the 90-degree rule
d-optimal     the least volume of the axis' covariance over the belief, as textbooks do
uniform       contacts spread most evenly around the object and along it; refuses nothing
random        anything the hand reaches, in no order; refuses nothing

The first three refuse singular triples first.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from estimator.belief import Belief
from estimator.bounds import AxisBound
from estimator.vectors import Array
from planner.goal import Goal

Criterion = Literal["information", "pair-bound", "d-optimal", "uniform", "random"]
REFUSING: tuple[Criterion, ...] = ("information", "pair-bound", "d-optimal")
BOUND_WEIGHT = 0.2


@dataclass(frozen=True, eq=False)
class Merits:
    """What criteria look at, of N candidates with m touches each.

    Args:
        theta, z: Places on the believed surface, (N, m) [rad], [m].
        value: Expected error of the axis after the touches, in goals, (N,).
        after: Covariances after them on B sampled objects, in goals, (B, N, 4, 4).
        bound: Worst case from the best pair, (N,).
        best_bound: The angle of that for a pair 90 degrees apart [rad].
    """

    theta: Array
    z: Array
    value: Array
    after: Array
    bound: AxisBound
    best_bound: float
    belief: Belief
    goal: Goal


def costs(criterion: Criterion, merits: Merits, rng: np.random.Generator | None) -> Array:
    """Of each candidate, the less the better, (N,).

    Raises:
        ValueError: The criterion `random` without an rng.
    """
    if criterion != "random":
        return _COSTS[criterion](merits)
    if rng is None:
        raise ValueError("criterion 'random': an rng is needed to draw the order")
    return rng.permutation(len(merits.theta)).astype(np.float64)


def _information(merits: Merits) -> Array:
    bound = np.log(merits.bound.angle / merits.best_bound)
    return np.asarray(np.log(merits.value) + BOUND_WEIGHT * bound)


def _pair_bound(merits: Merits) -> Array:
    """Logarithm of the angle in its bound; a single touch has none, so all of them are alike."""
    return np.asarray(np.log(merits.bound.angle))


def _d_optimal(merits: Merits) -> Array:
    """Mean over objects of half the logarithm of the determinant."""
    return np.asarray(0.5 * np.linalg.slogdet(merits.after)[1].mean(axis=0))


def _uniform(merits: Merits) -> Array:
    """How far from even, around and along, earlier contacts included.

    The root mean square by which the gaps between meridians differ from a full turn's share, plus
    that by which sorted heights differ from the middles of as many equal parts of the height.
    """
    belief = merits.belief
    theta, z = merits.theta, merits.z
    if belief.contacts:
        surface = belief.surface
        known = surface.cylindrical(np.array([c.position for c in belief.contacts]))
        one = np.ones((len(theta), 1))
        theta = np.hstack([theta, known[0] * one])
        z = np.hstack([z, known[2] * one])
    n = theta.shape[1]
    around = np.sort(np.mod(theta, 2.0 * np.pi), axis=1) / (2.0 * np.pi)
    gaps = np.diff(around, axis=1, append=around[:, :1] + 1.0)
    low, high = belief.surface.profile.z_range
    along = (np.sort(z, axis=1) - low) / (high - low) - (np.arange(n) + 0.5) / n
    return np.asarray(_rms(n * gaps - 1.0) + _rms(along))


def _rms(x: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(x**2, axis=1)))


_COSTS: dict[Criterion, Callable[[Merits], Array]] = {
    "information": _information,
    "pair-bound": _pair_bound,
    "d-optimal": _d_optimal,
    "uniform": _uniform,
}
