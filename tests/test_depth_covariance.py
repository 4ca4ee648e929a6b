"""The depth reader's error bars hold: seeded Monte Carlo through the simulated pad.

Matched: half space, bodies whose sections are arcs, the noise that the reader is told. Radii
10-60 mm across and 40 mm to flat along, 1-5 N, any angle, places in the middle of the pad.
"""

import numpy as np
import pytest
from scipy.stats import chi2

from estimator.local_surface import misplaced
from estimator.readers.depth import read_depth
from estimator.readers.depth_noise import DepthNoise
from sim_sensor.signals.gel import GelPad
from sim_sensor.signals.gel_shape import arc_patches

QUIET = {"thickness": np.inf, "gain": 0.0, "offset": 0.0, "misplaced": 0.0, "misturned": 0.0}
NOISES = {
    "white": DepthNoise(white=0.03e-3, correlated=0.0),
    "1 mm": DepthNoise(correlated=0.03e-3, length=1e-3),
    "2 mm": DepthNoise(correlated=0.03e-3, length=2e-3),
}
GRID = [(R1, R2) for R1 in (10.0, 25.0, 60.0) for R2 in (40.0, 180.0, np.inf)]
FORCES = (1.0, 2.0, 5.0)


def pressed(noise, n, seed, R1, R2, force):
    """n images with their tensors and angles."""
    rng = np.random.default_rng(seed)
    pad = GelPad(
        white=noise.white, correlated=noise.correlated, length=noise.length or 1e-3, **QUIET
    )
    psi = rng.uniform(0.0, np.pi, n)
    U = np.stack([[np.cos(psi), -np.sin(psi)], [np.sin(psi), np.cos(psi)]]).transpose(2, 0, 1)
    K = np.einsum("bij,j,bkj->bik", U, np.array([1e3 / R1, 1e3 / R2]), U)
    at = rng.uniform(-1.5e-3, 1.5e-3, (n, 2))
    touch = pad.ideal().press(arc_patches(K), rng=rng, force=force, at=at)
    return touch.depth, pad.pitch, K, U


def tensor_errors(readings, K):
    return (readings.tensors - K)[:, [0, 1, 0], [0, 1, 1]]


def covered(readings, K):
    error = tensor_errors(readings, K)
    inverse = np.linalg.inv(readings.covariances[:, 5:, 5:])
    return np.einsum("bi,bij,bj->b", error, inverse, error) < chi2.ppf(0.95, 3)


@pytest.mark.parametrize("name", NOISES)
def test_95_percent_regions_of_the_tensor_cover_93_to_97_percent(name):
    """3780 touches over the whole grid: the count's own sd is 0.35 %."""
    hits = []
    for k, (R1, R2) in enumerate(GRID):
        for force in FORCES:
            depth, pitch, K, _ = pressed(NOISES[name], 140, 10 * k + int(force), R1, R2, force)
            readings = read_depth(depth, pitch, noise=NOISES[name])
            assert readings.touched.all()
            hits.append(covered(readings, K))
    share = np.mean(hits)
    assert 0.93 < share < 0.97
    assert np.mean(hits, axis=1).min() > 0.85


@pytest.mark.parametrize("name", NOISES)
@pytest.mark.parametrize(("R1", "R2", "force"), [(10, 40, 2), (25, 180, 1), (25, 180, 5)])
def test_predicted_spread_of_the_direction_is_the_observed_one(name, R1, R2, force):
    """Within 20 % where it is below 5 degrees."""
    depth, pitch, _, U = pressed(NOISES[name], 400, 7, R1, R2, force)
    readings = read_depth(depth, pitch, noise=NOISES[name])
    turned = np.einsum("bji,bjk,bkl->bil", U, readings.tensors, U)
    error = 0.5 * np.arctan2(2.0 * turned[:, 0, 1], turned[:, 0, 0] - turned[:, 1, 1])
    c, s = U[:, 0, 0] ** 2 - U[:, 1, 0] ** 2, 2.0 * U[:, 0, 0] * U[:, 1, 0]
    row = np.stack([-0.5 * s, 0.5 * s, c], axis=-1)
    variance = np.einsum("bi,bij,bj->b", row, readings.covariances[:, 5:, 5:], row)
    predicted = np.sqrt(np.median(variance)) / (1e3 / R1 - 1e3 / R2)
    assert np.degrees(predicted) < 5.0
    assert error.std() == pytest.approx(predicted, rel=0.2)


