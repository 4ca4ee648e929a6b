"""Fitted quadratics in an image plane as patches of surface with the covariance of everything."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimator.local_surface import ERRORS, LocalSurface
from estimator.readers.depth_fit import dome_terms
from estimator.readers.depth_noise import DepthNoise
from estimator.readers.depth_reading import FLAGS, NO_CONTACT, SMALL, UMBILIC
from estimator.vectors import Array, Index, Mask, cross, frozen

_UNKNOWN = (2e-3, 0.2, 100.0)  # sd of place [m], normal [rad], curvature [1/m] where no fit exists
_METRES = np.array([1e-3, 1.0, 1.0, 1e3, 1e3, 1e3])  # terms in mm to SI


@dataclass(frozen=True, eq=False)
class DepthReadings:
    """What B images say; frame S of the pad, SI.

    Args:
        touched: Whether there is a contact at all, (B,) of bool. Elsewhere all else means nothing.
        positions: Points on the object, (B, 3).
        frames: Rows x, y, n, (B, 3, 3); see `LocalSurface`.
        tensors: Curvature along x and y, (B, 2, 2).
        covariances: (B, 8, 8), errors as in `LocalSurface`.
        residuals: rms misfit over what the noise leaves, (B,).
        noises: White rms, correlated rms, its length [m] that the covariance is made of, (B, 3).
        flags: For each image its short phrases.
    """

    touched: Mask
    positions: Array
    frames: Array
    tensors: Array
    covariances: Array
    residuals: Array
    noises: Array
    flags: tuple[tuple[str, ...], ...]

    def __len__(self) -> int:
        return len(self.positions)

    def surface(self, i: int = 0) -> LocalSurface:
        """Reading i by itself.

        Raises:
            ValueError: Nothing was touched.
        """
        if not self.touched[i]:
            raise ValueError(f"depth image {i}: no contact; ask `touched` first")
        return LocalSurface(
            self.positions[i],
            self.frames[i],
            self.tensors[i],
            self.covariances[i],
            residual=float(self.residuals[i]),
            flags=self.flags[i],
        )


def surfaces_of(
    centres: Array,
    terms: Array,
    covariances: Array,
    residuals: Array,
    noises: Array,
    bits: Index,
    pad_radius: float,
    noise: DepthNoise,
) -> DepthReadings:
    """Fitted terms z = c + g.x + x'Hx/2 [mm] as positions, frames, tensors with covariance [SI]."""
    gain = (terms - _pad_terms(centres, pad_radius * 1e3)) * _METRES  # scales all that stands out
    theta = terms * _METRES
    cov = covariances * np.outer(_METRES, _METRES)
    cov += noise.gain**2 * gain[:, :, None] * gain[:, None, :]
    p = np.column_stack([centres * 1e-3, theta[:, 0]])
    frames, along = _frames(theta[:, 1:3])
    K, J = _tensors(theta, frames, along)
    cov8 = J @ cov @ J.transpose(0, 2, 1)
    unfitted = (bits & (NO_CONTACT | SMALL)) > 0
    p_sd, n_sd, k_sd = _UNKNOWN
    cov8[unfitted] = np.diag(np.square([p_sd, p_sd, p_sd, n_sd, n_sd, k_sd, k_sd, k_sd]))
    D = np.hypot(0.5 * (K[:, 0, 0] - K[:, 1, 1]), K[:, 0, 1])
    spread = np.sqrt(np.maximum(cov8[:, 7, 7], 0.25 * (cov8[:, 5, 5] + cov8[:, 6, 6])))
    bits = np.where((2.0 * spread > D) & ~unfitted, bits | UMBILIC, bits)
    touched = (bits & NO_CONTACT) == 0
    touched.setflags(write=False)
    return DepthReadings(
        touched,
        positions=frozen(p),
        frames=frozen(frames),
        tensors=frozen(K),
        covariances=frozen(cov8),
        residuals=frozen(residuals),
        noises=frozen(noises * 1e-3),
        flags=tuple(map(_phrases, bits.tolist())),
    )


def _frames(g: Array) -> tuple[Array, Array]:
    """Frames with rows x, y, n (B, 3, 3) at slopes g (B, 2), and the image plane's (x, y) of each
    of the two tangents, (B, 2, 2).

    The object lies above z(x), so its outward normal is (g, -1); x is the image's x, projected.
    """
    n = np.column_stack([g, -np.ones(len(g))])
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    x = np.column_stack([np.ones(len(g)), np.zeros(len(g)), g[:, 0]])
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    frames = np.stack([x, cross(n, x), n], axis=1)
    return frames, frames[:, :2, :2]


def _tensors(theta: Array, frames: Array, along: Array) -> tuple[Array, Array]:
    """Curvature tensors b_i'H b_j / w (second over first fundamental form), (B, 2, 2), and the
    derivatives (B, 8, 6) of the errors over the terms (c, g, H). H is held while g varies."""
    w = np.sqrt(1.0 + np.sum(theta[:, 1:3] ** 2, axis=1))
    H = theta[:, [[3, 4], [4, 5]]]
    K = along @ H @ along.transpose(0, 2, 1) / w[:, None, None]
    J = np.zeros((len(theta), ERRORS, 6))
    J[:, :3, 0] = frames[:, :, 2]
    J[:, 3:5, 1:3] = along / w[:, None, None]
    for row, (i, j) in enumerate([(0, 0), (1, 1), (0, 1)], start=5):
        p, q = along[:, i] / w[:, None], along[:, j]
        J[:, row, 3] = p[:, 0] * q[:, 0]
        J[:, row, 4] = p[:, 0] * q[:, 1] + p[:, 1] * q[:, 0]
        J[:, row, 5] = p[:, 1] * q[:, 1]
    return K, J


def _pad_terms(centres: Array, radius: float) -> Array:
    """Of the undeformed pad at each centre [mm], (B, 6)."""
    pads = np.zeros((len(centres), 6))
    if np.isfinite(radius):
        for pad, (x, y) in zip(pads, centres, strict=True):
            dome_terms(x, y, radius, pad)
    return pads


def _phrases(word: int) -> tuple[str, ...]:
    return tuple(text for k, text in enumerate(FLAGS) if word >> k & 1)
