"""Functions compiled to machine code: the inner loops of the estimator.

Compiled once a machine (a minute, see `planner.first_use`), then loaded from the user's cache
folder: AXIS_BY_TOUCH_CACHE, else XDG_CACHE_HOME, else ~/.cache. numba renews a function only when
its own file changes, although it holds the code of every function it calls; so the folder is named
after all sources of this package and of the function's own.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache, partial
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
    return _compiled(function, from_python=True)


def compiled_part(function: F) -> F:
    """The same for what only compiled functions call: it takes a third less time to compile.

    Raises:
        TypeError: When Python calls it.
    """
    found: Any = _compiled(function, from_python=False)
    found._insert = lambda *_: None  # no code of it is entered from Python, there is no way in
    found._compile_for_args = partial(_refuse, function)
    return cast(F, found)


def compiled_in_place(function: F) -> F:
    """The same, its code written in place of the call: for thin layers over much code.

    A compiled function holds all that it calls, and all of that goes through the compiler again
    with every layer above it.
    """
    return _compiled(function, from_python=False, inline="always")


def has_code(function: Callable[..., Any]) -> bool:
    """Whether the cache holds machine code of a compiled function, for whatever arguments."""
    found: Any = function
    name = f"{function.__module__.rpartition('.')[2]}.{function.__qualname__}-*.nbi"
    return any(Path(found._cache.cache_path).glob(name))


def _refuse(function: Callable[..., Any], *_: Any, **__: Any) -> None:
    name = f"{function.__module__}.{function.__qualname__}"
    raise TypeError(f"{name} is a part of compiled functions; Python may call what is @compiled")


def _compiled(function: F, *, from_python: bool, inline: str = "never") -> F:
    package = sys.modules[function.__module__.partition(".")[0]]
    other = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(_folder(Path(str(package.__file__)).parent))  # read by the next
    try:
        found = numba.njit(
            cache=True, error_model="numpy", fastmath=FAST, nogil=True,
            no_cfunc_wrapper=True, no_cpython_wrapper=not from_python, inline=inline,
        )(function)  # fmt: skip
    finally:
        numba.config.CACHE_DIR = other
    found.get_call_template = _for_any_constant(found.get_call_template)
    return cast(F, found)


def _for_any_constant(template: Callable[..., Any]) -> Callable[..., Any]:
    """numba would compile a function once more for every constant that another calls it with."""

    def general(args: Sequence[Any], kws: Mapping[str, Any]) -> Any:
        plain = {name: numba.types.unliteral(kind) for name, kind in kws.items()}
        return template([numba.types.unliteral(kind) for kind in args], plain)

    return general


@compiled_part
def vector(row: Array, first: int) -> V3:
    """Three numbers of a row."""
    return (row[first], row[first + 1], row[first + 2])


@compiled_part
def dot(a: V3, b: V3) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled_part
def cross3(a: V3, b: V3) -> V3:
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@compiled_part
def along(a: V3, s: float, b: V3) -> V3:
    """a + s b."""
    return (a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2])


@compiled
def scaled(s: float, a: V3) -> V3:
    return (s * a[0], s * a[1], s * a[2])


@compiled_part
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
