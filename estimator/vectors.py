"""Arrays that do not change, and the few vector operations everybody needs."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


def frozen(values: ArrayLike) -> Array:
    """A read-only float copy: what frozen dataclasses hold."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


def finite_array(name: str, values: ArrayLike, shape: tuple[int, ...]) -> Array:
    """The values as a read-only array, or one clear error naming the field.

    Raises:
        ValueError: Not numbers, not of this shape, or not finite.
    """
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{name}: expected numbers of shape {shape}, got {values!r}") from None
    if array.shape != shape:
        raise ValueError(f"{name}: expected shape {shape}, got {array.shape}")
    if not np.all(np.isfinite(array)):
        raise ValueError(f"{name}: expected finite numbers, got {array.tolist()}")
    array.setflags(write=False)
    return array


def unit(v: Array) -> Array:
    """Rows (or one vector) scaled to length one; zero has no direction and gives NaN."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(v / np.sqrt(np.sum(v * v, axis=-1, keepdims=True)))


def cross(a: Array, b: Array) -> Array:
    """np.cross for vectors of three, several times faster on the small arrays used here."""
    a0, a1, a2 = a[..., 0], a[..., 1], a[..., 2]
    b0, b1, b2 = b[..., 0], b[..., 1], b[..., 2]
    x = a1 * b2 - a2 * b1
    out = np.empty((*x.shape, 3))
    out[..., 0] = x
    out[..., 1] = a2 * b0 - a0 * b2
    out[..., 2] = a0 * b1 - a1 * b0
    return out


def basis_across(u: Array) -> Array:
    """Two unit vectors that complete unit `u` to a right-handed frame.

    The first is the world axis least aligned with `u`, made perpendicular to it, so the basis
    is smooth except where that choice changes.

    Args:
        u: Unit vectors, shape (..., 3).
    Returns:
        Shape (..., 2, 3): e1, e2 with e1 x e2 = u.
    """
    seed = np.eye(3)[np.argmin(np.abs(u), axis=-1)]
    e1 = unit(seed - np.sum(seed * u, axis=-1, keepdims=True) * u)
    basis = np.empty((*u.shape[:-1], 2, 3))
    basis[..., 0, :] = e1
    basis[..., 1, :] = cross(u, e1)
    return basis
