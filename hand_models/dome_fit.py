"""The dome whose heights are nearest to those of a fingertip: nonlinear least squares."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from hand_models.dome import LEAST_AXIS, Dome

Array = NDArray[np.float64]

_SMALLEST = 1e-3  # ball that is rolled [m]
_LARGEST = 0.03  # entry of the root of A [m]
_CALM = 0.02  # so much misfit for as much axis: what says nothing about an axis keeps it short
_NOTHING = 5e-4  # half axes below are left out [m]
_LOWER = np.tril_indices(3)


def fit_dome(u: Array, heights: Array, sphere: Dome) -> Dome:
    """The dome that reaches to given heights (N,) along unit vectors (N, 3) [m].

    Unknown are its middle, the ball's radius and a triangular root L of A = L L^T, from the sphere
    stretched along each of three axes and shrunk in turn.

    Args:
        sphere: That fits best.
    """

    def misfit(x: Array) -> Array:
        stretch = np.sqrt(np.sum((u @ _root(x)) ** 2, axis=1) + LEAST_AXIS**2)
        calm = _CALM * x[4:] / np.sqrt(len(u))
        return np.concatenate([u @ x[:3] + x[3] + stretch - heights, calm])

    low = np.concatenate([np.full(3, -np.inf), [_SMALLEST], np.full(6, -_LARGEST)])
    high = np.concatenate([np.full(4, np.inf), np.full(6, _LARGEST)])
    fits = [
        least_squares(misfit, start, bounds=(low, high), x_scale=1e-3) for start in _starts(sphere)
    ]
    best = min(fits, key=lambda fit: float(fit.cost)).x
    return Dome(best[:3], float(best[3]) + LEAST_AXIS, _axes(_root(best)))


def _starts(sphere: Dome) -> list[Array]:
    half = 0.5 * sphere.radius
    stretched = [np.diag(np.where(np.arange(3) == k, _LARGEST / 2, half / 2)) for k in range(3)]
    return [np.concatenate([sphere.centre, [half], L[_LOWER]]) for L in stretched]


def _root(x: Array) -> Array:
    L = np.zeros((3, 3))
    L[_LOWER] = x[4:]
    return L


def _axes(L: Array) -> Array:
    """Half axes of the ellipsoid, the longest first, without those that are next to nothing."""
    directions, lengths, _ = np.linalg.svd(L)
    return np.asarray((directions * lengths).T[lengths > _NOTHING])
