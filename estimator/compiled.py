"""Functions compiled to machine code: the inner loops of the estimator.

Compiled once a machine (half a minute at the first call), then loaded from numba's cache.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., Any])
V3 = tuple[float, float, float]


def compiled(function: F) -> F:
    """numba.njit that a type checker sees through; division by zero gives inf, as in numpy."""
    return cast(F, numba.njit(cache=True, error_model="numpy")(function))


@compiled
def dot(a: V3, b: V3) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def cross3(a: V3, b: V3) -> V3:
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@compiled
def along(a: V3, s: float, b: V3) -> V3:
    """a + s b."""
    return (a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2])


@compiled
def scaled(s: float, a: V3) -> V3:
    return (s * a[0], s * a[1], s * a[2])


@compiled
def across(u: V3) -> tuple[V3, V3]:
    """`estimator.vectors.basis_across` of one unit vector."""
    x, y, z = abs(u[0]), abs(u[1]), abs(u[2])
    seed = (0.0, 0.0, 1.0)
    if x <= y and x <= z:
        seed = (1.0, 0.0, 0.0)
    elif y <= z:
        seed = (0.0, 1.0, 0.0)
    e1 = along(seed, -dot(seed, u), u)
    e1 = scaled(1.0 / dot(e1, e1) ** 0.5, e1)
    return e1, cross3(u, e1)
