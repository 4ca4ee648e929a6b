"""The simulated gel pad: the body's shape where it touches, Hertz beside, errors as stated."""

import dataclasses

import numpy as np
import pytest

from estimator.axis import Axis
from estimator.profile import barrel, cylinder, sphere
from estimator.readers.hertz import ellipse_curvatures, indentation
from estimator.surface import SurfaceOfRevolution
from sim_sensor.signals.gel import GelPad
from sim_sensor.signals.gel_contact import free_surface, outside
from sim_sensor.signals.gel_shape import POWERS, arc_patches, patches_on

QUIET = {"correlated": 0.0, "gain": 0.0, "offset": 0.0, "misplaced": 0.0, "misturned": 0.0}
UPRIGHT = Axis(np.zeros(3), np.array([0.0, 0.0, 1.0]))


def rng(seed=0):
    return np.random.default_rng(seed)


def pixels(pad):
    rows, columns = pad.shape
    y = (np.arange(rows) - 0.5 * (rows - 1)) * pad.pitch
    x = (np.arange(columns) - 0.5 * (columns - 1)) * pad.pitch
    return np.meshgrid(x, y)


def test_inside_the_contact_the_gel_has_the_spheres_shape():
    pad = GelPad(thickness=np.inf, **QUIET)
    R = 0.03
    body = patches_on(SurfaceOfRevolution(UPRIGHT, sphere(R, 0.04)), [0.4], [0.0])
    touch = pad.ideal().press(body, rng=rng(), force=2.0)
    x, y = pixels(pad)
    rho2 = x**2 + y**2
    within = rho2 < touch.ellipse[0, 1] ** 2
    wanted = touch.indentation[0] - (R - np.sqrt(R**2 - rho2))
    assert within.sum() > 200
    assert np.abs(touch.depth[0] - wanted)[within].max() < 2e-6


@pytest.mark.parametrize("at", [(3.2, 0.0), (0.0, 2.5), (3.0, 4.0), (-8.0, 1.0)])
def test_free_surface_is_that_of_the_half_space_under_hertz_pressure(at):
    """Against the sum of Boussinesq displacements p / (pi E* r) over the pressed ellipse."""
    a, b, modulus, force = 3.0, 2.0, 0.33, 1.3  # mm, N, MPa
    n = 400
    r = (np.arange(n) + 0.5) / n
    phi = (np.arange(n) + 0.5) / n * 2.0 * np.pi
    r, phi = np.meshgrid(r, phi)
    area = a * b * r / n * 2.0 * np.pi / n
    pressure = 1.5 * force / (np.pi * a * b) * np.sqrt(1.0 - r**2)
    distance = np.hypot(at[0] - a * r * np.cos(phi), at[1] - b * r * np.sin(phi))
    direct = np.sum(pressure * area / distance) / (np.pi * modulus)
    delta = float(indentation(a, b, force, modulus))
    table = free_surface(np.array([a]), np.array([b]), np.array([delta]))[0]
    assert delta * outside(*at, a, b, np.sqrt(a * b), table) == pytest.approx(direct, rel=2e-4)


def test_gel_leaves_the_body_smoothly_at_the_rim():
    a, b, modulus, force = 3.0, 2.0, 0.33, 1.3
    k_a, k_b = ellipse_curvatures(a, b, force, modulus)
    delta = float(indentation(a, b, force, modulus))
    table = free_surface(np.array([a]), np.array([b]), np.array([delta]))[0]
    for phi in np.linspace(0.0, 1.5, 5):
        x, y = a * np.cos(phi), b * np.sin(phi)
        paraboloid = delta - 0.5 * (k_a * x * x + k_b * y * y)
        assert delta * outside(x, y, a, b, np.sqrt(a * b), table) == pytest.approx(
            paraboloid, rel=1e-5
        )


def test_far_from_the_contact_only_the_force_counts():
    table = free_surface(np.array([0.5]), np.array([0.3]), np.array([1.0]))[0]
    delta = float(indentation(0.5, 0.3, 1.0, 0.3))
    assert delta * outside(6.0, 5.0, 0.5, 0.3, np.sqrt(0.15), table) == pytest.approx(
        1.0 / (np.pi * 0.3 * np.hypot(6.0, 5.0)), rel=1e-2
    )


@pytest.mark.parametrize("profile", [barrel(0.038, 3.0, 0.1), cylinder(0.01, 0.1)])
def test_patch_heights_are_those_of_the_surface_itself(profile):
    """To third order in distance the patch is exact; the rest of a micrometre is its fit."""
    surface = SurfaceOfRevolution(UPRIGHT, profile)
    patch = patches_on(surface, [0.3, 2.0], [0.01, -0.02], x_axis_W=np.array([0.3, 0.2, 0.9]))
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(-2.5e-3, 2.5e-3, 7), [-2e-3, 0.0, 2e-3]))
    for i in range(2):
        h = sum(c * u**p * v**q for c, (p, q) in zip(patch.heights[i], POWERS, strict=True))
        local = np.column_stack([u, v, -h])
        points = patch.positions[i] + local @ patch.frames[i]
        assert np.abs(surface.signed_distance(points)).max() < 1.5e-6


