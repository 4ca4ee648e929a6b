"""The simulated strain finger: reference strains, and every imperfection with its own trace."""

import numpy as np
import pytest

from estimator.readers.hertz import contact_ellipse
from estimator.readers.response_models import separable
from estimator.readers.strain_array import StrainArray, taxel_array
from sim_sensor.signals.tactel_imperfections import ORDINARY, StrainImperfections
from sim_sensor.signals.tactels import StrainFinger

CENTRE = [[0.0, 0.0]]
SMALL = StrainArray(tactels=(4, 4))
# R1, R2 [mm], direction of R2 from the finger's axis [deg], x, y [mm], F [N]; strains in percent,
# rows around the finger, x fastest, for d = 2.5 mm, nu = .49, E = .40 MPa; from another code.
TOUCHES = [
    (25.4, 177.8, 90.0, 0.0, 0.0, 1.0, 0.48519559780,
     [[-.19220, -.25678, -.25678, -.19220], [-.10986, 2.39783, 2.39783, -.10986],
      [-.10986, 2.39783, 2.39783, -.10986], [-.19220, -.25678, -.25678, -.19220]]),
    (25.4, 177.8, 70.0, 0.5, -0.7, 1.0, 0.47460655581,
     [[-.20221, -.25428, -.27288, -.22782], [-.04225, 3.68194, 3.92664, .22260],
      [-.23050, .53958, 1.42422, .01554], [-.15392, -.22037, -.23272, -.18206]]),
    (40.0, 60.0, 100.0, -1.0, 1.2, 3.0, 0.93781811223,
     [[-.49717, -.58663, -.54825, -.40800], [.48031, 1.67233, 1.24788, -.18629],
      [6.31335, 8.93812, 7.73181, 2.30546], [-.57171, -.52496, -.57885, -.55954]]),
]  # fmt: skip


def body(R1, R2, psi_deg):
    """Tensor [1/m] of radii [mm], R2 at psi from the finger's axis."""
    c, s = np.cos(np.deg2rad(psi_deg)), np.sin(np.deg2rad(psi_deg))
    u, v = np.array([c, s]), np.array([-s, c])
    return 1e3 * (np.outer(v, v) / R1 + np.outer(u, u) / R2)


def session(array=SMALL, seed=0, response=None, **imperfections):
    finger = StrainFinger(array, StrainImperfections(**imperfections), response)
    return finger.session(rng=np.random.default_rng(seed))


def pressed(finger, tensor, place=(0.0, 0.0), force=1.0, **how):
    rng = np.random.default_rng(7)
    return finger.press([place], [force], tensor[None], rng=rng, exact=True, **how)


@pytest.mark.parametrize("touch", TOUCHES)
def test_reference_strains_and_indentation(touch):
    R1, R2, psi, x, y, force, delta, percent = touch
    found = pressed(session(), body(R1, R2, psi), (x * 1e-3, y * 1e-3), force)
    np.testing.assert_allclose(100.0 * found.readings[0], percent, atol=2e-5)
    assert found.indentation[0] * 1e3 == pytest.approx(delta, rel=1e-6)


def test_readings_agree_with_a_dense_sum_over_the_pressure():
    """Midpoint rule in polar coordinates, 4e5 cells, written down anew: 1e-4 of the peak."""
    place, force, tensor = np.array([0.8e-3, -1.1e-3]), 2.0, body(15.0, 80.0, 65.0)
    M = contact_ellipse(tensor + np.diag([0.0, 1.0 / SMALL.radius]), force, SMALL.effective_modulus)
    r = (np.arange(600) + 0.5) / 600
    t = 2.0 * np.pi * np.arange(600) / 600
    u = r[:, None, None] * np.stack([np.cos(t), np.sin(t)], axis=-1)
    weight = np.repeat(r * np.sqrt(1.0 - r**2), len(t))
    points = place + u.reshape(-1, 2) @ M
    d, nu = SMALL.depth, SMALL.poisson
    r2 = np.sum((points[:, None] - SMALL.positions) ** 2, axis=-1)
    h = (1 + nu) * d * ((3 - 2 * nu) * d**2 - 2 * nu * r2) / (2 * np.pi * (r2 + d**2) ** 2.5)
    expected = force / SMALL.response_modulus * (weight @ h) / weight.sum()
    found = pressed(session(), tensor, place, force).readings.ravel()
    assert np.abs(found - expected).max() < 1e-4 * expected.max()


def test_same_body_a_pitch_further_reads_the_same_a_tactel_further():
    whole, tensor = session(StrainArray()), body(20.0, 90.0, 80.0)
    here = pressed(whole, tensor, (0.4e-3, 0.3e-3)).readings[0]
    there = (0.4e-3 + SMALL.axial_pitch, 0.3e-3 - SMALL.arc_pitch)
    np.testing.assert_allclose(
        pressed(whole, tensor, there).readings[0, :-1, 1:], here[1:, :-1], rtol=1e-6, atol=1e-9
    )


