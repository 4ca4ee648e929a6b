"""Normal equations of one window of strains: residuals, their slopes, and the prior's part."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from estimator.compiled import compiled_part
from estimator.readers.hertz import ellipse_into
from estimator.readers.strain_model import ellipse_readings, over_curvature
from estimator.readers.strain_quadrature import MOST_NODES
from estimator.vectors import Array, Index

ROUGH_DIGITS = 3.0  # of the quadrature while the ellipse is fitted
ROUND = 0.1  # curvatures closer than this count as one in the prior's slope [1/m]


class Problem(NamedTuple):
    """What all windows of a batch have in common; flat tuples, so compiled code takes them whole.

    `material` is E* [Pa], compliance, depth [m], the finger's curvature, and the flat curvature
    that the one-curvature algorithm assumes [1/m]; `prior` mean and 1/sd of the flat curvature
    (1/sd = 0: none); `box` the least and largest x_0, y_0 (from the window's middle) and ln F;
    `digits` are those of the quadrature.
    """

    kind: int
    rows: Array
    positions: Array
    material: tuple[float, float, float, float, float]
    prior: tuple[float, float]
    box: Array
    digits: float


class Room(NamedTuple):
    """Where one evaluation leaves its results: readings, slopes, ellipse, J'WJ and J'Wr."""

    model: Array
    J: Array
    M: Array
    M_J: Array
    u: Array
    p: Array
    A: Array
    g: Array


@compiled_part
def solve_into(A: Array, g: Array, n: int, damping: float, L: Array, x: Array) -> bool:
    """x = (A + damping diag A)^-1 g by Cholesky; False if not positive definite."""
    for i in range(n):
        for j in range(i + 1):
            s = A[i, j] * (1.0 + damping) if i == j else A[i, j]
            for k in range(j):
                s -= L[i, k] * L[j, k]
            if i == j:
                if not s > 0.0:
                    return False
                L[i, i] = s**0.5
            else:
                L[i, j] = s / L[j, j]
    for i in range(n):
        s = g[i]
        for k in range(i):
            s -= L[i, k] * x[k]
        x[i] = s / L[i, i]
    for i in range(n - 1, -1, -1):
        s = x[i]
        for k in range(i + 1, n):
            s -= L[k, i] * x[k]
        x[i] = s / L[i, i]
    return True


@compiled_part
def flat_curvature(state: Array, finger: float, slope: Array) -> float:
    """Smaller curvature of the body (finger removed) and its derivatives over K."""
    p, r = 0.5 * (state[3] - state[4] + finger), state[5]
    D = (p * p + r * r + ROUND * ROUND) ** 0.5
    slope[0], slope[1], slope[2] = 0.5 - 0.5 * p / D, 0.5 + 0.5 * p / D, -r / D
    return float(0.5 * (state[3] + state[4] - finger) - D)


@compiled_part
def allowed(state: Array, middle: Array, box: Array, least_ratio: float) -> bool:
    """Inside the box of places and forces, and the tensor positive definite."""
    for i in range(3):
        value = state[i] - (middle[i] if i < 2 else 0.0)
        if not box[i, 0] <= value <= box[i, 1]:
            return False
    m, p = 0.5 * (state[3] + state[4]), 0.5 * (state[3] - state[4])
    least = m - (p * p + state[5] * state[5]) ** 0.5
    return bool(least > least_ratio * m and 0.0 < m < 1e5)


@compiled_part
def evaluate(
    readings: Array, weights: Array, tactels: Index, state: Array, by_ellipse: bool,
    problem: Problem, room: Room,
) -> tuple[float, float]:  # fmt: skip
    """Fill the room at this state; chi2 of the readings, and the sum with the prior's part.

    `by_ellipse` says that the state's last three numbers are the ellipse, not the curvature: then
    the quadrature is rough and there is no prior.
    """
    modulus, compliance, depth = problem.material[:3]
    A, g, J = room.A, room.g, room.J
    digits = ROUGH_DIGITS if by_ellipse else problem.digits
    if by_ellipse:
        room.M[:] = state[3:6]
    else:
        ellipse_into(state[3:6], np.exp(state[2]), modulus, room.M, room.M_J)
    ellipse_readings(
        state, room.M, (depth, digits), compliance, problem.kind, problem.rows, problem.positions,
        tactels, room.model, J, room.u, room.p,
    )  # fmt: skip
    if not by_ellipse:
        over_curvature(J, room.M_J)
    chi2 = 0.0
    A[:], g[:] = 0.0, 0.0
    for t in range(len(readings)):
        w = weights[t] * weights[t]
        if w > 0.0:
            r = readings[t] - room.model[t]
            chi2 += w * r * r
            for i in range(6):
                g[i] += w * r * J[t, i]
                for j in range(i + 1):
                    A[i, j] += w * J[t, i] * J[t, j]
    total = chi2
    if not by_ellipse:
        total += _add_prior(state, problem, A, g)
    for i in range(6):
        for j in range(i):
            A[j, i] = A[i, j]
    return chi2, total


@compiled_part
def _add_prior(state: Array, problem: Problem, A: Array, g: Array) -> float:
    """Its residual's square; the lower triangle of A and g grow by it."""
    mean, rate = problem.prior
    if rate == 0.0:
        return 0.0
    slope = np.empty(3)
    r = (mean - flat_curvature(state, problem.material[3], slope)) * rate
    for i in range(3):
        g[3 + i] += r * slope[i] * rate
        for j in range(i + 1):
            A[3 + i, 3 + j] += slope[i] * slope[j] * rate * rate
    return r * r


@compiled_part
def new_room(tactels: int) -> Room:
    return Room(
        np.empty(tactels), np.empty((tactels, 6)), np.empty(3), np.empty((3, 4)),
        np.empty((3, MOST_NODES**2)), np.empty((2, MOST_NODES**2)), np.empty((6, 6)), np.empty(6),
    )  # fmt: skip
