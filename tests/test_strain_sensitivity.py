"""Figure 14: worst errors by eqs. (73)-(80), against known values and the paper's bound."""

from dataclasses import replace

import numpy as np
import pytest

from estimator.readers.strain_array import StrainArray
from estimator.readers.strain_model import predicted_readings, touch_state
from estimator.readers.strain_sensitivity import largest_errors, revolved_tensor

PAPER = StrainArray(tactels=(4, 4), modulus=0.25e6, response_modulus=0.25e6, poisson=0.5)
INCH = 25.4e-3
CROSSED = np.pi / 2 + np.deg2rad(np.linspace(-25, 25, 51))  # the flat direction, from the axis


def worst_angle(force, R2, array=PAPER):
    errors = largest_errors(array, radii=(INCH, R2), psi=CROSSED, force=force)
    return np.rad2deg(errors[:, 2].max())


BOUNDS = [(1, 57.9, 2.43), (2, 21.8, 1.32), (2.09, 20.5, 1.26)]


@pytest.mark.parametrize(("force", "two", "one"), BOUNDS)
def test_bounds_of_both_algorithms(force, two, one):
    assert worst_angle(force, 7 * INCH) == pytest.approx(two, rel=0.03)
    assert worst_angle(force, np.inf) == pytest.approx(one, rel=0.03)


def test_at_the_papers_bound_the_other_parameters_err_as_the_prototype_says():
    errors = largest_errors(PAPER, radii=(INCH, 7 * INCH), psi=CROSSED[-1], force=2.09)[0]
    relative = errors[[0, 1, 3]] / [INCH, 7 * INCH, 2.09]
    np.testing.assert_allclose(relative, [0.24, 4.3, 0.025], rtol=0.05)


def test_only_force_over_modulus_matters():
    stiff = replace(PAPER, modulus=0.40e6, response_modulus=0.40e6)
    assert worst_angle(3.2, 7 * INCH, stiff) == pytest.approx(worst_angle(2.0, 7 * INCH), rel=1e-9)


def test_the_worst_error_is_reached_and_no_random_one_is_larger():
    """Eq. (79) against least squares solved for errors of that length."""
    rng, psi, force = np.random.default_rng(0), np.deg2rad([75.0]), 2.0

    def strains(p):
        tensor = revolved_tensor((p[0], p[1]), np.array([p[2]]))
        return predicted_readings(touch_state([[0, 0]], [p[3]], tensor, PAPER), PAPER).ravel()

    p = np.array([INCH, 7 * INCH, psi[0], force])
    steps = np.diag([1e-5, 1e-4, 1e-4, 1e-4])
    J = np.stack([(strains(p + h) - strains(p - h)) / (2 * h.sum()) for h in steps], axis=1)
    error = rng.normal(size=(4000, 16))
    error *= 4 * 5e-4 / np.linalg.norm(error, axis=1, keepdims=True)
    moved = np.abs(np.linalg.lstsq(J, error.T, rcond=None)[0])
    bound = largest_errors(PAPER, radii=(INCH, 7 * INCH), psi=psi, force=force)[0]
    assert np.all(moved.max(axis=1) <= bound * 1.001)
    along = np.linalg.pinv(J)[2]
    reached = np.linalg.lstsq(J, along / np.linalg.norm(along) * 2e-3, rcond=None)[0][2]
    assert reached == pytest.approx(bound[2], rel=1e-3)
