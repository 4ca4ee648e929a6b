"""An estimate is about the contacts, not about how they are written down."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from paper_tables import measured
from scipy.spatial.transform import Rotation

from estimator.axis import Axis, angle_between, offset_at
from estimator.fusion import estimate_axis

TEN = (0, 1, 2, 3, 4, 5, 6, 7, 8, 11)
CASES = [(0, 3, 8), (1, 5, 7, 11), TEN]


def contacts(chosen):
    table = measured("table8")
    return [table[i] for i in chosen]


def assert_same(one, other, moved=lambda p: p, turned=lambda v: v, length=1.0):
    """Every hypothesis with its probability, to 1e-6."""
    assert one.verdict == other.verdict
    assert one.p_value == pytest.approx(other.p_value, abs=1e-6)
    for a, b in zip(one.hypotheses, other.hypotheses, strict=True):
        expected = Axis(moved(a.axis.point), turned(a.axis.direction))
        assert angle_between(expected, b.axis) < 1e-6
        assert offset_at(expected, b.axis, expected.point) < 1e-6 * length
        assert a.probability == pytest.approx(b.probability, abs=1e-6)
        assert a.angle_95 == pytest.approx(b.angle_95, rel=1e-4)


@pytest.mark.parametrize("chosen", CASES)
@settings(max_examples=8, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_rigid_motion_of_the_world_moves_the_axis_along(chosen, seed):
    rng = np.random.default_rng(seed)
    R, t = Rotation.random(random_state=seed).as_matrix(), rng.normal(size=3)
    there = [
        replace(c, position=R @ c.position + t, normal=R @ c.normal, directions=c.directions @ R.T)
        for c in contacts(chosen)
    ]
    one, other = estimate_axis(contacts(chosen)), estimate_axis(there)
    assert_same(one, other, lambda p: R @ p + t, lambda v: R @ v)


@pytest.mark.parametrize("chosen", CASES)
@pytest.mark.parametrize("unit", [1e-3, 39.37, 1e3])
def test_the_unit_of_length_does_not_matter(chosen, unit):
    """Inches, millimetres: everything with a length in it is scaled, noise included."""
    scaled = []
    for c in contacts(chosen):
        s = c.noise
        noise = replace(
            s, position=s.position * unit, deviator=s.deviator / unit, flat=s.flat / unit,
            mean_curvature=s.mean_curvature / unit, position_bias=s.position_bias * unit,
        )  # fmt: skip
        scaled.append(
            replace(c, position=c.position * unit, curvatures=c.curvatures / unit, noise=noise)
        )
    one, other = estimate_axis(contacts(chosen)), estimate_axis(scaled)
    assert_same(one, other, lambda p: unit * p, length=unit)


@pytest.mark.parametrize("chosen", CASES)
@settings(max_examples=8, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_order_of_contacts_and_order_and_sign_of_directions_do_not_matter(chosen, seed):
    rng = np.random.default_rng(seed)
    shuffled = []
    for c in rng.permutation(np.array(contacts(chosen), dtype=object)):
        rows, signs = rng.permutation(2), rng.choice([-1.0, 1.0], size=(2, 1))
        turned = replace(c, directions=signs * c.directions[rows], curvatures=c.curvatures[rows])
        shuffled.append(turned)
    assert_same(estimate_axis(contacts(chosen)), estimate_axis(shuffled))