def test_strains_go_on_around_the_seam_of_the_finger():
    """20 rows of 18 degrees close the circle: no row is special."""
    ring, tensor = session(StrainArray(tactels=(20, 4))), body(20.0, 90.0, 80.0)
    place = np.array([0.2e-3, 0.5e-3])
    here = pressed(ring, tensor, place).readings[0]
    far = pressed(ring, tensor, place + np.array([0.0, 10 * SMALL.arc_pitch])).readings[0]
    np.testing.assert_allclose(np.roll(here, 10, axis=0), far, rtol=1e-6, atol=1e-9)


def test_scale_of_modulus_is_a_scale_of_force_when_all_of_it_changes():
    """Only E* K / F is observable (sensor.md, 0): half the modulus, half the force, same strain."""
    soft = StrainArray(tactels=(4, 4), modulus=0.2e6, response_modulus=0.2e6)
    tensor = body(25.4, 177.8, 80.0)
    np.testing.assert_allclose(
        pressed(session(soft), tensor, force=0.5).readings,
        pressed(session(), tensor, force=1.0).readings,
        rtol=1e-12,
    )


def test_wrong_modulus_is_the_patch_of_another_body():
    """K_est = s K + (s - 1) diag(0, 1 / r_f) reads the same at the stated modulus."""
    s, tensor = 1.6, body(12.7, 1e6, 30.0)
    as_read = s * tensor + (s - 1.0) * np.diag([0.0, 1.0 / SMALL.radius])
    np.testing.assert_allclose(
        pressed(session(modulus=s), tensor).readings,
        pressed(session(), as_read).readings,
        rtol=1e-9,
        atol=1e-12,
    )
    u = np.linalg.eigh(as_read)[1][:, 0]
    assert np.rad2deg(np.arctan2(u[1], u[0])) % 180.0 == pytest.approx(22.352, abs=1e-3)


def test_turned_finger_reads_a_body_turned_the_other_way_round():
    turned = pressed(session(turn=np.deg2rad(8.0)), body(25.4, 177.8, 70.0))
    plain = pressed(session(), body(25.4, 177.8, 78.0))
    np.testing.assert_allclose(turned.readings, plain.readings, rtol=1e-9, atol=1e-12)


