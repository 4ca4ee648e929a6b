"""Small symmetric systems inside compiled loops, in lower triangles."""

from __future__ import annotations

from math import log, sqrt

import numpy as np

from estimator.compiled import compiled_part
from estimator.vectors import Array


@compiled_part
def factor(A: Array, L: Array) -> float:
    """Cholesky factor L of A (lower triangles), pivots kept positive; returns log det A."""
    log_det = 0.0
    for j in range(len(A)):
        for k in range(j + 1):
            total = A[j, k]
            for m in range(k):
                total -= L[j, m] * L[k, m]
            if k < j:
                L[j, k] = total / L[k, k]
            else:
                pivot = max(total, 1e-14 * abs(A[j, j]) + 1e-300)
                L[j, j] = sqrt(pivot)
                log_det += log(pivot)
    return log_det


@compiled_part
def solve_factored(L: Array, y: Array) -> None:
    """y becomes A^-1 y."""
    P = len(y)
    for j in range(P):
        for m in range(j):
            y[j] -= L[j, m] * y[m]
        y[j] /= L[j, j]
    for j in range(P - 1, -1, -1):
        for m in range(j + 1, P):
            y[j] -= L[m, j] * y[m]
        y[j] /= L[j, j]


@compiled_part
def inverse(A: Array, out: Array, L: Array) -> None:
    """out becomes the inverse of a positive definite A (lower triangle in, whole matrix out)."""
    factor(A, L)
    for j in range(len(A)):
        for k in range(len(A)):
            out[j, k] = 1.0 if j == k else 0.0
        solve_factored(L, out[j])


@compiled_part
def marginal(A: Array) -> Array:
    """The first four states' information, all others marginalised (lower triangle in, whole out).

    One state after the other: rank-one Schur complements.
    """
    P = len(A)
    F, out = np.empty((P, P)), np.empty((4, 4))
    for j in range(P):
        for k in range(j + 1):
            F[j, k] = A[j, k]
            F[k, j] = A[j, k]
    for last in range(P - 1, 3, -1):
        for j in range(last):
            for k in range(last):
                F[j, k] -= F[j, last] * F[last, k] / F[last, last]
    for j in range(4):
        for k in range(4):
            out[j, k] = F[j, k]
    return out
