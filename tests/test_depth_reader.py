"""Depth images and normal maps are read rightly: bodies, frames, domes, lines, holes."""

import numpy as np
import pytest

from estimator.axis import Axis
from estimator.profile import barrel, cylinder, spline_through
from estimator.readers.depth import read_depth
from estimator.readers.depth_cells import pool
from estimator.readers.depth_fit import fit_once, gather
from estimator.readers.depth_noise import DepthNoise, noise_of_frames
from estimator.readers.depth_normals import read_normals
from estimator.readers.depth_reading import covariance_into
from estimator.surface import SurfaceOfRevolution
from sim_sensor.signals.gel import GelPad
from sim_sensor.signals.gel_noise import depth_noise
from sim_sensor.signals.gel_shape import arc_patches, patches_on

QUIET = {"correlated": 0.0, "gain": 0.0, "offset": 0.0, "misplaced": 0.0, "misturned": 0.0}
SOFT = DepthNoise(white=1e-6, correlated=0.0)
UPRIGHT = Axis(np.zeros(3), np.array([0.0, 0.0, 1.0]))


def rng(seed=0):
    return np.random.default_rng(seed)


def disk(rho, pitch):
    """Cells of single pixels over a disk of radius rho [mm], and the fit's inverse there."""
    n = 2 * int(rho / pitch) + 3
    cells = np.empty((4, n, n))
    pool(np.zeros((n, n)), pitch, 1, cells)
    inside = np.hypot(cells[1], cells[2]) < rho
    points, centre, inv = np.empty((4, n * n)), np.empty(2), np.empty((6, 6))
    count = gather(cells, inside, np.inf, points, centre)
    assert fit_once(points, count, centre, np.zeros(6), inv)
    return cells, inside, centre, inv, count


def fit_sd(rho, pitch, noise):
    cells, inside, centre, inv, _ = disk(rho, pitch)
    out = np.empty((6, 6))
    covariance_into(cells, inside, centre, inv, pitch, 1, np.array(noise), np.empty((6, 6)), out)
    return np.sqrt(np.diag(out))


def test_white_noise_gives_the_reference_spread_of_the_tensor():
    """sensor.md, section 6, no. 12: rho = 3 mm, N = 7860, s = .03 mm: 1.84e-4 per mm."""
    pitch = 3.0 * np.sqrt(np.pi / 7860)
    assert disk(3.0, pitch)[-1] == pytest.approx(7860, rel=0.01)
    assert fit_sd(3.0, pitch, (0.03, 0.0, 1.0))[4] == pytest.approx(1.84e-4, rel=0.03)


@pytest.mark.parametrize(("ratio", "share"), [(5, 0.8), (4, 0.73), (3, 0.55), (2, 0.4)])
def test_correlated_noise_stays_under_the_bound_by_the_reference_share(ratio, share):
    """sensor.md, section 4: sd(kxy) is this share of s l sqrt(48) / rho^3."""
    s, length, rho = 0.03, 1.0, float(ratio)
    bound = s * length * np.sqrt(48.0) / rho**3
    assert fit_sd(rho, 0.1, (0.0, s, length))[4] / bound == pytest.approx(share, abs=0.08)


@pytest.mark.parametrize("length", [0.5, 1.0, 2.0])
def test_correlated_covariance_is_the_dense_one(length):
    """Against all pairs of pixels, A^-1 X'RX A^-1 with R = exp(-r^2 / 2 l^2)."""
    cells, inside, *_ = disk(3.0, 0.2)
    x, y = cells[1][inside], cells[2][inside]
    X = np.column_stack([np.ones_like(x), x, y, 0.5 * x * x, x * y, 0.5 * y * y])
    R = np.exp(-0.5 * ((x[:, None] - x) ** 2 + (y[:, None] - y) ** 2) / length**2)
    solve = np.linalg.pinv(X)
    dense = np.sqrt(np.diag(solve @ R @ solve.T))
    assert fit_sd(3.0, 0.2, (0.0, 1.0, length)) == pytest.approx(dense, rel=0.05)


