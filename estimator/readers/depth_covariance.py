"""What white and correlated noise does to a fit: its covariance, and what it leaves behind.

Errors of reconstruction are smooth: autocorrelation exp(-r^2 / 2 l^2) with l of a millimetre or
two (sensor.md, section 4). Ordinary least squares does not know; its covariance does,

    cov = A^-1 (s_w^2 A + s_c^2 B) A^-1,    A = X'X,   B = X'RX,

with R the correlation of all pairs of pixels in the domain. The rows X are summed in cells of
about l / 3, and the correlation of means over cells of side q is again Gaussian to 2 %, with
l'^2 = l^2 + q^2 / 6 and its height l^2 / l'^2: R is separable and costs a few thousand products.
"""

from __future__ import annotations

import numpy as np

from estimator.compiled import compiled_part
from estimator.readers.depth_cells import COUNT, MEAN, X, Y
from estimator.readers.depth_fit import TERMS, beyond_quadratic, dome, row_of
from estimator.readers.depth_noise import two_variances
from estimator.vectors import Array, Mask

LENGTHS = np.array((0.0, 0.25, 0.4, 0.6, 0.9, 1.3, 2.0, 3.0))  # tried where none is told [mm]
_UNSEEN = 2.0
_LIKELY, _SPREAD = 1.3, 0.6  # of those: [mm], sd of the logarithm


