"""Point 7: anything a contact may hold. No NaN comes out, nothing is raised but the door's
ValueError, nothing takes long.

Every chunk of inputs is one kind of trouble (KINDS), one number of contacts and one noise; it goes
through the door for many and, set by set, through the door for one.
"""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from fuzz_inputs import KINDS, draw_inputs
from honesty import proportion
from workload import Row, Table, Workload

from estimator.batches import ContactSets
from estimator.estimate import AxisEstimate
from estimator.fusion import estimate_axis
from estimator.vectors import Array

CHUNK = 50
SLOW = 1.0  # a run may take no longer [s]


@dataclass(frozen=True)
class Outcome:
    """One run of one door."""

    refused: bool = False
    raised: str = ""
    broken: bool = False
    seconds: float = 0.0


def fuzz_study(work: Workload) -> list[Table]:
    """Runs, refusals, breakages and the slowest run of each kind of input."""
    found: dict[str, list[Outcome]] = {kind: [] for kind in KINDS}
    for chunk, start in enumerate(range(0, work.count, CHUNK)):
        rng = np.random.default_rng([work.seed, 9, chunk])
        kind = tuple(KINDS)[chunk % len(KINDS)]
        sets = draw_inputs(kind, min(CHUNK, work.count - start), rng=rng)
        found[kind].append(_through_many(work, sets, chunk))
        found[kind].extend(_through_one(sets, i, chunk) for i in range(len(sets)))
        work.progress(len(sets))
    return [
        Table("Fuzzed inputs", [_row(k, outcomes) for k, outcomes in found.items() if outcomes])
    ]


def _row(kind: str, outcomes: list[Outcome]) -> Row:
    raised = [o.raised for o in outcomes if o.raised]
    return {
        "input": kind,
        "runs": len(outcomes),
        "refused": proportion(np.array([o.refused for o in outcomes])),
        "broken": sum(o.broken for o in outcomes),
        "raised": len(raised),
        "slowest s": max(o.seconds for o in outcomes),
        "over 1 s": sum(o.seconds > SLOW for o in outcomes),
        "first exception": raised[0] if raised else "",
    }


def _through_many(work: Workload, sets: ContactSets, chunk: int) -> Outcome:
    """A whole chunk; its time is that of one set."""

    def sound() -> bool:
        found = work.estimate(sets)
        probable = (found.probabilities, found.p_values, found.label_probabilities)
        return (
            all(np.all(np.isfinite(v)) for v in vars(found).values())
            and all(np.all((v >= 0) & (v <= 1 + 1e-9)) for v in probable)
            and all(_is_covariance(c) for c in found.covariances)
        )

    return _tried(sound, f"chunk {chunk}", share=len(sets))


def _through_one(sets: ContactSets, i: int, chunk: int) -> Outcome:
    return _tried(lambda: _is_sound(estimate_axis(sets.take(i))), f"chunk {chunk} set {i}")


def _is_sound(estimate: AxisEstimate) -> bool:
    """Numbers are numbers, probabilities lie in [0, 1], covariances are positive."""
    numbers = [estimate.p_value, *(p for _, p in estimate.labellings)]
    for h in estimate.hypotheses:
        numbers += [h.probability, h.angle_95, h.offset_95, *h.axis.point, *h.parallel_rows]
        if not _is_covariance(h.covariance):
            return False
    probable = [estimate.p_value, *(h.probability for h in estimate.hypotheses)]
    return (
        bool(np.all(np.isfinite(numbers)))
        and all(0.0 <= p <= 1.0 for p in probable)
        and len(estimate.reasons) > 0
    )


def _is_covariance(matrix: Array) -> bool:
    """Finite, variances positive, no correlation beyond one but by rounding."""
    sd = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    if not (np.all(np.isfinite(matrix)) and np.all(sd > 0.0)):
        return False
    return bool(np.linalg.eigvalsh(matrix / np.outer(sd, sd))[0] > -1e-6)


def _tried(sound: Callable[[], bool], where: str, *, share: int = 1) -> Outcome:
    start = time.perf_counter()
    try:
        broken = not sound()
    except Exception as error:  # whatever it is, it is what this study looks for
        seconds = (time.perf_counter() - start) / share
        if type(error) is ValueError and str(error).startswith("contact"):
            return Outcome(refused=True, seconds=seconds)
        frame = traceback.extract_tb(error.__traceback__)[-1]
        said = f"{type(error).__name__}: {error} ({where}, {Path(frame.filename).name})"
        return Outcome(raised=said, seconds=seconds)
    return Outcome(broken=broken, seconds=(time.perf_counter() - start) / share)