@pytest.mark.parametrize("pixels", [1, 4])
def test_correlated_covariance_is_that_of_the_fit_repeated_on_drawn_noise(pixels):
    cells, inside, centre, inv, _ = disk(2.5, 0.1 * pixels)
    shape = (600, *(pixels * n for n in inside.shape))
    images = depth_noise(
        shape, 0.1e-3, white=0.02e-3, correlated=0.03e-3, length=1.2e-3, rng=rng(1)
    )
    terms, points = np.zeros((len(images), 6)), np.empty((4, inside.size))
    for image, row in zip(images, terms, strict=True):
        pool(1e3 * image, 0.1, pixels, cells)
        n = gather(cells, inside, np.inf, points, centre)
        fit_once(points, n, centre, row, inv)
    out = np.empty((6, 6))
    noise = np.array([0.02, 0.03, 1.2])
    covariance_into(cells, inside, centre, inv, 0.1 * pixels, pixels, noise, np.empty((6, 6)), out)
    assert terms.std(axis=0) == pytest.approx(np.sqrt(np.diag(out)), rel=0.1)


def objects():
    vase = spline_through(
        np.linspace(-0.09, 0.09, 7), np.array([26, 33, 38, 39, 35, 30, 29]) * 1e-3
    )
    return [barrel(0.0254, 2.8, 0.1), cylinder(0.02, 0.1), vase]


@pytest.mark.parametrize("radius", [np.inf, 0.025])
@pytest.mark.parametrize("profile", objects(), ids=["barrel", "cylinder", "vase"])
def test_reading_without_noise_is_the_surface_of_revolution_itself(profile, radius):
    """World position, normal and tensor, through the stated pose; flat and domed pads."""
    surface = SurfaceOfRevolution(UPRIGHT, profile)
    pad = GelPad(pitch=0.1e-3, radius=radius, **QUIET)
    theta, z = [0.3, 1.0, 2.0], [0.0, 0.02, -0.01]
    bodies = patches_on(surface, theta, z, x_axis_W=np.array([0.5, -0.2, 0.8]))
    touch = pad.ideal().press(bodies, rng=rng(), force=[1.0, 2.0, 4.0], at=(1e-3, 0.5e-3))
    readings = read_depth(touch.depth, pad.pitch, pad_radius=radius, noise=SOFT)
    for i, X in enumerate(touch.X_WS):
        local = readings.surface(i)
        p = X[:3, :3] @ local.position + X[:3, 3]
        place = surface.place_of(p)
        truth = surface.at(np.array(place.theta), np.array(place.z))
        frame = local.frame @ X[:3, :3].T
        assert np.linalg.det(frame) == pytest.approx(1.0)
        assert abs(surface.signed_distance(p)) < 5e-6
        assert np.degrees(np.arccos(frame[2] @ truth.n)) < 0.1
        rows = frame[:2] @ np.vstack([truth.k_theta, truth.k_z]).T
        wanted = (rows * [truth.kappa_theta, truth.kappa_z]) @ rows.T
        assert local.tensor == pytest.approx(wanted, abs=0.02 * truth.kappa_theta)


@pytest.mark.parametrize("angle", [0.0, 0.7, 1.3, 2.6])
def test_directions_turn_with_the_body(angle):
    c, s = np.cos(angle), np.sin(angle)
    U = np.array([[c, -s], [s, c]])
    K = U @ np.diag([40.0, 6.0]) @ U.T
    touch = GelPad(**QUIET).ideal().press(arc_patches(K), rng=rng(), force=2.0)
    local = read_depth(touch.depth, 0.25e-3, noise=SOFT).surface()
    assert local.tensor == pytest.approx(K, abs=0.3)
    rows, curvatures = local.principal
    assert curvatures == pytest.approx([6.0, 40.0], abs=0.3)
    assert abs(rows[1] @ [c, -s, 0.0]) == pytest.approx(1.0, abs=1e-3)  # the body's y is -y


@pytest.mark.parametrize("force", [1.0, 4.0])
def test_a_line_contact_keeps_its_radius(force):
    """Where a threshold of depth sees R1 several times too large (sensor.md, section 4)."""
    pad = GelPad(thickness=np.inf, **QUIET)
    touch = pad.ideal().press(arc_patches(np.diag([50.0, 0.0])), rng=rng(), force=force)
    local = read_depth(touch.depth, pad.pitch, noise=SOFT).surface()
    assert local.tensor[0, 0] == pytest.approx(50.0, rel=0.02)
    assert abs(local.tensor[1, 1]) < 0.5
    assert "contact reaches the border of the image" in local.flags
    y, x = np.indices(pad.shape) - 0.5 * (np.array(pad.shape)[:, None, None] - 1.0)
    deep = touch.depth[0] > 0.3 * touch.depth[0].max()
    rows = np.column_stack([np.ones(deep.sum()), *(v[deep] * pad.pitch for v in (x, y))])
    rows = np.column_stack(
        [rows, 0.5 * rows[:, 1] ** 2, rows[:, 1] * rows[:, 2], 0.5 * rows[:, 2] ** 2]
    )
    naive = -np.linalg.lstsq(rows, touch.depth[0][deep], rcond=None)[0][3]
    assert naive < 25.0


