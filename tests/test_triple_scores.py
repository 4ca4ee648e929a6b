"""Compiled scores of triples: those of plain linear algebra, and blind to what must not matter."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimator.axis import Axis
from estimator.information import (
    contact_information,
    known_before,
    predicted_covariance,
    with_untold_rotation,
)
from estimator.prior import coarse_prior
from estimator.profile import barrel
from estimator.sensors import SENSORS
from estimator.surface import SurfaceOfRevolution
from estimator.triple_scores import in_goals, triple_scores

ANGLE, OFFSET = np.deg2rad(3.0), 2e-3
COMMON = float(np.deg2rad(5.0))
PRIOR = coarse_prior(
    Axis([0.0, 0.0, 0.0], [0.0, 0.0, 1.0]), angle=0.26, offset=0.015, radius=0.033, radius_sd=0.008
)
BEFORE = known_before(PRIOR.covariance, COMMON)
THETA, Z = np.deg2rad([0.0, 40.0, 110.0, 170.0, 230.0, 300.0]), 1e-3 * np.arange(-25, 35, 10)


def grid(axes, theta=THETA, z=Z):
    """Information of places on barrels about several axes, (B, G, 5, 5)."""
    rows = []
    for axis in axes:
        place = SurfaceOfRevolution(axis, barrel(0.033, 3.0, 0.1)).at(theta[None], z[None])
        noise = SENSORS["gel"]
        rows.append(contact_information(place, axis.point[None], axis.direction[None], noise)[0])
    return np.array(rows)


def drawn_axes(count, seed=0):
    rng = np.random.default_rng(seed)
    return [Axis(0.2 * rng.normal(size=3), rng.normal(size=3)) for _ in range(count)]


def scored(information, triples, height=0.0):
    def scaled(J):
        return in_goals(J, angle=ANGLE, offset=OFFSET, height=height)

    return triple_scores(scaled(information), scaled(BEFORE), triples)


def brute_force(information, triples, height=0.0):
    """Covariances by numpy, in metres and radians, moved to the height."""
    total = information[:, triples].sum(axis=2)
    after = predicted_covariance(total, PRIOR.covariance, COMMON)
    moved = np.eye(4)
    moved[0, 2] = moved[1, 3] = height  # a tilt moves the axis up there
    after = moved @ after @ moved.T
    offset2 = after[..., 0, 0] + after[..., 1, 1]
    angle2 = after[..., 2, 2] + after[..., 3, 3]
    return 0.5 * np.log(offset2 / OFFSET**2 + angle2 / ANGLE**2).mean(axis=0)


ALL = np.array(list(combinations(range(len(THETA)), 3)))


@pytest.mark.parametrize("objects", [1, 3, 16, 37])
@pytest.mark.parametrize("height", [0.0, 0.04])
def test_scores_are_those_of_plain_linear_algebra(objects, height):
    information = grid(drawn_axes(objects))
    np.testing.assert_allclose(
        scored(information, ALL, height), brute_force(information, ALL, height), atol=1e-9
    )


def test_more_triples_than_one_block_are_scored_as_each_alone():
    information = grid(drawn_axes(2))
    many = np.random.default_rng(0).integers(0, len(THETA), size=(1500, 3))
    alone = np.array([scored(information, row[None])[0] for row in many])
    np.testing.assert_allclose(scored(information, many), alone, atol=1e-12)


def test_a_touch_that_misses_is_worth_nothing_there():
    """A third touch that misses everywhere leaves a pair; misses on one object cost only there."""
    information = grid(drawn_axes(4))
    missed = information.copy()
    missed[:, 5] = 0.0
    pair = np.concatenate([information, np.zeros((4, 1, 5, 5))], axis=1)
    assert scored(missed, np.array([[0, 2, 5]])) == pytest.approx(
        scored(pair, np.array([[0, 2, 6]]))
    )
    once = information.copy()
    once[1, 5] = 0.0
    one, none, every = (scored(x, np.array([[0, 2, 5]]))[0] for x in (once, information, missed))
    assert none < one < every


@settings(max_examples=25, deadline=None)
@given(st.permutations([0, 1, 2]), st.integers(0, len(ALL) - 1))
def test_the_order_of_the_three_does_not_matter(order, which):
    information = grid(drawn_axes(2))
    triple = ALL[which][None]
    assert scored(information, triple[:, order]) == pytest.approx(scored(information, triple))


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000))
def test_scores_do_not_change_as_the_world_moves(seed):
    """The prior is round, so any pose of object and touches together is as good."""
    here, there = drawn_axes(2, seed)
    np.testing.assert_allclose(scored(grid([here]), ALL), scored(grid([there]), ALL), atol=1e-8)


def test_another_touch_never_hurts():
    information = np.concatenate([grid(drawn_axes(3)), np.zeros((3, 1, 5, 5))], axis=1)
    nothing = len(THETA)
    for i, j, k in ALL:
        three, two = scored(information, np.array([[i, j, k], [i, j, nothing]]))
        assert three < two


def test_the_place_of_the_grasp_counts():
    """Far above the touches the same tilt is a larger offset."""
    information = grid(drawn_axes(2))
    assert np.all(scored(information, ALL, 0.2) > scored(information, ALL, 0.0))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"triples": np.array([[0, 1, 6]])}, "expected places 0 to 5"),
        ({"triples": np.array([[0, 1]])}, r"expected shape \(T, 3\)"),
        ({"information": np.zeros((1, 6, 4, 4))}, r"expected shape \(B, G, 5, 5\)"),
    ],
)
def test_what_does_not_fit_is_refused(change, message):
    given_ = {"information": grid(drawn_axes(1)), "before": BEFORE, "triples": ALL} | change
    with pytest.raises(ValueError, match=message):
        triple_scores(**given_)


def test_a_goal_of_zero_is_refused():
    with pytest.raises(ValueError, match="angle and offset > 0"):
        in_goals(BEFORE, angle=0.0, offset=OFFSET)


@pytest.mark.parametrize("admitted", [0.0, COMMON])
def test_an_untold_rotation_counts_as_it_biases(admitted):
    """Against `with_untold_rotation`; contacts that wrap around suffer least."""
    information = in_goals(grid(drawn_axes(3)), angle=ANGLE, offset=OFFSET)
    before = in_goals(known_before(PRIOR.covariance, admitted), angle=ANGLE, offset=OFFSET)
    triples = np.array(list(combinations(range(len(THETA)), 3)))
    total = before + information[:, triples].sum(axis=2)
    for untold in (0.0, COMMON):
        after = with_untold_rotation(total, before, untold)
        expected = 0.5 * np.log(np.einsum("btii->bt", after)).mean(axis=0)
        got = triple_scores(information, before, triples, untold=untold)
        np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-9)
    gain = got - triple_scores(information, before, triples)
    around = [i for i, t in enumerate(triples) if tuple(t) == (0, 2, 4)]  # 0, 110, 230 deg
    aside = [i for i, t in enumerate(triples) if tuple(t) == (0, 1, 2)]  # 0, 40, 110 deg
    if admitted == 0.0:
        assert gain[around] < 0.5 * gain[aside]
