"""Beliefs to start from: what people have before the first touch.

a pose with a covariance        `belief_from_pose`
a bounding cylinder             `belief_from_cylinder`
a point cloud of one side       `belief_from_points`
nothing but a box               `belief_from_box`
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from estimator.axis import Axis
from estimator.band import ProfileBand
from estimator.belief import Belief, coarse_belief
from estimator.cloud import CloudFit, fit_cloud
from estimator.estimate import Hypothesis
from estimator.prior import AxisPrior, coarse_prior
from estimator.vectors import Array, finite_array, frozen

RADIUS_SPREAD = 0.25  # how far a touched place may differ from a stated radius, relative
CLOUD_SPREAD = 0.05  # likewise from the profile that a cloud showed
CLOUD_ANGLE, CLOUD_OFFSET = float(np.deg2rad(0.5)), 0.5e-3  # what a camera's calibration is off
ANY_DIRECTION = 2.34  # rms angle [rad] at which a Gaussian falls at 90 deg as sin(a)/a does
BOX_RADIUS, BOX_RADIUS_SD = 0.36, 0.09  # of the mean edge, for cylinders 0.5-4 diameters high
BOX_HEIGHT = 0.9  # likewise, half of them are higher


def belief_from_pose(
    axis: Axis,
    covariance: Array,
    *,
    radius: float,
    height: float,
    radius_sd: float | None = None,
) -> Belief:
    """A pose estimate with its covariance.

    Args:
        axis: Its point at the object's middle.
        covariance: Of (t1, t2, w1, w2) in the chart at `axis` (`estimator.axis`), (4, 4).
        radius, height: Of the object's side [m].
        radius_sd: How far a touched place may differ from `radius`; None is a quarter of it [m].
    Raises:
        ValueError: No covariance, or lengths that are not positive.
    """
    _require_length("height", height)
    _require_length("radius", radius)
    sd = RADIUS_SPREAD * radius if radius_sd is None else radius_sd
    prior = AxisPrior(axis, covariance, radius, sd)
    return coarse_belief(prior, (-0.5 * height, 0.5 * height))


def belief_from_cylinder(
    point: ArrayLike,
    direction: ArrayLike,
    *,
    radius: float,
    height: float,
    angle: float,
    offset: float,
    radius_sd: float | None = None,
) -> Belief:
    """A bounding cylinder, and how far off it may be.

    Args:
        point: Middle of the cylinder, world [m], (3,).
        direction: Along its axis, either sense, (3,).
        radius, height: [m].
        angle, offset: Root mean square errors of its axis [rad], [m].
        radius_sd: As for `belief_from_pose`.
    Raises:
        ValueError: A direction of length zero, or lengths and errors that are not positive.
    """
    for name, value in (("angle", angle), ("offset", offset)):
        _require_length(name, value)
    axis = Axis(finite_array("point", point, (3,)), finite_array("direction", direction, (3,)))
    variances = 0.5 * np.array([offset, offset, angle, angle]) ** 2
    return belief_from_pose(
        axis, np.diag(variances), radius=radius, height=height, radius_sd=radius_sd
    )


def belief_from_box(lower: ArrayLike, upper: ArrayLike) -> Belief:
    """Nothing known but a box about the object, edges along the world's axes.

    Any direction is as likely as any other; radius and height are those of upright and tilted
    cylinders that just fit into such a box, which they do within a third. The mean axis stands
    along the edge whose two others are most alike, which matters little.

    Args:
        lower, upper: Two corners [m], (3,).
    Raises:
        ValueError: An edge is not positive.
    """
    low, high = finite_array("box lower", lower, (3,)), finite_array("box upper", upper, (3,))
    edges = high - low
    if np.any(edges <= 0.0):
        raise ValueError(f"box: expected lower < upper in every coordinate, got edges {edges} m")
    odd = int(np.argmin([abs(edges[(i + 1) % 3] - edges[(i + 2) % 3]) for i in range(3)]))
    mean = float(np.mean(edges))
    prior = coarse_prior(
        Axis(0.5 * (low + high), np.eye(3)[odd]),
        angle=ANY_DIRECTION,
        offset=0.15 * mean,
        radius=BOX_RADIUS * mean,
        radius_sd=BOX_RADIUS_SD * mean,
    )
    half = 0.5 * BOX_HEIGHT * mean
    return coarse_belief(prior, (-half, half))


def belief_from_points(
    points: Array, *, normals: Array | None = None, noise: float = 1e-3
) -> Belief:
    """A point cloud of one side: axis and profile fitted, with their uncertainty.

    `estimator.cloud.fit_cloud` says more, e.g. what the side that was seen leaves open.

    Args:
        points: Of the object alone, world [m], (N, 3), 30 or more.
        normals: If there are any, signs free, (N, 3).
        noise: Sd of a point, at least [m].
    Raises:
        ValueError: Too few points, or points on a plane or a sphere, which have no one axis.
    """
    return belief_from_cloud(fit_cloud(points, normals=normals, noise=noise))


def belief_from_cloud(fit: CloudFit) -> Belief:
    """The belief that a fitted cloud gives; a camera's calibration widens it a little."""
    calibration = 0.5 * np.array([CLOUD_OFFSET] * 2 + [CLOUD_ANGLE] * 2) ** 2
    covariance = fit.covariance + np.diag(calibration)
    radius = float(np.mean(fit.radii))
    spread = float(np.hypot(np.std(fit.radii), CLOUD_SPREAD * radius))
    prior = AxisPrior(fit.axis, covariance, radius, spread)
    gap = (fit.z[:, None] - fit.z) / (0.3 * (fit.z[-1] - fit.z[0]))
    shape = (CLOUD_SPREAD * radius) ** 2 * np.exp(-0.5 * gap**2)
    band = ProfileBand(fit.z, fit.radii, frozen(fit.radii_covariance + shape))
    start = Hypothesis(fit.axis, prior.covariance, 1.0, 0.0, frozen(np.zeros(0)))
    return Belief(prior, band, (start,), band)


def _require_length(name: str, value: float) -> None:
    if not (np.isfinite(value) and value > 0.0):
        raise ValueError(f"belief {name}: expected a number > 0, got {value}")
