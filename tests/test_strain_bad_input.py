"""Bad strains are an error that says what is right, or a flagged reading with a wide covariance."""

from dataclasses import replace

import numpy as np
import pytest
from touches import FINGER, angle_error, in_cell, readings, touches

from estimator.readers.strain import read_strains
from estimator.readers.strain_array import StrainArray, taxel_array
from estimator.readers.strain_flags import (
    BEYOND,
    DEAD,
    EDGE,
    FLAGS,
    LONG,
    NO_CONTACT,
    OFF_PRIOR,
    POOR,
    SATURATED,
    TOO_FEW,
    TWO,
    UMBILIC,
)  # fmt: skip
from estimator.readers.strain_model import predicted_readings, touch_state
from estimator.readers.strain_sensitivity import revolved_tensor

N = 500


def up(read, *names):
    """Whether any of these flags is raised, for each reading."""
    return np.any(read.raised[:, [FLAGS.index(name) for name in names]], axis=1)


def usual(rng, n=N):
    psi = np.deg2rad(rng.uniform(60, 120, n))
    radii = {"R1": rng.uniform(10e-3, 25e-3, n), "R2": rng.uniform(0.1, 0.3, n)}
    return touches(rng, **radii, psi=psi, force=rng.uniform(1.5, 2.5, n)), psi


def test_shapes_and_values_that_are_no_strains_are_named():
    with pytest.raises(ValueError, match=r"expected shape \(B, 8, 8\), rows around .*\(4, 4\)"):
        read_strains(np.zeros((4, 4)), FINGER)
    with pytest.raises(ValueError, match="NaN for dead tactels, got infinity"):
        read_strains(np.full((8, 8), np.inf), FINGER)
    with pytest.raises(ValueError, match="reading 1 has no live tactel"):
        read_strains(np.stack([np.zeros((8, 8)), np.full((8, 8), np.nan)]), FINGER)
    with pytest.raises(ValueError, match="expected numbers"):
        read_strains([["much", "little"]], FINGER)
    with pytest.raises(ValueError, match="'map', 'two' or 'one', got 'both'"):
        read_strains(np.zeros((8, 8)), FINGER, curvatures="both")
    with pytest.raises(ValueError, match="one for each of 8 x 8 tactels, got 24"):
        read_strains(np.zeros((8, 8)), FINGER, response=taxel_array().response())


@pytest.mark.parametrize(
    ("field", "value", "says"),
    [
        ("depth", 0.0, "depth: expected greater than zero, got 0.0"),
        ("modulus", float("nan"), "modulus: expected greater than zero"),
        ("poisson", 0.6, "poisson: expected 0 to 0.5, got 0.6"),
        ("noise", -1.0, "noise: expected a number >= 0, got -1.0"),
        ("rounding", 0.0, "rounding and noise: one must be greater than zero"),
        ("window", (9, 4), r"window: expected 3 rows and columns or more within \(8, 8\)"),
        ("tactels", (30, 8), "tactels: 30 rows .* go more than once around"),
        ("measures", "heat", "measures: expected 'strain' or 'pressure', got 'heat'"),
    ],
)
def test_an_impossible_array_names_its_field(field, value, says):
    with pytest.raises(ValueError, match=f"strain array {says}"):
        StrainArray(**{field: value})


def test_nothing_felt_is_no_contact_and_says_nothing_of_the_surface():
    rng = np.random.default_rng(0)
    read = read_strains(rng.uniform(-5e-4, 5e-4, (N, 8, 8)), FINGER)
    assert up(read, NO_CONTACT).all()
    surface = read.surface(0)
    assert surface.force == 0.0
    assert np.all(np.sqrt(np.diagonal(surface.covariance))[5:] > 1e3)


@pytest.mark.parametrize("curvatures", ["map", "two"])
def test_an_ellipse_longer_than_the_window_is_flagged(curvatures):
    rng = np.random.default_rng(1)
    psi = np.deg2rad(rng.uniform(-20, 20, N))
    flat = 1.0 / rng.uniform(0, 10, N)
    force = rng.uniform(1, 5, N)
    states, _, long_axis = touches(
        rng, R1=rng.uniform(10e-3, 60e-3, N), R2=flat, psi=psi, force=force
    )
    read = read_strains(readings(rng, states), FINGER, curvatures=curvatures)
    outside = long_axis > 9e-3
    assert outside.sum() > 300
    assert up(read, LONG, BEYOND, UMBILIC, SATURATED, EDGE, POOR)[outside].mean() >= 0.99
    assert up(read, LONG)[(long_axis > 9.3e-3) & (long_axis < 13e-3)].mean() >= 0.99


