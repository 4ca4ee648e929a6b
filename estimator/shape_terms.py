"""What an object gives of itself: convex contacts have the axis behind them, slopes are gentle."""

from __future__ import annotations

import numpy as np

from estimator.compiled import compiled_part
from estimator.readings import CONVEX
from estimator.sight import MN, MU, Seen
from estimator.vectors import Array

INSIDE = 0.05  # softness of "the axis lies behind the surface", on n . rad


@compiled_part
def add_constraints(
    row: Array, seen: Seen, slope: float, derivatives: bool,
    gradient: Array, fisher: Array, rows: Array, locals_: int,
) -> float:  # fmt: skip
    """What an object gives: the axis lies behind every convex contact, n . rad > 0 by eq. (2);
    and, where `slope` is finite, sin(slope of the profile) = n . u is about that small.
    """
    short = -seen.m_n / INSIDE if row[CONVEX] > 0.0 and seen.m_n < 0.0 else 0.0
    steep = seen.m_u / slope
    if derivatives and (short > 0.0 or slope < np.inf):
        sharp = 1.0 / INSIDE if short > 0.0 else 0.0
        for j in range(locals_):
            gradient[j] += steep / slope * rows[MU, j] - short * sharp * rows[MN, j]
            for k in range(j + 1):
                fisher[j, k] += sharp**2 * rows[MN, j] * rows[MN, k]
                fisher[j, k] += rows[MU, j] * rows[MU, k] / slope**2
    return 0.5 * short**2 + 0.5 * steep**2
