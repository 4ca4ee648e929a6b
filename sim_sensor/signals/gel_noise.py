"""Errors of a reconstructed depth image: white, and smooth ones that do not average out."""

from __future__ import annotations

import numpy as np

from estimator.vectors import Array

_STEP = 0.7  # of nodes, in correlation lengths: the rms ripples by 0.03 % over the image


def depth_noise(
    shape: tuple[int, int, int],
    pitch: float,
    *,
    white: float,
    correlated: float,
    length: float,
    rng: np.random.Generator,
) -> Array:
    """Images of white noise plus Gaussian noise of autocorrelation exp(-r^2 / 2 l^2).

    The smooth part is independent numbers on a grid of 0.7 l, each carrying exp(-r^2 / l^2).

    Args:
        shape: Images, rows, columns.
        pitch: Of pixels [m].
        white, correlated: rms [m].
        length: l [m].
    """
    out = np.zeros(shape)
    if correlated > 0.0:
        rows, columns = (_carriers(n, pitch / length) for n in shape[1:])
        nodes = rng.standard_normal((shape[0], rows.shape[1], columns.shape[1]))
        out = correlated * (rows @ (nodes @ columns.T))
    if white > 0.0:
        out += white * rng.standard_normal(shape)
    return np.asarray(out)


def _carriers(n: int, pitch: float) -> Array:
    """What each node contributes to each of n pixels along one axis; lengths in units of l."""
    x = (np.arange(n) - 0.5 * (n - 1)) * pitch
    last = np.ceil((0.5 * n * pitch + 3.0) / _STEP)
    nodes = np.arange(-last, last + 1.0) * _STEP
    k = np.exp(-np.square(x[:, None] - nodes))
    return np.asarray(k * (_STEP * np.sqrt(2.0 / np.pi)) ** 0.5)  # sum of k^2 is one
