"""What the Monte Carlo's studies are given, and what they hand back."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

from honesty import Interval

from estimator.assumptions import Assumptions
from estimator.batches import AxisEstimates, ContactSets


class Estimator(Protocol):
    """`estimator.fusion.estimate_axes`, or what stands for it."""

    def __call__(self, sets: ContactSets, *, assumptions: Assumptions = ...) -> AxisEstimates: ...


Cell = float | int | str | Interval
Row = dict[str, Cell]
Progress = Callable[[int], None]  # called with the number of runs just finished

BATCH = 2000  # runs estimated at a time


@dataclass(frozen=True)
class Table:
    """Figures to print and to write: every row has the same keys."""

    title: str
    rows: list[Row]


@dataclass(frozen=True)
class Workload:
    """How much to run, on what, and whom to ask."""

    estimate: Estimator
    count: int
    seed: int
    sensors: tuple[str, ...]
    structured: bool = False
    objects: Path | None = None
    progress: Progress = lambda runs: None

    def __iter__(self) -> Iterator[int]:
        """Sizes of batches that make up the count."""
        for start in range(0, self.count, BATCH):
            yield min(BATCH, self.count - start)

    def share(self, parts: int) -> Workload:
        """One of `parts` equal workloads, at least one run."""
        return replace(self, count=max(1, round(self.count / parts)))
