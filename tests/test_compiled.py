"""Compiled functions: parts of others have no door for Python, and one code for every constant."""

from __future__ import annotations

import numba
import numpy as np
import pytest

from estimator.compiled import compiled, compiled_part


@compiled_part
def column_sum(table, column):
    total = 0.0
    for i in range(table.shape[0]):
        total += table[i, column]
    return total


@compiled
def three_sums(table):
    return column_sum(table, 0) + 10.0 * column_sum(table, 1) + 100.0 * column_sum(table, 2)


def test_a_function_called_with_constants_is_compiled_once():
    table = np.array([[1.0, 2.0, 3.0], [1.0, 0.0, 0.0]])
    assert three_sums(table) == 322.0
    for column in range(3):  # as another function's code asks for it
        constant = numba.types.literal(column)
        column_sum.get_call_template([numba.typeof(table), constant], {})
    assert len(column_sum.signatures) == 1


@pytest.mark.parametrize("values", [(2.0, 0.0), (np.nan, 1.0)])
def test_division_by_zero_and_nan_are_numpys(values):
    assert np.isnan(ratio(*values)) if np.isnan(values[0]) else np.isposinf(ratio(*values))


@compiled
def ratio(a, b):
    return a / b


def test_python_cannot_call_a_part_before_or_after_it_was_compiled():
    """It has no wrapper for Python; numba alone would crash."""
    for _ in range(2):
        with pytest.raises(TypeError, match="column_sum is a part of compiled functions"):
            column_sum(np.zeros((1, 3)), 0)
        three_sums(np.zeros((1, 3)))