def test_stated_pose_puts_the_images_surface_on_the_body():
    surface = SurfaceOfRevolution(UPRIGHT, barrel(0.038, 3.0, 0.1))
    for radius in (np.inf, 0.03):
        pad = GelPad(thickness=np.inf, radius=radius, **QUIET)
        patch = patches_on(surface, [0.3], [0.01], x_axis_W=np.array([0.3, 0.2, 0.9]))
        touch = pad.ideal().press(patch, rng=rng(), force=2.0, at=(1.5e-3, -1e-3))
        x, y = pixels(pad)
        dome = np.sqrt(radius**2 - x**2 - y**2) - radius if np.isfinite(radius) else 0.0 * x
        near = np.hypot(x - 1.5e-3, y + 1e-3) < 0.9 * touch.ellipse[0, 1]
        points = np.stack([x, y, dome - touch.depth[0]], axis=-1)[near]
        X = touch.X_WS[0]
        assert np.abs(surface.signed_distance(points @ X[:3, :3].T + X[:3, 3])).max() < 3e-6


def test_indentation_is_reached_and_needs_its_force():
    pad = GelPad(**QUIET)
    bodies = arc_patches(np.array([np.diag([40.0, 6.0]), np.diag([50.0, 0.0])]))
    given = pad.ideal().press(bodies, rng=rng(), indentation=0.6e-3)
    assert given.indentation == pytest.approx([0.6e-3] * 2, rel=1e-2)
    again = pad.ideal().press(bodies, rng=rng(), force=given.force)
    assert again.indentation == pytest.approx([0.6e-3] * 2, rel=3e-2)


def test_a_bonded_layer_is_stiffer_and_relaxes_faster():
    body = arc_patches(np.diag([40.0, 20.0]))
    thick, thin = (
        GelPad(thickness=t, **QUIET).ideal().press(body, rng=rng(), force=2.0)
        for t in (np.inf, 2e-3)
    )
    assert thin.indentation[0] < 0.8 * thick.indentation[0]
    corner = [t.depth[0, 0, 0] / t.indentation[0] for t in (thick, thin)]
    assert corner[1] < 0.3 * corner[0]


def test_reconstruction_noise_has_the_stated_rms_and_correlation():
    pad = GelPad(correlated=0.03e-3, length=1.5e-3, white=0.01e-3, offset=0.0, gain=0.0)
    error = pad.ideal().idle(400, rng=rng())
    assert error.std() == pytest.approx(np.hypot(0.03e-3, 0.01e-3), rel=0.03)
    lag = 6  # 1.5 mm: one length
    along = np.mean(error[:, :, lag:] * error[:, :, :-lag])
    across = np.mean(error[:, lag:] * error[:, :-lag])
    assert along == pytest.approx((0.03e-3) ** 2 * np.exp(-0.5), rel=0.1)
    assert across == pytest.approx(along, rel=0.15)


def test_a_session_errs_alike_in_all_its_images():
    pad = dataclasses.replace(GelPad(), correlated=0.0)
    body = arc_patches(np.diag([40.0, 20.0]))
    session = pad.session(rng=rng(3))
    first, second = (session.press(body, rng=rng(s), force=2.0) for s in (1, 2))
    assert np.array_equal(first.depth, second.depth)
    ideal = pad.ideal().press(body, rng=rng(1), force=2.0)
    assert first.depth[0] == pytest.approx(ideal.depth[0] * session.gain + session.offset, abs=1e-9)
    error = ideal.X_WS[0] @ np.linalg.inv(first.X_WS[0])
    assert 0.0 < np.linalg.norm(error - np.eye(4)) < 0.1
    other = pad.session(rng=rng(4))
    assert other.gain != session.gain


def test_deep_images_clip():
    pad = GelPad(deepest=0.3e-3)
    touch = pad.ideal().press(arc_patches(np.diag([20.0, 20.0])), rng=rng(), indentation=0.6e-3)
    assert touch.depth.max() == 0.3e-3


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"pitch": 0.0}, "pitch: expected > 0"),
        ({"poisson": 0.7}, "poisson: expected 0 to 0.5"),
        ({"correlated": -1.0}, "correlated: expected >= 0"),
        ({"radius": 5e-3}, "dome wider than the image"),
        ({"size": (1e-3, 1e-3)}, "8 x 8 pixels or more"),
    ],
)
def test_impossible_pads_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        GelPad(**change)


@pytest.mark.parametrize(
    ("press", "message"),
    [
        ({}, "one of force"),
        ({"force": 1.0, "indentation": 1e-3}, "one of force"),
        ({"force": -1.0}, "greater than zero"),
        ({"force": 1.0, "at": (9e-3, 0.0)}, "on a pad of"),
    ],
)
def test_impossible_touches_are_refused(press, message):
    with pytest.raises(ValueError, match=message):
        GelPad().ideal().press(arc_patches(np.eye(2) * 30.0), rng=rng(), **press)
