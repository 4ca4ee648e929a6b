"""A surface that is known to be rough is believed less, and no more than it deserves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from estimator.assumptions import Assumptions, Roughness
from estimator.axis import Axis
from estimator.fusion import estimate_axes, estimate_axis
from estimator.profile import barrel
from estimator.sensors import SENSORS
from estimator.surface import SurfaceOfRevolution
from sim_sensor.batch_noise import read_sets
from sim_sensor.noise import SimulatedSensor

ROUGH = Roughness(normal=np.deg2rad(1.0), curvature=2.0)
NOISE = SENSORS["gel"]
SURFACE = SurfaceOfRevolution(Axis([0.1, 0.0, 0.0], [0.1, 0.2, 1.0]), barrel(0.03, 3.0, 0.12))


def touched(noise, seed=3, sets=400):
    """Sets of six contacts; they err as `noise` says, the estimator is told NOISE."""
    rng = np.random.default_rng(seed)
    theta, z = rng.uniform(-np.pi, np.pi, (sets, 6)), rng.uniform(-0.05, 0.05, (sets, 6))
    return read_sets(SimulatedSensor(NOISE, noise), SURFACE.at(theta, z), rng=rng)


def test_roughness_counts_as_if_the_sensor_were_that_much_worse() -> None:
    worse = replace(
        NOISE,
        normal=np.hypot(NOISE.normal, ROUGH.normal),
        deviator=np.hypot(NOISE.deviator, ROUGH.curvature),
        mean_curvature=np.hypot(NOISE.mean_curvature, ROUGH.curvature),
    )
    sets = touched(worse, sets=20)
    told = estimate_axes(replace(sets, noise=worse))
    assumed = estimate_axes(sets, assumptions=Assumptions(rough=ROUGH))
    np.testing.assert_allclose(assumed.points, told.points, atol=1e-9)
    np.testing.assert_allclose(assumed.covariances, told.covariances, rtol=1e-6, atol=1e-12)


def test_a_rough_surface_fits_badly_until_its_roughness_is_known() -> None:
    """400 sets of six touches: how many have p < 0.05."""
    sets = touched(replace(NOISE, normal=3.0 * NOISE.normal, deviator=2.5, mean_curvature=2.5))
    trusting = np.mean(estimate_axes(sets).p_values < 0.05)
    known = np.mean(
        estimate_axes(sets, assumptions=Assumptions(rough=Roughness(np.deg2rad(2.0), 2.2))).p_values
        < 0.05
    )
    assert trusting > 0.5
    assert known < 0.1


def test_a_reading_with_its_own_covariance_is_roughened_too() -> None:
    contacts = touched(NOISE, sets=1).take(0)
    sds = [1e-4] * 3 + [0.01] * 2 + [1.7, 1.7, 1.2]
    own = [replace(c, covariance=np.diag(np.square(sds))) for c in contacts]
    smooth, rough = (
        estimate_axis(own, assumptions=Assumptions(rough=r)) for r in (Roughness(), ROUGH)
    )
    assert np.all(np.diag(rough.covariance) > 1.2 * np.diag(smooth.covariance))


@pytest.mark.parametrize("field", ["normal", "curvature"])
def test_roughness_is_a_size(field: str) -> None:
    with pytest.raises(ValueError, match=f"roughness {field}: expected a number >= 0, got -1"):
        Roughness(**{field: -1.0})