def test_dead_pixels_and_holes_do_not_bias():
    pad = GelPad(pitch=0.1e-3, **QUIET)
    touch = pad.ideal().press(arc_patches(np.diag([40.0, 10.0])), rng=rng(), force=2.0)
    depth = touch.depth[0]
    depth[rng(1).random(depth.shape) < 0.3] = np.nan
    depth[60:70, 75:90] = np.nan
    local = read_depth(depth, pad.pitch, noise=SOFT).surface()
    assert local.tensor == pytest.approx(np.diag([40.0, 10.0]), abs=0.4)


def test_gain_scales_only_the_curvature_relative_to_the_pad():
    """A flat pad keeps the direction, and the stated gain error is in the covariance."""
    K = np.array([[35.0, 12.0], [12.0, 15.0]])
    touch = GelPad(**QUIET).ideal().press(arc_patches(K), rng=rng(), force=2.0)
    noise = DepthNoise(white=1e-6, correlated=0.0, gain=0.05)
    plain = read_depth(touch.depth, 0.25e-3, noise=noise).surface()
    more = read_depth(1.05 * touch.depth, 0.25e-3, noise=noise).surface()
    assert more.tensor == pytest.approx(1.05 * plain.tensor, rel=2e-3)
    sd = np.sqrt(np.diag(plain.covariance))
    assert sd[5:] == pytest.approx(0.05 * np.abs(plain.tensor[[0, 1, 0], [0, 1, 1]]), rel=0.05)


def test_frames_without_contact_tell_the_noise():
    pad = GelPad(white=0.01e-3, correlated=0.03e-3, length=1.5e-3)
    white, correlated, length = noise_of_frames(pad.ideal().idle(60, rng=rng()), pad.pitch)
    assert white == pytest.approx(0.01e-3, rel=0.1)
    assert correlated == pytest.approx(0.03e-3, rel=0.15)
    assert length == pytest.approx(1.5e-3, rel=0.15)


@pytest.mark.parametrize("radius", [np.inf, 0.025])
def test_normal_maps_give_the_same_surface_with_their_own_spread(radius):
    pad = GelPad(radius=radius, pitch=0.2e-3, thickness=np.inf, **QUIET)
    K = np.array([[40.0, -10.0], [-10.0, 8.0]])
    touch = pad.ideal().press(arc_patches(K), rng=rng(), force=3.0, at=(1e-3, 2e-3))
    rows, columns = pad.shape
    y = ((np.arange(rows) - 0.5 * (rows - 1)) * pad.pitch)[:, None]
    x = (np.arange(columns) - 0.5 * (columns - 1)) * pad.pitch
    dome = np.sqrt(radius**2 - x**2 - y**2) - radius if np.isfinite(radius) else 0.0
    slope_y, slope_x = np.gradient(dome - touch.depth[0], pad.pitch)
    normals = np.repeat(np.stack([-slope_x, -slope_y, np.ones_like(slope_x)], -1)[None], 150, 0)
    noise = DepthNoise(white=0.01, correlated=0.03, length=0.5e-3)
    for k in range(2):
        normals[..., k] += depth_noise(
            normals.shape[:3], pad.pitch, white=0.01, correlated=0.03, length=0.5e-3, rng=rng(k)
        )
    readings = read_normals(normals, pad.pitch, pad_radius=radius, noise=noise)
    exact = read_depth(touch.depth, pad.pitch, pad_radius=radius, noise=SOFT)
    errors = (readings.tensors - exact.tensors)[:, [0, 1, 0], [0, 1, 1]]
    sd = np.sqrt(np.diagonal(readings.covariances, axis1=1, axis2=2))[:, 5:].mean(axis=0)
    assert errors.std(axis=0) == pytest.approx(sd, rel=0.2)
    assert np.all(np.abs(errors.mean(axis=0)) < 0.4 * sd)
    assert np.median(readings.residuals) == pytest.approx(1.0, abs=0.1)
