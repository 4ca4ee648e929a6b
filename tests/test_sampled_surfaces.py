"""Many objects at once are the same as one by one."""

import numpy as np
import pytest

from estimator.axis import Axis
from estimator.belief import SampledObjects
from estimator.profile import SplineProfile
from estimator.surface import SurfaceOfRevolution
from estimator.vectors import unit
from planner.choosing.prospects import prospects
from planner.choosing.sampled_surfaces import SampledProfiles, SampledSurfaces

RNG = np.random.default_rng(8)
B, N = 5, 40
Z = np.linspace(-0.06, 0.05, 12)
OBJECTS = SampledObjects(
    RNG.normal(scale=0.3, size=(B, 3)),
    unit(RNG.normal(size=(B, 3))),
    Z,
    0.03 + 0.004 * RNG.normal(size=(B, len(Z))).clip(-2, 2),
)
SURFACES = SampledSurfaces(OBJECTS)
THETA = RNG.uniform(-np.pi, np.pi, (B, N))
HEIGHT = np.concatenate([RNG.uniform(Z[0], Z[-1], (B, N - 3)), np.tile(Z[[0, 5, -1]], (B, 1))], 1)


def one(b):
    axis = Axis(OBJECTS.points[b], OBJECTS.directions[b])
    return SurfaceOfRevolution(axis, SplineProfile(Z, OBJECTS.radii[b]))


def test_profiles_are_the_splines_of_each_object():
    together = SampledProfiles(Z, OBJECTS.radii).derivatives(HEIGHT)
    for b in range(B):
        for many, single in zip(together, one(b).profile.derivatives(HEIGHT[b]), strict=True):
            np.testing.assert_allclose(many[b], single, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("name", ["p", "n", "k_theta", "k_z", "kappa_theta", "kappa_z"])
def test_geometry_is_that_of_each_object(name):
    together = getattr(SURFACES.at(THETA, HEIGHT), name)
    for b in range(B):
        np.testing.assert_allclose(
            together[b], getattr(one(b).at(THETA[b], HEIGHT[b]), name), rtol=1e-9, atol=1e-12
        )


def test_places_come_back_from_points():
    theta, rho, z = SURFACES.cylindrical(SURFACES.at(THETA, HEIGHT).p)
    np.testing.assert_allclose(np.exp(1j * theta), np.exp(1j * THETA), atol=1e-9)
    np.testing.assert_allclose(z, HEIGHT, atol=1e-12)
    np.testing.assert_allclose(rho, SURFACES.profiles.derivatives(HEIGHT)[0], rtol=1e-9)


def test_approaches_end_on_the_walls_they_hit():
    """From 5 mm above a place, straight along its normal: back to that place."""
    place = SURFACES.at(THETA, HEIGHT)
    inner = (HEIGHT > -0.055) & (HEIGHT < 0.045)
    for b in range(B):
        p = place.p[b][:, None] + 0.005 * place.n[b][:, None]
        landed = prospects(OBJECTS, p, place.n[b][:, None], pad=0.0)
        np.testing.assert_array_equal(landed.hit[b, :, 0][inner[b]], True)
        np.testing.assert_allclose(landed.geometry.p[b][inner[b]], place.p[b][inner[b]], atol=1e-6)
