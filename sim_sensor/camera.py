"""Cameras: what is known of an object before it is touched, wrong by a stated amount."""

from __future__ import annotations

import numpy as np

from estimator.axis import Axis, from_chart
from estimator.belief import Belief, coarse_belief
from estimator.prior import coarse_prior
from estimator.surface import SurfaceOfRevolution
from estimator.vectors import Array

RADIUS_ERROR = 0.10  # sd of the believed radius, relative
RADIUS_SPREAD = 0.25  # how far a touched place is believed to differ from it, relative
HEIGHT_ERROR = 0.05  # sd of the believed height, relative
GRAZING = float(np.cos(np.deg2rad(80.0)))  # least cosine to the line of sight that is seen


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


def depth_view(
    surface: SurfaceOfRevolution,
    *,
    towards: Array,
    noise: float = 1e-3,
    count: int = 600,
    rng: np.random.Generator,
) -> Array:
    """Points of the side that a depth camera sees, each off along the line of sight, (N, 3) [m].

    Places are even over heights and angles; those turned away by more than 80 degrees are not
    seen, so that fewer than `count` come out.

    Args:
        surface: The true object.
        towards: From the object to the camera, far away, (3,).
        noise: Sd of a point [m].
    Raises:
        ValueError: A direction of no length, or noise that is negative.
    """
    if not (np.isfinite(noise) and noise >= 0.0):
        raise ValueError(f"depth_view noise: expected a number >= 0 m, got {noise}")
    if not np.linalg.norm(towards) > 0.0:
        raise ValueError(f"depth_view towards: expected a direction, got {towards}")
    sight = np.asarray(towards, dtype=np.float64) / np.linalg.norm(towards)
    low, high = surface.profile.z_range
    place = surface.at(rng.uniform(-np.pi, np.pi, count), rng.uniform(low, high, count))
    seen = place.n @ sight > GRAZING
    return np.asarray(place.p[seen] + noise * rng.normal(size=(int(seen.sum()), 1)) * sight)


def box_view(surface: SurfaceOfRevolution) -> tuple[Array, Array]:
    """Corners of the box along the world's axes that just holds the object, (3,) each [m]."""
    z = np.linspace(*surface.profile.z_range, 101)
    r = surface.profile.derivatives(z)[0][:, None]
    u = surface.axis.direction
    middle, half = surface.axis.point + z[:, None] * u, r * np.sqrt(1.0 - u**2)
    return np.min(middle - half, axis=0), np.max(middle + half, axis=0)
