"""Degenerate objects end in `undetermined` with the right reason, never in a confident wrong axis.

Each is touched with and without a prior and with several noises; the contacts are exact, which is
the hardest case for honesty: everything fits.
"""

from dataclasses import replace

import numpy as np
import pytest

from estimator.axis import Axis, angle_between
from estimator.contact import Contact
from estimator.fusion import estimate_axis
from estimator.prior import coarse_prior
from estimator.profile import barrel, cone, cylinder, sphere
from estimator.sensors import SENSORS
from estimator.surface import Place, SurfaceOfRevolution
from estimator.vectors import basis_across, unit

AXIS = Axis(np.array([0.4, 0.1, 0.2]), np.array([0.2, -0.1, 1.0]))
PRIORS = (None, coarse_prior(AXIS, angle=0.26, offset=0.015, radius=0.03, radius_sd=0.008))
NOISES = ("ideal", "gel", "gel-poor", "taxel")


def touched(profile, places, noise):
    surface = SurfaceOfRevolution(AXIS, profile)
    return [surface.contact(Place(theta, z), SENSORS[noise]) for theta, z in places]


@pytest.mark.parametrize("prior", PRIORS, ids=("no prior", "prior"))
@pytest.mark.parametrize("noise", NOISES)
def test_a_sphere_leaves_the_direction_free_and_says_so(noise, prior):
    places = ((0.0, -0.01), (2.0, 0.0), (4.2, 0.01), (1.0, 0.012))
    result = estimate_axis(touched(sphere(0.03, 0.04), places, noise), prior=prior)
    assert result.verdict == "undetermined"
    words = " ".join(result.reasons)
    assert "umbilic" in words
    assert "sphere" in words or "tilt" in words
    centre = AXIS.point
    foot = result.axis.foot(centre)
    assert np.linalg.norm(foot - centre) < 2e-3  # what a sphere does tell


@pytest.mark.parametrize("prior", PRIORS, ids=("no prior", "prior"))
@pytest.mark.parametrize("noise", NOISES)
def test_a_flat_end_leaves_the_position_free_and_says_so(noise, prior):
    n = AXIS.direction
    k = basis_across(n)
    contacts = [
        Contact(AXIS.point + 0.01 * (c @ k), n, k, np.zeros(2), SENSORS[noise])
        for c in np.array([[1.0, 0.0], [0.0, 1.5], [-1.0, -0.3]])
    ]
    result = estimate_axis(contacts, prior=prior)
    assert result.verdict == "undetermined"
    assert "flat end" in " ".join(result.reasons)


@pytest.mark.parametrize("prior", PRIORS, ids=("no prior", "prior"))
@pytest.mark.parametrize("noise", NOISES)
@pytest.mark.parametrize("theta", [(0.0, 1.05, 2.1), (0.0, 2.1, 4.2), (0.0, 1.57, 3.9, 5.0)])
def test_one_parallel_of_a_can_is_undetermined(noise, prior, theta):
    contacts = touched(cylinder(0.03, 0.1), [(t, 0.004) for t in theta], noise)
    result = estimate_axis(contacts, prior=prior)
    assert result.verdict == "undetermined"
    assert "one parallel where the profile has no slope" in " ".join(result.reasons)


@pytest.mark.parametrize("noise", NOISES)
def test_one_meridian_is_undetermined(noise):
    places = [(0.5, z) for z in (-0.02, 0.0, 0.025)]
    result = estimate_axis(touched(barrel(0.03, 4.0, 0.1), places, noise))
    assert result.verdict == "undetermined"
    assert "one meridian" in " ".join(result.reasons)


def test_three_normals_without_directions_never_fix_an_axis():
    """Finding of theory.md: the bound is infinite, a naive fit is 87 degrees off, silently."""
    blind = replace(SENSORS["gel"], deviator=1e3, flat=1e4)
    surface = SurfaceOfRevolution(AXIS, cone(0.03, 0.2, 0.1))
    places = ((0.0, -0.02), (1.5, 0.0), (3.4, 0.02))
    contacts = [replace(surface.contact(Place(t, z), blind)) for t, z in places]
    assert estimate_axis(contacts).verdict == "undetermined"


