"""The paper's cylindrical finger errs as its Tables 7 and 8 say: by session, by site, by reading.

Counts and intervals as in test_simulated_sensor.
"""

from __future__ import annotations

import numpy as np
import pytest
from reading_scatter import (
    COUNT,
    KAPPA,
    MEAN,
    SD,
    SURFACE,
    readings,
    scatter_of,
    truth_at,
)

from estimator.profile import ArcProfile
from estimator.surface import SurfaceOfRevolution
from sim_sensor.noise import simulated_sensor


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
