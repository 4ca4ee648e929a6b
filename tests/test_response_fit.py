"""A simulated probing campaign gives the impulse responses back, its probe accounted for."""

import numpy as np
import pytest

from estimator.readers.probing import Probe, Probing
from estimator.readers.response_fit import fit_response
from estimator.readers.response_models import separable
from estimator.readers.strain_array import StrainArray
from sim_sensor.signals.probing import Campaign, probe_finger
from sim_sensor.signals.tactel_imperfections import StrainImperfections
from sim_sensor.signals.tactels import StrainFinger

PAIR = [27, 28]  # tactels in the middle of 8 x 8
WIDE = Probe(1e-3, "flat")


def of_pair(probing):
    return Probing(
        probing.x, probing.y, probing.responses[..., PAIR], probing.positions[PAIR], probing.probe
    )


def campaign(probe, *, response=None, seed=1):
    wrong = StrainImperfections(gain_spread=0.05, jitter=0.2e-3)
    session = StrainFinger(imperfections=wrong, response=response).session(
        rng=np.random.default_rng(0)
    )
    probing = probe_finger(session, Campaign(probe=probe), rng=np.random.default_rng(seed))
    return session.response.take(PAIR), of_pair(probing)


def worst(fit, truth, reach=5e-3):
    """Largest error of the fitted impulse response, as a fraction of its peak."""
    points = np.random.default_rng(2).uniform(-reach, reach, (800, 2)) + truth.positions[0]
    exact = truth(points)
    return float(np.abs(fit.model(points) - exact).max() / exact.max())


@pytest.fixture(scope="module")
def wide():
    return campaign(WIDE)


def test_the_campaign_is_the_papers():
    """About 3500 probes, every 0.02 inch and 3 degrees."""
    probing = probe_finger(
        StrainFinger().session(rng=np.random.default_rng(0)), rng=np.random.default_rng(0)
    )
    assert 3400 < probing.responses[..., 0].size < 3600
    np.testing.assert_allclose(probing.steps, (0.508e-3, 12.7e-3 * np.deg2rad(3.0)), rtol=1e-9)


def test_half_space_is_recovered_within_its_covariance(wide):
    truth, probing = wide
    fit = fit_response(probing, "boussinesq")
    assert fit.rms_percent < 0.6
    sd = np.sqrt(np.diagonal(fit.covariance, axis1=1, axis2=2))
    found = fit.model.positions
    assert np.abs(found - truth.positions).max() < 0.02e-3
    assert np.abs(fit.of("depth") - 2.5e-3).max() < 5e-5
    assert np.all(np.abs(found - truth.positions) < 5.0 * sd[:, :2])
    assert worst(fit, truth) < 0.01


def test_probe_width_left_out_widens_and_lowers_the_response(wide):
    truth, probing = wide
    modelled = fit_response(probing, "boussinesq")
    ignored = fit_response(probing, "boussinesq", model_probe=False)
    assert worst(ignored, truth) > 10.0 * worst(modelled, truth)
    assert np.all(ignored.of("depth") > 1.08 * modelled.of("depth"))
    assert ignored.rms_percent > modelled.rms_percent  # the paper: "a slightly better fit"


def test_separable_model_fits_a_point_load_to_about_one_percent_as_in_the_paper(wide):
    """'a fit to the RobotWorld data of about 1-2% of full scale rms' (7.2.2)."""
    _, probing = wide
    assert 0.8 < fit_response(probing, "separable").rms_percent < 2.0


def test_each_step_of_the_paper_improves_the_fit():
    """Own d and v, then places, turns (83) and skew (84), on a finger that has all of them."""
    array = StrainArray()
    model = separable(
        array.positions, amplitude=7.6e4, d_x=2.3e-3, v_x=0.4, d_y=2.6e-3, v_y=0.3,
        phi_x=0.12, phi_y=-0.08, skew=60.0,
    )  # fmt: skip
    truth, probing = campaign(Probe(0.5e-3), response=model)
    own = ("amplitude", "d_x", "v_x", "d_y", "v_y")
    steps = (own, (*own, "x", "y"), (*own, "x", "y", "phi_x", "phi_y"), ())
    fits = [fit_response(probing, "separable", free=free) for free in steps]
    rms = [fit.rms_percent for fit in fits]
    assert rms[0] > 1.3 * rms[1] > 1.3 * rms[2] > 1.3 * rms[3]
    np.testing.assert_allclose(fits[-1].of("skew"), 60.0, atol=3.0)
    np.testing.assert_allclose(fits[-1].of("phi_x"), 0.12, atol=0.03)
    assert worst(fits[-1], truth) < 0.01


def test_deconvolved_table_is_sharper_and_nearer_the_truth(wide):
    """7.2.3: 'the shape became slightly sharper and the amplitude increased'."""
    truth, probing = wide
    plain = fit_response(probing, "cubic", model_probe=False)
    sharp = fit_response(probing, "cubic")
    above = truth.positions[0][None]
    assert sharp.model(above)[0, 0] > 1.1 * plain.model(above)[0, 0]
    assert worst(plain, truth) > 0.2
    assert worst(sharp, truth) < 0.06


def test_tables_interpolate_better_from_nearest_to_cubic():
    truth, probing = campaign(Probe())
    errors = [worst(fit_response(probing, kind), truth) for kind in ("nearest", "linear", "cubic")]
    assert errors[0] > 2.0 * errors[1]
    assert errors[1] > 1.5 * errors[2]
    assert errors[2] < 0.02


def test_table_of_a_tactel_runs_across_the_seam_of_a_finger_probed_all_round():
    y = np.linspace(-4e-2, 4e-2, 120, endpoint=False)
    x = np.linspace(-5e-3, 5e-3, 11)
    place = np.array([[0.0, -3.9e-2]])
    around = 8e-2
    offset = y - place[0, 1] - around * np.round((y - place[0, 1]) / around)
    answers = np.exp(-((offset / 3e-3) ** 2))[None, :] * np.exp(-((x / 3e-3) ** 2))[:, None]
    probing = Probing(x, y, answers[..., None], place, circumference=around)
    fit = fit_response(probing, "cubic")
    for side in (-2e-3, 2e-3):
        expected = np.exp(-((side / 3e-3) ** 2))
        assert fit.model(place + np.array([0.0, side]))[0, 0] == pytest.approx(expected, abs=5e-3)


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda p: fit_response(p, "spline"), "response kind: expected one of"),
        (lambda p: fit_response(p, "boussinesq", free=("skew",)), "unknown; boussinesq has"),
        (lambda p: Probe(-1.0), "probe radius: expected zero or more"),
        (lambda p: Probe(1e-3, "square"), "expected flat or spherical"),
        (lambda p: Probing(p.x, p.y, p.responses[1:], p.positions), "responses: expected"),
        (lambda p: Probing(p.x**2, p.y, p.responses, p.positions), "x: expected at least four"),
        (lambda p: Campaign(force=0.0), "force: expected greater than zero"),
    ],
)
def test_misuse_says_what_would_have_worked(wide, make, match):
    with pytest.raises(ValueError, match=match):
        make(wide[1])
