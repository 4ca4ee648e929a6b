"""The Monte Carlo's own truth is true: shapes, placements, scans, fuzz and statistics."""

from __future__ import annotations

import json
from pathlib import Path

import fuzz_inputs
import honesty
import numpy as np
import pytest
import scan
from detectability import powers
from scenarios import FAMILIES, RADII, draw_scenes, draw_shapes

from estimator.axis import Axis, from_chart, to_chart
from estimator.batches import AxisEstimates
from estimator.contact import require_distinct
from estimator.sensors import SENSORS
from estimator.vectors import Array


@pytest.mark.parametrize("family", FAMILIES)
def test_profiles_have_the_derivatives_they_state(family: str) -> None:
    shapes = draw_shapes(family, 50, rng=np.random.default_rng(1))
    z = np.linspace(-0.9, 0.9, 7) * shapes.half_height * shapes.radius
    h = 1e-4 * shapes.radius
    below, here, above = (shapes.derivatives(z + k * h)[0] for k in (-1, 0, 1))
    _, dr, ddr = shapes.derivatives(z)
    np.testing.assert_allclose((above - below) / (2 * h), dr, atol=1e-5)
    np.testing.assert_allclose((above - 2 * here + below) / h**2 * shapes.radius,
                               ddr * shapes.radius, atol=2e-3)  # fmt: skip
    assert here.min() > 0.2 * RADII[0]
    np.testing.assert_allclose(shapes.derivatives(0 * z)[0] / shapes.radius, 1.0)


@pytest.mark.parametrize("family", FAMILIES)
def test_places_lie_on_a_surface_of_revolution_about_the_true_axis(family: str) -> None:
    scenes = draw_scenes(family, 40, 5, rng=np.random.default_rng(2))
    g, u = scenes.geometry, scenes.directions[:, None]
    out = g.p - scenes.points[:, None]
    rad = out - np.sum(out * u, axis=-1, keepdims=True) * u
    r = np.linalg.norm(rad, axis=-1)
    rad /= r[..., None]
    np.testing.assert_allclose(np.cross(u, rad), np.sign(_dot(np.cross(u, rad), g.k_theta))[
        ..., None] * g.k_theta, atol=1e-9)  # fmt: skip
    np.testing.assert_allclose(_dot(np.cross(u, rad), g.n), 0.0, atol=1e-9)  # eq. (22)
    np.testing.assert_allclose(_dot(g.n, rad) / r, g.kappa_theta, rtol=1e-9)  # eqs (2), (20)
    assert scenes.radii.min() > RADII[0]
    assert scenes.radii.max() < RADII[1]


def _dot(a: Array, b: Array) -> Array:
    return np.sum(a * b, axis=-1)


@pytest.mark.parametrize("family", FAMILIES)
def test_well_placed_contacts_have_distinct_heights_and_wrap_around(family: str) -> None:
    rng = np.random.default_rng(3)
    scenes = draw_scenes(family, 100, 3, rng=rng, placement="well-placed")
    g, u = scenes.geometry, scenes.directions[:, None]
    z = np.sort(_dot(g.p - scenes.points[:, None], u), axis=1)
    assert (np.diff(z, axis=1) / scenes.radii[:, None]).min() > 0.2
    cosines = _dot(g.k_theta, np.roll(g.k_theta, 1, axis=1))
    assert np.abs(np.rad2deg(np.arccos(cosines)) - 120.0).max() < 24.0 + 1e-6


def test_families_and_placements_are_known_by_name() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(ValueError, match="'teapot': known are cylinder, cone, barrel"):
        draw_scenes("teapot", 1, 3, rng=rng)
    with pytest.raises(ValueError, match="'anyhow': known are random, well-placed"):
        draw_scenes("cone", 1, 3, rng=rng, placement="anyhow")


def gaussian_runs(count: int, inflation: float) -> tuple[honesty.Scenes, AxisEstimates]:
    """Estimates whose errors are Gaussian and whose covariances state them `inflation` too big."""
    rng = np.random.default_rng(4)
    scenes = draw_scenes("barrel", count, 6, rng=rng)
    covariance = honesty.cramer_rao(scenes, SENSORS["gel"])
    x = np.einsum("bij,bj->bi", np.linalg.cholesky(covariance), rng.standard_normal((count, 4)))
    lines = [
        from_chart(Axis(p, u), step)
        for p, u, step in zip(scenes.points, scenes.directions, x, strict=True)
    ]
    points, directions = (np.array([getattr(a, n) for a in lines]) for n in ("point", "direction"))
    one = np.ones(count)
    return scenes, AxisEstimates(
        points, directions, inflation * covariance, one, np.zeros(count, dtype=np.intp), one,
        np.ones((count, 6)), one, 0 * one,
    )  # fmt: skip


def test_errors_are_read_in_the_chart_at_each_estimate() -> None:
    scenes, estimates = gaussian_runs(20, 1.0)
    x = honesty.charted(estimates.points, estimates.directions, scenes.points, scenes.directions)
    for i in range(20):
        truth = Axis(scenes.points[i], scenes.directions[i])
        np.testing.assert_allclose(x[i], to_chart(estimates.axis(i), truth), atol=1e-12)


def test_errors_drawn_from_the_bound_are_efficient() -> None:
    scenes, estimates = gaussian_runs(2000, 1.0)
    error = honesty.charted(
        scenes.points, scenes.directions, estimates.points, estimates.directions
    )
    ratio = honesty.efficiency(error, honesty.cramer_rao(scenes, SENSORS["gel"]))
    for figure in (ratio.angle, ratio.offset, ratio.whole):
        assert figure.low < 1.0 < figure.high
        assert figure.high - figure.low < 0.2
    twice = honesty.efficiency(2 * error, honesty.cramer_rao(scenes, SENSORS["gel"]))
    assert twice.whole.value == pytest.approx(2 * ratio.whole.value)