def test_tangential_load_adds_an_odd_part_along_it():
    tensor = body(25.4, 177.8, 90.0)
    plain = pressed(session(), tensor).readings[0]
    ahead = pressed(session(friction=0.2), tensor, slips=[0.0]).readings[0]
    behind = pressed(session(friction=0.2), tensor, slips=[np.pi]).readings[0]
    np.testing.assert_allclose(0.5 * (ahead + behind), plain, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(ahead, behind[:, ::-1], rtol=1e-9, atol=1e-12)
    assert ahead[1, 2] > 1.02 * plain[1, 2] > plain[1, 1] > ahead[1, 1]  # compressed ahead


def test_band_stiffness_makes_readings_depend_on_place():
    tensor, sticky = body(20.0, 100.0, 80.0), session(StrainArray(), band_stiffness=0.2)
    on_tactel, between = SMALL.positions[5], np.zeros(2)
    for place, sign in ((on_tactel, -1.0), (between, 1.0)):
        plain = np.linalg.det(pressed(session(StrainArray()), tensor, place).ellipse[0])
        found = np.linalg.det(pressed(sticky, tensor, place).ellipse[0])
        assert sign * (found / plain - 1.0) > 0.05  # stiffer above a band: a smaller patch


def test_what_a_session_draws_stays_for_the_session():
    finger = StrainFinger(StrainArray(depth_error=0.02, modulus_error=0.03), ORDINARY)
    one, again, other = (finger.session(rng=np.random.default_rng(s)) for s in (1, 1, 2))
    assert np.array_equal(one.response.rows, again.response.rows)
    assert not np.array_equal(one.response.rows, other.response.rows)
    sessions = [finger.session(rng=np.random.default_rng(s)) for s in range(400)]
    moduli = np.log([s.modulus / finger.array.effective_modulus for s in sessions])
    depths = np.log([np.sqrt(s.response.rows[0, 3]) / finger.array.depth for s in sessions])
    turns = np.array([s.turn for s in sessions])
    assert np.std(moduli) == pytest.approx(0.03, rel=0.12)
    assert np.std(depths) == pytest.approx(0.02, rel=0.12)
    assert np.std(turns) == pytest.approx(np.deg2rad(0.5), rel=0.12)


def test_spreads_of_gain_and_place_have_the_sizes_stated():
    wrong = StrainImperfections(gain_spread=0.03, jitter=0.1e-3, band_shift=0.2e-3, band_skew=0.05)
    finger = StrainFinger(StrainArray(), wrong)
    nominal, rows, places = finger.array.response(), [], []
    for seed in range(100):
        true = finger.session(rng=np.random.default_rng(seed)).response
        rows.append(true.rows[:, 0] / nominal.rows[:, 0])
        places.append(true.positions - nominal.positions)
    off = np.array(places) - [0.0, 1.0] * (0.05 * nominal.positions[:, :1])
    assert np.std(rows) == pytest.approx(0.03, rel=0.05)
    assert np.std(off) == pytest.approx(np.hypot(0.1e-3, 0.2e-3), rel=0.05)
    along_band = off.reshape(100, 8, 8, 2)[..., 1]  # lengthwise bands: rows
    assert np.std(along_band - along_band.mean(axis=2, keepdims=True)) < 0.11e-3


def test_readings_are_rounded_noisy_and_clipped_as_stated():
    array = StrainArray(tactels=(4, 4), noise=1e-3)
    finger, B = session(array, ceiling=0.02), 4000
    tensor = np.repeat(body(25.4, 177.8, 90.0)[None], B, axis=0)
    rng = np.random.default_rng(5)
    readings = finger.press(np.zeros((B, 2)), np.ones(B), tensor, rng=rng).readings
    steps = readings / (2.0 * array.rounding)
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    corner = readings[:, 0, 0]
    assert np.std(corner) == pytest.approx(np.sqrt(1e-6 + array.rounding**2 / 3.0), rel=0.05)
    assert np.mean(corner) == pytest.approx(-0.19220e-2, abs=1e-4)
    assert readings.max() == pytest.approx(0.02)


@pytest.mark.parametrize(("how", "value"), [("stuck", 0.0), ("dead", np.nan)])
def test_stuck_tactel_reads_zero_and_a_dead_one_nothing_the_others_as_before(how, value):
    tensor = body(25.4, 177.8, 90.0)
    whole = pressed(session(), tensor).readings[0]
    found = pressed(session(**{how: ((1, 2),)}), tensor).readings[0]
    alive = np.ones((4, 4), bool)
    alive[1, 2] = False
    np.testing.assert_equal(found[1, 2], value)
    np.testing.assert_array_equal(found[alive], whole[alive])


def test_another_response_model_generates_by_itself():
    model = separable(SMALL.positions, amplitude=7.6e4, d_x=2.3e-3, v_x=0.4, d_y=2.3e-3, v_y=0.4)
    tensor = body(25.4, 177.8, 90.0)
    found = pressed(session(response=model), tensor).readings[0]
    assert 0.005 < np.abs(found - pressed(session(), tensor).readings[0]).max() / found.max() < 0.1


def test_body_too_flat_for_hertz_is_marked_not_refused():
    along = body(25.4, 1e6, 0.0)  # a cylinder along the finger's axis: a line
    found = pressed(session(StrainArray()), along)
    assert found.conforming[0]
    assert np.all(np.isfinite(found.readings))
    assert not pressed(session(), body(25.4, 177.8, 90.0)).conforming[0]


def test_taxel_array_on_a_flat_pad_reads_most_of_the_force():
    """4 x 6 cells of 4.7 mm: Boussinesq pressure spreads, a third of it or less lies outside."""
    pad = StrainFinger(taxel_array()).session(rng=np.random.default_rng(0))
    found = pad.press(CENTRE, [2.0], body(25.4, 177.8, 90.0)[None], rng=np.random.default_rng(1))
    assert 0.8 < found.readings.sum() / 2.0 < 1.02
    ellipse_axes = np.linalg.eigh(found.ellipse[0])[1]
    assert abs(ellipse_axes[1, 1]) == pytest.approx(1.0)  # long along y: flat pad, no mixing


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: StrainImperfections(modulus=0.0), "modulus: expected greater than zero"),
        (lambda: StrainImperfections(jitter=-1.0), "jitter: expected zero or more"),
        (lambda: session(dead=((4, 0),)), r"dead tactel \(4, 0\): expected one of 4 x 4"),
        (lambda: session(StrainArray(), response=SMALL.response()), "expected 64 tactels, got 16"),
        (lambda: pressed(session(), body(20.0, 90.0, 80.0), force=0.0), "force: expected greater"),
    ],
)
def test_misuse_says_what_would_have_worked(make, match):
    with pytest.raises(ValueError, match=match):
        make()


def test_only_a_half_space_can_be_dragged():
    model = separable(SMALL.positions, amplitude=7.6e4, d_x=2.3e-3, v_x=0.4, d_y=2.3e-3, v_y=0.4)
    with pytest.raises(ValueError, match="only the half space knows tangential loads"):
        session(response=model, friction=0.1)
