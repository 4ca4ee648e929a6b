"""Space for derivatives: made once, overwritten by every call."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from estimator.compiled import compiled, compiled_part
from estimator.readings import ERRORS
from estimator.sight import LOCAL
from estimator.vectors import Array


class Work(NamedTuple):
    """For P parameters and n contacts."""

    gradient: Array  # (P,)
    fisher: Array  # (P, P), lower triangle
    kept_gradient: Array  # (P,)
    kept_fisher: Array  # (P, P)
    local_gradient: Array  # (9,)
    local_fisher: Array  # (9, 9)
    rows: Array  # (8, 9)
    lean: Array  # (3, 8)
    chart: Array  # (4, 4)
    lifted: Array  # (P, P)
    step: Array  # (P,)
    right: Array  # (n,): probability that each contact is no gross error
    tally: Array  # sum and number of squared residuals: gross errors left out, and all


@compiled
def work_space(parameters: int, contacts: int) -> Work:
    return Work(
        np.zeros(parameters),
        np.zeros((parameters, parameters)),
        np.zeros(parameters),
        np.zeros((parameters, parameters)),
        np.zeros(LOCAL),
        np.zeros((LOCAL, LOCAL)),
        np.zeros((8, LOCAL)),
        np.zeros((3, ERRORS)),
        np.zeros((4, 4)),
        np.zeros((parameters, parameters)),
        np.zeros(parameters),
        np.zeros(contacts),
        np.zeros(4),
    )


@compiled_part
def copied(x: Array, out: Array) -> None:
    for k in range(len(x)):
        out[k] = x[k]


@compiled_part
def remember(work: Work) -> None:
    """Keep gradient and information while a step is tried."""
    copied(work.gradient, work.kept_gradient)
    for j in range(len(work.fisher)):
        copied(work.fisher[j], work.kept_fisher[j])


@compiled_part
def recall(work: Work) -> None:
    """Take them back after a step that failed."""
    copied(work.kept_gradient, work.gradient)
    for j in range(len(work.fisher)):
        copied(work.kept_fisher[j], work.fisher[j])
