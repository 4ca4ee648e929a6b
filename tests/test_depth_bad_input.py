"""Bad depth images: one clear error for misuse, a flag and a wide covariance for bad luck."""

import numpy as np
import pytest

from estimator.readers.depth import read_depth
from estimator.readers.depth_noise import DepthNoise, noise_of_frames
from estimator.readers.depth_normals import read_normals
from sim_sensor.gel import GelPad
from sim_sensor.gel_shape import arc_patches

PITCH = 0.25e-3
NOISE = DepthNoise(correlated=0.03e-3, length=1.5e-3)


def pressed(K=((40.0, 0.0), (0.0, 15.0)), seed=0, **how):
    pad = GelPad(gain=0.0, offset=0.0)
    how = {"force": 2.0, **how}
    touch = pad.ideal().press(arc_patches(np.array(K)), rng=np.random.default_rng(seed), **how)
    return touch.depth[0]


def sd_of_tensor(local):
    return np.sqrt(np.diag(local.covariance))[5:]


@pytest.mark.parametrize(
    ("depth", "how", "message"),
    [
        (np.zeros(5), {}, r"depth: expected shape \(H, W\) or \(B, H, W\)"),
        (np.zeros((2, 2, 9, 9)), {}, "depth: expected shape"),
        (np.zeros((4, 30)), {}, "H, W >= 8"),
        (np.zeros((0, 30, 30)), {}, "H, W >= 8"),
        (np.full((9, 9), "a"), {}, "depth: expected an array of numbers"),
        ([[1.0, 2.0], [3.0]], {}, "depth: expected an array of numbers"),
        (np.full((9, 9), np.inf), {}, "NaN for dead pixels"),
        (np.zeros((9, 9)), {"pixel_pitch": 0.0}, "pixel_pitch: expected a finite number > 0"),
        (np.zeros((9, 9)), {"pixel_pitch": np.nan}, "pixel_pitch: expected a finite number > 0"),
        (np.zeros((9, 9)), {"least_depth": -1.0}, "least_depth: expected a finite number > 0"),
        (np.zeros((9, 9)), {"pad_radius": 1e-3}, "half the image's diagonal"),
        (np.zeros((9, 9)), {"pad_radius": np.nan}, "half the image's diagonal"),
    ],
)
def test_misuse_is_one_clear_error(depth, how, message):
    how = {"pixel_pitch": PITCH, **how}
    with pytest.raises(ValueError, match=message):
        read_depth(depth, how.pop("pixel_pitch"), **how)


@pytest.mark.parametrize(
    ("normals", "message"),
    [
        (np.zeros((9, 9)), r"normals: expected shape \(H, W, 3\)"),
        (np.zeros((9, 9, 2)), "normals: expected shape"),
        (-np.ones((9, 9, 3)), "out of the gel"),
    ],
)
def test_misuse_of_normal_maps_is_one_clear_error(normals, message):
    with pytest.raises(ValueError, match=message):
        read_normals(normals, PITCH)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"white": -1.0}, "white: expected zero or greater"),
        ({"gain": np.nan}, "gain: expected zero or greater"),
        ({"correlated": 1e-5, "length": 0.0}, "length: expected greater than zero"),
    ],
)
def test_impossible_noises_are_refused(wrong, message):
    with pytest.raises(ValueError, match=message):
        DepthNoise(**wrong)


def test_noise_needs_two_frames():
    with pytest.raises(ValueError, match="frames: expected"):
        noise_of_frames(np.zeros((1, 20, 20)), PITCH)


def nothing():
    return GelPad(offset=0.0, gain=0.0).ideal().idle(20, rng=np.random.default_rng(0))


@pytest.mark.parametrize("images", [nothing(), np.full((2, 48, 64), np.nan), np.zeros((1, 9, 9))])
def test_no_contact_is_told_and_has_no_surface(images):
    readings = read_depth(images, PITCH, noise=NOISE)
    assert not readings.touched.any()
    assert all(flags == ("no contact",) for flags in readings.flags)
    with pytest.raises(ValueError, match="no contact; ask `touched` first"):
        readings.surface(0)


def test_a_batch_may_hold_touches_and_misses():
    readings = read_depth(
        np.stack([pressed(K=((60.0, 0.0), (0.0, 25.0)), force=0.7), np.zeros((48, 64))]),
        PITCH,
        noise=NOISE,
    )
    assert readings.touched.tolist() == [True, False]
    assert readings.surface(0).flags == ()


def test_two_contacts_are_flagged_and_widen_the_covariance():
    one = pressed(at=(-5e-3, 0.0), K=((150.0, 0.0), (0.0, 100.0)), force=0.5)
    other = pressed(at=(5e-3, 1e-3), K=((120.0, 0.0), (0.0, 150.0)), force=0.5, seed=1)
    alone = read_depth(other, PITCH, noise=NOISE).surface()
    both = read_depth(np.maximum(one, other), PITCH, noise=NOISE).surface()
    assert "two contacts" not in alone.flags
    assert "two contacts" in both.flags
    assert np.all(sd_of_tensor(both) > 2.0 * sd_of_tensor(alone))


