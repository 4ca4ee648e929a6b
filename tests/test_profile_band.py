"""The profile with its band: contacts give r, r' and r'', with the errors of sensor and axis."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from estimator.axis import Axis, from_chart
from estimator.band import coarse_band
from estimator.belief import coarse_belief, update
from estimator.estimate import Hypothesis, Nuisance
from estimator.prior import coarse_prior
from estimator.profile import SplineProfile, barrel, cone, cylinder, sphere
from estimator.profile_readings import ProfileReadings, profile_readings
from estimator.sensors import SENSORS
from estimator.surface import Place, SurfaceOfRevolution
from sim_sensor.noise import simulated_sensor

AXIS = Axis(np.array([0.4, 0.1, 0.2]), np.array([0.3, -0.2, 0.9]))
SURE = np.diag([1e-8, 1e-8, 1e-8, 1e-8]) ** 2
HEIGHT = 0.1


def hypothesis(n, axis=AXIS, covariance=SURE, parallel_row_0=1.0):
    return Hypothesis(axis, covariance, 1.0, 0.0, np.full(n, parallel_row_0))


def vase(radius=0.033, relief=0.12, waves=0.8, phase=0.7):
    z = np.linspace(-0.5 * HEIGHT, 0.5 * HEIGHT, 41)
    turn = 2.0 * np.pi * waves * z / HEIGHT + phase
    return SplineProfile(z, radius * (1.0 + relief * np.sin(turn)))


def touches(profile, noise="ideal", axis=AXIS):
    surface = SurfaceOfRevolution(axis, profile)
    places = ((0.0, -0.03), (1.1, 0.003), (2.3, 0.02), (4.0, 0.035))
    return [surface.contact(Place(t, z), SENSORS[noise]) for t, z in places]


def told(z, r, dr, ddr, sds):
    values = [np.atleast_1d(np.asarray(x, float)) for x in (z, r, dr, ddr)]
    covariance = np.diag(np.repeat(sds, len(values[0]))) ** 2
    return ProfileReadings(*values, covariance=covariance, by_axis=np.zeros((len(covariance), 4)))


def test_conditioning_a_band_is_exact_linear_gaussian():
    """Against Bayes' rule on a dense draw: mean of every node."""
    band = coarse_band(0.03, 0.005, (-0.05, 0.05))
    after = band.conditioned(told(0.01, 0.036, 0.1, -5.0, (1e-3, 0.02, 3.0)))
    drawn = band.sample(200_000, rng=np.random.default_rng(0))
    spline = CubicSpline(band.z, drawn, axis=1, bc_type="natural")
    misfit = ((spline(0.01) - 0.036) / 1e-3) ** 2 + ((spline(0.01, 1) - 0.1) / 0.02) ** 2
    misfit += ((spline(0.01, 2) + 5.0) / 3.0) ** 2
    weight = np.exp(-0.5 * misfit)
    effective = weight.sum() ** 2 / np.sum(weight**2)
    assert effective > 500
    mean = weight @ drawn / weight.sum()
    np.testing.assert_allclose(after.mean, mean, atol=4 * after.sd.max() / np.sqrt(effective))


def test_a_bands_radius_between_nodes_is_that_of_its_samples():
    band = coarse_band(0.03, 0.003, (-0.05, 0.05)).conditioned(
        told(0.01, 0.03, 0.1, 0.0, (1e-3, 0.02, 3.0))
    )
    drawn = band.sample(40_000, rng=np.random.default_rng(0))
    z = np.array([-0.043, 0.0, 0.0123])
    r = CubicSpline(band.z, drawn, axis=1, bc_type="natural")(z)
    mean, sd = band.radius(z)
    np.testing.assert_allclose(mean, r.mean(axis=0), atol=1e-4)
    np.testing.assert_allclose(sd, r.std(axis=0), rtol=0.02)


