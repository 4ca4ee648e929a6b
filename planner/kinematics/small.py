"""Vectors and matrices of three inside compiled loops, written out.

Array expressions and `@` would be shorter, and each takes a second or more to compile.
"""

from __future__ import annotations

from math import cos, sin, sqrt

from estimator.compiled import V3, compiled_part
from estimator.vectors import Array

LEAST_ANGLE = 1e-12  # below which a rotation is the identity [rad]


@compiled_part
def clear(matrix: Array) -> None:
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            matrix[i, j] = 0.0


@compiled_part
def times(R: Array, x: float, y: float, z: float) -> V3:
    """R v."""
    return (
        R[0, 0] * x + R[0, 1] * y + R[0, 2] * z,
        R[1, 0] * x + R[1, 1] * y + R[1, 2] * z,
        R[2, 0] * x + R[2, 1] * y + R[2, 2] * z,
    )


@compiled_part
def transposed_times(R: Array, x: float, y: float, z: float) -> V3:
    """R^T v."""
    return (
        R[0, 0] * x + R[1, 0] * y + R[2, 0] * z,
        R[0, 1] * x + R[1, 1] * y + R[2, 1] * z,
        R[0, 2] * x + R[1, 2] * y + R[2, 2] * z,
    )


@compiled_part
def turned(w0: float, w1: float, w2: float, x: float, y: float, z: float) -> V3:
    """exp(w) v, by Rodrigues' formula."""
    square = w0 * w0 + w1 * w1 + w2 * w2
    if square < LEAST_ANGLE**2:
        return (x, y, z)
    angle = sqrt(square)
    s, c = sin(angle) / angle, (1.0 - cos(angle)) / square
    along, keep = c * (w0 * x + w1 * y + w2 * z), 1.0 - c * square
    return (
        keep * x + along * w0 + s * (w1 * z - w2 * y),
        keep * y + along * w1 + s * (w2 * x - w0 * z),
        keep * z + along * w2 + s * (w0 * y - w1 * x),
    )


@compiled_part
def turn_by(w0: float, w1: float, w2: float, R: Array) -> None:
    """R becomes exp(w) R."""
    for k in range(3):
        R[0, k], R[1, k], R[2, k] = turned(w0, w1, w2, R[0, k], R[1, k], R[2, k])
