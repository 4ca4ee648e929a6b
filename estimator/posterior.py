"""The density whose peaks are the possible axes, and the batched climb to those peaks.

Given the axis, contacts are independent, so their labels are summed out one by one:

    p(line | contacts) ~ prior(line) prod_i  1/2 [ p(contact_i | line, label 0) + ... label 1) ]

and nothing has to enumerate 2^n labellings. A labelling may also be held fixed, which reaches the
best line of *each* labelling, also of those the sum would drown.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from estimator.contact import Miss
from estimator.likelihood import Lines, Terms, evaluate
from estimator.prior import (
    AxisPrior,
    LineTerms,
    location_terms,
    miss_terms,
    offset_terms,
    prior_terms,
)
from estimator.readings import Readings
from estimator.vectors import Array, Index, Mask

LARGEST_TURN = 0.3  # of one step [rad]


@dataclass(frozen=True, eq=False)
class Posterior:
    """Readings with everything else that bears on the line.

    Args:
        readings: Contacts as arrays.
        origin: Reference point: the charts' origins are its feet [m], (3,).
        spread: Length scale of the contacts [m]; without a prior the line is expected within
            about twice this from them.
        prior: What is believed of the axis, if anything.
        misses: Where fingers met nothing.
    """

    readings: Readings
    origin: Array
    spread: float
    prior: AxisPrior | None = None
    misses: tuple[Miss, ...] = ()

    def background(self, lines: Lines) -> LineTerms:
        """Everything but the contacts."""
        terms = offset_terms(self.readings.var_offset, lines)
        if self.prior is None:
            return terms + location_terms(self.origin, 2.0 * self.spread, lines)
        terms = terms + prior_terms(self.prior, lines)
        return terms + miss_terms(self.misses, self.prior.radius, self.prior.radius_sd, lines)

    def at(self, lines: Lines, labels: Index | None = None) -> LineTerms:
        """Cost, gradient and information; labels (S, n) fixed, or summed out where None."""
        return self.background(lines) + over_contacts(evaluate(self.readings, lines), labels)

    def take(self, index: Index) -> Posterior:
        """The rows of batched readings that belong to some of the lines."""
        return replace(self, readings=self.readings.take(index))


def over_contacts(terms: Terms, labels: Index | None) -> LineTerms:
    """Sum contacts up under fixed labels, or with the labels summed out."""
    if labels is None:
        weights = label_weights(terms)
        cost = -np.logaddexp(-terms.cost[..., 0], -terms.cost[..., 1])
    else:
        weights = np.eye(2)[labels.astype(int)]
        cost = np.sum(weights * terms.cost, axis=-1)
    return LineTerms(
        cost.sum(axis=1) + terms.cost.shape[1] * np.log(2.0),
        np.einsum("snl,snlp->sp", weights, terms.gradient),
        np.einsum("snl,snlpq->spq", weights, terms.fisher),
    )


def label_weights(terms: Terms) -> Array:
    """Probability of each row being the parallel's, given the line, (S, n, 2)."""
    odds = np.clip(terms.cost[..., 1] - terms.cost[..., 0], -500.0, 500.0)
    first = 1.0 / (1.0 + np.exp(-odds))
    return np.stack([first, 1.0 - first], axis=-1)


def climb(
    posterior: Posterior,
    start: Lines,
    labels: Index | None = None,
    *,
    iterations: int = 40,
    gain_at_rest: float = 1e-7,
) -> tuple[Lines, LineTerms]:
    """Fisher scoring with Levenberg's damping, all starts at once.

    A step is taken only where the full cost (log determinants included) falls.

    Returns:
        Where each start ended (its point at the foot of the origin), and the terms there.
    """
    origin = posterior.origin
    lines = start.moved(np.zeros((len(start.a), 5)), origin)
    terms = posterior.at(lines, labels)
    damping = np.full(len(lines.a), 1e-3)
    active = np.arange(len(lines.a))
    for _ in range(iterations):
        step = _damped_step(terms, damping, active, posterior.spread)
        trial = lines.take(active).moved(step, origin)
        here = labels[active] if labels is not None else None
        found = posterior.take(active).at(trial, here)
        gain = terms.cost[active] - found.cost
        better = gain > 0
        lines = _replaced(lines, active[better], trial, better)
        terms = _replaced_terms(terms, active[better], found, better)
        damping[active] = np.where(better, 0.2, 8.0) * damping[active]
        resting = (better & (gain < gain_at_rest)) | (damping[active] > 1e7)
        active = active[~resting]
        if len(active) == 0:
            break
        damping = np.maximum(damping, 1e-9)
    return lines, terms


def _damped_step(terms: LineTerms, damping: Array, active: Index, spread: float) -> Array:
    units = np.array([spread, spread, 1.0, 1.0, 1.0])
    fisher = terms.fisher[active] * units[:, None] * units
    gradient = terms.gradient[active] * units
    diagonal = np.einsum("spp->sp", fisher)
    lifted = damping[active, None] * (diagonal + 1.0) + 1e-9
    step = -np.linalg.solve(fisher + lifted[..., None] * np.eye(5), gradient[..., None])[..., 0]
    longest = np.max(np.abs(step[:, :4]) / [1.5, 1.5, LARGEST_TURN, LARGEST_TURN], axis=1)
    return np.asarray(step / np.maximum(longest, 1.0)[:, None] * units)


def _replaced(lines: Lines, where: Index, trial: Lines, chosen: Mask) -> Lines:
    a, u, delta = lines.a.copy(), lines.u.copy(), lines.delta.copy()
    a[where], u[where], delta[where] = trial.a[chosen], trial.u[chosen], trial.delta[chosen]
    return Lines(a, u, delta)


def _replaced_terms(terms: LineTerms, where: Index, found: LineTerms, chosen: Mask) -> LineTerms:
    cost, gradient, fisher = terms.cost.copy(), terms.gradient.copy(), terms.fisher.copy()
    cost[where], gradient[where] = found.cost[chosen], found.gradient[chosen]
    fisher[where] = found.fisher[chosen]
    return LineTerms(cost, gradient, fisher)