def test_a_reading_beyond_the_nodes_counts_along_the_straight_end():
    band = coarse_band(0.03, 0.005, (-0.05, 0.05))
    after = band.conditioned(told(0.06, 0.04, 0.2, 0.0, (1e-5, 1e-4, 1.0)))
    assert after.radius(np.array([0.05]))[0] == pytest.approx(0.038, abs=1e-5)


@pytest.mark.parametrize("profile", [cylinder(0.03, 0.1), cone(0.03, 0.3, 0.1), vase()])
@pytest.mark.parametrize("row", [0, 1])
def test_exact_contacts_give_the_exact_profile(profile, row):
    """Whichever row is the parallel's; r, r', r'' against the profile's own derivatives."""
    contacts = touches(profile)
    if row == 1:
        contacts = [
            replace(c, directions=c.directions[::-1], curvatures=c.curvatures[::-1])
            for c in contacts
        ]
    read = profile_readings(contacts, hypothesis(4, parallel_row_0=1.0 - row))
    np.testing.assert_allclose(read.z, [-0.03, 0.003, 0.02, 0.035], atol=1e-12)
    for got, true in zip((read.r, read.dr, read.ddr), profile.derivatives(read.z), strict=True):
        np.testing.assert_allclose(got, true, rtol=1e-9, atol=1e-9)


def test_an_error_of_the_axis_moves_the_readings_as_finite_differences_say():
    """Contacts of a true axis that lies at x in the chart: read minus true profile, over x."""
    profile, step, S = barrel(0.033, 2.0, HEIGHT), 1e-6, np.diag([1e-3, 2e-3, 0.05, 0.1]) ** 2
    columns = []
    for x in step * np.eye(4):
        contacts = touches(profile, axis=from_chart(AXIS, x))
        read = profile_readings(contacts, hypothesis(4))
        true = profile.derivatives(read.z)
        gap = [a - b for a, b in zip((read.r, read.dr, read.ddr), true, strict=True)]
        columns.append(np.concatenate(gap) / step)
    J = np.array(columns).T
    own = profile_readings(contacts, hypothesis(4)).covariance
    got = profile_readings(contacts, hypothesis(4, covariance=S)).covariance - own
    scale = np.sqrt(np.outer(np.diag(J @ S @ J.T), np.diag(J @ S @ J.T)))
    np.testing.assert_allclose(got / scale, J @ S @ J.T / scale, atol=1e-3)


@pytest.mark.parametrize("noise", ["gel-good", "gel", "taxel"])
def test_the_sensors_part_of_the_errors_is_what_readings_scatter(noise):
    """2000 readings of one place of a steep barrel, the axis known."""
    profile, rng = barrel(0.033, 6.0, HEIGHT), np.random.default_rng(0)
    place = SurfaceOfRevolution(AXIS, profile).at(np.array(1.0), np.array(0.03))
    session = simulated_sensor(noise).session(rng=rng)
    contacts = [session.read(place, rng=rng) for _ in range(2000)]
    rows = np.array([abs(c.directions[0] @ place.k_theta) > 0.7 for c in contacts])
    known = replace(hypothesis(2000), parallel_rows=rows.astype(float))
    read = profile_readings(contacts, known)
    true = profile.derivatives(read.z)
    error = np.array([a - b for a, b in zip((read.r, read.dr, read.ddr), true, strict=True)])
    sd = np.sqrt(np.diag(read.covariance)).reshape(3, 2000)
    np.testing.assert_allclose(np.std(error / sd, axis=1), 1.0, atol=0.1)


def test_a_doubtful_label_widens_the_curvature_unless_both_rows_agree():
    def sd_of(profile, probability):
        contacts = touches(profile, "gel")[:1]
        read = profile_readings(contacts, hypothesis(1, parallel_row_0=probability))
        return np.sqrt(read.covariance[2, 2])

    assert sd_of(cylinder(0.033, HEIGHT), 1.0) < 2.5
    assert sd_of(cylinder(0.033, HEIGHT), 0.5) > 10.0
    ball = sphere(0.06, HEIGHT)
    assert sd_of(ball, 0.5) == pytest.approx(sd_of(ball, 1.0), rel=1e-6)


