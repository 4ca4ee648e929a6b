"""Error bounds: the paper's figures, and that no sampled error exceeds a bound that is tight.

Lengths in inches where the paper's figures 5 and 8 are reproduced (r = rho = 1 in, its Table 7).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from estimator.bounds import (
    PAPER_ERRORS,
    SensorErrors,
    axis_point_error,
    bound_from_directions,
    bound_from_magnitudes,
    printed_eq_72,
    tilt_gains,
)
from estimator.contact import SensorNoise
from estimator.sensors import SENSORS

INCH = 0.0254
DEG = np.pi / 180.0
ALPHA, E = PAPER_ERRORS.normal, PAPER_ERRORS.parallel_direction
DP = PAPER_ERRORS.position


def unit_vectors(rng, n, dim=3):
    v = rng.normal(size=(n, dim))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def test_figure_5_axis_point_error_and_orientation_error():
    rho = np.array([0.5, 1.0, 1.5, 2.0, 3.0]) * INCH
    expected = [0.14373, 0.277453, 0.41118, 0.54491, 0.81236]
    np.testing.assert_allclose(axis_point_error(rho, PAPER_ERRORS) / INCH, expected, atol=1e-5)
    L = np.array([0.6, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 10.0]) * INCH
    phi = [67.64, 47.72, 33.704, 21.712, 16.108, 10.659, 7.974, 5.307, 3.181]
    bound = bound_from_magnitudes(INCH, INCH, L, PAPER_ERRORS)
    np.testing.assert_allclose(bound.angle / DEG, phi, atol=5e-3)
    np.testing.assert_allclose(bound.position / INCH, 0.277453, atol=1e-5)
    np.testing.assert_allclose(bound.angle[[2, 4, 6]] / DEG, [33.704, 16.108, 7.974], atol=1e-3)


def test_figure_8_with_both_corners():
    D = np.array([10, 20, 30, 45, 60, 80, 90, 91, 100, 120, 135, 150, 160, 170]) * DEG
    delta = [0.39355, 0.17549, 0.11348, 0.07490, 0.05663, 0.04362, 0.03952, 0.03917, 0.04271,
             0.05490, 0.07174, 0.10607, 0.15809, 0.31498]  # fmt: skip
    phi = [36.905, 17.541, 11.666, 7.860, 6.008, 4.670, 4.245, 4.282, 4.670, 6.008, 7.860, 11.666,
           17.541, 36.905]  # fmt: skip
    bound = bound_from_directions(INCH, D, PAPER_ERRORS)
    np.testing.assert_allclose(bound.position / INCH, delta, atol=1e-5)
    np.testing.assert_allclose(bound.angle / DEG, phi, atol=1e-3)


def test_printed_eq_72_agrees_up_to_90_degrees_and_falls_towards_a_singularity_beyond():
    D = np.array([20.0, 60.0, 90.0]) * DEG
    np.testing.assert_allclose(
        printed_eq_72(D, E), bound_from_directions(INCH, D, PAPER_ERRORS).angle, rtol=1e-12
    )
    beyond = np.array([120.0, 150.0, 180.0]) * DEG
    np.testing.assert_allclose(printed_eq_72(beyond, E) / DEG, [3.465, 3.106, 3.0], atol=1e-3)
    assert np.all(bound_from_directions(INCH, beyond, PAPER_ERRORS).angle > 2e-3 + E)


def test_the_best_pair_is_at_90_degrees_and_for_position_at_90_plus_the_normal_error():
    def best(field):
        def cost(D):
            return float(getattr(bound_from_directions(INCH, D, PAPER_ERRORS), field))

        return minimize_scalar(cost, bounds=(0.3, 2.8), method="bounded", options={"xatol": 1e-9})

    assert best("position").x / DEG == pytest.approx(91.0, abs=0.01)
    assert best("position").fun / INCH == pytest.approx(0.039167, abs=1e-6)
    assert best("angle").x / DEG == pytest.approx(90.0, abs=0.01)
    assert best("angle").fun / DEG == pytest.approx(4.2446, abs=1e-4)


def test_no_bound_is_infinite_or_half_pi():
    singular = np.array([0.0, 1.0, 2.0, 180.0, 360.0]) * DEG
    bound = bound_from_directions(INCH, singular, PAPER_ERRORS)
    assert np.all(np.isinf(bound.position))
    np.testing.assert_array_equal(bound.angle, np.pi / 2)
    for D in (5.9, 174.1):
        assert bound_from_directions(INCH, D * DEG, PAPER_ERRORS).angle == np.pi / 2
    for L in (0.0, 0.55):
        assert bound_from_magnitudes(INCH, INCH, L * INCH, PAPER_ERRORS).angle == np.pi / 2


def test_separation_is_taken_modulo_a_turn():
    a = bound_from_directions(INCH, np.array([100.0, -100.0, 260.0, 460.0]) * DEG, PAPER_ERRORS)
    np.testing.assert_allclose(a.position, a.position[0], rtol=1e-9)
    np.testing.assert_allclose(a.angle, a.angle[0], rtol=1e-9)


def test_no_line_through_two_balls_tilts_more_than_the_magnitude_bound_and_some_do_as_much():
    rng, L = np.random.default_rng(0), 2.0 * INCH
    da = float(axis_point_error(INCH, PAPER_ERRORS))
    bound = bound_from_magnitudes(INCH, INCH, L, PAPER_ERRORS)
    e_1, e_2 = da * unit_vectors(rng, 200_000), da * unit_vectors(rng, 200_000)
    tangent = np.array([-np.cos(bound.angle), 0.0, np.sin(bound.angle)])  # touches both balls
    e_1[0], e_2[0] = da * tangent, -da * tangent
    line = np.array([0.0, 0.0, L]) + e_2 - e_1
    phi = np.arctan2(np.hypot(line[:, 0], line[:, 1]), line[:, 2])
    assert np.max(phi) <= bound.angle + 1e-12
    assert np.max(phi) >= 0.9999 * bound.angle
    s = rng.uniform(0, 1, (len(e_1), 1))
    between = np.linalg.norm((e_1 + s * (e_2 - e_1)), axis=1)
    assert np.max(between) <= bound.position


def test_no_sensor_error_moves_an_axis_point_farther_than_eq_68():
    rng = np.random.default_rng(1)
    n_true, n = np.array([0.0, 0.6, 0.8]), 100_000
    tilt = rng.choice([1.0, 0.5], n) * ALPHA
    across = np.cross(unit_vectors(rng, n), n_true)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    normal = np.cos(tilt)[:, None] * n_true + np.sin(tilt)[:, None] * across
    rho = INCH * (1.0 + PAPER_ERRORS.relative_radius * rng.choice([-1.0, 1.0], n))
    da = DP * unit_vectors(rng, n) - rho[:, None] * normal + INCH * n_true
    size = np.linalg.norm(da, axis=1)
    bound = float(axis_point_error(INCH, PAPER_ERRORS))
    assert np.max(size) <= bound
    assert np.max(size) > 0.9 * bound  # the three errors cannot be parallel: never quite tight


def trace_crossings(D, rng, n, height=0.0):
    """Where two planes with worst errors meet, in the section `height` above both contacts."""
    points, normals = [], []
    for theta in (-0.5 * D, 0.5 * D):
        radial = np.array([np.cos(theta), np.sin(theta)])
        across = np.array([-radial[1], radial[0]])
        in_section = rng.choice([-1.0, 1.0, 0.3], n) * ALPHA
        about_normal = rng.choice([-1.0, 1.0], n) * E
        k = np.cos(in_section)[:, None] * across + np.sin(in_section)[:, None] * radial
        offset = np.where(rng.random(n) < 0.5, 1.0, -1.0)[:, None] * DP * k
        points.append(INCH * radial + offset - np.tan(about_normal)[:, None] * height * k)
        normals.append(k)
    A = np.stack(normals, axis=1)
    d = np.stack([np.sum(p * k, axis=1) for p, k in zip(points, normals, strict=True)], axis=1)
    return np.linalg.norm(np.linalg.solve(A, d[..., None])[..., 0], axis=1)


@pytest.mark.parametrize("D", [20, 45, 60, 90, 91, 120, 150, 170])
@pytest.mark.parametrize("height", [0.0, 0.8 * INCH])
def test_no_pair_of_planes_meets_farther_than_the_position_bound_and_some_do_as_far(D, height):
    rng = np.random.default_rng(D)
    error = trace_crossings(D * DEG, rng, 20_000, height)
    bound = bound_from_directions(INCH, D * DEG, PAPER_ERRORS, height_offset=height).position
    assert np.max(error) <= bound * (1 + 1e-12)
    assert np.max(error) >= 0.9999 * bound


@pytest.mark.parametrize("D", [10, 30, 60, 90, 120, 150, 170])
def test_no_cross_product_of_directions_tilts_more_than_the_angle_bound(D):
    turn = np.arange(0.0, 360.0, 0.5) * DEG
    cones = []
    for theta in (0.0, D * DEG):
        k, level = np.array([[np.cos(theta), np.sin(theta), 0], [-np.sin(theta), np.cos(theta), 0]])
        across = np.outer(np.cos(turn), level) + np.outer(np.sin(turn), [0.0, 0.0, 1.0])
        cones.append(np.cos(E) * k + np.sin(E) * across)
    u = np.cross(cones[0][:, None], cones[1][None]).reshape(-1, 3)
    phi = np.arctan2(np.hypot(u[:, 0], u[:, 1]), np.abs(u[:, 2]))
    bound = bound_from_directions(INCH, D * DEG, PAPER_ERRORS).angle
    assert np.max(phi) <= bound * (1 + 1e-12)
    assert np.max(phi) >= 0.999 * bound


GAINS = [  # meridians, rms, worst, common: derived by hand for wrapped, clustered and paired
    ((0, 90), 1.4142, 1.4142, 1.4142),
    ((0, 120, 240), 1.1547, 1.3333, 0.0),
    ((0, 60, 120), 1.1547, 1.3333, 1.3333),
    ((0, 90, 45), 1.2247, 1.5, 1.2071),
    ((0, 90, 225), 1.2247, 1.5, 0.2071),
    ((0, 90, 180), 1.2247, 1.4142, 1.0),
]


@pytest.mark.parametrize(("theta", "rms", "worst", "common"), GAINS)
def test_tilt_gains_of_labelled_contacts(theta, rms, worst, common):
    gains = tilt_gains(np.array(theta) * DEG)
    assert (gains.rms, gains.worst) == (
        pytest.approx(rms, abs=1e-4),
        pytest.approx(worst, abs=1e-4),
    )
    assert gains.common == pytest.approx(common, abs=1e-4)


@pytest.mark.parametrize("theta", [(0, 90), (0, 120, 240), (0, 60, 120), (10, 80, 230, 300)])
def test_tilt_gains_are_what_turned_directions_do_to_the_least_squares_axis(theta):
    rng, sigma, n = np.random.default_rng(5), 1e-3, 20_000
    t = np.array(theta) * DEG
    k_theta = np.stack([-np.sin(t), np.cos(t), 0 * t], axis=-1)
    up = np.array([0.0, 0.0, 1.0])

    def tilt(eps):  # eps (..., n): turn each k_theta about its normal, then the smallest direction
        turned = np.cos(eps)[..., None] * k_theta + np.sin(eps)[..., None] * up
        u = np.linalg.svd(turned)[2][..., 2, :]
        return np.hypot(u[..., 0], u[..., 1])

    gains = tilt_gains(t)
    rms = np.sqrt(np.mean(tilt(sigma * rng.normal(size=(n, len(t)))) ** 2)) / sigma
    assert rms == pytest.approx(float(gains.rms), rel=0.02)
    assert tilt(sigma * np.ones(len(t))) / sigma == pytest.approx(float(gains.common), abs=1e-3)
    signs = rng.choice([-sigma, sigma], (500, len(t)))
    assert np.max(tilt(signs)) / sigma == pytest.approx(float(gains.worst), rel=1e-3)


def test_tilt_gains_are_infinite_on_one_meridian_plane():
    gains = tilt_gains(np.array([[0.0, 180.0, 0.0], [0.0, 120.0, 240.0]]) * DEG)
    assert np.isinf([gains.rms[0], gains.worst[0], gains.common[0]]).all()
    assert np.isfinite([gains.rms[1], gains.worst[1], gains.common[1]]).all()


@pytest.mark.parametrize("normal", [0.012, 0.15])
def test_bounds_from_noise_hold_two_sigma_of_sampled_curvature_tensors(normal):
    noise, rng, n = replace(SENSORS["gel"], normal=normal), np.random.default_rng(6), 100_000
    kappa_theta, kappa_z = 28.0, 3.0
    errors = SensorErrors.from_noise(noise, np.array(kappa_theta), np.array(kappa_z))
    half, xy = noise.deviator * rng.normal(size=(2, n))
    mean = noise.mean_curvature * rng.normal(size=n)
    scale = 1.0 + noise.curvature_scale * rng.normal(size=n)
    difference = 0.5 * (kappa_theta - kappa_z) + half
    turn = 0.5 * np.arctan2(xy, difference)
    tilt = noise.normal * rng.normal(size=n)
    outside = np.mean(np.hypot(turn, tilt) > errors.parallel_direction)
    assert 0.03 < outside < 0.06
    kappa = (0.5 * (kappa_theta + kappa_z) + mean + np.hypot(difference, xy)) * scale
    outside = np.mean(np.abs(kappa_theta / kappa - 1.0) > errors.relative_radius)
    assert 0.03 < outside < 0.07
    assert errors.position == 2.0 * noise.position


def test_an_umbilic_has_no_direction_bound():
    kappa = np.array([20.0, 20.0])
    errors = SensorErrors.from_noise(SENSORS["gel"], kappa, np.array([20.0, 5.0]))
    assert errors.parallel_direction[0] == np.pi / 2
    assert errors.parallel_direction[1] < 0.25
    bound = bound_from_directions(0.05, np.full(2, 1.5), errors)
    assert bound.angle[0] == np.pi / 2 > bound.angle[1]


def test_a_session_offset_widens_the_direction_bound():
    base = SensorNoise(1e-4, 0.01, 0.02, 0.5, 1.0, 0.1, 3.0)
    offset = SensorNoise(1e-4, 0.01, 0.02, 0.5, 1.0, 0.1, 3.0, direction_offset=0.1)
    narrow, wide = (
        SensorErrors.from_noise(x, np.array(30.0), np.array(0.0)) for x in (base, offset)
    )
    assert wide.parallel_direction > narrow.parallel_direction + 0.1


def test_negative_errors_are_refused():
    with pytest.raises(ValueError, match="sensor errors normal: expected numbers >= 0"):
        SensorErrors(1e-4, -0.1, 0.1, 0.1, 0.1)
