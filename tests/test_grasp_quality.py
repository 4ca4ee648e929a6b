"""Wrench margins against closed forms, an outside solver, and the laws they must obey."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from planner.grasping.grasp_quality import (
    contact_wrenches,
    ferrari_canny,
    gauge_margin,
    has_force_closure,
)

RADIUS = 0.03


def ring(angles_deg, *, radius=RADIUS, heights=0.0):
    """Contacts on a cylinder about z."""
    t = np.deg2rad(angles_deg)
    n = np.stack([np.cos(t), np.sin(t), 0 * t], axis=-1)
    p = radius * n
    p[..., 2] = heights
    return p, n


def wrenches(p, n, *, friction=0.5, origin=(0.0, 0.0, 0.0), length=RADIUS, **options):
    origin = np.broadcast_to(origin, (*p.shape[:-2], 3))
    return contact_wrenches(p, n, friction=friction, origin=origin, torque_length=length, **options)


def random_contacts(rng, count, fingers=3):
    t = rng.uniform(0, 360, (count, fingers))
    p, n = ring(t, heights=rng.uniform(-0.02, 0.02, (count, fingers)))
    n = n + 0.2 * rng.normal(size=n.shape)
    return p, n / np.linalg.norm(n, axis=-1, keepdims=True)


@pytest.mark.parametrize("edges", [4, 16])
def test_three_fingers_at_120_degrees_have_the_margin_of_the_closed_form(edges):
    """mu / sqrt(5) as mu tends to zero, with L = r.

    Weakest is a tilt with half as much pull along the axis: two contacts feel nothing, one feels
    3/2; a small force across shares it out between the normals, a third of it to each.
    """
    friction = 1e-3
    margin = ferrari_canny(wrenches(*ring([0.0, 120.0, 240.0]), friction=friction, edges=edges))
    assert margin * np.sqrt(5.0) / friction == pytest.approx(1.0, abs=2e-3)


@pytest.mark.parametrize("half_angle_deg", [0.0, 20.0, 26.0, 27.0, 35.0])
def test_two_soft_fingers_close_where_their_line_is_in_both_cones(half_angle_deg):
    """Nguyen 1988. The cone of friction 0.5 has a half angle of 26.565 degrees."""
    p, n = ring([0.0, 180.0])
    tilt = np.deg2rad(half_angle_deg)
    n = np.array([[np.cos(tilt), np.sin(tilt), 0.0], [-np.cos(tilt), np.sin(tilt), 0.0]])
    soft = wrenches(p, n, torsion=0.005, edges=720)
    assert has_force_closure(soft[None])[0] == (half_angle_deg < 26.565)
    assert (ferrari_canny(wrenches(p, n, torsion=0.005, edges=8)) > 0) <= (half_angle_deg < 26.565)


def test_two_hard_fingers_never_close():
    """Nothing resists a torque about their line."""
    hard = wrenches(*ring([0.0, 180.0]))
    assert gauge_margin(hard[None])[0] == -np.inf
    assert ferrari_canny(hard) == 0.0


@pytest.mark.parametrize("fingers", [3, 4])
def test_the_gauge_is_the_min_weight_of_an_outside_solver(fingers):
    """max t  subject to  W a = 0, sum a = 1, a >= t: n t by HiGHS."""
    p, n = random_contacts(np.random.default_rng(fingers), 40, fingers)
    found = wrenches(p, n, length=0.05)
    gauge = gauge_margin(found)
    for W, mine in zip(found, gauge, strict=True):
        k = len(W)
        told = linprog(
            [0.0] * k + [-1.0],
            A_eq=np.c_[np.vstack([W.T, np.ones((1, k))]), np.zeros(7)],
            b_eq=[0.0] * 6 + [1.0],
            A_ub=np.c_[-np.eye(k), np.ones(k)],
            b_ub=np.zeros(k),
            bounds=[(None, None)] * (k + 1),
        )
        assert mine == pytest.approx(k * told.x[-1], rel=1e-6, abs=1e-7)
    assert 0.1 < np.mean(gauge > 1e-6) < 0.9


def test_both_margins_agree_on_force_closure():
    p, n = random_contacts(np.random.default_rng(7), 60)
    found = wrenches(p, n)
    held = has_force_closure(found)
    np.testing.assert_array_equal(held, [ferrari_canny(W) > 1e-8 for W in found])


def test_no_wrench_below_the_margin_breaks_the_grasp_and_one_just_above_does():
    """The ball is inscribed: wrenches of that size are answered, some a little larger are not."""
    W = wrenches(*ring([0.0, 120.0, 240.0], heights=np.array([-0.01, 0.0, 0.01])))
    margin = ferrari_canny(W)
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(400, 6))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)

    def answered(size):
        shifted = W[None] + size * directions[:, None]  # the hull, with the load on it
        return gauge_margin(shifted) >= -1e-7

    assert answered(0.999 * margin).all()
    support = (directions @ W.T).max(axis=1)
    assert np.all(support >= margin)
    assert answered(1.001 * support.min()).sum() < len(directions)


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    turn=st.tuples(*[st.floats(-3.0, 3.0)] * 3),
    shift=st.tuples(*[st.floats(-1.0, 1.0)] * 3),
    scale=st.floats(0.2, 5.0),
)
def test_neither_motion_nor_size_changes_a_grasp(seed, turn, shift, scale):
    """Size: with the torque length in proportion. Pyramids turn with the world, so many edges."""
    p, n = random_contacts(np.random.default_rng(seed), 1)
    R = Rotation.from_rotvec(turn).as_matrix()
    moved = wrenches(
        scale * p @ R.T + shift, n @ R.T, origin=shift, length=scale * RADIUS, edges=96
    )
    before, after = gauge_margin(wrenches(p, n, edges=96))[0], gauge_margin(moved)[0]
    assert after == pytest.approx(before, abs=0.02 * max(1.0, abs(before)))


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), scale=st.floats(0.2, 5.0), friction=st.floats(0.1, 1.0))
def test_the_gauge_knows_no_unit_and_no_origin(seed, scale, friction):
    p, n = random_contacts(np.random.default_rng(seed), 1)
    here = gauge_margin(wrenches(p, n, friction=friction))[0]
    there = wrenches(p, n, friction=friction, origin=(0.02, -0.01, 0.03), length=scale * RADIUS)
    assert gauge_margin(there)[0] == pytest.approx(here, rel=1e-5, abs=1e-6)


def test_more_friction_and_more_fingers_never_hold_less():
    p, n = random_contacts(np.random.default_rng(3), 20, 4)
    for i in range(20):
        margins = [ferrari_canny(wrenches(p[i], n[i], friction=mu)) for mu in (0.3, 0.5, 0.8)]
        assert margins == sorted(margins)
        three = ferrari_canny(wrenches(p[i, :3], n[i, :3]))
        assert three <= ferrari_canny(wrenches(p[i], n[i])) + 1e-9


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"friction": -0.1}, "friction: expected a number >= 0"),
        ({"torsion": np.nan}, "torsion"),
        ({"length": 0.0}, "torque_length: expected a length > 0"),
        ({"edges": 2}, "edges: expected at least 3, got 2"),
    ],
)
def test_nonsense_is_refused_by_name(options, message):
    with pytest.raises(ValueError, match=message):
        wrenches(*ring([0.0, 120.0, 240.0]), **options)
