"""The touch that is proposed tells the axes apart, where a touch anywhere often does not."""

from dataclasses import replace

import numpy as np
import pytest

from estimator.axis import Axis, angle_between, offset_at
from estimator.contact import Contact
from estimator.fusion import estimate_axis
from estimator.profile import barrel, cone, cylinder
from estimator.sensors import SENSORS
from estimator.smooth import smooth_profile, surface_through
from estimator.surface import Place, SurfaceOfRevolution
from estimator.telling import telling_contact, telling_words
from estimator.vectors import unit

AXIS = Axis(np.array([0.4, 0.1, 0.2]), np.array([0.2, -0.1, 1.0]))
CAN = SurfaceOfRevolution(AXIS, cylinder(0.03, 0.1))
COARSE = replace(SENSORS["gel"], curvature_scale=2.0, mean_curvature=50.0)
EQUAL_HEIGHTS = ((0.0, 0.004), (1.8, 0.004), (3.9, 0.02))


def two_equal_heights(noise=COARSE, surface=CAN, places=EQUAL_HEIGHTS):
    return [surface.contact(Place(*place), noise) for place in places]


def ambiguous():
    """By directions alone a second axis fits two equal heights on a can exactly."""
    vague = replace(SENSORS["gel"], curvature_scale=5.0, mean_curvature=200.0)
    contacts = two_equal_heights(vague)
    estimate = estimate_axis(contacts)
    assert estimate.verdict == "ambiguous"
    return contacts, estimate


def read(contact, rng):
    """A reading with noise on position, normal and the deviator of the curvature tensor."""
    s = contact.noise
    a, d = s.deviator * rng.normal(size=2)
    K = np.diag(contact.curvatures) + np.array([[a, d], [d, -a]])
    values, vectors = np.linalg.eigh(K * np.exp(0.3 * rng.normal()))
    n = unit(contact.normal + s.normal * rng.normal(size=2) @ contact.directions)
    k = vectors.T @ contact.directions
    left, _, right = np.linalg.svd(k - np.outer(k @ n, n), full_matrices=False)
    values = np.where(np.abs(values) < s.flat, np.nan, values)
    position = contact.position + s.position * rng.normal(size=3)
    return Contact(position, n, left @ right, values, s)


def nearest_place(surface, position):
    place = surface.place_of(position)
    return Place(place.theta, float(np.clip(place.z, *surface.profile.z_range)))


def is_right(estimate, axis):
    return (
        angle_between(estimate.axis, axis) < 0.17
        and offset_at(estimate.axis, axis, axis.point) < 8e-3
    )


def test_touching_there_determines_the_axis_that_two_equal_heights_leave_ambiguous():
    contacts, estimate = ambiguous()
    telling = telling_contact(estimate.hypotheses, contacts)
    place = nearest_place(CAN, telling.position)
    after = estimate_axis([*contacts, CAN.contact(place, contacts[0].noise)])
    assert after.verdict == "determined"
    assert is_right(after, AXIS)
    assert telling.log_odds > 4.0
    assert telling.pair == (0, 1)


def test_a_touch_there_settles_far_more_often_than_another_near_the_contacts():
    """40 ambiguous triples of random cans, cones and barrels; five random touches of each, between
    the heights that were touched."""
    rng = np.random.default_rng(3)
    profiles = (cylinder(0.03, 0.1), cone(0.03, 0.2, 0.1), barrel(0.03, 4.0, 0.1))
    proposed, anywhere, wrong, count = 0, 0.0, 0, 0
    while count < 40:
        axis = Axis(AXIS.point, rng.normal(size=3))
        surface = SurfaceOfRevolution(axis, profiles[rng.integers(3)])
        places = np.column_stack([rng.uniform(-np.pi, np.pi, 3), rng.uniform(-0.03, 0.03, 3)])
        contacts = [read(c, rng) for c in two_equal_heights(COARSE, surface, places)]
        estimate = estimate_axis(contacts)
        if estimate.verdict != "ambiguous":
            continue
        count += 1
        for _ in range(5):
            height = rng.uniform(places[:, 1].min(), places[:, 1].max())
            place = Place(rng.uniform(-np.pi, np.pi), height)
            anywhere += settled(contacts, surface, place, rng)[0] / 5
        telling = telling_contact(estimate.hypotheses, contacts)
        if telling is not None:
            right, false = settled(contacts, surface, nearest_place(surface, telling.position), rng)
            proposed, wrong = proposed + right, wrong + false
    assert wrong <= 2
    assert proposed >= 35
    assert count - proposed <= 0.7 * (count - anywhere), (proposed, anywhere)


