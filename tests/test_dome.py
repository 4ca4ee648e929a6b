"""A pad's surface in closed form: against points of it, differences, meshes and Pinocchio."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hand_models import load_hand
from hand_models.cache import hand_fingerprint
from hand_models.chains import chains_of
from hand_models.dome import LEAST_AXIS, Dome, directions_about
from hand_models.dome_fit import fit_dome
from hand_models.pads import fit_pad, pad_bulges, refined
from hand_models.spheres import link_spheres
from hand_models.symbolic import symbolic_balls
from planner.kinematics.placing import ball_jacobian, place_ball, place_joints

UP = np.array([0.0, 0.0, 1.0])
CENTRE = np.array([0.01, -0.02, 0.005])
SPHERE = Dome(CENTRE, 0.012, np.zeros((0, 3)))
CYLINDER = Dome(CENTRE, 0.008, np.array([[0.01, 0.004, 0.0]]))
DOME = Dome(CENTRE, 0.004, np.array([[0.02, 0, 0], [0, 0.01, 0.003], [0, -0.0015, 0.005]]))
HANDS = ("psyonic_right", "dex3_right", "allegro_right")
angles = st.floats(-np.pi, np.pi)


def direction(azimuth: float, height: float) -> np.ndarray:
    across = np.sqrt(1.0 - height**2)
    return np.array([across * np.cos(azimuth), across * np.sin(azimuth), height])


def points_of(dome: Dome) -> np.ndarray:
    """Inside and on it: the ellipsoid's root over a ball, and a ball about each of those points."""
    unit = directions_about(UP, np.pi, 400)
    values, vectors = np.linalg.eigh(dome.spread)
    ellipsoid = unit @ (vectors * np.sqrt(values)).T
    return (dome.centre + ellipsoid[:, None] + dome.ball * unit).reshape(-1, 3)


@pytest.mark.parametrize("dome", [SPHERE, CYLINDER, DOME])
@given(azimuth=angles, height=st.floats(-1.0, 1.0))
@settings(max_examples=40, deadline=None)
def test_it_touches_where_it_reaches_farthest(dome, azimuth, height):
    u = direction(azimuth, height)
    x = dome.touched(u)
    assert u @ x == pytest.approx(dome.heights(u), abs=1e-15)
    farthest = (points_of(dome) @ u).max()
    assert farthest <= u @ x + 1e-12  # nothing of it is beyond
    assert farthest > u @ x - 3e-4  # and something nearly there: 400 directions
    assert dome.fronts(x[None], u, 1e-9)[0]
    assert not dome.fronts(x[None], -u, 1e-9)[0]
    assert not dome.fronts((x + 1e-3 * u)[None], u, 2e-4)[0]


@pytest.mark.parametrize("dome", [SPHERE, CYLINDER, DOME])
@given(azimuth=angles, height=st.floats(-0.99, 0.99))
@settings(max_examples=40, deadline=None)
def test_it_rolls_as_it_says(dome, azimuth, height):
    u, step = direction(azimuth, height), 1e-6
    for across in np.linalg.svd(u[None])[2][1:]:
        more, less = (
            dome.touched((u + s * across) / np.linalg.norm(u + s * across)) for s in (step, -step)
        )
        rolled = (more - less) / (2 * step)
        np.testing.assert_allclose(dome.turning(u) @ across, rolled, atol=1e-5)


def test_a_cylinder_on_a_plane_has_a_place_all_the_same():
    """In its middle, and within a tilt of a degree or so it goes to the end."""
    a = CYLINDER.axes[0]
    along = a / np.linalg.norm(a)
    flat = np.array([along[1], -along[0], 0.0])
    np.testing.assert_allclose(CYLINDER.touched(flat), CENTRE + 0.008 * flat, atol=1e-12)
    assert CYLINDER.ball == 0.008 - LEAST_AXIS
    tilted = np.cos(0.3) * flat + np.sin(0.3) * along
    off = (CYLINDER.touched(tilted) - CENTRE - CYLINDER.ball * tilted) @ along
    assert off == pytest.approx(np.linalg.norm(a), rel=0.1)


@pytest.mark.parametrize("dome", [CYLINDER, DOME])
def test_a_dome_is_found_from_its_points(dome):
    normal = direction(0.4, 0.95)
    u = directions_about(normal, np.radians(40.0), 400)
    sphere = fit_pad(dome.points, normal)
    assert sphere.misfit > 2e-4
    better = refined(sphere, dome.points)
    assert better.misfit < 5e-5  # sampled points fall short by 0.02 mm
    np.testing.assert_allclose(better.dome.touched(u), dome.touched(u), atol=1.5e-3)
    exact = fit_dome(u, dome.heights(u), sphere.dome)
    assert np.abs(exact.heights(u) - dome.heights(u)).max() < 2e-5


