"""What an estimate says: an axis, how sure, which others remain, and a verdict in words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from estimator.axis import Axis
from estimator.planes import Labelling
from estimator.vectors import Array

Verdict = Literal["determined", "ambiguous", "undetermined"]
VERDICTS: tuple[Verdict, ...] = ("determined", "ambiguous", "undetermined")

CHI_95 = 2.4477  # radius of the 95 % disc of a plane Gaussian, in standard deviations


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One axis that explains the touches.

    Args:
        axis: Its point is the chart's origin.
        covariance: Of (t1, t2, w1, w2) in the chart at `axis` [m, m, rad, rad], (4, 4).
        probability: Against the other hypotheses.
        direction_offset: Common rotation of the first sensor's directions at this axis [rad].
        parallel_rows: For each contact the probability that row 0 is the parallel's, (n,).
    """

    axis: Axis
    covariance: Array
    probability: float
    direction_offset: float
    parallel_rows: Array

    @property
    def angle_95(self) -> float:
        """The direction is off by no more than this with 95 % probability [rad]."""
        sd = float(np.sqrt(np.linalg.eigvalsh(self.covariance[2:, 2:])[-1]))
        return min(CHI_95 * sd, 0.5 * np.pi)  # two lines are never farther apart

    @property
    def offset_95(self) -> float:
        """The axis passes `axis.point` no farther than this with 95 % probability [m]."""
        return CHI_95 * float(np.sqrt(np.linalg.eigvalsh(self.covariance[:2, :2])[-1]))


@dataclass(frozen=True, eq=False)
class FreeMotion:
    """A motion of the axis that the touches leave open.

    Args:
        pivot: A point of the axis that it does not move, for a shift any point [m], (3,).
        shift: Where it moves the axis' point, across the axis [m], (3,).
        tilt: Rotation vector of the axis about the pivot [rad], (3,).

    Shift and tilt are one standard deviation of it, as the touches alone limit them.
    """

    pivot: Array
    shift: Array
    tilt: Array


@dataclass(frozen=True, eq=False)
class Nuisance:
    """What an estimate found out about the sensor or the finger besides the axis.

    Args:
        name: "direction_offset" [rad], "scale_offset" [-] or "position_bias" [m].
        owner: Name of the sensor or finger.
        mean, sd: Shape (1,), for the position bias (3,) in the world.
    """

    name: str
    owner: str
    mean: Array
    sd: Array


@dataclass(frozen=True, eq=False)
class TellingContact:
    """Where to touch next, to find out which axis is right.

    Args:
        position: On the surface that the likeliest axis predicts, world [m], (3,).
        normal: Outward normal expected there; the finger comes along its opposite, (3,).
        log_odds: Expected after that touch, of the axis that is right against all others; no
            more than 8. A forecast from a smooth profile and readings without noise.
        pair: The two hypotheses it tells apart, as indices: the likeliest and its first rival.
    """

    position: Array
    normal: Array
    log_odds: float
    pair: tuple[int, int]


@dataclass(frozen=True, eq=False)
class AxisEstimate:
    """The axis, with everything that must be known before it is trusted.

    Args:
        hypotheses: Distinct axes, likeliest first; probabilities sum to at most one.
        labellings: Each labelling with its probability, likeliest first, those below 1e-4
            left out.
        verdict: `determined`: one axis, every part of it fixed by the touches. `ambiguous`:
            several axes fit. `undetermined`: some motion of the axis is free.
        reasons: Why, in words.
        p_value: How often a true surface of revolution would fit worse than this one.
        free_motions: Of the likeliest axis, freest first.
        nuisances: What else was estimated, at the likeliest axis.
        gross_errors: Probability that each contact is grossly wrong, (n,).
        telling: Where to touch next to tell several axes apart, where `ambiguous`.
    """

    hypotheses: tuple[Hypothesis, ...]
    labellings: tuple[tuple[Labelling, float], ...]
    verdict: Verdict
    reasons: tuple[str, ...]
    p_value: float
    free_motions: tuple[FreeMotion, ...]
    nuisances: tuple[Nuisance, ...]
    gross_errors: Array
    telling: TellingContact | None = None

    @property
    def best(self) -> Hypothesis:
        return self.hypotheses[0]

    @property
    def axis(self) -> Axis:
        """The likeliest axis; its point is the foot of the contacts' (or prior's) middle."""
        return self.best.axis

    @property
    def covariance(self) -> Array:
        """Of the likeliest axis in the chart at itself (`estimator.axis`), (4, 4)."""
        return self.best.covariance

    @property
    def angle_95(self) -> float:
        return self.best.angle_95

    @property
    def offset_95(self) -> float:
        return self.best.offset_95
