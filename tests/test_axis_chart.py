"""Lines without a sign: distances, angles, and the chart covariances live in."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from estimator.axis import Axis, angle_between, distance_between, from_chart, offset_at, to_chart

vector = st.tuples(*[st.floats(-3, 3)] * 3).map(np.array)
direction = vector.filter(lambda v: np.linalg.norm(v) > 0.1)
tilt = st.one_of(st.floats(1e-9, 1e-6), st.floats(1e-6, 1.5), st.sampled_from([0.0, 1e-9, 1.569]))


def perpendicular(u, seed):
    across = seed - (seed @ u) * u
    return across / np.linalg.norm(across)


@given(
    point=vector, u=direction, angle=tilt, heading=st.floats(0, 2 * np.pi),
    shift=st.tuples(st.floats(-2, 2), st.floats(-2, 2)),
)  # fmt: skip
@settings(deadline=None, max_examples=200)
def test_chart_coordinates_return_after_a_round_trip_at_any_tilt_below_90_degrees(
    point, u, angle, heading, shift
):
    reference = Axis(point, u)
    x = np.array([*shift, angle * np.cos(heading), angle * np.sin(heading)])
    axis = from_chart(reference, x)
    assert angle_between(reference, axis) == pytest.approx(angle, rel=1e-6, abs=1e-15)
    np.testing.assert_allclose(to_chart(reference, axis), x, rtol=1e-6, atol=1e-14)


@given(p=vector, u=direction, q=vector, v=direction)
@settings(deadline=None, max_examples=200)
def test_a_line_returns_after_a_round_trip_through_the_chart(p, u, q, v):
    reference, axis = Axis(p, u), Axis(q, v)
    assume(angle_between(reference, axis) < np.pi / 2 - 1e-6)
    again = from_chart(reference, to_chart(reference, axis))
    assert angle_between(axis, again) < 1e-12
    assert offset_at(axis, again, reference.point) < 1e-11


@given(p=vector, u=direction, q=vector, v=direction, slide=st.floats(-5, 5))
@settings(deadline=None, max_examples=100)
def test_neither_the_sign_of_a_direction_nor_the_choice_of_its_point_matters(p, u, q, v, slide):
    a, b = Axis(p, u), Axis(q, v)
    same = Axis(b.point + slide * b.direction, -v)
    assume(angle_between(a, b) < np.pi / 2 - 1e-6)
    np.testing.assert_allclose(to_chart(a, same), to_chart(a, b), atol=1e-9)
    assert angle_between(a, same) == pytest.approx(angle_between(a, b), abs=1e-12)
    assert distance_between(a, same) == pytest.approx(distance_between(a, b), abs=1e-6)
    assert offset_at(a, same, p) == pytest.approx(offset_at(a, b, p), abs=1e-9)


@given(p=vector, u=direction)
@settings(deadline=None, max_examples=50)
def test_the_reference_itself_is_the_origin_of_its_chart(p, u):
    axis = Axis(p, u)
    np.testing.assert_allclose(to_chart(axis, axis), 0.0, atol=1e-14)
    np.testing.assert_allclose(to_chart(axis, Axis(p, -u)), 0.0, atol=1e-14)


@pytest.mark.parametrize("angle", [1e-12, 1e-9, 1e-6, 1e-3, 0.5, np.pi / 2])
def test_small_angles_are_accurate_where_an_arccosine_returns_zero(angle):
    rng = np.random.default_rng(0)
    for _ in range(20):
        u = rng.normal(size=3)
        u /= np.linalg.norm(u)
        v = np.cos(angle) * u + np.sin(angle) * perpendicular(u, rng.normal(size=3))
        a, b = Axis(rng.normal(size=3), u), Axis(rng.normal(size=3), -v)
        assert angle_between(a, b) == pytest.approx(angle, rel=1e-6, abs=3e-16)


def test_distance_between_lines_is_the_smallest_over_all_pairs_of_points():
    rng = np.random.default_rng(1)
    s = np.linspace(-40, 40, 1601)
    for _ in range(10):
        a, b = (Axis(rng.normal(size=3), rng.normal(size=3)) for _ in range(2))
        on_a, on_b = (x.point + s[:, None] * x.direction for x in (a, b))
        nearest = np.linalg.norm(on_a - np.array([b.foot(p) for p in on_a]), axis=1).min()
        assert distance_between(a, b) <= nearest + 1e-12
        assert distance_between(a, b) == pytest.approx(nearest, abs=1e-2)
        assert distance_between(a, b) == pytest.approx(distance_between(b, a), abs=1e-12)
        assert np.linalg.norm(on_b - a.foot(on_b), axis=1).min() >= distance_between(a, b) - 1e-12


def test_distance_of_parallel_lines_is_their_offset_anywhere():
    a = Axis([0.0, 0.0, 0.0], [1.0, 2.0, 2.0])
    b = Axis(
        3.0 * perpendicular(a.direction, np.array([0.0, 0.0, 1.0])) + 7 * a.direction, [1, 2, 2]
    )
    assert distance_between(a, b) == pytest.approx(3.0)
    assert offset_at(a, b, np.array([5.0, 6.0, 7.0])) == pytest.approx(3.0)


def test_line_distance_may_vanish_for_a_wrong_axis_but_the_offset_beside_a_contact_does_not():
    truth, wrong = Axis([0, 0, 0], [0, 0, 1]), Axis([0, 0, 0], [1, 0, 0])
    assert distance_between(truth, wrong) == 0.0
    assert offset_at(truth, wrong, np.array([1.0, 0.0, 1.0])) == pytest.approx(np.sqrt(2))


def test_the_foot_is_the_nearest_point_and_based_near_keeps_the_line():
    axis = Axis([1.0, 2.0, 3.0], [1.0, -1.0, 0.5])
    point = np.array([0.3, -2.0, 5.0])
    foot = axis.foot(point)
    assert (point - foot) @ axis.direction == pytest.approx(0.0, abs=1e-12)
    moved = axis.based_near(point)
    np.testing.assert_allclose(moved.point, foot)
    assert offset_at(axis, moved, point) < 1e-12


@pytest.mark.parametrize(
    ("point", "u", "message"),
    [
        ([0, 0], [0, 0, 1], r"axis point: expected shape \(3,\), got \(2,\)"),
        ([0, 0, np.nan], [0, 0, 1], "axis point: expected finite numbers"),
        ([0, 0, 0], [0, 0, 0], "axis direction: length zero points nowhere"),
        ([0, 0, 0], "up", "axis direction: expected numbers of shape"),
    ],
)
def test_lines_that_cannot_be_are_refused(point, u, message):
    with pytest.raises(ValueError, match=message):
        Axis(point, u)


def test_an_axis_cannot_be_changed_from_outside():
    point = np.zeros(3)
    axis = Axis(point, [0, 0, 2.0])
    point[0] = 1.0
    assert axis.point[0] == 0.0
    assert np.linalg.norm(axis.direction) == 1.0
    with pytest.raises(ValueError, match="read-only"):
        axis.point[0] = 1.0
