"""Where a fit of strains begins: the most similar of a thousand templates.

A template is a contact somewhere in the middle cell of the window (anywhere, for the few touches
whose peak is not there) with an ellipse of some size, length and direction. Similar means the
largest normalised correlation, whatever the force.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from estimator.readers.hertz import curvature_tensor
from estimator.readers.strain_array import StrainArray
from estimator.readers.strain_model import predicted_readings
from estimator.vectors import Array, Index, Mask, frozen

SIZES = (0.5, 0.85, 1.25, 1.8)  # sqrt(a b) / d
LENGTHS = (1.0, 1.6, 2.7, 4.5)  # a / b
ANGLES = 4
CELL = np.array([-0.45, -0.225, 0.0, 0.225, 0.45])  # places in the middle cell, of the pitch
CHUNK = 1024


@dataclass(frozen=True, eq=False)
class Templates:
    """N contacts of 1 N in the middle of a window.

    Args:
        states: Place from the window's middle, ln F = 0, relative curvature over force (N, 6).
        readings: (N, T), of unit length; `lengths` (N,) is what they were divided by.
        places: How many; the templates of one place are together.
    """

    states: Array
    readings: Array
    lengths: Array
    places: int


@lru_cache(maxsize=16)
def templates(array: StrainArray, central: bool) -> Templates:
    """Of the array's nominal response; made once for an array."""
    small = StrainArray(**{**vars(array), "tactels": array.window})
    ellipses = np.array([_ellipse(s, t, i) for s in SIZES for t in LENGTHS for i in range(ANGLES)
                         if t > 1.0 or i == 0])  # fmt: skip
    K = curvature_tensor(ellipses * array.depth, 1.0, array.effective_modulus)
    places = [CELL if central else 0.5 * np.arange(-n, n + 1) for n in array.window]
    y, x = np.meshgrid(*places, indexing="ij")
    x0, y0 = x.ravel() * array.axial_pitch, y.ravel() * array.arc_pitch
    grid = np.zeros((len(x0), len(K), 6))
    grid[..., 0], grid[..., 1] = x0[:, None], y0[:, None]
    grid[..., 3], grid[..., 4], grid[..., 5] = K[:, 0, 0], K[:, 1, 1], K[:, 0, 1]
    states = grid.reshape(-1, 6)
    readings = predicted_readings(states, small).reshape(len(states), -1)
    lengths = np.linalg.norm(readings, axis=1)
    return Templates(frozen(states), frozen(readings / lengths[:, None]), frozen(lengths), len(x0))


def _ellipse(size: float, length: float, turn: int) -> Array:
    """M over d."""
    a, b = size * np.sqrt(length), size / np.sqrt(length)
    angle = turn * np.pi / ANGLES
    c, s = np.cos(angle), np.sin(angle)
    R = np.array([[c, -s], [s, c]])
    return np.asarray(R @ np.diag([a, b]) @ R.T)


def starts(windows: Array, weights: Array, array: StrainArray, *, best: int = 1) -> Array:
    """States the templates most like each window, best first; places from the window's middle.

    Args:
        windows: Readings (B, T), dead tactels 0.
        weights: (B, T), 0 where a tactel is dead.
        best: How many, not two of one place.
    Returns:
        (B, best, 6).
    """
    out = np.empty((len(windows), best, 6))
    peaks = np.argmax(windows, axis=1)
    middle = _is_middle(np.arange(windows.shape[1]), array.window)[peaks]
    for central in (True, False):
        known = templates(array, central) if np.any(middle == central) else None
        chosen = np.flatnonzero(middle == central)
        for first in range(0, len(chosen), CHUNK):
            part = chosen[first : first + CHUNK]
            assert known is not None
            out[part] = _best(windows[part], weights[part] > 0.0, known, best)
    return out


def _is_middle(tactels: Index, window: tuple[int, int]) -> Mask:
    """Whether a tactel is at a corner of the middle cell (or next to the middle tactel)."""
    row, column = np.divmod(tactels, window[1])
    off_row, off_column = row - 0.5 * (window[0] - 1), column - 0.5 * (window[1] - 1)
    return np.asarray((np.abs(off_row) < 0.75) & (np.abs(off_column) < 0.75))


def _best(windows: Array, alive: Mask, known: Templates, best: int) -> Array:
    score = windows @ known.readings.T
    square = np.ones((1, 1))
    if not alive.all():
        square = np.maximum(alive.astype(np.float64) @ np.square(known.readings).T, 1e-12)
        score /= square**0.5
    chosen = _ranked(score, known.places, best)
    rows = np.arange(len(score))[:, None]
    square = np.broadcast_to(square, score.shape)[rows, chosen]
    force = score[rows, chosen] / (square**0.5 * known.lengths[chosen])
    states = known.states[chosen]
    force = np.maximum(force, 1e-6)
    states[..., 2] = np.log(force)
    states[..., 3:] *= force[..., None]  # the ellipse knows only K / F
    return states


def _ranked(score: Array, places: int, best: int) -> Index:
    """Indices of the best templates, the second and later ones of other places."""
    if best == 1:
        return np.asarray(np.argmax(score, axis=1)[:, None])
    grouped = score.reshape(len(score), places, -1)
    inner = np.argmax(grouped, axis=2)
    order = np.argsort(-grouped.max(axis=2), axis=1)[:, :best]
    return np.asarray(order * grouped.shape[2] + np.take_along_axis(inner, order, axis=1))
