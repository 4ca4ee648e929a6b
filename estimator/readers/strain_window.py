"""Which tactels of a full array are fitted: the window with the most in its middle."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from estimator.readers.strain_array import StrainArray
from estimator.vectors import Array, Index, Mask

FEWEST = 8  # live tactels that six unknowns and a residual need


class Windows(NamedTuple):
    """One window for each of B frames, of T tactels.

    Args:
        readings: Dead tactels 0, (B, T) [unit].
        sd: Of each reading, (B, T) [unit].
        live: False where a tactel is dead, (B, T).
        tactels: Indices into the array, (B, T).
        middles: Of the window, x and y [m], (B, 2).
        outside: Index of the largest reading outside the window, -1 if there is none (B,).
    """

    readings: Array
    sd: Array
    live: Mask
    tactels: Index
    middles: Array
    outside: Index


def checked_frames(strains: ArrayLike, array: StrainArray) -> Array:
    """Readings as (B, rows, columns); NaN marks dead tactels.

    Raises:
        ValueError: Another shape, infinite values, or a frame without one live tactel.
    """
    try:
        frames = np.array(strains, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError("strains: expected numbers, NaN for dead tactels") from None
    if frames.shape == array.tactels:
        frames = frames[None]
    if frames.ndim != 3 or frames.shape[1:] != array.tactels:
        raise ValueError(
            f"strains: expected shape (B, {array.tactels[0]}, {array.tactels[1]}), rows around "
            f"the finger and columns along it, got {frames.shape}"
        )
    if np.any(np.isinf(frames)):
        raise ValueError("strains: expected finite numbers, NaN for dead tactels, got infinity")
    dead = np.all(np.isnan(frames), axis=(1, 2))
    if np.any(dead):
        raise ValueError(f"strains: reading {int(np.argmax(dead))} has no live tactel, all are NaN")
    return frames


def choose_windows(frames: Array, array: StrainArray) -> Windows:
    """The window whose middle (2 x 2, or its odd kin) reads most, wholly on the array."""
    columns, (h, w) = array.tactels[1], array.window
    B = len(frames)
    row, column = _corners(frames, array)
    i = row[:, None, None] + np.arange(h)[:, None]
    j = column[:, None, None] + np.arange(w)
    tactels = (i * columns + j).reshape(B, h * w)
    flat, sd = frames.reshape(B, -1), array.standard_deviation(frames).reshape(B, -1)
    each = np.arange(B)[:, None]
    readings = flat[each, tactels]
    live = ~np.isnan(readings)
    first, last = array.positions[tactels[:, 0]], array.positions[tactels[:, -1]]
    rest = np.where(np.isnan(flat), -np.inf, flat)
    rest[each, tactels] = -np.inf
    outside = np.argmax(rest, axis=1)
    outside[np.isinf(rest[np.arange(B), outside])] = -1
    return Windows(
        np.where(live, readings, 0.0), np.where(live, sd[each, tactels], 1.0), live, tactels,
        0.5 * (first + last), outside,
    )  # fmt: skip


def _corners(frames: Array, array: StrainArray) -> tuple[Index, Index]:
    """Row and column of each window's first tactel."""
    h, w = array.window
    if array.window == array.tactels:
        zero = np.zeros(len(frames), dtype=np.intp)
        return zero, zero
    inner = (2 - h % 2, 2 - w % 2)
    dead = np.isnan(frames)
    blocks = _block_sums(np.where(dead, 0.0, frames), inner)
    if dead.any():
        blocks = blocks / np.maximum(_block_sums(1.0 - dead, inner), 0.5)
    row, column = np.divmod(blocks.reshape(len(frames), -1).argmax(axis=1), blocks.shape[2])
    row, column = row - (h - inner[0]) // 2, column - (w - inner[1]) // 2
    return (
        np.clip(row, 0, array.tactels[0] - h),
        np.clip(column, 0, array.tactels[1] - w),
    )


def _block_sums(values: Array, shape: tuple[int, int]) -> Array:
    """Sums over all blocks of 1 or 2 rows and columns."""
    if shape[0] == 2:
        values = values[:, 1:] + values[:, :-1]
    if shape[1] == 2:
        values = values[:, :, 1:] + values[:, :, :-1]
    return values
