"""A depth image in coarse cells: means of small blocks of pixels, and where the contact is.

White noise averages out in a cell, correlated noise (which decides, sensor.md section 4) does not,
and a few hundred cells carry all that a quadratic can take from thousands of pixels. A cell keeps
the centroid of its finite pixels, so dead pixels leave no bias. Lengths are in millimetres here
and in `depth_fit`, for the conditioning of sixth-order moments.
"""

from __future__ import annotations

import numpy as np

from estimator.compiled import compiled, compiled_part
from estimator.vectors import Array

MEAN, X, Y, COUNT = 0, 1, 2, 3  # layers of cells


@compiled
def pool(image: Array, pitch: float, m: int, cells: Array) -> tuple[float, int]:
    """Fill cells (4, h, w) from one image; its deepest pixel and how many are exactly as deep.

    Args:
        image: Depth [mm], (H, W), NaN where a pixel is dead.
        pitch: Of pixels [mm].
        m: Pixels along a cell's side.
        cells: Out; mean depth, centroid x and y [mm] about the middle of the image, pixels.
    """
    rows, columns = image.shape
    deepest, same = -np.inf, 0
    for ci in range(cells.shape[1]):
        for cj in range(cells.shape[2]):
            total, sx, sy, n = 0.0, 0.0, 0.0, 0
            for i in range(ci * m, min(ci * m + m, rows)):
                for j in range(cj * m, min(cj * m + m, columns)):
                    d = image[i, j]
                    if np.isnan(d):
                        continue
                    total, sx, sy, n = total + d, sx + j, sy + i, n + 1
                    if d >= deepest:
                        same = same + 1 if d == deepest else 1
                        deepest = d
            share = 1.0 / max(n, 1)
            cells[MEAN, ci, cj], cells[COUNT, ci, cj] = total * share, n
            cells[X, ci, cj] = (sx * share - 0.5 * (columns - 1)) * pitch
            cells[Y, ci, cj] = (sy * share - 0.5 * (rows - 1)) * pitch
    return deepest, same


@compiled_part
def deepest_cell(cells: Array) -> tuple[int, int, float]:
    """Row, column and depth [mm] of the deepest cell, averaged over its neighbours (one noisy
    cell is no peak); depth -inf where every pixel is dead."""
    h, w = cells.shape[1:]
    best, bi, bj = -np.inf, 0, 0
    for i in range(h):
        for j in range(w):
            if not (cells[COUNT, i, j] > 0.0 and cells[MEAN, i, j] > 0.5 * best):
                continue
            total, n = 0.0, 0
            for k in range(max(i - 1, 0), min(i + 2, h)):
                for m in range(max(j - 1, 0), min(j + 2, w)):
                    if cells[COUNT, k, m] > 0.0:
                        total += cells[MEAN, k, m]
                        n += 1
            if total > best * n or best == -np.inf:
                best, bi, bj = total / n, i, j
    return bi, bj, best


@compiled_part
def flood(cells: Array, i: int, j: int, level: float, label: int, labels: Array) -> int:
    """Label the cells deeper than `level` that hang together with cell i, j; their number."""
    h, w = labels.shape
    stack = np.empty((h * w, 2), np.int64)
    stack[0, 0], stack[0, 1] = i, j
    labels[i, j] = label
    waiting, size = 1, 0
    while waiting:
        waiting -= 1
        ci, cj = stack[waiting, 0], stack[waiting, 1]
        size += 1
        for k in range(4):
            ni, nj = ci + (k == 0) - (k == 1), cj + (k == 2) - (k == 3)
            if ni < 0 or nj < 0 or ni >= h or nj >= w or labels[ni, nj] != 0:
                continue
            if cells[MEAN, ni, nj] > level and cells[COUNT, ni, nj] > 0.0:
                labels[ni, nj] = label
                stack[waiting, 0], stack[waiting, 1] = ni, nj
                waiting += 1
    return size


@compiled_part
def other_blob(cells: Array, level: float, labels: Array) -> int:
    """Size in cells of the largest blob deeper than `level` that is not yet labelled."""
    largest, label = 0, 2
    for i in range(labels.shape[0]):
        for j in range(labels.shape[1]):
            if labels[i, j] == 0 and cells[COUNT, i, j] > 0.0 and cells[MEAN, i, j] > level:
                largest = max(largest, flood(cells, i, j, level, label, labels))
                label += 1
    return largest
