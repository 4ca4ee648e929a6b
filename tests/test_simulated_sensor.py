"""A simulated sensor scatters as its noise says, and as the presets' table says.

Monte Carlo: 2000 readings a case, seeds fixed; the 99.99 % interval of a standard deviation from
2000 normal draws is +-6.2 %, of a mean +-0.088 standard deviations.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reading_scatter import (
    COUNT,
    KAPPA,
    MEAN,
    SD,
    SINGLE,
    SURFACE,
    readings,
    scatter_of,
    truth_at,
)

from estimator.contact import SensorNoise
from estimator.profile import ArcProfile, PolynomialProfile
from estimator.sensors import SENSORS
from estimator.surface import Geometry, SurfaceOfRevolution
from sim_sensor.noise import CommonErrors, Session, SimulatedSensor, simulated_sensor


@pytest.mark.parametrize("name", SINGLE)
def test_position_and_normal_scatter_as_the_estimator_is_told(name: str) -> None:
    noise, s = SENSORS[name], readings(name)
    np.testing.assert_allclose(s.position.std(axis=0), noise.position, rtol=SD)
    np.testing.assert_allclose(s.tilt.std(axis=0), noise.normal, rtol=SD)
    assert np.abs(s.position.mean(axis=0)).max() < MEAN * noise.position
    assert np.abs(s.tilt.mean(axis=0)).max() < MEAN * noise.normal


@pytest.mark.parametrize("name", SINGLE)
def test_direction_scatters_as_the_deviator_over_the_difference_of_curvatures(name: str) -> None:
    predicted = np.hypot(SENSORS[name].deviator / (KAPPA[0] - KAPPA[1]), SENSORS[name].direction)
    # second order: a fluctuating denominator, 1 + (sd / difference)^2 at gel-poor's 12 %
    assert readings(name).psi.std() == pytest.approx(predicted, rel=SD + 3 * predicted**2)


@pytest.mark.parametrize("name", SINGLE)
def test_curvatures_scatter_as_tensor_noise_and_scale_say(name: str) -> None:
    noise, s = SENSORS[name], readings(name)
    tensor = np.hypot(noise.deviator, noise.mean_curvature)
    for i, kappa in enumerate(KAPPA):
        if not (i == 1 and np.isnan(s.curvatures[:, 1]).any()):
            predicted = np.hypot(tensor, noise.curvature_scale * kappa)
            assert s.curvatures[:, i].std() == pytest.approx(predicted, rel=SD + 0.01)


@pytest.mark.parametrize(
    ("name", "position_mm", "normal_deg", "direction_deg", "r1_percent"),
    [
        ("fearing1988", 0.127, 0.57, 1.2, 12.5),
        ("taxel", 0.15, 1.4, 1.7, 11.0),
        ("gel", 0.10, 0.7, 2.1, 7.0),
        ("gel-good", 0.05, 0.3, 0.7, 3.0),
        ("gel-poor", 0.20, 1.4, 7.0, 21.0),
    ],
)
def test_presets_have_the_scatter_of_the_sensor_table(
    name: str, position_mm: float, normal_deg: float, direction_deg: float, r1_percent: float
) -> None:
    s = readings(name)
    rounding = 0.04  # the table has two digits
    assert 1e3 * s.position.std() == pytest.approx(position_mm, rel=SD)
    assert np.rad2deg(s.tilt.std()) == pytest.approx(normal_deg, rel=SD)
    assert np.rad2deg(s.psi.std()) == pytest.approx(direction_deg, rel=SD + rounding)
    k1 = 100 * s.curvatures[:, 0].std() / KAPPA[0]
    assert k1 == pytest.approx(r1_percent, rel=SD + rounding)


def test_curvatures_below_the_resolution_are_nan_and_saddles_are_not() -> None:
    rng, gel = np.random.default_rng(1), simulated_sensor("gel-good").session
    can = SurfaceOfRevolution(SURFACE.axis, PolynomialProfile((0.03,), (-0.05, 0.05)))
    session = gel(rng=rng)
    seen = np.array([session.read(truth_at(0.3, can), rng=rng).curvatures for _ in range(200)])
    assert np.nanmin(np.abs(seen)) >= SENSORS["gel-good"].flat
    assert 50 < np.isnan(seen).any(axis=1).sum() < 200
    saddle = SurfaceOfRevolution(SURFACE.axis, ArcProfile(0.060, 0.030, (-0.01, 0.01), outer=False))
    curvatures = session.read(truth_at(0.0, saddle), rng=rng).curvatures
    assert sorted(curvatures) == pytest.approx([-1 / 0.030, 1 / 0.030], rel=0.15)


@pytest.mark.parametrize("name", SENSORS)
def test_rows_come_in_either_order_and_sign(name: str) -> None:
    rng, truth = np.random.default_rng(9), truth_at(0.4)
    session = simulated_sensor(name).session(rng=rng)
    dots = np.array(
        [session.read(truth, rng=rng).directions[0] @ truth.k_theta for _ in range(400)]
    )
    first = np.abs(dots) > np.sqrt(0.5)
    assert abs(first.mean() - 0.5) < 0.1  # 4 sd of 400 coin throws
    assert abs((dots[first] > 0).mean() - 0.5) < 0.14


def test_directions_are_uniform_where_the_surface_is_umbilic() -> None:
    ball = SurfaceOfRevolution(SURFACE.axis, ArcProfile(0.0, 0.035, (-0.03, 0.03)))
    truth, rng = truth_at(0.4, ball, 0.005), np.random.default_rng(11)
    session = simulated_sensor("gel").session(rng=rng)
    rows = np.array([session.read(truth, rng=rng).directions[0] for _ in range(COUNT)])
    angle = np.arctan2(rows @ truth.k_z, rows @ truth.k_theta)
    # first two even harmonics of a uniform angle: mean zero, sd 1/sqrt(2 N) a component
    for harmonic in (2, 4):
        assert abs(np.exp(1j * harmonic * angle).mean()) < 4.0 / np.sqrt(COUNT)


@pytest.mark.parametrize("name", SENSORS)
def test_an_explicit_direction_offset_turns_every_reading(name: str) -> None:
    offset, truth = np.deg2rad(8.0), truth_at(-0.7)
    rng = np.random.default_rng(4)
    session = simulated_sensor(name).session(rng=rng, direction_offset=offset)
    s = scatter_of([session.read(truth, rng=rng) for _ in range(500)], truth)
    assert s.psi.mean() == pytest.approx(offset, abs=4 * s.psi.std() / np.sqrt(500) + 2e-5)


@given(
    theta=st.floats(-3.1, 3.1),
    z=st.floats(-0.03, 0.03),
    seed=st.integers(0, 2**32 - 1),
    name=st.sampled_from(list(SENSORS)),
)
def test_every_reading_is_a_valid_contact_and_carries_what_the_estimator_is_told(
    theta: float, z: float, seed: int, name: str
) -> None:
    rng = np.random.default_rng(seed)
    session = simulated_sensor(name).session(rng=rng)
    contact = session.read(truth_at(theta, z=z), rng=rng)  # Contact checks the frame
    assert contact.noise is SENSORS[name]
    again = np.random.default_rng(seed)
    repeated = simulated_sensor(name).session(rng=again).read(truth_at(theta, z=z), rng=again)
    np.testing.assert_array_equal(contact.position, repeated.position)


def test_a_flat_place_and_a_vertical_normal_are_read_without_a_special_case() -> None:
    up = np.array([0.0, 0.0, 1.0])
    zero = np.array(0.0)
    flat = Geometry(np.zeros(3), up, np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), zero, zero)
    for name in SENSORS:
        rng = np.random.default_rng(0)
        contact = simulated_sensor(name).session(rng=rng).read(flat, rng=rng)
        assert contact.normal @ up > 0.9


def test_sensors_are_checked_by_name_and_offset() -> None:
    with pytest.raises(ValueError, match="'nose' is unknown; known are ideal, fearing1988"):
        simulated_sensor("nose")
    with pytest.raises(ValueError, match="direction_offset"):
        simulated_sensor("gel").session(rng=np.random.default_rng(0), direction_offset=np.nan)


def test_a_sensor_of_ones_own_needs_no_preset() -> None:
    noise = SensorNoise(1e-9, 1e-9, 0.0, 0.0, 1e-12, 0.0, 1e-9)
    own = SimulatedSensor(noise, noise, CommonErrors(log_radius=np.log(2.0)))
    rng, truth = np.random.default_rng(0), truth_at(0.2)
    session: Session = own.session(rng=rng)
    assert sorted(session.read(truth, rng=rng).curvatures) == pytest.approx(
        sorted(0.5 * np.array(KAPPA))
    )
    told = replace(own, told=SENSORS["gel"])
    assert told.session(rng=rng).read(truth, rng=rng).noise is SENSORS["gel"]
