"""What each imperfection of the finger does to a reading: the error budget, sign and size.

R1 = 22, R2 = 190 mm within 25 degrees of crossed, 1.5 N, anywhere in one cell, two-curvature
reader. Factors and shares are those of another code; they are medians or shares of 400 readings.
"""

import numpy as np
import pytest

from estimator.readers.strain import read_strains
from estimator.readers.strain_array import StrainArray
from sim_sensor.signals.tactel_imperfections import StrainImperfections
from sim_sensor.signals.tactels import StrainFinger

COUNT = 400
R1, K2 = 22e-3, 1.0 / 190e-3
ARRAY = StrainArray()


def readings(**wrong):
    """Error of the direction [deg], actual angle [deg], R1 factor, share saturated."""
    rng = np.random.default_rng(5)
    crossed = rng.uniform(-25.0, 25.0, COUNT)
    psi = np.deg2rad(crossed + 90.0)
    u = np.stack([np.cos(psi), np.sin(psi)], axis=1)
    v = np.stack([-u[:, 1], u[:, 0]], axis=1)
    tensors = np.einsum("bi,bj->bij", v, v) / R1 + K2 * np.einsum("bi,bj->bij", u, u)
    places = rng.uniform(-0.5, 0.5, (COUNT, 2)) * [ARRAY.axial_pitch, ARRAY.arc_pitch]
    finger = StrainFinger(ARRAY, StrainImperfections(**wrong))
    session = finger.session(rng=np.random.default_rng(1))
    touches = session.press(places, np.full(COUNT, 1.5), tensors, rng=rng)
    found = read_strains(touches.readings, ARRAY, curvatures="two")
    error = (np.rad2deg(found.directions) - 90.0 - crossed + 90.0) % 180.0 - 90.0
    curvatures = np.linalg.eigvalsh(found.tensors)
    factor = np.median(1.0 / curvatures[:, 1]) / R1
    return error, crossed, factor, np.mean(curvatures[:, 0] <= 1e-3)


@pytest.fixture(scope="module")
def matched():
    return readings()


def test_matched_finger_is_read_without_bias(matched):
    error, _, factor, saturated = matched
    assert abs(np.median(error)) < 0.3
    assert factor == pytest.approx(1.0, abs=0.02)
    assert saturated < 0.2


@pytest.mark.parametrize(
    ("modulus", "factor", "least", "most"),
    [(0.95, 1.05, 0.2, 0.45), (0.90, 1.10, 0.5, 0.85), (0.80, 1.22, 0.8, 1.0),
     (1.10, 0.90, 0.0, 0.1), (1.25, 0.78, 0.0, 0.05)],
)  # fmt: skip
def test_wrong_modulus_scales_the_radius_and_saturates_the_second(modulus, factor, least, most):
    """All twelve second radii of Table 8 are saturated: its scale was off, not its noise."""
    _, _, found, saturated = readings(modulus=modulus)
    assert found == pytest.approx(factor, abs=0.02)
    assert least <= saturated <= most


def test_wrong_depth_bends_the_angles():
    """True depth 5 % more: slope .83, R1 x 1.07, nearly all saturated. 5 % less: slope 1.9."""
    error, crossed, factor, saturated = readings(depth=1.05)
    assert np.polyfit(crossed, crossed + error, 1)[0] == pytest.approx(0.83, abs=0.05)
    assert factor == pytest.approx(1.07, abs=0.02)
    assert saturated > 0.9
    error, crossed, _, _ = readings(depth=0.95)
    assert np.polyfit(crossed, crossed + error, 1)[0] == pytest.approx(1.9, abs=0.25)


def test_skewed_bands_turn_every_angle_by_the_sheared_curvature():
    """y seen = y - e x adds e (K_yy + 1/r_f) to K_xy: e K_yy / (k1 - k2) = 6 deg for e = .05."""
    expected = np.rad2deg(0.05 * (K2 + ARRAY.curvature) / (1.0 / R1 - K2))
    for sign in (1.0, -1.0):
        error = readings(band_skew=0.05 * sign)[0]
        assert sign * np.median(error) == pytest.approx(expected, abs=1.2)


def test_turned_finger_turns_every_angle_by_as_much(matched):
    error = readings(turn=np.deg2rad(8.0))[0]
    assert np.median(error) == pytest.approx(8.0, abs=0.3)
    assert np.std(error) < 1.3 * np.std(matched[0])


@pytest.mark.parametrize(
    ("wrong", "times"),
    [({"jitter": 1e-4}, 1.5), ({"friction": 0.2}, 1.5), ({"band_shift": 1e-4}, 1.5)],
)
def test_misplaced_tactels_and_tangential_loads_scatter_the_angles(matched, wrong, times):
    plain, error = (np.quantile(np.abs(e), 0.8) for e in (matched[0], readings(**wrong)[0]))
    assert error > times * plain


def test_gain_spread_turns_less_than_misplacement():
    """Gains off by 3 %: 1.2 degrees; places off by .1 mm: position dependent, much more."""
    gain, place = (np.abs(readings(**w)[0]) for w in ({"gain_spread": 0.03}, {"jitter": 1e-4}))
    assert np.quantile(gain, 0.8) < 0.7 * np.quantile(place, 0.8)


def test_sticking_bands_make_the_angle_depend_on_the_place_as_the_paper_saw():
    """'as much as 12 degrees in some cases as we varied the contact location' (7.2.6)."""
    steps = np.linspace(-0.5, 0.5, 9)
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    places = grid * [ARRAY.axial_pitch, ARRAY.arc_pitch]
    psi = np.deg2rad(70.0)
    u, v = np.array([np.cos(psi), np.sin(psi)]), np.array([-np.sin(psi), np.cos(psi)])
    tensors = np.tile(np.outer(v, v) / R1 + K2 * np.outer(u, u), (len(places), 1, 1))
    ranges = []
    for stiffness in (0.0, 0.25):
        finger = StrainFinger(ARRAY, StrainImperfections(band_stiffness=stiffness))
        session, rng = finger.session(rng=np.random.default_rng(0)), np.random.default_rng(0)
        touches = session.press(places, np.full(len(places), 2.0), tensors, rng=rng, exact=True)
        found = read_strains(touches.readings, ARRAY, curvatures="two")
        ranges.append(np.ptp(np.rad2deg(found.directions) % 180.0))
    assert ranges[0] < 0.1
    assert 8.0 < ranges[1] < 16.0
