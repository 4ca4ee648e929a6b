"""Rows of one task on several cores: compiled functions let go of the interpreter while they run.

Every row is computed as if it were alone, so results do not depend on the number of cores. As many
are used as the process may run on, or as OMP_NUM_THREADS or `on_cores` says.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from functools import lru_cache
from itertools import pairwise

Work = Callable[[slice], None]

_asked: ContextVar[int | None] = ContextVar("asked", default=None)

MOST = 8  # shares; what is shared takes some ten milliseconds in all


def in_shares(work: Work, rows: int, *, least: int = 1) -> None:
    """Call `work` with slices that make up all rows; the last share is the caller's own.

    Args:
        work: Writes what it finds about its rows, and nothing else; not itself `in_shares`.
        rows: How many there are.
        least: Shares are multiples of so many rows, half a millisecond's; what a kernel takes
            together stays together.
    Raises:
        Exception: What `work` raises, once every share has ended.
    """
    blocks = -(-rows // least)
    shares = max(1, min(cores(), MOST, blocks))
    ends = [min(rows, least * (blocks * k // shares)) for k in range(shares + 1)]
    slices = [slice(a, b) for a, b in pairwise(ends)]
    others = [_helpers().submit(work, part) for part in slices[:-1]]
    try:
        work(slices[-1])
    finally:
        failures = [other.exception() for other in others]
    for failure in failures:
        if failure is not None:
            raise failure


def cores() -> int:
    """On how many cores rows are shared out."""
    return _asked.get() or _allowed()


@contextmanager
def on_cores(count: int) -> Iterator[None]:
    """So many within this block, in this thread.

    Raises:
        ValueError: Fewer than one.
    """
    if count < 1:
        raise ValueError(f"cores: expected 1 or more, got {count}")
    token = _asked.set(count)
    try:
        yield
    finally:
        _asked.reset(token)


@lru_cache
def _allowed() -> int:
    asked = os.environ.get("OMP_NUM_THREADS", "")
    if asked.isdecimal() and int(asked) > 0:
        return int(asked)
    return available_cores()


def available_cores() -> int:
    """On how many cores this process may run."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@lru_cache
def _helpers() -> ThreadPoolExecutor:
    """Threads beside the caller's own, started as they are needed."""
    return ThreadPoolExecutor(MOST - 1, thread_name_prefix="axis-by-touch")


if hasattr(os, "register_at_fork"):  # a forked process has none of its parent's threads
    os.register_at_fork(after_in_child=_helpers.cache_clear)