@pytest.mark.parametrize("unread", ["saturated", "not measured"])
def test_a_curvature_that_was_not_read_says_nothing_of_the_bend(unread):
    """Not even that it is flat: some sensors report a concave curvature in the same way."""
    contacts = touches(vase(), "gel")
    if unread == "saturated":
        contacts = [replace(c, curvatures=[c.curvatures[0], np.nan]) for c in contacts]
    else:
        contacts = [replace(c, noise=replace(c.noise, flat=np.inf)) for c in contacts]
    read = profile_readings(contacts, hypothesis(4))
    assert np.all(np.sqrt(np.diag(read.covariance))[8:] > 900.0)
    np.testing.assert_allclose(read.r, vase().derivatives(read.z)[0], atol=1e-9)


def test_curvatures_tell_the_profile_between_the_contacts():
    """Bend read or not: the band is narrower, and nearer to the truth."""
    profile = barrel(0.033, 4.0, HEIGHT)
    contacts = touches(profile, "gel-good")[::3]
    blind = [replace(c, curvatures=[c.curvatures[0], np.nan]) for c in contacts]
    prior, z = coarse_band(0.033, 0.008, (-0.05, 0.05)), np.linspace(-0.045, 0.045, 19)
    (mean, sd), (mean_blind, sd_blind) = (
        prior.conditioned(profile_readings(c, hypothesis(2))).radius(z) for c in (contacts, blind)
    )
    true = profile.derivatives(z)[0]
    assert np.all(sd <= sd_blind + 1e-12)
    assert np.mean(sd) < 0.8 * np.mean(sd_blind)
    assert np.std(mean - true) < 0.7 * np.std(mean_blind - true)


def test_readings_are_corrected_for_what_was_found_of_finger_and_sensor():
    shift, scale = np.array([1e-3, -2e-3, 0.5e-3]), 0.2
    true = touches(vase())
    felt = [
        replace(
            c, position=c.position + shift, curvatures=c.curvatures * np.exp(-scale),
            finger="thumb", sensor="gel",
        )
        for c in true
    ]  # fmt: skip
    found = (
        Nuisance("position_bias", "thumb", shift, np.full(3, 5e-4)),
        Nuisance("scale_offset", "gel", np.array([scale]), np.array([0.1])),
        Nuisance("position_bias", "index", -shift, np.full(3, 5e-4)),
    )
    exact = profile_readings(true, hypothesis(4))
    read = profile_readings(felt, hypothesis(4), found)
    np.testing.assert_allclose(read.r, exact.r, atol=1e-12)
    np.testing.assert_allclose(read.ddr, exact.ddr, rtol=1e-9)
    stretch = np.sqrt(1.0 + read.dr**2)
    np.testing.assert_allclose(np.sqrt(np.diag(read.covariance))[:4], 5e-4 * stretch, rtol=1e-3)
    np.testing.assert_allclose(
        np.sqrt(np.diag(read.covariance))[8:], np.abs(0.1 * exact.ddr), rtol=0.05, atol=0.01
    )


def test_a_contact_that_is_grossly_wrong_does_not_bend_the_band():
    surface = SurfaceOfRevolution(AXIS, cylinder(0.033, HEIGHT))
    places = ((0.0, -0.03), (2.1, -0.01), (4.2, 0.0), (1.0, 0.01), (3.1, 0.02), (5.2, 0.03))
    good = [surface.contact(Place(t, z), SENSORS["gel"]) for t, z in places]
    g = surface.at(np.array(0.5), np.array(0.0))
    turned = np.array([g.k_theta + g.k_z, g.k_theta - g.k_z]) / np.sqrt(2.0)
    wrong = replace(
        surface.contact(Place(0.5, 0.0), SENSORS["gel"]),
        position=g.p + 0.01 * g.n + 0.02 * g.k_theta, directions=turned,
    )  # fmt: skip
    prior = coarse_prior(AXIS, angle=0.26, offset=0.015, radius=0.033, radius_sd=0.008)
    belief = coarse_belief(prior, (-0.05, 0.05))
    clean, after = update(belief, good), update(belief, [*good, wrong])
    assert after.estimate.gross_errors[-1] > 0.9
    np.testing.assert_allclose(after.band.mean, clean.band.mean, atol=2e-4)


