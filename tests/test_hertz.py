"""The Hertz ellipse is exact both ways: against reference values, closed forms and differences."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimator.readers.hertz import (
    contact_ellipse,
    curvature_into,
    curvature_tensor,
    ellipse_curvatures,
    ellipse_into,
    indentation,
    peak_pressure,
)

MODULUS = 5.3e5


def turned(ellipse, angle):
    c, s = np.cos(angle), np.sin(angle)
    R = np.array([[c, -s], [s, c]])
    return R @ ellipse @ R.T


def test_reference_ellipse_has_its_curvatures_and_indentation():
    kappa = ellipse_curvatures(4.0, 2.0, 1.3, 0.4 / 0.75)
    np.testing.assert_allclose(kappa, [0.045847721158, 0.130333761017], rtol=1e-10)
    np.testing.assert_allclose(indentation(4.0, 2.0, 1.3, 0.4 / 0.75), 0.6274492912983, rtol=1e-10)


def test_ratio_of_the_axes_is_the_exact_one_for_curvature_ratios_up_to_a_hundred():
    ratios = np.array([2.0, 5.0, 10.0, 23.0, 100.0])
    tensors = np.zeros((5, 2, 2))
    tensors[:, 0, 0], tensors[:, 1, 1] = 1.0, ratios
    M = contact_ellipse(tensors, 1.0, 1.0)
    exact = [1.5858021197, 2.8901810398, 4.4994473032, 7.5491685581, 18.1871030044]
    np.testing.assert_allclose(M[:, 0, 0] / M[:, 1, 1], exact, rtol=1e-9)


def test_sphere_is_the_closed_form():
    M = contact_ellipse(np.eye(2) / 20.0, 1.0, 0.4 / 0.75)
    np.testing.assert_allclose(M, np.eye(2) * (0.75 * 20.0 / (0.4 / 0.75)) ** (1 / 3), rtol=1e-12)
    assert M[0, 0] == pytest.approx(3.041101, abs=1e-6)
    a = M[0, 0]
    assert indentation(a, a, 1.0, 0.4 / 0.75) == pytest.approx(a**2 / 20.0, rel=1e-12)


def test_pressure_carries_the_force():
    a, b, F = 3e-3, 1e-3, 2.0
    assert peak_pressure(a, b, F) * 2.0 / 3.0 * np.pi * a * b == pytest.approx(F, rel=1e-14)


@given(
    st.floats(-2.0, 3.0), st.floats(0.0, 6.0), st.floats(0.0, np.pi), st.floats(0.01, 100.0)
)  # fmt: skip
def test_ellipse_and_curvature_are_each_others_inverse(size, elongation, angle, force):
    mean = 10.0**size
    x = np.tanh(elongation)
    K = turned(np.diag([mean * (1 - x), mean * (1 + x)]), angle)
    M = contact_ellipse(K, force, MODULUS)
    np.testing.assert_allclose(curvature_tensor(M, force, MODULUS), K, atol=1e-9 * mean)
    out = np.empty(3)
    if elongation < 4.0:
        curvature_into(np.array([M[0, 0], M[1, 1], M[0, 1]]), force, MODULUS, out)
        np.testing.assert_allclose(out, [K[0, 0], K[1, 1], K[0, 1]], atol=1e-9 * mean)


def jet(state):
    M, J = np.empty(3), np.empty((3, 4))
    ellipse_into(np.ascontiguousarray(state[1:]), float(np.exp(state[0])), MODULUS, M, J)
    return M, J


@pytest.mark.parametrize("ratio", [1.0, 1.0 + 1e-9, 1.02, 3.0, 40.0])
def test_slopes_agree_with_differences_also_where_the_patch_is_round(ratio):
    K = turned(np.diag([50.0, 50.0 * ratio]), 0.7)
    state = np.array([0.4, K[0, 0], K[1, 1], K[0, 1]])
    _, J = jet(state)
    for j, h in enumerate((1e-4, 1e-3, 1e-3, 1e-3)):
        e = np.eye(4)[j] * h
        near, far = (jet(state + e)[0] - jet(state - e)[0]), jet(state + 2 * e)[0]
        difference = (8.0 * near - (far - jet(state - 2 * e)[0])) / (12.0 * h)
        np.testing.assert_allclose(J[:, j], difference, atol=1e-6 * np.abs(J[:, j]).max())


def test_indentation_moves_as_the_pressures_moments_say():
    """d delta = (2/3) delta dF/F + tr(M^2 dK) / 6: what the covariance of the depth rests on."""
    K, F = turned(np.diag([30.0, 140.0]), 0.5), 1.7

    def depth(tensor, force):
        b, a = np.linalg.eigvalsh(contact_ellipse(tensor, force, MODULUS))
        return float(indentation(a, b, force, MODULUS))

    M = contact_ellipse(K, F, MODULUS)
    dK = np.array([[0.3, 0.1], [0.1, -0.2]]) * 1e-2
    moved = (depth(K + dK, F) - depth(K - dK, F)) / 2.0
    assert moved == pytest.approx(np.trace(M @ M @ dK) / 6.0, rel=1e-6)
    grown = (depth(K, F * 1.001) - depth(K, F / 1.001)) / 2.0
    assert grown == pytest.approx(2.0 / 3.0 * depth(K, F) * np.log(1.001), rel=1e-5)


def test_no_contact_ellipse_without_convexity_or_force():
    with pytest.raises(ValueError, match="positive definite"):
        contact_ellipse(np.diag([-1.0, 5.0]), 1.0, 1.0)
    with pytest.raises(ValueError, match=r"force: expected greater than zero, got -1\.0"):
        contact_ellipse(np.eye(2), -1.0, 1.0)
