"""How a depth image errs: what a user states, and what frames without contact tell of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimator.compiled import compiled
from estimator.vectors import Array


@dataclass(frozen=True)
class DepthNoise:
    """What is known of a depth sensor's errors; standard deviations.

    Args:
        white: Of each pixel [m] (of slopes [-] for a normal map).
        correlated: Of the smooth part [m] (or [-]).
        length: l of its autocorrelation exp(-r^2 / 2 l^2) [m].
        gain: Relative, of all depths alike [-]: scales the curvature relative to the pad.
    Raises:
        ValueError: Negative or not finite; correlated noise without a length.
    """

    white: float = 0.0
    correlated: float = 0.03e-3
    length: float = 1.5e-3
    gain: float = 0.0

    def __post_init__(self) -> None:
        for name in ("white", "correlated", "length", "gain"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0.0):
                raise ValueError(f"depth noise {name}: expected zero or greater, got {value!r}")
        if self.correlated > 0.0 and self.length == 0.0:
            raise ValueError("depth noise length: expected greater than zero, else use `white`")


def noise_of_frames(frames: Array, pixel_pitch: float) -> tuple[float, float, float]:
    """White rms [m], correlated rms [m] and length [m] of frames in which nothing is touched.

    From the structure function of what differs from the mean frame, at lags of 1, 2, 4 ... pixels.
    The surest way to know a sensor: a few tens of frames suffice.

    Args:
        frames: Depth [m], (n, H, W), n >= 2, NaN where a pixel is dead.
        pixel_pitch: [m].
    Raises:
        ValueError: Wrong shape, or fewer than two frames.
    """
    frames = np.asarray(frames, dtype=np.float64)
    if frames.ndim != 3 or len(frames) < 2 or min(frames.shape[1:]) < 8:
        raise ValueError(f"frames: expected (n >= 2, H, W) with H, W >= 8, got {frames.shape}")
    n = len(frames)
    error = (frames - frames.mean(axis=0)) * np.sqrt(n / (n - 1.0))
    variance = float(np.nanmean(error**2))
    lags = [k for k in (1, 2, 4, 8, 16, 32) if k < min(frames.shape[1:]) // 2]
    steps = [
        0.5
        * (
            np.nanmean(np.square(error[:, k:] - error[:, :-k]))
            + np.nanmean(np.square(error[:, :, k:] - error[:, :, :-k]))
        )
        for k in lags
    ]
    h = np.array(lags) * pixel_pitch * 1e3
    best = (np.inf, np.sqrt(variance), 0.0, 0.0)
    for length in np.geomspace(0.15, 6.0, 75):
        rise = -np.expm1(-0.5 * (h / length) ** 2)
        rows = np.vstack([np.column_stack([np.full(len(h), 2.0), 2.0 * rise]), [1.0, 1.0]])
        seen = np.append(steps, variance)
        white, smooth = two_variances(rows / seen[:, None])
        misfit = float(np.sum((rows @ [white, smooth] / seen - 1.0) ** 2))
        if misfit < best[0]:
            best = (misfit, np.sqrt(white), np.sqrt(smooth), length)
    return float(best[1]), float(best[2]), float(best[3] * 1e-3)


@compiled
def two_variances(rows: Array) -> tuple[float, float]:
    """Non-negative (p, q) with rows (p, q)' nearest to ones."""
    aa = ab = bb = a = b = 0.0
    for i in range(rows.shape[0]):
        p, q = rows[i, 0], rows[i, 1]
        aa += p * p
        ab += p * q
        bb += q * q
        a += p
        b += q
    det = aa * bb - ab * ab
    if det > 1e-12 * aa * bb:
        p, q = (bb * a - ab * b) / det, (aa * b - ab * a) / det
        if p >= 0.0 and q >= 0.0:
            return p, q
    p, q = a / aa, (b / bb if bb > 0.0 else 0.0)
    alone_p = aa * p * p - 2.0 * a * p
    alone_q = bb * q * q - 2.0 * b * q
    return (p, 0.0) if alone_p <= alone_q else (0.0, q)