@pytest.mark.parametrize("name", NOISES)
def test_predicted_spread_of_height_and_normal_is_the_observed_one(name):
    """Of what stands across the surface; along it a point may lie anywhere on the body."""
    depth, pitch, K, _ = pressed(NOISES[name], 400, 11, 25.0, 60.0, 2.0)
    rng = np.random.default_rng(11)
    rng.uniform(0.0, np.pi, 400)
    at = rng.uniform(-1.5e-3, 1.5e-3, (400, 2))
    readings = read_depth(depth, pitch, noise=NOISES[name])
    flip = np.array([1.0, -1.0])  # the body's y is the pad's -y
    away = (readings.positions[:, :2] - at) * flip
    slope = np.einsum("bij,bj->bi", K, away)
    error = readings.frames[:, 2, :2] * flip - slope
    sd = np.sqrt(np.diagonal(readings.covariances, axis1=1, axis2=2))
    assert error.std(axis=0) == pytest.approx(np.sqrt(np.mean(sd[:, 3:5] ** 2, axis=0)), rel=0.2)
    assert np.abs(error).max() < 0.2


def test_a_noise_told_by_nobody_is_found_in_the_image():
    """Not as well as a told one, and what is wider than the contact cannot be seen at all."""
    share = {}
    for name, noise in NOISES.items():
        depth, pitch, K, _ = pressed(noise, 400, 3, 25.0, 100.0, 3.0)
        share[name] = np.mean(covered(read_depth(depth, pitch), K))
    assert share["white"] > 0.93
    assert share["1 mm"] > 0.9
    assert share["2 mm"] > 0.8


def test_a_pad_that_errs_beyond_its_stated_noise_widens_the_covariance():
    noise = DepthNoise(correlated=0.01e-3, length=1e-3)
    worse = DepthNoise(correlated=0.05e-3, length=1e-3)
    depth, pitch, K, _ = pressed(worse, 200, 3, 25.0, 100.0, 3.0)
    readings = read_depth(depth, pitch, noise=noise)
    assert np.mean(["poor fit" in flags for flags in readings.flags]) > 0.99
    assert np.mean(covered(readings, K)) > 0.85


def test_session_errors_are_covered_when_they_are_told():
    """A real pad: bonded layer, gain, offset, misplaced; one reading from each of 300 sessions."""
    pad = GelPad()
    told = DepthNoise(correlated=pad.correlated, length=pad.length, gain=pad.gain)
    rng = np.random.default_rng(5)
    K = np.array([[35.0, 8.0], [8.0, 12.0]])
    hits = []
    for _ in range(300):
        session = pad.session(rng=rng)
        touch = session.press(arc_patches(K), rng=rng, force=3.0)
        X = touch.X_WS[0]
        felt = read_depth(touch.depth, pad.pitch, noise=told).surface()
        local = misplaced(felt, place=pad.misplaced, turn=pad.misturned)
        across = (X[:3, :3].T @ np.eye(3))[:, :2]  # the body's x and y in S
        rows = local.frame[:2] @ across
        error = (local.tensor - rows @ K @ rows.T)[[0, 1, 0], [0, 1, 1]]
        hits.append(error @ np.linalg.solve(local.covariance[5:, 5:], error) < chi2.ppf(0.95, 3))
    assert 0.91 < np.mean(hits) <= 1.0
