"""Probe the finger, fit its responses, read with them: what each response model is worth.

Medians over 200 touches at 1.5 N anywhere in one cell, two-curvature reader.
"""

import numpy as np
import pytest

from estimator.readers.probing import Probe
from estimator.readers.response_fit import fit_response
from estimator.readers.response_models import boussinesq, separable
from estimator.readers.strain import read_strains
from estimator.readers.strain_array import StrainArray, taxel_array
from sim_sensor.signals.probing import Campaign, probe_finger
from sim_sensor.signals.tactel_imperfections import StrainImperfections
from sim_sensor.signals.tactels import StrainFinger

COUNT = 200
ARRAY = StrainArray(tactels=(4, 4))
CYLINDER, BARREL = (1.0 / 12.7e-3, 0.0), (1.0 / 22e-3, 1.0 / 190e-3)
REFITTED = {"amplitude": 7.7e4, "d_x": 2.22e-3, "v_x": 0.39, "d_y": 2.22e-3, "v_y": 0.39}


def session(array=ARRAY, response=None, **wrong):
    finger = StrainFinger(array, StrainImperfections(**wrong), response)
    return finger.session(rng=np.random.default_rng(0))


def error_of_direction(finger, response, curvatures, angles, force=1.5):
    """Signed, of every touch [deg], and the residuals."""
    rng, array = np.random.default_rng(3), finger.array
    psi = np.deg2rad(np.broadcast_to(angles, COUNT))
    u = np.stack([np.cos(psi), np.sin(psi)], axis=1)
    v = np.stack([-u[:, 1], u[:, 0]], axis=1)
    tensors = sum(
        k * np.einsum("bi,bj->bij", w, w) for k, w in zip(curvatures, (v, u), strict=True)
    )
    places = rng.uniform(-0.5, 0.5, (COUNT, 2)) * [array.axial_pitch, array.arc_pitch]
    touches = finger.press(places, np.full(COUNT, force), tensors, rng=rng)
    found = read_strains(touches.readings, array, curvatures="two", response=response)
    error = (np.rad2deg(found.directions) - angles + 90.0) % 180.0 - 90.0
    return error, found.residuals


def probed(finger, radius, kind, **how):
    campaign = Campaign(probe=Probe(radius))
    probing = probe_finger(finger, campaign, rng=np.random.default_rng(1))
    return fit_response(probing, kind, **how).model


@pytest.mark.parametrize("kind", ["boussinesq", "cubic"])
@pytest.mark.parametrize(("radius", "least", "most"), [(0.5e-3, -5.0, -1.5), (1e-3, -25.0, -8.0)])
def test_probe_width_left_out_turns_directions(kind, radius, least, most):
    """Probe radius .5 and 1 mm on a cylinder of 12.7 mm: 2 to 3 and 8 to 20 degrees too small."""
    finger, angles = session(), np.random.default_rng(0).uniform(40.0, 60.0, COUNT)
    ignored = probed(finger, radius, kind, model_probe=False)
    assert least < np.median(error_of_direction(finger, ignored, CYLINDER, angles)[0]) < most
    modelled = probed(finger, radius, kind)
    assert abs(np.median(error_of_direction(finger, modelled, CYLINDER, angles)[0])) < 3.0


def test_a_crooked_finger_is_read_well_with_its_own_responses_only():
    finger = session(gain_spread=0.05, jitter=0.2e-3, band_skew=0.03)
    angles = np.random.default_rng(0).uniform(65.0, 115.0, COUNT)
    straight, residual = error_of_direction(finger, None, BARREL, angles)
    assert np.mean(np.abs(straight)) > 15.0
    assert np.median(residual) > 2.0
    true = np.mean(np.abs(error_of_direction(finger, finger.response, BARREL, angles)[0]))
    for kind, times in (("boussinesq", 1.5), ("cubic", 1.5), ("linear", 2.5)):
        own = error_of_direction(finger, probed(finger, 0.5e-3, kind), BARREL, angles)[0]
        assert np.mean(np.abs(own)) < times * true, kind


@pytest.mark.parametrize("angle", [75.0, 65.0, 50.0])
def test_separable_responses_read_only_what_they_generated(angle):
    """1 % of misfit to a half space is fatal on a curved finger; against itself it is none."""
    model = separable(ARRAY.positions, **REFITTED)
    wrong, residual = error_of_direction(session(), model, BARREL, angle)
    assert np.median(np.abs(wrong)) > 12.0
    assert np.median(residual) > 3.0
    own, residual = error_of_direction(session(response=model), model, BARREL, angle)
    assert abs(np.median(own)) < 3.0
    assert np.median(residual) < 1.3


def test_a_flat_pad_forgives_a_wrong_response():
    """Kernel 5 % too deep: a few tenths of a degree on a flat pad, many degrees on a finger."""
    pad = StrainArray(tactels=(4, 4), radius=float("inf"))
    worst = {}
    for array in (pad, ARRAY):
        deep = boussinesq(array.positions, depth=1.05 * array.depth, poisson=array.poisson)
        errors = error_of_direction(session(array), deep, BARREL, 70.0, force=2.0)[0]
        worst[np.isinf(array.radius)] = abs(np.median(errors))
    assert worst[True] < 1.0
    assert worst[False] > 4.0


@pytest.mark.parametrize(
    ("curvatures", "force", "q95"),
    [((1 / 25e-3, 1 / 178e-3), 1.0, 3.2), ((1 / 25e-3, 1 / 178e-3), 3.0, 1.1),
     ((1 / 40e-3, 1 / 100e-3), 1.0, 6.7), ((1 / 40e-3, 1 / 100e-3), 3.0, 2.2)],
)  # fmt: skip
def test_taxel_array_reads_directions_as_well_as_derived(curvatures, force, q95):
    """4.7 mm, 4 x 6, 3 mm deep, 5 mN and 2 %: 95 % of directions within these degrees."""
    angles = np.random.default_rng(4).uniform(0.0, 180.0, COUNT)
    errors = error_of_direction(session(taxel_array()), None, curvatures, angles, force)[0]
    assert 0.5 * q95 < np.quantile(np.abs(errors), 0.95) < 1.3 * q95