def test_wilson_interval_is_the_tabulated_one() -> None:
    """Eight of ten: 0.490 to 0.943 (Newcombe 1998 gives the same formula)."""
    share = honesty.proportion(np.arange(10) < 8)
    assert share == pytest.approx((0.8, 0.4902, 0.9433), abs=1e-4)


def test_probabilities_that_are_true_are_calibrated_and_others_are_not() -> None:
    rng = np.random.default_rng(6)
    stated = rng.uniform(0.3, 1.0, 20000)
    zero = np.zeros(20000)

    def runs(right: Array) -> honesty.Runs:
        return honesty.Runs(
            np.zeros((20000, 4)), zero, zero, zero.astype(np.intp), zero, stated,
            np.ones(20000, dtype=bool), right,
        )  # fmt: skip

    for b in honesty.calibration(runs(rng.random(20000) < stated)):
        assert b.observed.low - 0.01 < b.stated < b.observed.high + 0.01
    boastful = honesty.calibration(runs(rng.random(20000) < stated**2))
    assert sum(b.stated > b.observed.high for b in boastful) >= 8


def scan_file(folder: Path, dents_mm: Array) -> Path:
    """A cone of radius 30 to 50 mm, 100 mm tall, with the given residual map."""
    z = np.linspace(0.0, 100.0, 40)
    record = {
        "name": "made up",
        "profile": {"z_mm": z.tolist(), "r_mm": (30.0 + 0.2 * z).tolist()},
        "residual_map_mm": {"r_minus_profile": dents_mm.tolist()},
    }
    (folder / "a_without.json").write_text(json.dumps({"name": "no map"}))
    path = folder / "cone.json"
    path.write_text(json.dumps(record))
    return folder


def test_a_scan_without_dents_feels_like_its_profile(tmp_path: Path) -> None:
    smooth = scan.load_scan(scan_file(tmp_path, np.zeros((24, 36))))
    rng = np.random.default_rng(7)
    theta, z = rng.uniform(-4, 4, (30, 4)), rng.uniform(-0.04, 0.04, (30, 4))
    g = scan.felt(smooth, theta, z)
    r, slope = 0.040 + 0.2 * z, 0.2
    w = np.sqrt(1 + slope**2)
    rad = np.stack([np.cos(theta), np.sin(theta), 0 * theta], axis=-1)
    np.testing.assert_allclose(g.p, np.concatenate(
        [r[..., None] * rad[..., :2], z[..., None]], axis=-1), atol=5e-6)  # fmt: skip
    assert np.abs(np.sum(g.n * rad, axis=-1) - 1 / w).max() < 1e-3
    np.testing.assert_allclose(g.kappa_theta, 1 / (r * w), rtol=0.02)
    assert np.abs(g.kappa_z).max() < 0.2
    assert np.abs(g.k_theta[..., 2]).max() < 0.01


def test_a_scan_closes_around_the_object_and_feels_its_dents(tmp_path: Path) -> None:
    angles = np.deg2rad(10.0) * (np.arange(36) + 0.5)
    dents = 0.5 * np.cos(3 * angles) * np.linspace(0.5, 1.5, 24)[:, None]
    wavy = scan.load_scan(scan_file(tmp_path, dents))
    z = np.array([0.01])
    turn = np.array([0.0, 1.0, 2 * np.pi - 1e-9])
    expected = 0.042 + 5e-4 * np.cos(3 * turn) * wavy.dents.ev(z, angles[:1])[0] / (
        5e-4 * np.cos(3 * angles[0])
    )
    np.testing.assert_allclose(wavy.radius(turn, np.repeat(z, 3)), expected, atol=3e-6)
    # r = R + A cos 3 theta has the curvature of a circle plus A (9 - 1) / R^2 at a crest
    g = scan.felt(wavy, np.zeros((1, 1)), z[None])
    crest = (1 / 0.042 + 8 * (wavy.radius(turn[:1], z)[0] - 0.042) / 0.042**2) / np.hypot(1, 0.2)
    assert float(g.kappa_theta[0, 0]) == pytest.approx(crest, rel=0.05)


def test_a_folder_without_a_residual_map_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="residual map"):
        scan.load_scan(tmp_path)


@pytest.mark.parametrize("kind", fuzz_inputs.KINDS)
def test_fuzz_draws_what_a_contact_accepts(kind: str) -> None:
    for seed in range(6):
        sets = fuzz_inputs.draw_inputs(kind, 8, rng=np.random.default_rng(seed))
        for i in range(len(sets)):
            contacts = sets.take(i)  # Contact checks frames and numbers
            if kind != "nearly one point":
                require_distinct(contacts, minimum=2)


def test_no_test_notices_a_shift_too_small_and_any_test_a_large_one() -> None:
    scenes, rng = (
        draw_scenes("barrel", 4, 6, rng=np.random.default_rng(8)),
        np.random.default_rng(9),
    )
    finger = np.arange(6) % 3
    small, medium, large = (
        powers(scenes, SENSORS["gel"], finger, bias, rng=rng).mean(axis=0)
        for bias in (1e-7, 1e-3, 1.0)
    )
    np.testing.assert_allclose(small, 0.05, atol=0.02)
    np.testing.assert_allclose(large, 1.0, atol=0.02)
    assert 0.2 < medium[0] < medium[1] < 0.9  # the likelihood ratio is the better test
