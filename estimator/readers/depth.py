"""Read a gel pad: a depth image to the touched patch of surface, with covariance.

Frame S of the pad: origin in the middle of the image on the undeformed gel, x along a row of
pixels, y down a column, z out of the pad towards the object. Depth is positive into the gel and
measured along z, so the object's surface is at z = -depth (below the dome of a domed pad). A pose
X_WS in these axes turns the answer into a `Contact`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from estimator.readers.depth_fit import TERMS
from estimator.readers.depth_noise import DepthNoise
from estimator.readers.depth_reading import CELL, read_images
from estimator.readers.depth_surfaces import DepthReadings, surfaces_of
from estimator.vectors import Array, Index


def read_depth(
    depth: ArrayLike,
    pixel_pitch: float,
    *,
    pad_radius: float = np.inf,
    noise: DepthNoise | None = None,
    least_depth: float = 0.1e-3,
) -> DepthReadings:
    """Depth images of a gel pad to second-order surface patches.

    A quadratic is fitted over the inner part of the contact, which follows from the fit itself
    (`estimator.readers.depth_fit`); the patch is given at the middle of that domain. Pixels that
    are not finite are left out.

    Degenerate: a contact reaching the border says little along itself, an umbilic nothing of
    directions; flags say so and the covariance has it. With two contacts the deeper one is read.

    Args:
        depth: Into the gel [m], (H, W) or (B, H, W).
        pixel_pitch: Distance of neighbouring pixels on the gel [m].
        pad_radius: Of the undeformed gel's spherical dome [m]; inf is a flat pad.
        noise: Of the sensor; see `noise_of_frames`. None estimates white and correlated noise
            from each image's own residuals, which cannot see what is wider than the contact.
        least_depth: That counts as a contact [m]; at least four sd of the noise are asked for.
    Raises:
        ValueError: Wrong shape, smaller than 8 x 8, infinite depths, pitch, radius or depth not
            positive.
    """
    images = images_of("depth", depth, 2)
    if np.any(np.isinf(images)):
        raise ValueError("depth: expected metres, NaN for dead pixels, found an infinite one")
    require_positive(pixel_pitch=pixel_pitch, least_depth=least_depth)
    half_diagonal = 0.5 * pixel_pitch * float(np.hypot(*images.shape[1:]))
    if not pad_radius > half_diagonal:
        raise ValueError(
            f"pad_radius: expected more than half the image's diagonal, {half_diagonal:g} m, "
            f"or inf for a flat pad; got {pad_radius}"
        )
    fit = _fit(images * 1e3, pixel_pitch * 1e3, pad_radius * 1e3, noise, least_depth * 1e3)
    return surfaces_of(*fit, pad_radius, noise or DepthNoise())


def images_of(name: str, values: ArrayLike, ndim: int) -> Array:
    """As a batch of floats, (B, H, W, ...)."""
    try:
        images = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{name}: expected an array of numbers") from None
    shape = "(H, W) or (B, H, W)" if ndim == 2 else "(H, W, 3) or (B, H, W, 3)"
    if images.ndim not in (ndim, ndim + 1) or (ndim == 3 and images.shape[-1] != 3):
        raise ValueError(f"{name}: expected shape {shape}, got {images.shape}")
    images = images.reshape(-1, *images.shape[-ndim:]) if images.ndim == ndim else images
    if len(images) == 0 or min(images.shape[1:3]) < 8:
        raise ValueError(f"{name}: expected {shape} with H, W >= 8, got {images.shape}")
    return images


def require_positive(**values: float) -> None:
    for name, value in values.items():
        if not (np.isfinite(value) and value > 0.0):
            raise ValueError(f"{name}: expected a finite number > 0 [m], got {value!r}")


def _fit(
    images: Array, pitch: float, radius: float, noise: DepthNoise | None, least: float
) -> tuple[Array, Array, Array, Array, Array, Index]:
    """Centres, terms, covariances, residuals, noises, flags; millimetres."""
    B = len(images)
    told = np.full(3, np.nan)
    if noise is not None:
        told = 1e3 * np.array([noise.white, noise.correlated, noise.length])
        least = max(least, 4.0 * float(np.hypot(*told[:2])))
    centres, terms, covariances = np.zeros((B, 2)), np.zeros((B, TERMS)), np.zeros((B, 6, 6))
    residuals, flags, noises = np.zeros(B), np.zeros(B, np.intp), np.tile(told, (B, 1))
    pixels = max(1, round(CELL / pitch))
    read_images(
        np.ascontiguousarray(images), pitch, pixels, radius, least,
        noises, centres, terms, covariances, residuals, flags,
    )  # fmt: skip
    return centres, terms, covariances, residuals, noises, flags
