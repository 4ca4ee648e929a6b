"""Space for derivatives: made once, overwritten by every call."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimator.compiled import compiled, compiled_part
from estimator.readings import ERRORS
from estimator.sight import LOCAL
from estimator.vectors import Array

LOCAL_WORK = np.dtype([
    ("gradient", np.float64, LOCAL), ("fisher", np.float64, (LOCAL, LOCAL)),
    ("rows", np.float64, (8, LOCAL)), ("lean", np.float64, (3, ERRORS)),
    ("chart", np.float64, (4, 4)), ("tally", np.float64, 4),
], align=True)  # fmt: skip


class Work(NamedTuple):
    """For P parameters and n contacts.

    Attributes:
        gradient, fisher: (P,), (P, P) lower triangle.
        kept: (P, P + 1) fisher and, behind it, gradient, while a step is tried.
        lifted, step: (P, P), (P,).
        right: (n,) probability that each contact is no gross error.
        local: (1,) record of one contact's `gradient`, `fisher`, `rows` and `lean`, of `chart`,
            and of `tally`: sum and number of squared residuals, gross errors left out, and all.
            In compiled code a record is a bare pointer: its array has to outlive it.
    """

    gradient: Array
    fisher: Array
    kept: Array
    lifted: Array
    step: Array
    right: Array
    local: NDArray[np.void]


@compiled
def work_space(parameters: int, contacts: int) -> Work:
    return Work(
        np.zeros(parameters),
        np.zeros((parameters, parameters)),
        np.zeros((parameters, parameters + 1)),
        np.zeros((parameters, parameters)),
        np.zeros(parameters),
        np.zeros(contacts),
        np.zeros(1, dtype=LOCAL_WORK),
    )


@compiled_part
def copied(x: Array, out: Array) -> None:
    for k in range(len(x)):
        out[k] = x[k]


@compiled_part
def remember(work: Work) -> None:
    """Keep gradient and information while a step is tried."""
    P = len(work.gradient)
    for j in range(P):
        work.kept[j, P] = work.gradient[j]
        for k in range(P):
            work.kept[j, k] = work.fisher[j, k]


@compiled_part
def recall(work: Work) -> None:
    """Take them back after a step that failed."""
    P = len(work.gradient)
    for j in range(P):
        work.gradient[j] = work.kept[j, P]
        for k in range(P):
            work.fisher[j, k] = work.kept[j, k]
