"""Labellings and plane stacks: [A d] is what the paper says, and Table 1 tells the eight cases."""

from __future__ import annotations

import numpy as np
import pytest

from estimator.axis import Axis
from estimator.planes import (
    Labelling,
    Meeting,
    labellings,
    meetings,
    plane_stacks,
    planes_of,
    ranks,
)
from estimator.profile import barrel
from estimator.sensors import sensor_noise
from estimator.surface import Place, SurfaceOfRevolution

OBJECT = SurfaceOfRevolution(Axis([0.4, -0.2, 0.1], [1.0, 2.0, 3.0]), barrel(0.04, 3.0, 0.12))
THETA, Z = np.deg2rad([10.0, 95.0, 230.0]), np.array([-0.03, 0.01, 0.04])


def exact_contacts():
    noise = sensor_noise("ideal")
    return [OBJECT.contact(Place(t, z), noise) for t, z in zip(THETA, Z, strict=True)]


def test_labellings_count_in_binary_and_name_the_other_row():
    assert [str(x) for x in labellings(3)] == [f"{i:03b}" for i in range(8)]
    assert Labelling((0, 1, 1)).meridian_rows == (1, 0, 0)
    assert len(set(labellings(5))) == 32


@pytest.mark.parametrize("rows", [(), (0, 2, 1), (0, -1)])
def test_a_labelling_of_anything_but_zeros_and_ones_is_refused(rows):
    with pytest.raises(ValueError, match="expected one 0 or 1 for each contact"):
        Labelling(rows)


def test_correct_planes_hold_the_axis_and_swapped_planes_are_eq_43():
    stack = planes_of(exact_contacts(), origin=OBJECT.axis.point, unit=0.04)
    A, d = stack.A @ OBJECT.frame.T, stack.d  # in the object's frame, where the paper works
    r, dr, _ = OBJECT.profile.derivatives(Z)
    correct = np.stack([-np.sin(THETA), np.cos(THETA), 0 * Z], axis=-1)  # (24)
    swapped = np.stack([dr * np.cos(THETA), dr * np.sin(THETA), 1 + 0 * Z], axis=-1)  # (43)
    swapped /= np.sqrt(1 + dr**2)[:, None]
    d_swapped = (r * dr + Z) / np.sqrt(1 + dr**2) / 0.04  # (42)
    for labelling, A_l, d_l in zip(labellings(3), A, d, strict=True):
        flag = np.array(labelling.parallel_rows)
        np.testing.assert_allclose(A_l, np.where(flag[:, None] == 0, correct, swapped), atol=1e-12)
        np.testing.assert_allclose(d_l, np.where(flag == 0, 0.0, d_swapped), atol=1e-12)


def test_many_triples_at_once_equal_one_at_a_time():
    rng = np.random.default_rng(1)
    p, k = rng.normal(size=(5, 3, 3)), rng.normal(size=(5, 3, 2, 3))
    many = plane_stacks(p, k)
    assert many.matrix.shape == (5, 8, 3, 4)
    for t in range(5):
        one = plane_stacks(p[t], k[t])
        np.testing.assert_array_equal(many.matrix[t], one.matrix)
        np.testing.assert_array_equal(many.origin[t], p[t].mean(axis=0))
        assert many.unit[t] == pytest.approx(np.sqrt(np.var(p[t], axis=0).sum()))


def test_centred_and_scaled_singular_values_ignore_world_origin_and_unit():
    contacts = exact_contacts()
    p = np.array([c.position for c in contacts])
    k = np.array([c.directions for c in contacts])
    here = plane_stacks(p, k).matrix
    in_inches_elsewhere = plane_stacks(p / 0.0254 + [44.0, -7.0, 3.0], k).matrix
    np.testing.assert_allclose(here, in_inches_elsewhere, atol=1e-12)
    raw = plane_stacks(p + 44.0, k, origin=np.zeros(3), unit=1.0).matrix
    sigma_here, sigma_raw = (np.linalg.svd(m, compute_uv=False)[:, -1] for m in (here, raw))
    assert np.max(np.abs(sigma_here - sigma_raw)) > 0.1  # why nobody else forms d


def test_a_point_in_units_returns_to_the_world():
    stack = planes_of(exact_contacts(), unit=0.04)
    x = np.linalg.lstsq(stack.A[0], stack.d[0], rcond=1e-9)[0]
    world = stack.to_world(np.tile(x, (8, 1)))[0]
    foot = OBJECT.axis.foot(world)
    np.testing.assert_allclose(world, foot, atol=1e-12)


UPRIGHT = [[1, 0, 0], [0, 1, 0], [np.sqrt(0.5), np.sqrt(0.5), 0]]
CASES = {
    Meeting.COINCIDENT: ([[1, 0, 0], [-1, 0, 0], [1, 0, 0]], [2, -2, 2]),
    Meeting.TWO_COINCIDENT_ONE_PARALLEL: ([[1, 0, 0], [-1, 0, 0], [1, 0, 0]], [2, -2, 3]),
    Meeting.THREE_PARALLEL: ([[1, 0, 0], [-1, 0, 0], [1, 0, 0]], [2, 2, 3]),
    Meeting.TWO_COINCIDENT_ONE_CROSSING: ([[1, 0, 0], [0, 1, 0], [0, -1, 0]], [2, 1, -1]),
    Meeting.COMMON_LINE: (UPRIGHT, [1, 2, 3 * np.sqrt(0.5)]),
    Meeting.TWO_PARALLEL_ONE_CROSSING: ([[1, 0, 0], [0, 1, 0], [0, -1, 0]], [2, 1, 1]),
    Meeting.PRISM: (UPRIGHT, [1, 2, 0]),
    Meeting.POINT: (np.eye(3), [1, 2, 3]),
}


@pytest.mark.parametrize("case", list(Meeting))
def test_each_case_of_table_1_is_told_in_any_pose_and_order(case):
    rng = np.random.default_rng(case)
    A, d = (np.array(x, float) for x in CASES[case])
    for _ in range(20):
        R, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        shift = rng.normal(size=3)
        moved = np.column_stack([A @ R.T, d + A @ R.T @ shift])[rng.permutation(3)]
        assert meetings(moved, tolerance=1e-9) == case


def test_ranks_are_those_of_table_1():
    table = {1: (1, 1), 2: (1, 2), 3: (1, 2), 4: (2, 2), 5: (2, 2), 6: (2, 3), 7: (2, 3), 8: (3, 3)}
    for case, (A, d) in CASES.items():
        Ad = np.column_stack([A, d]).astype(float)
        pair = (ranks(Ad[:, :3], tolerance=1e-9), ranks(Ad, tolerance=1e-9))
        assert tuple(map(int, pair)) == table[case]


def test_shapes_origins_and_units_that_cannot_be_are_refused():
    p, k = np.eye(3), np.zeros((3, 2, 3))
    with pytest.raises(ValueError, match=r"directions: expected shape \(3, 2, 3\)"):
        plane_stacks(p, k[:2])
    with pytest.raises(ValueError, match="unit: expected a length greater than zero"):
        plane_stacks(p, k, unit=-1.0)
    with pytest.raises(ValueError, match="unit: expected 'spread' or a length"):
        plane_stacks(p, k, unit="mm")
    with pytest.raises(ValueError, match="origin: expected 'centroid' or a point"):
        plane_stacks(p, k, origin="centre")
