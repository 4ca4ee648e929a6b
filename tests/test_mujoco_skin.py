"""A pad in MuJoCo, on MuJoCo's own shapes, read by the depth reader: an outside judge of both."""

from __future__ import annotations

import functools

import numpy as np
import pytest

pytest.importorskip("mujoco", minversion="3.9")

import mujoco
from mujoco_finger import RADIUS, TORUS, Pressed, model_of, press

from estimator.local_surface import LocalSurface
from estimator.readers.raw_sensors import raw_sensor, with_depth
from estimator.vectors import Array
from sim_sensor.gel import GelPad
from sim_sensor.mujoco_skin import PITCH, pixels

SIDE = pixels(RADIUS) * PITCH
DEPTH = 1e-3  # of a press [m]
SPHEROID = (0.025, 0.060)  # half axes of the ellipsoid [m]


def place_on(shape: str, theta: float, t: float) -> tuple[Array, Array, Array, Array]:
    """Point, normal, direction of the parallel, and curvatures (parallel, meridian), closed form.

    Args:
        t: Height [m] on the cylinder, else the angle of the meridian curve.
    """
    out, e = np.array([np.cos(theta), np.sin(theta), 0.0]), [-np.sin(theta), np.cos(theta), 0.0]
    up = np.array([0.0, 0.0, 1.0])
    if shape == "cylinder":
        return 0.033 * out + t * up, out, np.array(e), np.array([1 / 0.033, 0.0])
    if shape == "ellipsoid":
        a, c = SPHEROID
        rho, z = a * np.cos(t), c * np.sin(t)
        n = np.cos(t) / a * out + np.sin(t) / c * up
        w = np.linalg.norm(n)
        # b/a^2 and ab/(..)^3 of the spheroid's two sections
        kappa = np.array([1 / (a * a * w), 1 / (a * a * c * c * w**3)])
        return rho * out + z * up, n / w, np.array(e), kappa
    big, small = TORUS
    n = np.cos(t) * out + np.sin(t) * up
    rho = big + small * np.cos(t)
    return big * out + small * n, n, np.array(e), np.array([np.cos(t) / rho, 1 / small])


PLACES = {
    "cylinder": (-0.03, 0.03),
    "ellipsoid": (-0.6, 0.6),
    "torus outside": (-0.7, 0.7),
    "torus inside": (np.pi - 0.4, np.pi + 0.4),
}


@functools.cache
def model(shape: str) -> mujoco.MjModel:
    return model_of(shape)


def pressed_on(
    where: str, rng: np.random.Generator, depth: float = DEPTH
) -> tuple[Pressed, tuple[Array, Array, Array, Array]]:
    """A pad pressed somewhere, turned any way about the normal."""
    shape = where.split()[0]
    theta, t, roll = rng.uniform([-np.pi, PLACES[where][0], -1.5], [np.pi, PLACES[where][1], 1.5])
    p, n, e, kappa = place_on(shape, theta, t)
    along = np.cos(roll) * e + np.sin(roll) * np.cross(n, e)
    return press(model(shape), p, n, depth, along=along), (p, n, e, kappa)


@pytest.mark.parametrize("where", PLACES)
def test_the_reader_finds_what_mujoco_is_pressed_on(where: str) -> None:
    rng = np.random.default_rng(0)
    for _ in range(12):
        pressed, (p, n, e, kappa) = pressed_on(where, rng)
        told = pressed.surface()
        R = pressed.X_WS[:3, :3]
        rows = told.frame @ R.T
        at = R @ told.position + pressed.X_WS[:3, 3]
        assert np.rad2deg(np.arccos(min(1.0, rows[2] @ n))) < 1.0  # it is read beside p
        assert abs((at - p) @ n) < 5e-5
        x = np.stack([rows[:2] @ e, rows[:2] @ np.cross(n, e)])
        expected = x.T * kappa @ x
        # a reader's tensor is good to a few per cent of the relative curvature it sees
        np.testing.assert_allclose(told.tensor, expected, atol=0.06 * (kappa.max() + 1 / RADIUS))
        values, vectors = np.linalg.eigh(told.tensor)
        direction = vectors[:, int(np.argmin(np.abs(values - kappa[0])))] @ rows[:2]
        assert np.rad2deg(np.arccos(min(1.0, abs(direction @ e)))) < 1.0


def errors(told: LocalSurface, clean: LocalSurface, X: Array) -> Array:
    """Height, normal and tensor of a reading in a frame at X against the clean one beside it."""
    rows, at = told.frame @ X[:3, :3].T, X[:3, :3] @ told.position + X[:3, 3]
    gap = at - clean.position
    v = clean.frame[:2] @ gap
    below = gap @ clean.frame[2] + 0.5 * v @ clean.tensor @ v
    n = clean.frame[2] + v @ clean.tensor @ clean.frame[:2]
    x = rows[:2] @ clean.frame[:2].T
    off = told.tensor - x @ clean.tensor @ x.T
    return np.array([below, -rows[0] @ n, -rows[1] @ n, off[0, 0], off[1, 1], off[0, 1]])


@pytest.mark.parametrize("where", ["cylinder", "ellipsoid", "torus inside"])
def test_what_the_reader_says_of_its_errors_is_true_in_mujoco(where: str) -> None:
    """With a gel's noise and mounting errors that the reader is not told: 120 presses."""
    sensor = with_depth(raw_sensor("gel-depth"), pixel_pitch=PITCH, radius=RADIUS)
    pad = GelPad(pitch=PITCH, size=(SIDE, SIDE), radius=RADIUS)
    rng = np.random.default_rng(1)
    squares = []
    for _ in range(120):
        pressed, _ = pressed_on(where, rng)
        clean, session = pressed.surface(), pad.session(rng=rng)
        told = sensor.read(session.image(1e3 * pressed.depth[None], rng=rng)[0])
        assert told is not None
        error = errors(told, clean, np.linalg.inv(session.X_SM))
        squares.append(error @ np.linalg.solve(told.covariance[2:, 2:], error))
    mean = float(np.mean(squares)) / 6.0
    assert 0.7 < mean < 1.4, mean  # 1 if honest; sd of the mean of 120 is 0.05


def test_a_pad_that_is_not_pressed_feels_nothing() -> None:
    p, n, e, _ = place_on("cylinder", 0.0, 0.0)
    with pytest.raises(AssertionError):
        press(model("cylinder"), p, n, -1e-4, along=e)


def test_depth_is_along_the_pads_own_z() -> None:
    """On a plane tilted in the image, depth along z is the depth along the normal over cos."""
    pressed, (_, n, _, _) = pressed_on("cylinder", np.random.default_rng(3))
    z = pressed.X_WS[:3, 2]
    assert np.rad2deg(np.arccos(-z @ n)) < 3.0  # the grid is aimed at the contact
    assert pressed.depth.max() == pytest.approx(DEPTH, rel=0.02)
    assert pressed.depth.min() == 0.0


def test_a_small_pad_has_a_small_image() -> None:
    """A fingertip of 6 mm: its dome has no place for 12 mm of pixels."""
    small = 0.006
    p, n, e, kappa = place_on("cylinder", 0.3, 0.01)
    pressed = press(model_of("cylinder", small), p, n, 0.8e-3, along=e, radius=small)
    assert pressed.depth.shape == (28, 28)
    told = with_depth(raw_sensor("gel-depth"), pixel_pitch=PITCH, radius=small).read(pressed.depth)
    assert told is not None
    assert told.tensor[0, 0] == pytest.approx(kappa[0], rel=0.2)
    assert told.tensor[1, 1] == pytest.approx(0.0, abs=6.0)