@pytest.mark.parametrize("name", ["psyonic_right", "dex3_right"])
def test_shipped_domes_are_those_of_the_meshes(name):
    """Spheres that stand for them from afar would be wrong by millimetres at the cone's edge."""
    hand = load_hand(name)
    cone = np.radians(40.0)
    with_spheres = pad_bulges(hand.with_balls(), cone)
    assert np.all(pad_bulges(hand, cone) < 1.3e-3)
    assert np.all(pad_bulges(hand, cone) < 0.65 * with_spheres)


@pytest.mark.parametrize("name", HANDS)
def test_all_forms_of_a_ball_agree_with_pinocchio_and_with_differences(name):
    hand, rng, step = load_hand(name), np.random.default_rng(0), 1e-7
    chains, nq, joints = chains_of(hand), hand.model.nq, hand.model.njoints
    R, p, ball = np.zeros((joints, 3, 3)), np.zeros((joints, 3)), np.zeros(3)
    turning, moves, turns = np.zeros((3, 3)), np.zeros((3, nq)), np.zeros((3, nq))
    q_symbol, n_symbol = ca.SX.sym("q", nq), ca.SX.sym("n", 3, len(hand.fingers))
    rows = range(len(hand.fingers))
    balls = symbolic_balls(hand, q_symbol, rows, n_symbol)
    symbolic = ca.Function("balls", [q_symbol, n_symbol], [balls])
    for q in rng.uniform(hand.lower, hand.upper, (4, nq)):
        pose = hand.at(q)
        n = -pose.pad_normals + 0.4 * rng.normal(size=pose.pad_normals.shape)
        n /= np.linalg.norm(n, axis=1, keepdims=True)
        told = pose.ball_centres(rows, n)
        np.testing.assert_allclose(np.array(symbolic(q, n.T)).T, told, atol=1e-12)
        place_joints(chains, q, R, p)
        for i in rows:
            place_ball(chains, i, R, p, -n[i], ball, turning)
            ball_jacobian(chains, i, R, p, -n[i], ball, turning, moves, turns)
            np.testing.assert_allclose(ball, told[i], atol=1e-12)
            for c, d in enumerate(step * np.eye(nq)):
                more, less = (hand.at(q + s * d).ball_centres([i], n[i][None]) for s in (1, -1))
                np.testing.assert_allclose(moves[:, c], (more - less)[0] / (2 * step), atol=1e-5)


def test_balls_take_a_domes_place_where_they_must():
    """On an arm's hand, too; and MuJoCo, whose skins are balls, asks for them."""
    hand = load_hand("psyonic_right")
    balls = hand.with_balls()
    assert not hand.has_balls
    assert balls.has_balls
    assert balls.with_balls() is balls
    for a, b in zip(hand.fingers, balls.fingers, strict=True):
        np.testing.assert_array_equal(a.pad_centre, b.dome.centre)
        assert a.pad_radius == b.dome.radius
    q = hand.middle
    np.testing.assert_allclose(hand.at(q).pad_centres, balls.at(q).pad_centres, atol=1e-15)
    models = pytest.importorskip("sim_sensor.physics.mujoco_models")
    with pytest.raises(ValueError, match="psyonic_right has domed pads"):
        models.build_models(hand, None)


def test_what_is_kept_of_a_hand_goes_by_its_domes():
    hand = load_hand("dex3_right")
    assert hand_fingerprint(hand) != hand_fingerprint(hand.with_balls())
    middle = hand.finger("middle")
    flat = replace(middle, dome=replace(middle.dome, axes=0.5 * middle.dome.axes))
    changed = replace(hand, fingers=(*hand.fingers[:2], flat))
    assert hand_fingerprint(hand) != hand_fingerprint(changed)
    spheres = link_spheres(changed)
    index, other = (np.sort(spheres.radii[spheres.finger_indices == i]) for i in (1, 2))
    assert len(index) != len(other) or not np.allclose(index, other)


def test_a_dome_cannot_be_changed():
    for array in (DOME.centre, DOME.axes, DOME.spread, DOME.points):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0
    mine = np.zeros(3)
    Dome(mine, 0.01, np.zeros((0, 3)))
    mine[0] = 1.0  # is mine still
