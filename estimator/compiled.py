"""Functions compiled to machine code: the inner loops of the estimator.

Compiled once a machine (a minute or two at the first plan), then loaded from the user's cache
folder: AXIS_BY_TOUCH_CACHE, else XDG_CACHE_HOME, else ~/.cache. numba renews a function only when
its own file changes, although it holds the code of every function it calls; so the folder is named
after all sources of this package and of the function's own.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

from estimator.vectors import Array

F = TypeVar("F", bound=Callable[..., Any])
V3 = tuple[float, float, float]


@lru_cache
def _folder(package: Path) -> Path:
    """Where code of a package compiled from exactly these sources is kept."""
    digest = hashlib.sha256()
    for folder in sorted({Path(__file__).parent, package}):
        for path in sorted(folder.rglob("*.py")):
            digest.update(path.read_bytes())
    named = os.environ.get("AXIS_BY_TOUCH_CACHE")
    user = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "axis-by-touch"
    return (Path(named) if named else user) / f"compiled-{digest.hexdigest()[:16]}"


FAST = {"contract", "reassoc", "nsz", "arcp"}


def compiled(function: F) -> F:
    """numba.njit that a type checker sees through; division by zero gives inf, as in numpy.

    Sums may be contracted and reordered, infinities and NaN keep their meaning.
    """
    package = sys.modules[function.__module__.partition(".")[0]]
    other = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(_folder(Path(str(package.__file__)).parent))  # read by the next
    try:
        return cast(F, numba.njit(cache=True, error_model="numpy", fastmath=FAST)(function))
    finally:
        numba.config.CACHE_DIR = other


@compiled
def vector(row: Array, first: int) -> V3:
    """Three numbers of a row."""
    return (row[first], row[first + 1], row[first + 2])


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