def test_a_clipped_image_is_flagged_and_read_from_what_is_left():
    depth = pressed(force=4.0)
    whole = read_depth(depth, PITCH, noise=NOISE).surface()
    clipped = read_depth(np.minimum(depth, 0.8 * depth.max()), PITCH, noise=NOISE).surface()
    assert "depth saturated" not in whole.flags
    assert "depth saturated" in clipped.flags
    error = (clipped.tensor - np.diag([40.0, 15.0]))[[0, 1, 0], [0, 1, 1]]
    assert np.all(np.abs(error) < 3.0 * sd_of_tensor(clipped))


def test_an_image_clipped_all_over_is_flagged_and_says_little():
    local = read_depth(np.full((48, 48), 2.5e-3), PITCH).surface()
    assert "depth saturated" in local.flags
    assert np.all(np.isfinite(local.point))
    assert sd_of_tensor(local).min() > 10.0


def test_depths_in_coarse_steps_are_not_taken_for_clipped():
    depth = np.round(pressed() / 8e-6) * 8e-6
    assert "depth saturated" not in read_depth(depth, PITCH, noise=NOISE).surface().flags


def test_a_contact_beyond_the_image_is_flagged():
    assert "contact reaches the border of the image" in (
        read_depth(pressed(at=(7e-3, 0.0)), PITCH, noise=NOISE).surface().flags
    )


def test_a_point_is_too_small_to_fit_and_says_little():
    depth = np.zeros((48, 64))
    depth[20:23, 30:33] = 0.5e-3
    local = read_depth(depth, PITCH, noise=NOISE).surface()
    assert "contact too small to fit" in local.flags
    assert np.all(sd_of_tensor(local) >= 100.0)
    assert np.abs(local.position[:2] - [0.0, -0.6e-3]).max() < 1e-3
    assert local.frame[2] == pytest.approx([0.0, 0.0, -1.0])


def test_a_sphere_has_no_directions():
    depth = pressed(K=((30.0, 0.0), (0.0, 30.0)))
    local = read_depth(depth, PITCH, noise=NOISE).surface()
    assert "directions undetermined (umbilic)" in local.flags


def test_a_hollow_body_is_flagged_and_doubted():
    rows, columns = np.indices((48, 64)) * PITCH
    ring = np.hypot(rows - 6e-3, columns - 8e-3)
    depth = 0.4e-3 + np.minimum(20.0 * ring**2, 0.2e-3)
    local = read_depth(depth, PITCH, noise=NOISE).surface()
    assert local.flags
    assert np.all(sd_of_tensor(local) > 3.0)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.8])
def test_dead_pixels_cost_only_precision(share):
    depth = pressed()
    depth[np.random.default_rng(1).random(depth.shape) < share] = np.nan
    local = read_depth(depth, PITCH, noise=NOISE).surface()
    error = (local.tensor - np.diag([40.0, 15.0]))[[0, 1, 0], [0, 1, 1]]
    assert np.all(np.abs(error) < 3.5 * sd_of_tensor(local))


def test_integers_and_single_precision_are_read_too():
    depth = pressed()
    exact = read_depth(depth, PITCH, noise=NOISE).surface()
    single = read_depth(depth.astype(np.float32), PITCH, noise=NOISE).surface()
    assert single.tensor == pytest.approx(exact.tensor, rel=1e-3)
    assert not read_depth(np.zeros((9, 9), dtype=np.int64), PITCH).touched.any()


def test_contacts_larger_than_the_image_are_flagged_in_99_percent():
    """Ellipses that reach a tenth beyond the image, with noise: radii 10-60 mm, 1-5 N."""
    rng = np.random.default_rng(2)
    pad = GelPad(thickness=np.inf, gain=0.0, offset=0.0)
    psi = rng.uniform(0.0, np.pi, 1500)
    k = np.column_stack([1e3 / rng.uniform(10.0, 60.0, 1500), rng.uniform(0.0, 8.0, 1500)])
    U = np.stack([[np.cos(psi), -np.sin(psi)], [np.sin(psi), np.cos(psi)]]).transpose(2, 0, 1)
    K = np.einsum("bij,bj,bkj->bik", U, k, U)
    touch = pad.ideal().press(arc_patches(K), rng=rng, force=rng.uniform(1.0, 5.0, 1500))
    a, b = touch.ellipse.T
    wide, high = (
        np.hypot(a * np.sin(psi), b * np.cos(psi)),
        np.hypot(a * np.cos(psi), b * np.sin(psi)),
    )
    beyond = (wide > 1.1 * 8e-3) | (high > 1.1 * 6e-3)
    readings = read_depth(touch.depth, PITCH, noise=NOISE)
    flagged = np.array([any("border" in flag for flag in flags) for flags in readings.flags])
    assert beyond.sum() > 1000
    assert flagged[beyond].mean() >= 0.99