def drawn_profile(family, rng):
    radius = 0.033 + 0.008 * rng.normal()
    if family == "cylinder":
        return cylinder(radius, HEIGHT)
    if family == "cone":
        return cone(radius, rng.choice([-1.0, 1.0]) * rng.uniform(0.05, 0.3), HEIGHT)
    if family == "barrel":
        return barrel(radius, rng.uniform(0.5, 3.0), HEIGHT)
    return vase(radius, rng.uniform(0.06, 0.15), rng.uniform(0.64, 1.0), rng.uniform(0, 2 * np.pi))


@pytest.mark.parametrize("family", ["cylinder", "cone", "barrel", "vase"])
def test_true_radii_lie_in_the_95_percent_band(family):
    """60 sessions of 3 to 8 noisy contacts anywhere with a wrong prior, 20 heights each."""
    inside = []
    for seed in range(60):
        rng = np.random.default_rng([seed, ord(family[0])])
        surface = SurfaceOfRevolution(AXIS, drawn_profile(family, rng))
        x = np.concatenate([0.0106 * rng.normal(size=2), 0.185 * rng.normal(size=2)])
        prior = coarse_prior(
            from_chart(AXIS, x), angle=0.262, offset=0.015, radius=0.033, radius_sd=0.008
        )
        session, n = simulated_sensor("gel").session(rng=rng), 3 + seed % 6
        places = zip(rng.uniform(0, 2 * np.pi, n), rng.uniform(-0.04, 0.04, n), strict=True)
        contacts = [session.read(surface.at(np.array(t), np.array(z)), rng=rng) for t, z in places]
        after = update(coarse_belief(prior, (-0.05, 0.05)), contacts)
        if after.hypotheses[0].probability < 0.95:
            continue  # the band is about the likeliest axis
        z = rng.uniform(-0.045, 0.045, 20)
        base = (AXIS.foot(after.axis.point) - AXIS.point) @ AXIS.direction
        mean, sd = after.band.radius(np.sign(after.axis.direction @ AXIS.direction) * (z - base))
        inside.append(np.abs(surface.profile.derivatives(z)[0] - mean) < 1.96 * sd)
    assert len(inside) >= 55
    assert 0.90 <= np.mean(inside) <= 0.985


def test_a_band_knows_how_it_errs_with_the_axis_it_was_read_about():
    """Against bands about axes that lie elsewhere, by differences."""
    profile, step = barrel(0.033, 6.0, HEIGHT), 1e-6
    sure = hypothesis(4, covariance=np.diag([1e-3, 1e-3, 0.02, 0.02]) ** 2)
    heights = np.array([-0.03, 0.0, 0.02])

    def band(x):
        contacts = touches(profile, "gel", axis=from_chart(AXIS, x))
        prior = coarse_band(0.033, 0.005, (-0.05, 0.05))
        return prior.conditioned(profile_readings(contacts, sure))

    J = np.array(
        [band(x).radius(heights)[0] - band(-x).radius(heights)[0] for x in step * np.eye(4)]
    )
    got = band(np.zeros(4)).radii_by_axis(heights)
    assert np.abs(got[:, :2]).max() > 0.05
    scale = np.array([1e-3, 1e-3, 0.02, 0.02])
    np.testing.assert_allclose(got * scale, J.T / (2.0 * step) * scale, atol=1e-4)
    assert not coarse_band(0.03, 0.005, (-0.05, 0.05)).radii_by_axis(heights).any()
