"""Touches of the strain finger for tests: random ones inside the cell, and their readings."""

import numpy as np

from estimator.readers.strain_array import StrainArray
from estimator.readers.strain_covariance import ellipses_of
from estimator.readers.strain_model import predicted_readings, touch_state
from estimator.readers.strain_sensitivity import revolved_tensor

FINGER = StrainArray()


def angle_error(found, psi):
    """Between undirected directions, within 90 degrees either way."""
    return (found - psi + np.pi / 2) % np.pi - np.pi / 2


def in_cell(rng, n, array=FINGER):
    return rng.uniform(-0.5, 0.5, (n, 2)) * [array.axial_pitch, array.arc_pitch]


def touches(rng, *, R1, R2, psi, force, array=FINGER):
    """States, body tensors and long semi-axes of touches anywhere in the middle cell."""
    n = len(psi)
    radii = np.stack([np.broadcast_to(R1, n), np.broadcast_to(R2, n)], axis=-1)
    tensors = revolved_tensor(radii, psi)
    states = touch_state(in_cell(rng, n, array), np.broadcast_to(force, n), tensors, array)
    return states, tensors, np.linalg.eigvalsh(ellipses_of(states, array)[0])[:, 1]


def readings(rng, states, array=FINGER):
    """With rounding errors, each uniform as the paper assumes."""
    exact = predicted_readings(states, array)
    return exact + rng.uniform(-array.rounding, array.rounding, exact.shape)


def tensor_coverage(read, tensors, limit=7.8147):
    """Share of the 95 % regions of the curvature tensor that hold the truth."""
    e = read.tensors - tensors
    e = np.stack([e[:, 0, 0], e[:, 1, 1], e[:, 0, 1]], axis=1)
    inverse = np.linalg.inv(read.covariances[:, 3:, 3:])
    return np.einsum("bi,bij,bj->b", e, inverse, e) < limit
