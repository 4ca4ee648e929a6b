"""A coarse camera: what is believed of an object before it is touched, wrong by a stated amount."""

from __future__ import annotations

import numpy as np

from estimator.axis import Axis, from_chart
from estimator.belief import Belief, coarse_belief
from estimator.prior import coarse_prior
from estimator.surface import SurfaceOfRevolution

RADIUS_ERROR = 0.10  # sd of the believed radius, relative
RADIUS_SPREAD = 0.25  # how far a touched place is believed to differ from it, relative
HEIGHT_ERROR = 0.05  # sd of the believed height, relative


def coarse_view(
    surface: SurfaceOfRevolution, *, angle: float, offset: float, rng: np.random.Generator
) -> Belief:
    """A belief whose axis is off by exactly `angle` and `offset`, in random directions.

    It says so: the prior's root mean square errors are these. Its radius is the object's mean
    radius and its height the object's height, each wrong by a few per cent.

    Args:
        surface: The true object.
        angle: Of the axis [rad].
        offset: Of the axis beside the object's middle [m].
    """
    low, high = surface.profile.z_range
    middle = surface.axis.point + 0.5 * (low + high) * surface.axis.direction
    tilt, shift = (np.array([np.cos(a), np.sin(a)]) for a in rng.uniform(-np.pi, np.pi, size=2))
    true = Axis(middle, surface.axis.direction)
    believed = from_chart(true, np.concatenate([offset * shift, angle * tilt]))
    radii = surface.profile.derivatives(np.linspace(low, high, 101))[0]
    radius = float(radii.mean() * (1.0 + np.clip(RADIUS_ERROR * rng.normal(), -0.3, 0.3)))
    height = float((high - low) * (1.0 + np.clip(HEIGHT_ERROR * rng.normal(), -0.15, 0.15)))
    prior = coarse_prior(
        believed, angle=angle, offset=offset, radius=radius, radius_sd=RADIUS_SPREAD * radius
    )
    return coarse_belief(prior, (-0.5 * height, 0.5 * height))
