"""What touches not yet made would tell, against Monte Carlo and against the estimator itself."""

from dataclasses import replace

import numpy as np
import pytest

from estimator.axis import Axis, from_chart, to_chart
from estimator.bounds import tilt_gains
from estimator.fusion import estimate_axis
from estimator.information import (
    Expected,
    contact_information,
    label_log_odds,
    predicted_covariance,
    with_untold_rotation,
)
from estimator.prior import coarse_prior
from estimator.profile import barrel, cone, cylinder
from estimator.sensors import SENSORS
from estimator.surface import Geometry, Place, SurfaceOfRevolution
from sim_sensor.noise import simulated_sensor

AXIS = Axis(np.array([0.4, 0.1, 0.2]), np.array([0.3, -0.2, 0.9]))
PRIOR = coarse_prior(AXIS, angle=0.26, offset=0.015, radius=0.033, radius_sd=0.008)
WRAPPED = ((0.0, -0.016), (2.1, 0.0), (4.2, 0.016))


def geometry(profile, places):
    surface = SurfaceOfRevolution(AXIS, profile)
    theta, z = np.array(places).T
    return surface.at(theta[None], z[None])


def information(profile, places, noise):
    each = contact_information(
        geometry(profile, places), AXIS.point[None], AXIS.direction[None], noise
    )
    return each[0].sum(axis=0)


@pytest.mark.parametrize("profile", [cylinder(0.033, 0.1), barrel(0.033, 3.0, 0.1)])
def test_predicted_covariance_is_the_scatter_of_the_estimates(profile):
    """120 noisy sessions; every variance within 40 % (its own sd is 13 %)."""
    noise = SENSORS["gel"]
    predicted = predicted_covariance(information(profile, WRAPPED, noise), PRIOR.covariance, 0.0)
    surface = SurfaceOfRevolution(AXIS, profile)
    x = []
    for seed in range(120):
        rng = np.random.default_rng(seed)
        drawn = np.sqrt(np.diag(PRIOR.covariance)) * rng.normal(size=4)
        prior = replace(PRIOR, axis=from_chart(AXIS, drawn))
        session = simulated_sensor("gel").session(rng=rng)
        contacts = [session.read(surface.at(np.array(t), np.array(z)), rng=rng) for t, z in WRAPPED]
        x.append(to_chart(AXIS, estimate_axis(contacts, prior=prior).axis))
    scatter = np.array(x).T @ np.array(x) / len(x)
    np.testing.assert_allclose(np.diag(scatter), np.diag(predicted), rtol=0.4)


def test_information_of_directions_alone_has_the_papers_tilt_gain():
    """(0, 120, 240) on a cylinder: rms tilt 1.1547 s, common offset 0 (theory.md 4.3)."""
    s = np.deg2rad(1.0)
    noise = replace(
        SENSORS["gel"], position=1e-6, normal=10.0, direction=s, deviator=0.0,
        mean_curvature=1e6, flat=1e6, curvature_scale=0.0,
    )  # fmt: skip
    theta = np.array([0.0, 2 * np.pi / 3, 4 * np.pi / 3])
    places = np.column_stack([theta, np.zeros(3)])
    J = information(cylinder(0.033, 0.1), places, noise)
    covariance = np.linalg.inv(J[2:4, 2:4])
    assert np.sqrt(np.trace(covariance)) / s == pytest.approx(1.1547, abs=1e-3)
    assert float(tilt_gains(theta).rms) == pytest.approx(1.1547, abs=1e-4)


def test_information_adds():
    profile, noise = cone(0.033, 0.2, 0.1), SENSORS["taxel"]
    whole = information(profile, WRAPPED, noise)
    parts = sum(information(profile, [place], noise) for place in WRAPPED)
    np.testing.assert_allclose(whole, parts, rtol=1e-10)


def odds(profile, places, noise, prior=None):
    g = geometry(profile, places)
    expected = Expected(g, AXIS.point[None], AXIS.direction[None])
    return float(label_log_odds(expected, noise, prior)[0])


def test_wrapped_heights_apart_can_be_labelled_and_one_parallel_cannot():
    """By directions: magnitudes are switched off, as in the paper."""
    blind = replace(SENSORS["gel"], mean_curvature=1e5, flat=1e5)
    assert odds(cylinder(0.033, 0.1), WRAPPED, blind, PRIOR) > 10.0
    equal = [(t, 0.0) for t, _ in WRAPPED]
    assert odds(cylinder(0.033, 0.1), equal, blind) < 1.0


def test_odds_agree_with_the_estimators_label_probability():
    """Log odds below and above zero must be those of exact contacts read by the estimator."""
    blind = replace(SENSORS["gel"], mean_curvature=1e5, flat=1e5)
    surface = SurfaceOfRevolution(AXIS, cylinder(0.033, 0.1))
    for places in (WRAPPED, ((0.0, 0.0), (1.2, 0.0005), (2.4, 0.015))):
        contacts = [surface.contact(Place(t, z), blind) for t, z in places]
        labellings = {str(k): p for k, p in estimate_axis(contacts, prior=PRIOR).labellings}
        right = labellings.get("000", 0.0)
        wrong = max([p for k, p in labellings.items() if k != "000"], default=1e-4)
        told = odds(cylinder(0.033, 0.1), places, blind, PRIOR)
        assert (told > 3.0) == (np.log(max(right, 1e-9) / wrong) > 3.0)


def test_many_problems_at_once_are_the_same_as_one_by_one():
    noise = SENSORS["gel"]
    sets = [
        WRAPPED,
        ((0.0, -0.01), (1.0, 0.0), (2.5, 0.01)),
        ((0.0, 0.0), (1.6, 0.02), (4.0, -0.02)),
    ]
    parts = [geometry(barrel(0.033, 3.0, 0.1), places) for places in sets]
    stacked = Geometry(*(np.concatenate([getattr(g, f) for g in parts]) for f in vars(parts[0])))
    points = np.repeat(AXIS.point[None], 3, axis=0)
    directions = np.repeat(AXIS.direction[None], 3, axis=0)
    together = label_log_odds(Expected(stacked, points, directions), noise, PRIOR)
    alone = [odds(barrel(0.033, 3.0, 0.1), places, noise, PRIOR) for places in sets]
    np.testing.assert_allclose(together, alone, rtol=0.02)


def test_an_untold_rotation_biases_as_predicted():
    """2000 least-squares readings of an estimator that does not know of the rotation it meets."""
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(9, 5)) * [3.0, 3.0, 3.0, 3.0, 5.0]  # what nine readings tell
    for admitted in (1e-6, 0.3):
        before = np.diag([1.0, 1.0, 1.0, 1.0, admitted**-2])
        total = before + rows.T @ rows
        truth = np.column_stack([rng.normal(size=(20_000, 4)), np.zeros(20_000)])
        truth[:, 4] = np.hypot(admitted, 0.2) * rng.normal(size=20_000)
        seen = truth @ rows.T + rng.normal(size=(20_000, 9))
        error = (seen @ rows @ np.linalg.inv(total) - truth)[:, :4]
        expected = with_untold_rotation(total, before, 0.2)
        scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
        np.testing.assert_allclose(
            error.T @ error / len(error) / scale, expected / scale, atol=0.04
        )
    none = with_untold_rotation(total, before, 0.0)
    np.testing.assert_allclose(none, np.linalg.inv(total)[:4, :4], rtol=1e-12)