def test_strain_beyond_the_linear_range_is_flagged_and_widened():
    rng = np.random.default_rng(2)
    psi = np.deg2rad(rng.uniform(60, 120, N))
    states, _, _ = touches(rng, R1=rng.uniform(4e-3, 8e-3, N), R2=0.1, psi=psi, force=6.0)
    strains = readings(rng, states)
    outside = strains.max(axis=(1, 2)) > 0.155
    assert outside.sum() > 200
    read = read_strains(strains, FINGER)
    assert up(read, BEYOND)[outside].all()
    calm = read_strains(strains, replace(FINGER, linear_range=1.0))
    wide, narrow = (np.trace(r.covariances, axis1=1, axis2=2)[outside] for r in (read, calm))
    assert np.all(wide > 3.0 * narrow)


@pytest.mark.parametrize(("curvatures", "share"), [("two", 0.99), ("map", 0.95)])
def test_round_bodies_have_no_direction(curvatures, share):
    """Also where a prior that is not meant for them pulls one curvature down."""
    rng = np.random.default_rng(3)
    R = rng.uniform(15e-3, 60e-3, N)
    psi = np.deg2rad(rng.uniform(40, 140, N))
    states, _, long_axis = touches(rng, R1=R, R2=1.02 * R, psi=psi, force=rng.uniform(1, 3, N))
    valid = long_axis < 8.5e-3
    read = read_strains(readings(rng, states)[valid], FINGER, curvatures=curvatures)
    assert up(read, UMBILIC, SATURATED).mean() >= share


@pytest.mark.parametrize("apart", [5e-3, 8e-3, 12e-3])
def test_two_contacts_are_not_read_as_one(apart):
    rng = np.random.default_rng(4)
    angle, centre = rng.uniform(0, 2 * np.pi, N), in_cell(rng, N)
    half = 0.5 * apart * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    strains = np.zeros((N, 8, 8))
    for sign in (-1, 1):
        radii = np.stack([rng.uniform(10e-3, 40e-3, N), rng.uniform(0.04, 0.2, N)], axis=1)
        body = revolved_tensor(radii, np.deg2rad(rng.uniform(40, 140, N)))
        states = touch_state(centre + sign * half, rng.uniform(0.7, 2, N), body, FINGER)
        strains += predicted_readings(states, FINGER)
    read = read_strains(strains + rng.uniform(-5e-4, 5e-4, strains.shape), FINGER)
    assert up(read, TWO, POOR).mean() >= 0.99


def test_saturated_tactels_do_not_fit():
    rng = np.random.default_rng(5)
    (states, _, _), _ = usual(rng)
    clipped = np.minimum(readings(rng, states), 0.02)
    assert up(read_strains(clipped, FINGER), POOR, LONG).mean() >= 0.99


def test_a_contact_at_the_rim_of_the_array_is_flagged():
    rng = np.random.default_rng(6)
    places = np.stack([np.full(N, 4.2 * FINGER.axial_pitch), rng.uniform(-2e-3, 2e-3, N)], axis=1)
    body = revolved_tensor((20e-3, 0.15), np.deg2rad(rng.uniform(60, 120, N)))
    states = touch_state(places, np.full(N, 1.5), body, FINGER)
    assert up(read_strains(readings(rng, states), FINGER), EDGE).mean() >= 0.99


@pytest.mark.parametrize("dead", [(3, 3), (4, 4), (2, 3)])
def test_a_dead_tactel_is_survived(dead):
    """Left out, not read as zero: errors stay what the covariance says they are."""
    rng = np.random.default_rng(7)
    (states, _, _), psi = usual(rng)
    strains = readings(rng, states)
    strains[:, dead[0], dead[1]] = np.nan
    read = read_strains(strains, FINGER)
    assert up(read, DEAD).mean() > 0.5  # those whose window holds it
    sound = ~up(read, UMBILIC, EDGE, TWO)
    assert sound.mean() > 0.8
    z = angle_error(read.directions, psi)[sound] / read.direction_sd[sound]
    assert 0.75 < np.sqrt(np.mean(np.clip(z, -4, 4) ** 2)) < 1.25
    place = np.linalg.norm(read.states[sound, :2] - states[sound, :2], axis=1)
    assert np.quantile(place, 0.95) < 0.2e-3


def test_too_few_live_tactels_are_not_fitted():
    strains = np.full((8, 8), np.nan)
    strains[3:5, 3:5] = 0.03
    read = read_strains(strains, FINGER)
    assert up(read, TOO_FEW).all()
    assert np.all(np.isfinite(read.surface(0).covariance))


def test_a_hollow_body_contradicts_the_prior_and_is_read_without_it():
    rng = np.random.default_rng(8)
    body = revolved_tensor((12e-3, 1.0), np.full(N, np.pi / 2))
    body[:, 0, 0] = 12.0
    body[:, 1, 1] = -50.0
    states = touch_state(in_cell(rng, N), np.full(N, 3.0), body, FINGER)
    read = read_strains(readings(rng, states), FINGER)
    assert up(read, OFF_PRIOR).mean() > 0.95
    assert np.median(np.abs(read.tensors[:, 1, 1] + 50.0)) < 5.0
