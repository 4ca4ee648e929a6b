"""A simulated sensor scatters as its noise says, and as the presets' table says.

Monte Carlo: 2000 readings a case, seeds fixed; the 99.99 % interval of a standard deviation from
2000 normal draws is +-6.2 %, of a mean +-0.088 standard deviations.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimator.axis import Axis
from estimator.contact import Contact, SensorNoise
from estimator.profile import ArcProfile, PolynomialProfile
from estimator.sensors import SENSORS
from estimator.surface import Geometry, SurfaceOfRevolution
from estimator.vectors import Array
from sim_sensor.noise import CommonErrors, Session, SimulatedSensor, simulated_sensor

COUNT = 2000
SD, MEAN = 0.062, 0.088
KAPPA = 1 / 0.0254, 1 / 0.178  # parallel, meridian [1/m]
# r = 25.4 mm, meridian radius 178 mm at z = 0, on a tilted axis
SURFACE = SurfaceOfRevolution(
    Axis([0.1, -0.2, 0.3], [0.2, -0.3, 0.9]),
    PolynomialProfile((0.0254, 0.0, -0.5 / 0.178), (-0.03, 0.03)),
)
SINGLE = ("ideal", "fearing1988", "taxel", "gel", "gel-good", "gel-poor")


def truth_at(theta: float, surface: SurfaceOfRevolution = SURFACE, z: float = 0.0) -> Geometry:
    return surface.at(np.array(theta), np.array(z))


@dataclass(frozen=True, eq=False)
class Scatter:
    """Errors of many readings, on the true frame (t horizontal, e, n)."""

    position: Array  # (N, 3) along t, e, n
    tilt: Array  # (N, 2) of the normal towards t and e
    psi: Array  # (N,) rotation about n
    curvatures: Array  # (N, 2) parallel, meridian


def scatter_of(contacts: list[Contact], truth: Geometry) -> Scatter:
    n = truth.n
    t = np.cross([0.0, 0.0, 1.0], n)
    t /= np.linalg.norm(t)
    frame = np.vstack([t, np.cross(n, t), n])
    normals = np.array([c.normal for c in contacts])
    rows = np.array([c.directions for c in contacts])
    across = np.array([truth.k_theta, truth.k_z]) @ frame[:2].T  # in (t, e)
    seen = rows @ frame[:2].T
    parallel = np.argmax(np.abs(seen @ across[0]), axis=1)
    picked = np.take_along_axis(rows, parallel[:, None, None], axis=1)[:, 0]
    # undo the tilt before the angle about n is read
    picked = np.array([turn(m, n) @ p for m, p in zip(normals, picked, strict=True)])
    picked *= np.sign(picked @ truth.k_theta)[:, None]
    psi = np.arctan2(picked @ np.cross(n, truth.k_theta), picked @ truth.k_theta)
    curvatures = np.array([c.curvatures for c in contacts])
    order = np.stack([parallel, 1 - parallel], axis=1)
    return Scatter(
        position=(np.array([c.position for c in contacts]) - truth.p) @ frame.T,
        tilt=normals @ frame[:2].T,
        psi=psi,
        curvatures=np.take_along_axis(curvatures, order, axis=1),
    )


def turn(a: Array, b: Array) -> Array:
    """The smallest rotation that takes unit a to unit b."""
    v = np.cross(a, b)
    V = np.cross(np.eye(3), v)
    return np.eye(3) + V + V @ V / (1.0 + a @ b)


@functools.cache
def readings(name: str) -> Scatter:
    """One session, every reading at a new site."""
    rng = np.random.default_rng(7)
    session, truth = simulated_sensor(name).session(rng=rng), truth_at(0.4)
    return scatter_of([session.read(truth, rng=rng) for _ in range(COUNT)], truth)


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


def test_robotworld_scatters_within_a_site_as_table_8() -> None:
    rng = np.random.default_rng(3)
    session, truth = simulated_sensor("robotworld").session(rng=rng), truth_at(0.4)
    site = session.new_site(rng=rng)
    s = scatter_of([session.read(truth, rng=rng, site=site) for _ in range(COUNT)], truth)
    assert np.rad2deg(s.psi.std()) == pytest.approx(2.4, rel=SD)
    offset = session.direction_offset + site.direction
    assert s.psi.mean() == pytest.approx(offset, abs=MEAN * np.deg2rad(2.4))
    log_radius = -np.log(s.curvatures[:, 0] / KAPPA[0])
    assert log_radius.std() == pytest.approx(0.055, rel=0.3)  # 0.052 / site scale is tensor noise
    np.testing.assert_allclose(
        s.position.mean(axis=0) @ s.position.mean(axis=0),
        session.fixture_W @ session.fixture_W,
        rtol=0.02,
    )


def test_robotworld_scatters_between_sites_as_table_8() -> None:
    s = readings("robotworld")
    assert np.rad2deg(s.psi.std()) == pytest.approx(np.hypot(2.1, 2.4), rel=SD)
    assert np.rad2deg(abs(s.psi.mean())) == pytest.approx(8.0, abs=MEAN * 3.2)
    log_radius = -np.log(s.curvatures[:, 0] / KAPPA[0])
    assert log_radius.std() == pytest.approx(np.hypot(0.26, 0.055), rel=SD)
    assert log_radius.mean() == pytest.approx(np.log(1.14), abs=MEAN * 0.27)
    # elevation -2 deg sd 1.1 deg, axial tilt sd 2.5 deg: 3.4 deg rms
    assert np.rad2deg(s.tilt[:, 1].mean()) == pytest.approx(-2.0, abs=MEAN * 1.13)
    np.testing.assert_allclose(np.rad2deg(s.tilt.std(axis=0)), [2.5, 1.13], rtol=SD)
    rms = np.sqrt(np.mean(np.sum(np.arcsin(s.tilt) ** 2, axis=1)))
    assert np.rad2deg(rms) == pytest.approx(3.4, rel=SD)


def test_robotworld_sessions_differ_in_sign_and_fixture() -> None:
    sensor, rng = simulated_sensor("robotworld"), np.random.default_rng(5)
    sessions = [sensor.session(rng=rng) for _ in range(COUNT)]
    signs = np.sign([s.direction_offset for s in sessions])
    assert abs(signs.mean()) < MEAN
    assert 1e3 * np.std([s.fixture_W for s in sessions]) == pytest.approx(0.8, rel=SD)


@pytest.mark.parametrize("name", ["fearing1988", "robotworld"])
def test_a_cylindrical_finger_tilts_its_normal_with_its_position_error(name: str) -> None:
    s = readings(name)
    tilt = s.tilt[:, 1] - s.tilt[:, 1].mean()
    around = s.position[:, 1] - s.position[:, 1].mean()
    # the outward normal of the finger goes with the point, the object's goes against it
    assert np.corrcoef(tilt, around)[0, 1] < -0.999
    assert tilt.std() / around.std() == pytest.approx(1 / 12.7e-3, rel=2e-3)
    assert abs(np.corrcoef(s.tilt[:, 0], s.position[:, 0])[0, 1]) < MEAN


def test_the_finger_axis_says_which_tilt_goes_with_the_position() -> None:
    rng, truth = np.random.default_rng(2), truth_at(1.1)
    session = simulated_sensor("fearing1988").session(rng=rng)
    along = truth.k_theta
    contacts = [session.read(truth, rng=rng, finger_axis_W=along) for _ in range(200)]
    e = np.cross(truth.n, along)
    tilt = np.array([c.normal @ e for c in contacts])
    around = np.array([(c.position - truth.p) @ e for c in contacts])
    assert np.corrcoef(tilt, around)[0, 1] < -0.999


@pytest.mark.parametrize("name", ["fearing1988", "robotworld"])
def test_a_one_curvature_sensor_never_says_the_flatter_curvature(name: str) -> None:
    saddle = SurfaceOfRevolution(SURFACE.axis, ArcProfile(0.060, 0.030, (-0.01, 0.01), outer=False))
    rng = np.random.default_rng(1)
    session = simulated_sensor(name).session(rng=rng)
    for surface, flat in ((SURFACE, KAPPA[1]), (saddle, -1 / 0.030)):
        truth = truth_at(0.0, surface)
        assert float(truth.kappa_z) == pytest.approx(flat)
        for _ in range(50):
            contact = session.read(truth, rng=rng)
            blind = np.isnan(contact.curvatures)
            assert blind.sum() == 1
            assert abs(contact.directions[blind][0] @ truth.k_z) > 0.8


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
