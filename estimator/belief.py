"""What is held true of the object, and how a touch changes it: the same type before and after."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from estimator.axis import Axis, chart_lines
from estimator.band import ProfileBand, coarse_band
from estimator.contact import Contact, Miss
from estimator.estimate import AxisEstimate, Hypothesis
from estimator.fusion import estimate_axis
from estimator.prior import AxisPrior
from estimator.profile_readings import ProfileReadings, profile_readings
from estimator.surface import SurfaceOfRevolution
from estimator.vectors import Array, frozen

SURE_HEIGHT = 0.7  # of the believed half height: beyond it a miss may have passed an end


@dataclass(frozen=True, eq=False)
class Belief:
    """A mixture over axes, a profile with a band, and the touches so far.

    Args:
        prior: What was believed before any touch, e.g. by a camera.
        prior_band: The profile believed then; every update conditions it anew.
        hypotheses: Axes with covariance and probability, likeliest first.
        band: The profile about the likeliest axis, z = 0 at that axis' point, also where several
            axes remain. Its spread allows for that axis' own covariance.
        contacts, misses: Every touch so far; the estimate always rests on all of them.
        estimate: What the estimator said of them, None before the first touch.
    """

    prior: AxisPrior
    prior_band: ProfileBand
    hypotheses: tuple[Hypothesis, ...]
    band: ProfileBand
    contacts: tuple[Contact, ...] = ()
    misses: tuple[Miss, ...] = ()
    estimate: AxisEstimate | None = None

    @property
    def axis(self) -> Axis:
        return self.hypotheses[0].axis

    @property
    def covariance(self) -> Array:
        """Of the likeliest axis, in the chart at itself."""
        return self.hypotheses[0].covariance

    @cached_property
    def surface(self) -> SurfaceOfRevolution:
        """The best guess."""
        return SurfaceOfRevolution(self.axis, self.band.profile)


@dataclass(frozen=True, eq=False)
class SampledObjects:
    """Objects drawn from a belief: axis points and directions (B, 3), node radii (B, k)."""

    points: Array
    directions: Array
    z: Array
    radii: Array


def coarse_belief(prior: AxisPrior, z_range: tuple[float, float]) -> Belief:
    """A belief before any touch: an axis prior with a size, and a range of heights.

    Args:
        prior: Its axis' point is z = 0, its direction the sense of z.
        z_range: Where the object's side is believed to begin and end [m].
    Raises:
        ValueError: The range is empty.
    """
    if not z_range[0] < z_range[1]:
        raise ValueError(f"belief z_range: expected low < high, got {z_range}")
    band = coarse_band(prior.radius, prior.radius_sd, z_range)
    start = Hypothesis(prior.axis, prior.covariance, 1.0, 0.0, frozen(np.zeros(0)))
    return Belief(prior, band, (start,), band)


def update(belief: Belief, touches: Iterable[Contact | Miss]) -> Belief:
    """The belief after more touches; a miss is news as well.

    All touches are read together again from the prior, so one by one and all at once agree.
    """
    touches = tuple(touches)
    contacts = belief.contacts + tuple(t for t in touches if isinstance(t, Contact))
    misses = belief.misses + tuple(t for t in touches if isinstance(t, Miss))
    beside = tuple(miss for miss in misses if _beside_wall(miss, belief))
    estimate = estimate_axis(contacts, prior=belief.prior, misses=beside)
    hypotheses = tuple(_with_sense(h, belief.prior.axis) for h in estimate.hypotheses)
    band = belief.prior_band.conditioned(_readings(estimate, hypotheses[0], contacts))
    return replace(
        belief,
        hypotheses=hypotheses,
        band=band,
        contacts=contacts,
        misses=misses,
        estimate=estimate,
    )


def sample_objects(belief: Belief, count: int, *, rng: np.random.Generator) -> SampledObjects:
    """Objects the belief holds possible: hypotheses by their probability, bands by their width.

    About the likeliest axis the profile errs with it (`ProfileBand.by_axis`); about others nobody
    knows how.
    """
    p = np.array([h.probability for h in belief.hypotheses])
    which = rng.choice(len(p), size=count, p=p / p.sum())
    points, directions = np.empty((count, 3)), np.empty((count, 3))
    radii, band = np.empty((count, len(belief.band.z))), belief.band
    for i, hypothesis in enumerate(belief.hypotheses):
        mine = np.nonzero(which == i)[0]
        x = rng.multivariate_normal(np.zeros(4), hypothesis.covariance, size=len(mine))
        axis = hypothesis.axis
        points[mine], directions[mine] = chart_lines(axis.point, axis.direction, x)
        radii[mine] = (
            band.sample_about(x, hypothesis.covariance, rng=rng)
            if i == 0
            else band.sample(len(mine), rng=rng)
        )
    return SampledObjects(points, directions, band.z, radii)


def _with_sense(hypothesis: Hypothesis, reference: Axis) -> Hypothesis:
    """The hypothesis with its direction on the prior's side; the chart's basis turns along.

    `basis_across` gives (e1, e2) at u and (e1, -e2) at -u, and a change of u is minus that of -u.
    """
    if hypothesis.axis.direction @ reference.direction >= 0:
        return hypothesis
    flip = np.diag([1.0, -1.0, -1.0, 1.0])
    axis = Axis(hypothesis.axis.point, -hypothesis.axis.direction)
    covariance = frozen(flip @ hypothesis.covariance @ flip.T)
    return replace(hypothesis, axis=axis, covariance=covariance)


def wall_readings(belief: Belief) -> ProfileReadings:
    """What a belief's contacts told of its band: those on the wall that are not grossly wrong.

    Raises:
        ValueError: Nothing was touched.
    """
    if belief.estimate is None:
        raise ValueError("nothing was touched, so nothing was told of the wall")
    return _readings(belief.estimate, belief.hypotheses[0], belief.contacts)


def _readings(
    estimate: AxisEstimate, hypothesis: Hypothesis, contacts: tuple[Contact, ...]
) -> ProfileReadings:
    right = np.nonzero(estimate.gross_errors < 0.5)[0]
    kept = replace(hypothesis, parallel_rows=frozen(hypothesis.parallel_rows[right]))
    return profile_readings([contacts[i] for i in right], kept, estimate.nuisances)


def _beside_wall(miss: Miss, belief: Belief) -> bool:
    """Whether a finger that met nothing was at a height where the believed object surely is.

    A tilt of the axis changes the height, but never to more than the distance from the middle.
    """
    low, high = belief.prior_band.z[0], belief.prior_band.z[-1]
    axis = belief.prior.axis
    q = miss.tip - axis.point - 0.5 * (low + high) * axis.direction
    tilt_sd = np.sqrt(np.linalg.eigvalsh(belief.prior.covariance[2:, 2:])[-1])
    height = abs(q @ axis.direction) + tilt_sd * np.linalg.norm(np.cross(q, axis.direction))
    return bool(min(height, np.linalg.norm(q)) < SURE_HEIGHT * 0.5 * (high - low))
