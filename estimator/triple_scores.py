"""The expected error of the axis after three touches, for every triple of a grid of places.

Information of independent contacts adds, so a triple on one object is worth

    value^2 = trace of the 4x4 block of  (J_0 + J_i + J_j + J_k)^-1

with the fifth parameter, the common rotation of the directions, marginalised, and every coordinate
in units of its goal; to that comes what a rotation that nobody was told of would bias
(`estimator.information.with_untold_rotation`). A million triples over 16 objects take 0.8 s of one
core.
"""

from __future__ import annotations

from math import log

import numpy as np
from numpy.typing import NDArray

from estimator.compiled import compiled, compiled_part
from estimator.side_by_side import in_shares
from estimator.vectors import Array, Index

LOWER = np.tril_indices(5)  # how a symmetric 5x5 matrix is packed
PACKED = 15
_AT_A_TIME = 512  # triples for which one object's information is read
_PRODUCT = 16  # squares multiplied before their logarithm is taken


def in_goals(information: Array, *, angle: float, offset: float, height: float = 0.0) -> Array:
    """Information about (t1, t2, w1, w2, delta) in units of the goals, at a place of the axis.

    The offset counts where the object will be held: there a tilt w moves the axis by height * w.

    Args:
        information: (..., 5, 5) in the chart at the axis [m], [rad].
        angle, offset: What counts as one [rad], [m].
        height: Of that place above the axis' point, along its direction [m].
    Raises:
        ValueError: A goal that is not positive.
    """
    if not (angle > 0.0 and offset > 0.0):
        raise ValueError(f"goals: expected angle and offset > 0, got {angle} rad and {offset} m")
    motion = np.diag([offset, offset, angle, angle, 1.0])  # t = offset * t' - height * w
    motion[0, 2] = motion[1, 3] = -height * angle
    return np.asarray(motion.T @ information @ motion)


def triple_scores(
    information: Array, before: Array, triples: Index, *, untold: float = 0.0
) -> Array:
    """Mean over objects of the logarithm of the expected error, in goals, of each triple.

    The mean of the logarithm is the expected information; a touch that would miss an object has no
    information there. Permuting a triple or moving the world changes nothing.

    Args:
        information: Of each place on each object `in_goals`, zero where missed, (B, G, 5, 5).
        before: What is known before the touches `in_goals`, positive definite, (5, 5).
        triples: Places of each triple, (T, 3); fastest where the last one runs fastest.
        untold: Sd of a common rotation beside what is admitted [rad].
    Returns:
        (T,); 0 is an rms error of one goal, log 2 of two.
    Raises:
        ValueError: A shape that does not fit, or a place that is not of the grid.
    """
    information = np.asarray(information, dtype=np.float64)
    triples = np.ascontiguousarray(triples, dtype=np.intp)
    if information.ndim != 4 or information.shape[2:] != (5, 5) or len(information) == 0:
        raise ValueError(
            f"information: expected shape (B, G, 5, 5), B >= 1, got {information.shape}"
        )
    if triples.ndim != 2 or triples.shape[1] != 3:
        raise ValueError(f"triples: expected shape (T, 3), got {triples.shape}")
    places = information.shape[1]
    if len(triples) and not (triples.min() >= 0 and triples.max() < places):
        raise ValueError(f"triples: expected places 0 to {places - 1}, as many as the grid has")
    out = np.zeros(len(triples))
    packed = np.ascontiguousarray(information[..., LOWER[0], LOWER[1]])
    known = np.asarray(before, dtype=np.float64)[LOWER]

    def score(part: slice) -> None:
        _fill_scores(packed, known, untold**2, triples[part], out[part])

    in_shares(score, len(triples), least=_AT_A_TIME)
    return out


@compiled
def _fill_scores(
    J: Array, before: Array, untold: float, triples: NDArray[np.intp], out: Array
) -> None:
    pair, total = np.empty(PACKED), np.empty(PACKED)
    product = np.empty(_AT_A_TIME)
    for start in range(0, len(triples), _AT_A_TIME):
        end = min(start + _AT_A_TIME, len(triples))
        product[:] = 1.0
        for b in range(len(J)):
            i, j = -1, -1
            for t in range(start, end):
                if triples[t, 0] != i or triples[t, 1] != j:
                    i, j = triples[t, 0], triples[t, 1]
                    for c in range(PACKED):
                        pair[c] = before[c] + J[b, i, c] + J[b, j, c]
                k = triples[t, 2]
                for c in range(PACKED):
                    total[c] = pair[c] + J[b, k, c]
                product[t - start] *= _trace(total, before[14], untold)
            if b % _PRODUCT == _PRODUCT - 1 or b == len(J) - 1:
                for t in range(start, end):
                    out[t] += log(product[t - start])
                    product[t - start] = 1.0
        for t in range(start, end):
            out[t] /= 2.0 * len(J)


@compiled_part
def _trace(m: Array, admitted: float, untold: float) -> float:
    """Trace of the 4x4 block of the inverse of a packed 5x5 matrix, and the squared bias.

    The last parameter is eliminated, then the last two of four, each by its Schur complement:
    with the blocks P, Q, R and S = R - Q^T P^-1 Q the trace is tr P^-1 + tr S^-1 (1 + X^T X),
    X = P^-1 Q. The bias is K (c_1, c_2), with K that block, times what was admitted over d.
    """
    d = 1.0 / m[14]
    p00, p10, p11 = m[0] - m[10] * m[10] * d, m[1] - m[11] * m[10] * d, m[2] - m[11] * m[11] * d
    q00, q10 = m[3] - m[12] * m[10] * d, m[4] - m[12] * m[11] * d
    q01, q11 = m[6] - m[13] * m[10] * d, m[7] - m[13] * m[11] * d
    r00, r10, r11 = m[5] - m[12] * m[12] * d, m[8] - m[13] * m[12] * d, m[9] - m[13] * m[13] * d
    p = 1.0 / (p00 * p11 - p10 * p10)
    i00, i10, i11 = p11 * p, -p10 * p, p00 * p
    x00, x10 = i00 * q00 + i10 * q10, i10 * q00 + i11 * q10
    x01, x11 = i00 * q01 + i10 * q11, i10 * q01 + i11 * q11
    s00 = r00 - q00 * x00 - q10 * x10
    s10 = r10 - q00 * x01 - q10 * x11
    s11 = r11 - q01 * x01 - q11 * x11
    s = 1.0 / (s00 * s11 - s10 * s10)
    square_0, square_1 = x00 * x00 + x10 * x10, x01 * x01 + x11 * x11
    cross = x00 * x01 + x10 * x11
    last = s11 * (1.0 + square_0) + s00 * (1.0 + square_1) - 2.0 * s10 * cross
    c20 = m[12] - x00 * m[10] - x10 * m[11]
    c21 = m[13] - x01 * m[10] - x11 * m[11]
    b2, b3 = s * (s11 * c20 - s10 * c21), s * (s00 * c21 - s10 * c20)
    b0 = i00 * m[10] + i10 * m[11] - x00 * b2 - x01 * b3
    b1 = i10 * m[10] + i11 * m[11] - x10 * b2 - x11 * b3
    bias = (b0 * b0 + b1 * b1 + b2 * b2 + b3 * b3) * (admitted * d) ** 2
    return float(i00 + i11 + s * last + untold * bias)
