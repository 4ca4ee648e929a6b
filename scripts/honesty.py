"""Does the estimator know what it knows? NEES, coverage, label calibration, Cramer-Rao ratios.

Conventions
    x        the true axis in the chart (t1, t2, w1, w2) at the estimated axis [m, m, rad, rad]
    NEES     x^T Sigma^-1 x, chi-square with 4 degrees of freedom where Sigma is true
    covered  NEES below the 95 % point of chi-square(4)
    wrong    determined, and NEES beyond what four sigma is for a Gaussian (tail 6.3e-5), or the
             direction off by over 10 deg: both are told apart
Every proportion carries its 95 % Wilson interval, every other figure a 95 % bootstrap interval.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scenarios import Scenes
from scipy.stats import chi2

from estimator.assumptions import SMOOTH, Roughness
from estimator.batches import AxisEstimates, ContactSets
from estimator.contact import SensorNoise
from estimator.estimate import VERDICTS
from estimator.information import contact_information, predicted_covariance
from estimator.readings import VOID, readings_of_sets
from estimator.vectors import Array, Index, Mask, basis_across

FREEDOM = 4
COVERED = float(chi2.isf(0.05, FREEDOM))
FOUR_SIGMA = float(chi2.isf(6.334e-5, FREEDOM))
FAR = float(np.deg2rad(10.0))
EDGES = (0.0, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99, 1.0)
DETERMINED = VERDICTS.index("determined")


class Interval(NamedTuple):
    """A figure and its 95 % interval."""

    value: float
    low: float
    high: float


class Share(Interval):
    """A proportion and its 95 % interval."""


@dataclass(frozen=True, eq=False)
class Runs:
    """What became of B runs.

    Args:
        error: x, (B, 4).
        nees: (B,).
        angle: Between true and estimated direction [rad], (B,).
        verdict: Index into VERDICTS, (B,).
        p_value: Of the fit, (B,).
        stated: Probability of the likeliest labelling, (B,).
        labelled: Every contact has directions to label, none is umbilic within noise, (B,).
        right: All labels right, (B,).
    """

    error: Array
    nees: Array
    angle: Array
    verdict: Index
    p_value: Array
    stated: Array
    labelled: Mask
    right: Mask

    @property
    def determined(self) -> Mask:
        return np.asarray(self.verdict == DETERMINED)

    def take(self, chosen: Mask | Index) -> Runs:
        return Runs(**{name: value[chosen] for name, value in vars(self).items()})


def joined(runs: list[Runs]) -> Runs:
    """Runs of several cells as one."""
    return Runs(**{name: np.concatenate([vars(r)[name] for r in runs]) for name in vars(runs[0])})


def judged(
    sets: ContactSets, scenes: Scenes, estimates: AxisEstimates, rough: Roughness = SMOOTH
) -> Runs:
    """Estimates against the truth; `rough` is what the estimator was told of the surface."""
    error = charted(estimates.points, estimates.directions, scenes.points, scenes.directions)
    solved = np.linalg.solve(estimates.covariances, error[..., None])[..., 0]
    rows = true_rows(sets, scenes)
    return Runs(
        error=error,
        nees=np.sum(error * solved, axis=1),
        angle=np.linalg.norm(error[:, 2:], axis=1),
        verdict=estimates.verdicts,
        p_value=estimates.p_values,
        stated=estimates.label_probabilities,
        labelled=labelled(sets, rough),
        right=np.all((estimates.parallel_rows < 0.5) == (rows == 1), axis=1),
    )


def charted(origins: Array, u0: Array, points: Array, directions: Array) -> Array:
    """`estimator.axis.to_chart` for lines (B, 3), (B, 3), each in a chart of its own, (B, 4)."""
    u = directions * np.where(np.sum(directions * u0, axis=1) >= 0, 1.0, -1.0)[:, None]
    basis = basis_across(u0)
    sine = np.einsum("bjx,bx->bj", basis, u)
    length = np.linalg.norm(sine, axis=1, keepdims=True)
    cosine = np.sum(u * u0, axis=1, keepdims=True)
    towards = sine / np.maximum(length, 1e-300)
    foot = points - origins
    foot = foot - np.sum(foot * u, axis=1, keepdims=True) * u
    bent = (cosine - 1.0) * np.einsum("bj,bjx->bx", towards, basis) - length * u0
    carried = basis + towards[:, :, None] * bent[:, None]
    t = np.einsum("bjx,bx->bj", carried, foot)
    return np.hstack([t, towards * np.arctan2(length, cosine)])


def true_rows(sets: ContactSets, scenes: Scenes) -> Index:
    """Which row of `directions` is nearer to the true parallel, (B, n)."""
    along = np.einsum("bnix,bnx->bni", sets.directions, scenes.geometry.k_theta)
    return np.argmax(np.abs(along), axis=-1)


def labelled(sets: ContactSets, rough: Roughness) -> Mask:
    """Whether every contact has directions to label: none is held umbilic, (B,)."""
    return np.all(readings_of_sets(sets, rough)[..., VOID] == 0.0, axis=1)


def beyond(runs: Runs) -> Mask:
    """`determined`, and yet beyond four sigma: an error the estimate rules out."""
    return np.asarray(runs.determined & (runs.nees > FOUR_SIGMA))


def far(runs: Runs) -> Mask:
    """`determined`, and yet off by ten degrees: admitted by a wide covariance, or not."""
    return np.asarray(runs.determined & (runs.angle > FAR))


def wrong_shares(runs: Runs) -> dict[str, Share]:
    """`determined` and wrong, of all runs: in either way, and in any."""
    return {
        "beyond 4 sd": proportion(beyond(runs)),
        "over 10 deg": proportion(far(runs)),
        "either": proportion(beyond(runs) | far(runs)),
    }


def mean_nees(runs: Runs) -> Interval:
    """Over determined runs; 4 where the covariance is true."""
    return bootstrap(runs.nees[runs.determined], np.mean)


def mean_nees_within(runs: Runs) -> Interval:
    """The same without runs beyond four sigma, one of which can outweigh all others."""
    nees = runs.nees[runs.determined]
    return bootstrap(nees[nees <= FOUR_SIGMA], np.mean)


def coverage(runs: Runs) -> Share:
    """Of the 95 % regions, over determined runs."""
    return proportion(runs.nees[runs.determined] < COVERED)


@dataclass(frozen=True)
class Bin:
    """Runs whose stated probability of the labels lies in one bin."""

    low: float
    high: float
    count: int
    stated: float
    observed: Share


def calibration(runs: Runs, edges: tuple[float, ...] = EDGES) -> list[Bin]:
    """Stated probability of the likeliest labelling against how often it is right.

    Sets with an umbilic contact, which has no label, are left out.
    """
    stated, right = runs.stated[runs.labelled], runs.right[runs.labelled]
    place = np.clip(np.digitize(stated, edges) - 1, 0, len(edges) - 2)
    return [
        Bin(
            edges[i],
            edges[i + 1],
            int(np.sum(place == i)),
            float(np.mean(stated[place == i])),
            proportion(right[place == i]),
        )
        for i in range(len(edges) - 1)
        if np.any(place == i)
    ]


def cramer_rao(scenes: Scenes, noise: SensorNoise) -> Array:
    """Least covariance of the axis in the chart at the truth, labels known, (B, 4, 4).

    No prior but one so wide (1 m, 10 rad) that it only keeps a free motion finite.
    """
    each = contact_information(scenes.geometry, scenes.points, scenes.directions, noise)
    wide = np.diag([1.0, 1.0, 100.0, 100.0])
    return predicted_covariance(each.sum(axis=1), wide, noise.direction_offset)


@dataclass(frozen=True)
class Efficiency:
    """Root mean square error over its Cramer-Rao bound.

    Args:
        angle, offset: Of the direction, and of the position beside the true axis' point.
        whole: sqrt(mean(x^T bound^-1 x) / 4), every run by its own bound.
    """

    angle: Interval
    offset: Interval
    whole: Interval


def efficiency(error: Array, bound: Array) -> Efficiency:
    """Errors (B, 4) in the chart at the truth against bounds (B, 4, 4)."""
    variances = np.diagonal(bound, axis1=1, axis2=2)
    squares = error**2
    scaled = np.sum(error * np.linalg.solve(bound, error[..., None])[..., 0], axis=1)
    return Efficiency(
        angle=_root_ratio(squares[:, 2:].sum(axis=1), variances[:, 2:].sum(axis=1)),
        offset=_root_ratio(squares[:, :2].sum(axis=1), variances[:, :2].sum(axis=1)),
        whole=_root_ratio(scaled, np.full(len(scaled), float(FREEDOM))),
    )


def _root_ratio(squares: Array, bounds: Array) -> Interval:
    pairs = np.stack([squares, bounds], axis=1)
    return bootstrap(pairs, lambda x, axis: np.sqrt(np.divide(*np.moveaxis(x.mean(axis), -1, 0))))


def proportion(hits: Mask) -> Share:
    """Share of true values with its Wilson score interval; NaN of nothing."""
    count = len(hits)
    if count == 0:
        return Share(np.nan, 0.0, 1.0)
    z, share = 1.959964, float(np.mean(hits))
    middle = (share + z * z / (2 * count)) / (1 + z * z / count)
    half = z * np.sqrt(share * (1 - share) / count + (z / (2 * count)) ** 2) / (1 + z * z / count)
    low, high = max(0.0, float(middle - half)), min(1.0, float(middle + half))
    return Share(share, min(share, low), max(share, high))  # but for rounding


def bootstrap(
    values: Array, statistic: Callable[..., Array], *, resamples: int = 400, seed: int = 0
) -> Interval:
    """A statistic (called with `axis=`) of rows of values, with its bootstrap interval."""
    if len(values) == 0:
        return Interval(np.nan, np.nan, np.nan)
    rng = np.random.default_rng(seed)
    figures = [
        float(statistic(values[rng.integers(len(values), size=len(values))], axis=0))
        for _ in range(resamples)
    ]
    low, high = np.percentile(figures, [2.5, 97.5])
    return Interval(float(statistic(values, axis=0)), float(low), float(high))
