"""The rank test and our estimator on the triples of Table 8: what is found, and how far off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from paper_experiments import INCH, Experiment, errors_of

from estimator.axis import Axis
from estimator.fusion import estimate_axis
from estimator.matching import RankVerdicts, pyramid_axes, rank_verdicts
from estimator.planes import Origin, labellings, plane_stacks
from estimator.vectors import unit

Array = NDArray[np.float64]

MACHINE = np.zeros(3)
TEN = (1, 2, 3, 4, 5, 6, 7, 8, 9, 12)  # contact 12 represents 10 and 11
TRIPLES = tuple(combinations([number - 1 for number in TEN], 3))
CORRECT_DEG = 20.0  # "gave the correct axis": between the clusters at 0 and at 80 = 180 - 100


@dataclass(frozen=True, eq=False)
class Accepted:
    """Axes that a method gives for some of the 120 triples.

    Args:
        outcomes: Of all triples.
        angle, distance: Of each accepted axis from the true one [deg], [in].
        right: Whether its labels are.
        triples: Which they were, indices into TRIPLES.
    """

    outcomes: NDArray[np.str_]
    angle: Array
    distance: Array
    right: NDArray[np.bool_]
    triples: tuple[int, ...]

    @property
    def correct(self) -> NDArray[np.bool_]:
        """Near the true axis, in the paper's sense."""
        return self.angle < CORRECT_DEG

    @property
    def success(self) -> NDArray[np.bool_]:
        """Below 10 degrees and 0.3 inch, what the paper calls usual."""
        return (self.angle < 10.0) & (self.distance < 0.3)

    def count(self, outcome: str) -> int:
        return int(np.sum(self.outcomes == outcome))


def rank_test(
    experiment: Experiment, tolerance: float, *, origin: Origin = MACHINE, unit_in: float = 1.0
) -> Accepted:
    """The paper's: the triples with a unique labelling, and the axis of their pyramid."""
    verdicts, points, directions = _pyramids(
        experiment.estimated["p"], experiment.directions, tolerance, origin, unit_in
    )
    unique = np.flatnonzero(verdicts.outcome == "unique")
    chosen = [int(np.argmax(verdicts.line[t])) for t in unique]
    axes = [Axis(points[t, i], directions[t, i]) for t, i in zip(unique, chosen, strict=True)]
    right = [
        labellings(3)[i] == experiment.labelling_of(TRIPLES[t])
        for t, i in zip(unique, chosen, strict=True)
    ]
    return _accepted(experiment, verdicts.outcome, axes, right, unique.tolist())


def own_estimates(experiment: Experiment) -> Accepted:
    """Ours: the likeliest axis of every triple, whatever the verdict; outcomes are verdicts."""
    found = [estimate_axis([experiment.contacts[i] for i in triple]) for triple in TRIPLES]
    axes = [in_inches(e.axis) for e in found]
    right = [
        e.labellings[0][0] == experiment.labelling_of(t)
        for e, t in zip(found, TRIPLES, strict=True)
    ]
    outcomes = np.array([str(e.verdict) for e in found])
    return _accepted(experiment, outcomes, axes, right, range(len(TRIPLES)))


def counts_under_rounding(
    experiment: Experiment, tolerance: float, *, draws: int, rng: np.random.Generator
) -> tuple[tuple[int, int], tuple[int, int]]:
    """Range of how many triples are unique, and how many of those correct, as digits move."""
    unique, correct = [], []
    for _ in range(draws):
        positions = experiment.estimated["p"]
        positions = positions + rng.uniform(-0.005, 0.005, positions.shape)
        k = experiment.directions + rng.uniform(-0.005, 0.005, experiment.directions.shape)
        verdicts, _, directions = _pyramids(positions, unit(k), tolerance, MACHINE, 1.0)
        accepted = verdicts.outcome == "unique"
        u = directions[accepted, np.argmax(verdicts.line[accepted], axis=-1)]
        near = np.abs(u @ experiment.truth.direction) > np.cos(np.deg2rad(CORRECT_DEG))
        unique.append(int(accepted.sum()))
        correct.append(int(near.sum()))
    return (min(unique), max(unique)), (min(correct), max(correct))


def in_inches(axis: Axis) -> Axis:
    """An axis in metres, as one in inches."""
    return Axis(axis.point / INCH, axis.direction)


def _pyramids(
    positions: Array, directions: Array, tolerance: float, origin: Origin, unit_in: float
) -> tuple[RankVerdicts, Array, Array]:
    """Of all triples: verdicts, and each labelling's axis as points [in] and directions."""
    index = np.array(TRIPLES)
    stacks = plane_stacks(positions[index], directions[index], origin=origin, unit=unit_in)
    return rank_verdicts(stacks, tolerance=tolerance), *pyramid_axes(stacks)


def _accepted(
    experiment: Experiment,
    outcomes: NDArray[np.str_],
    axes: Sequence[Axis],
    right: Sequence[bool],
    triples: Sequence[int],
) -> Accepted:
    errors = np.array([errors_of(axis, experiment.truth) for axis in axes]).reshape(-1, 2)
    return Accepted(outcomes, errors[:, 0], errors[:, 1], np.array(right, bool), tuple(triples))