def settled(contacts, surface, place, rng):
    """Whether one more touch determines the right axis, or a wrong one."""
    touch = read(surface.contact(place, contacts[0].noise), rng)
    after = estimate_axis([*contacts, touch])
    right = is_right(after, surface.axis)
    return after.verdict == "determined" and right, after.verdict == "determined" and not right


def test_the_place_is_on_the_surface_and_apart_from_the_contacts():
    contacts, estimate = ambiguous()
    telling = telling_contact(estimate.hypotheses, contacts)
    surface = surface_through(estimate.axis, contacts, telling.position[None])
    np.testing.assert_allclose(surface.p[0], telling.position, atol=1e-9)
    np.testing.assert_allclose(surface.n[0], telling.normal, atol=1e-9)
    assert min(np.linalg.norm(c.position - telling.position) for c in contacts) > 5e-3


def test_the_proposal_moves_with_the_object():
    contacts, estimate = ambiguous()
    telling = telling_contact(estimate.hypotheses, contacts)
    R = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    shift = np.array([0.3, -0.2, 0.1])
    moved = [
        replace(
            c,
            position=R @ c.position + shift,
            normal=R @ c.normal,
            directions=c.directions @ R.T,
        )
        for c in contacts
    ]
    again = telling_contact(estimate_axis(moved).hypotheses, moved)
    np.testing.assert_allclose(again.position, R @ telling.position + shift, atol=1e-5)


def test_one_hypothesis_or_no_contact_needs_no_touch():
    contacts, estimate = ambiguous()
    assert telling_contact(estimate.hypotheses[:1], contacts) is None
    assert telling_contact((), contacts) is None
    assert telling_contact(estimate.hypotheses, contacts[:1]) is None


def test_hypotheses_that_are_one_axis_cannot_be_told_apart():
    contacts, estimate = ambiguous()
    best = replace(estimate.best, probability=0.5)
    assert telling_contact((best, best), contacts) is None
    assert "touch far" in telling_words(None)


def test_words_name_the_place_and_the_way_to_it():
    contacts, estimate = ambiguous()
    telling = telling_contact(estimate.hypotheses, contacts)
    x, y, z = 1e3 * telling.position
    assert f"touch near ({x:.1f}, {y:.1f}, {z:.1f}) mm" in telling_words(telling)


@pytest.mark.parametrize(
    "profile", [cylinder(0.03, 0.1), cone(0.03, 0.3, 0.1), barrel(0.03, 4.0, 0.1)]
)
def test_the_smooth_surface_is_the_touched_one_between_the_touches(profile):
    surface = SurfaceOfRevolution(AXIS, profile)
    places = ((0.0, -0.02), (1.8, 0.0), (3.9, 0.02))
    contacts = two_equal_heights(SENSORS["ideal"], surface, places)
    truth = surface.at(np.linspace(-3.0, 3.0, 9), np.linspace(-0.02, 0.02, 9))
    found = surface_through(AXIS, contacts, truth.p)
    np.testing.assert_allclose(found.p, truth.p, atol=2e-4)
    np.testing.assert_allclose(found.n, truth.n, atol=0.03)
    np.testing.assert_allclose(found.kappa_theta, truth.kappa_theta, rtol=0.03)


def test_the_smooth_profiles_derivatives_are_those_of_its_radius():
    z = np.array([-0.02, 0.0, 0.025])
    values = np.array([[0.03, 0.032, 0.029], [0.2, 0.0, -0.3], [-8.0, -5.0, 0.0]])
    sds = np.array([[1e-4] * 3, [0.02] * 3, [3.0] * 3])
    heights = np.linspace(-0.03, 0.03, 7)
    h = 1e-5
    low, here, high = (smooth_profile(z, values, sds, heights + d) for d in (-h, 0.0, h))
    np.testing.assert_allclose(here[1], (high[0] - low[0]) / (2 * h), atol=1e-6)
    np.testing.assert_allclose(here[2], (high[1] - low[1]) / (2 * h), atol=1e-4)


def test_two_touches_at_one_height_that_disagree_give_a_finite_profile_between_them():
    z = np.zeros(2)
    values = np.array([[0.02, 0.04], [0.0, 0.0], [0.0, 0.0]])
    r, dr, ddr = smooth_profile(z, values, np.full((3, 2), 1e-3), np.array([0.0, 0.01]))
    assert 0.025 < r[0] < 0.035
    assert np.all(np.isfinite([r, dr, ddr]))