@pytest.mark.parametrize("noise", NOISES[:3])
def test_the_same_grasp_off_its_parallel_is_determined(noise):
    """The verdict does not cry wolf: heights 10 mm apart fix what one parallel leaves open."""
    places = ((0.0, -0.016), (2.1, 0.0), (4.2, 0.016))
    result = estimate_axis(touched(cylinder(0.03, 0.1), places, noise), prior=PRIORS[1])
    assert result.verdict == "determined"
    assert angle_between(result.axis, AXIS) < 1e-3


def test_two_axes_that_fit_are_called_ambiguous():
    """Two equal heights on a can: by directions alone a second axis fits exactly (label 110)."""
    noise = replace(SENSORS["gel"], curvature_scale=5.0, mean_curvature=200.0)
    places = ((0.0, 0.004), (1.8, 0.004), (3.9, 0.02))
    contacts = touched(cylinder(0.03, 0.1), places, "gel")
    result = estimate_axis([replace(c, noise=noise) for c in contacts])
    assert result.verdict == "ambiguous"
    assert "axes fit" in result.reasons[0]
    near = [h for h in result.hypotheses if angle_between(h.axis, AXIS) < 0.05]
    assert 0.2 < near[0].probability < 0.8


def test_many_touches_of_a_sphere_are_never_a_determined_axis():
    """100 times eight noisy touches: one lucky tensor among eight must not give a direction."""
    rng = np.random.default_rng(11)
    for _ in range(100):
        places = np.column_stack([rng.uniform(-np.pi, np.pi, 8), rng.uniform(-0.018, 0.018, 8)])
        ball = [_read(c, rng) for c in touched(sphere(0.03, 0.04), places, "gel")]
        assert estimate_axis(ball).verdict == "undetermined"


def test_a_sphere_felt_by_a_perfect_sensor_has_no_direction_either():
    perfect = replace(SENSORS["ideal"], deviator=0.0)
    places = ((0.0, -0.01), (2.0, 0.0), (4.2, 0.01))
    contacts = [replace(c, noise=perfect) for c in touched(sphere(0.03, 0.04), places, "gel")]
    round_ones = [replace(c, curvatures=np.full(2, 1 / 0.03)) for c in contacts]
    assert estimate_axis(round_ones).verdict == "undetermined"


def test_a_box_or_an_object_that_moved_is_not_believed():
    places = ((0.0, -0.016), (2.1, 0.0), (4.2, 0.016), (1.0, 0.02))
    contacts = touched(cylinder(0.03, 0.1), places, "gel")
    moved = replace(contacts[3], position=contacts[3].position + 0.02 * contacts[3].directions[0])
    result = estimate_axis([*contacts[:3], moved])
    assert result.p_value < 1e-4
    assert result.verdict == "undetermined"
    assert "fit no surface of revolution" in result.reasons[0]


def test_no_degenerate_touch_gives_a_confident_wrong_axis():
    """100 random grasps of a sphere and of one parallel, with reading noise in the tensor."""
    rng = np.random.default_rng(5)
    for _ in range(50):
        theta = rng.uniform(-np.pi, np.pi, size=3)
        z = rng.uniform(-0.015, 0.015, size=3)
        ball = [
            _read(c, rng) for c in touched(sphere(0.03, 0.04), zip(theta, z, strict=True), "gel")
        ]
        can = touched(cylinder(0.03, 0.1), [(t, z[0]) for t in theta], "gel")
        for contacts in (ball, [_read(c, rng) for c in can]):
            assert estimate_axis(contacts).verdict != "determined"


def _read(contact, rng):
    """A reading with noise on the curvature tensor, as sensor.md states it."""
    s = contact.noise
    d, a = s.deviator * rng.normal(size=2)
    K = (
        np.diag(contact.curvatures)
        + [[a, d], [d, -a]]
        + s.mean_curvature * rng.normal() * np.eye(2)
    )
    values, vectors = np.linalg.eigh(K)
    n = unit(contact.normal + s.normal * rng.normal(size=2) @ contact.directions)
    k = vectors.T @ contact.directions
    k = k - np.outer(k @ n, n)
    left, _, right = np.linalg.svd(k, full_matrices=False)
    return Contact(contact.position, n, left @ right, values, s)