@compiled_part
def smooth_moment(
    cells: Array, inside: Mask, centre: Array, side: float, pixels: int, length: float, B: Array
) -> None:
    """B = X'RX of unit correlated noise over the domain, (6, 6).

    Args:
        cells, inside, centre: As in `fit_once`.
        side: Of a cell [mm].
        pixels: Along a cell's side.
        length: l [mm].
    """
    G = max(1, round(0.35 * length / side))
    low_i, high_i, low_j, high_j = _box(inside, G)
    rows, columns = high_i - low_i, high_j - low_j
    S, row = np.zeros((columns, rows, TERMS)), np.empty(TERMS)
    for i in range(low_i * G, min(high_i * G, inside.shape[0])):
        for j in range(low_j * G, min(high_j * G, inside.shape[1])):
            if inside[i, j]:
                row_of(cells[X, i, j] - centre[0], cells[Y, i, j] - centre[1], row)
                for k in range(TERMS):
                    S[j // G - low_j, i // G - low_i, k] += cells[COUNT, i, j] * row[k]
    pitch = side / pixels
    spread = length * length + pitch * pitch * ((G * pixels) ** 2 - 1.0) / 6.0
    scale, step = length / spread**0.5, 0.5 * (G * side) ** 2 / spread
    T = np.dot(_kernel(columns, scale, step), S.reshape(columns, rows * TERMS))
    swapped = np.empty((rows, columns, TERMS))
    for i in range(rows):
        for j in range(columns):
            for k in range(TERMS):
                swapped[i, j, k] = T[j, i * TERMS + k]
    R = np.dot(_kernel(rows, scale, step), swapped.reshape(rows, columns * TERMS))
    B[:] = 0.0
    for i in range(rows):
        for j in range(columns):
            for k in range(TERMS):
                for n in range(k + 1):
                    B[k, n] += S[j, i, k] * R[i, j * TERMS + n]
    for k in range(TERMS):
        for n in range(k):
            B[n, k] = B[k, n]


@compiled_part
def _box(inside: Mask, G: int) -> tuple[int, int, int, int]:
    """Rows and columns of the domain, first and past the last, in blocks of G cells."""
    low_i, high_i, low_j, high_j = inside.shape[0], 0, inside.shape[1], 0
    for i in range(inside.shape[0]):
        for j in range(inside.shape[1]):
            if inside[i, j]:
                low_i, high_i = min(low_i, i), max(high_i, i)
                low_j, high_j = min(low_j, j), max(high_j, j)
    return low_i // G, high_i // G + 1, low_j // G, high_j // G + 1


@compiled_part
def _kernel(n: int, scale: float, step: float) -> Array:
    """Correlation along one axis of cells k apart, scale exp(-step k^2), as a matrix (n, n)."""
    values, out = np.empty(n), np.empty((n, n))
    for k in range(n):
        values[k] = scale * np.exp(-step * k * k)
    for i in range(n):
        for j in range(n):
            out[i, j] = values[abs(i - j)]
    return out


@compiled_part
def residuals(
    cells: Array, inside: Mask, radius: float, centre: Array, terms: Array, out: Array
) -> float:
    """Write each cell's misfit [mm] (zero outside); their mean square, pixels as weights."""
    square, weight, row = 0.0, 0.0, np.empty(TERMS)
    out[:] = 0.0
    for i in range(inside.shape[0]):
        for j in range(inside.shape[1]):
            if inside[i, j]:
                x, y = cells[X, i, j] - centre[0], cells[Y, i, j] - centre[1]
                row_of(x, y, row)
                r = dome(cells[X, i, j], cells[Y, i, j], radius) - cells[MEAN, i, j]
                r -= beyond_quadratic(x, y, terms)
                for k in range(TERMS):
                    r -= row[k] * terms[k]
                out[i, j] = r
                square += cells[COUNT, i, j] * r * r
                weight += cells[COUNT, i, j]
    return square / weight


@compiled_part
def trace_product(A: Array, B: Array) -> float:
    s = 0.0
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            s += A[i, j] * B[j, i]
    return s


@compiled_part
def expected_square(
    cells: Array, inside: Mask, inv: Array, B: Array, side: float, pixels: int, noise: Array
) -> float:
    """Mean square misfit [mm^2] that noise (white, correlated, length) leaves after the fit."""
    weight, n = 0.0, 0
    for i in range(inside.shape[0]):
        for j in range(inside.shape[1]):
            if inside[i, j]:
                weight += cells[COUNT, i, j]
                n += 1
    pitch, length = side / pixels, max(noise[2], 1e-6)
    flat = length**2 / (length**2 + pitch**2 * (pixels**2 - 1.0) / 6.0)
    smooth = max(flat - trace_product(inv, B) / weight, 1e-3)
    return float(noise[0] ** 2 * max(n - TERMS, 1) / weight + noise[1] ** 2 * smooth)


@compiled_part
def noise_of_residuals(
    cells: Array,
    inside: Mask,
    centre: Array,
    inv: Array,
    side: float,
    pixels: int,
    misfit: Array,
    noise: Array,
) -> None:
    """Estimate noise = (white, correlated, length) [mm] from one fit's residuals.

    From their mean square, which the fit has diminished (by what `expected_square` says), and
    their structure function at lags of one, two and four cells, which it hardly has. The length
    has a log-normal prior: what varies more slowly than the domain is wide cannot be seen in it,
    and for that the smooth variance is doubled.
    """
    seen, pairs = np.zeros(4), np.zeros(4)
    h, w = inside.shape
    for i in range(h):
        for j in range(w):
            if not inside[i, j]:
                continue
            seen[0] += misfit[i, j] ** 2
            pairs[0] += 1.0
            for k in range(3):
                lag = 1 << k
                if i + lag < h and inside[i + lag, j]:
                    seen[k + 1] += (misfit[i, j] - misfit[i + lag, j]) ** 2
                    pairs[k + 1] += 1.0
                if j + lag < w and inside[i, j + lag]:
                    seen[k + 1] += (misfit[i, j] - misfit[i, j + lag]) ** 2
                    pairs[k + 1] += 1.0
    n, pitch = pairs[0], side / pixels
    seen = np.maximum(seen / np.maximum(pairs, 1.0), 1e-14)
    B, rows, best = np.zeros((TERMS, TERMS)), np.zeros((4, 2)), np.inf
    weight = n * pixels * pixels
    for length in LENGTHS:
        rows[:, 1] = 0.0
        prior = 0.0
        if length > 0.0:
            smooth_moment(cells, inside, centre, side, pixels, length, B)
            spread = length**2 + pitch**2 * (pixels**2 - 1.0) / 6.0
            flat = length**2 / spread
            rows[0, 1] = max(flat - trace_product(inv, B) / weight, 1e-3) / seen[0]
            for k in range(3):
                rise = 1.0 - np.exp(-0.5 * ((1 << k) * side) ** 2 / spread)
                rows[k + 1, 1] = 2.0 * flat * rise / seen[k + 1]
            prior = (np.log(length / _LIKELY) / _SPREAD) ** 2
        per_cell = 1.0 / (pixels * pixels)
        rows[0, 0] = per_cell * max(n - TERMS, 1.0) / n / seen[0]
        for k in range(3):
            rows[k + 1, 0] = 2.0 * per_cell / seen[k + 1] if pairs[k + 1] > 0.0 else 0.0
            rows[k + 1, 1] = rows[k + 1, 1] if pairs[k + 1] > 0.0 else 0.0
        p, q = two_variances(rows)
        cost = 0.02 * prior
        for k in range(4):
            cost += (rows[k, 0] * p + rows[k, 1] * q - 1.0) ** 2 if pairs[k] > 0.0 else 0.0
        if cost < best:
            best = cost
            noise[0], noise[1], noise[2] = p**0.5, (_UNSEEN * q) ** 0.5, length
