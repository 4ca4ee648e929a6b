"""Read a gel pad that reports normals of its surface instead of depths (photometric stereo).

The slopes are fitted directly, z_x = g_x + H_xx x + H_xy y and z_y = g_y + H_xy x + H_yy y: their
errors do not pile up as those of an integrated depth do. The integral is needed for one thing, to
find where the contact is; the domain then follows the fit as in `depth_fit`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.fft import dctn, idctn

from estimator.compiled import compiled, compiled_part
from estimator.readers.depth import images_of, require_positive
from estimator.readers.depth_cells import COUNT, MEAN, X, Y, pool
from estimator.readers.depth_covariance import smooth_moment, trace_product
from estimator.readers.depth_fit import TERMS, dome, inverse
from estimator.readers.depth_noise import DepthNoise
from estimator.readers.depth_reading import (
    BORDER,
    CELL,
    NO_CONTACT,
    POOR,
    POOR_RATIO,
    SMALL,
    fit_domain,
    leaves_image,
    locate,
    place_only,
)
from estimator.readers.depth_surfaces import DepthReadings, surfaces_of
from estimator.vectors import Array, Index, Mask

HEIGHT_SHARE = 0.25  # sd of the height over the greatest depth: slopes leave it open
_LENGTH = 1.0  # of the noise, where it is not told [mm]
_OF_X, _OF_Y = (0, 2, 3), (1, 3, 4)  # of (g_x, g_y, H_xx, H_xy, H_yy): what 1, x, y belong to


def read_normals(
    normals: ArrayLike,
    pixel_pitch: float,
    *,
    pad_radius: float = np.inf,
    noise: DepthNoise | None = None,
    least_depth: float = 0.1e-3,
) -> DepthReadings:
    """Normal maps of a gel pad to second-order surface patches, as `read_depth` does for depths.

    Slopes do not know the height: the position's error along z is a quarter of the depth that
    the integrated slopes reach over the image's lowest tenth.

    Args:
        normals: Of the gel's surface, out of the gel (z > 0), in the frame S of
            `estimator.readers.depth`; of any length, NaN where a pixel is dead, (H, W, 3) or
            (B, H, W, 3).
        pixel_pitch: Distance of neighbouring pixels on the gel [m].
        pad_radius: Of the undeformed gel's spherical dome [m]; inf is a flat pad.
        noise: Of each *slope* [-], independent in x and y. None takes each image's residual as
            smooth with l = 1 mm.
        least_depth: That counts as a contact [m].
    Raises:
        ValueError: Wrong shape, normals that point into the gel, pitch not positive.
    """
    vectors = images_of("normals", normals, 3)
    require_positive(pixel_pitch=pixel_pitch, least_depth=least_depth)
    with np.errstate(invalid="ignore", divide="ignore"):
        if np.any(vectors[..., 2] <= 0.0):
            raise ValueError("normals: expected out of the gel, z > 0; NaN where a pixel is dead")
        slopes = -vectors[..., :2] / vectors[..., 2:]
    slopes[~np.isfinite(slopes).all(axis=-1)] = np.nan
    pitch, radius = pixel_pitch * 1e3, pad_radius * 1e3
    depth = _depth_of(slopes, pitch, radius)
    B = len(depth)
    told = np.full(3, np.nan)
    if noise is not None:
        told = np.array([noise.white, noise.correlated, noise.length * 1e3])
    centres, terms, covariances = np.zeros((B, 2)), np.zeros((B, TERMS)), np.zeros((B, 6, 6))
    residuals, flags, noises = np.zeros(B), np.zeros(B, np.intp), np.tile(told, (B, 1))
    pixels = max(1, round(CELL / pitch))
    _read_slopes(
        depth, np.ascontiguousarray(slopes), pitch, pixels, radius, least_depth * 1e3,
        noises, centres, terms, covariances, residuals, flags,
    )  # fmt: skip
    return surfaces_of(
        centres, terms, covariances, residuals, noises, flags, pad_radius, noise or DepthNoise()
    )


def _depth_of(slopes: Array, pitch: float, radius: float) -> Array:
    """Integrate by least squares (Poisson, cosine transform); zero at the lowest tenth [mm]."""
    rows, columns = slopes.shape[1:3]
    y = (np.arange(rows) - 0.5 * (rows - 1))[:, None] * pitch
    x = (np.arange(columns) - 0.5 * (columns - 1)) * pitch
    s = np.sqrt(radius**2 - x**2 - y**2) if np.isfinite(radius) else np.inf
    p = np.nan_to_num(-x / s - slopes[..., 0])  # of the depth: the dome's minus the surface's
    q = np.nan_to_num(-y / s - slopes[..., 1])
    divergence = np.zeros(slopes.shape[:3])
    between = 0.5 * (p[:, :, 1:] + p[:, :, :-1]) * pitch
    divergence[:, :, :-1] += between
    divergence[:, :, 1:] -= between
    between = 0.5 * (q[:, 1:] + q[:, :-1]) * pitch
    divergence[:, :-1] += between
    divergence[:, 1:] -= between
    waves = 2.0 * np.cos(np.pi * np.arange(columns) / columns) - 2.0
    waves = waves + (2.0 * np.cos(np.pi * np.arange(rows) / rows) - 2.0)[:, None]
    waves[0, 0] = 1.0
    depth = idctn(dctn(divergence, axes=(1, 2)) / waves, axes=(1, 2))
    depth -= np.quantile(depth, 0.1, axis=(1, 2), keepdims=True)
    depth[np.isnan(slopes[..., 0])] = np.nan
    return np.asarray(depth)


@compiled_part
def _slope_beyond(x: float, y: float, t: Array) -> tuple[float, float]:
    """Gradient of `depth_fit.beyond_quadratic`."""
    hx, hy = t[3] * x + t[4] * y, t[4] * x + t[5] * y
    bend = 0.5 * (hx * hx + hy * hy)
    lift = t[1] * x + t[2] * y + 0.25 * (x * hx + y * hy)
    out_x = (t[3] * hx + t[4] * hy) * lift + bend * (t[1] + 0.5 * hx)
    return out_x, (t[4] * hx + t[5] * hy) * lift + bend * (t[2] + 0.5 * hy)


@compiled_part
def _fit_slopes(
    cx: Array, cy: Array, inside: Mask, centre: Array, terms: Array, M: Array, inv: Array
) -> tuple[bool, float]:
    """Fit g and H in `terms`; whether that worked, and the mean square misfit.

    Args:
        cx, cy: Slopes in cells, of `pool`, (4, h, w) each.
        M: Out: moments of (1, x, y), (3, 3).
        inv: Out: inverse normal matrix of the five, (5, 5).
    """
    rhs, A, row, weight, square = np.zeros(5), np.zeros((5, 5)), np.empty(3), 0.0, 0.0
    M[:] = 0.0
    for again in range(2):
        for i in range(inside.shape[0]):
            for j in range(inside.shape[1]):
                if not inside[i, j]:
                    continue
                x, y = cx[X, i, j] - centre[0], cx[Y, i, j] - centre[1]
                w, (bx, by) = cx[COUNT, i, j], _slope_beyond(x, y, terms)
                zx, zy = cx[MEAN, i, j] - bx, cy[MEAN, i, j] - by
                row[0], row[1], row[2] = 1.0, x, y
                if again:
                    zx -= terms[1] + terms[3] * x + terms[4] * y
                    zy -= terms[2] + terms[4] * x + terms[5] * y
                    square += 0.5 * w * (zx * zx + zy * zy)
                    weight += w
                    continue
                for k in range(3):
                    rhs[_OF_X[k]] += w * row[k] * zx
                    rhs[_OF_Y[k]] += w * row[k] * zy
                    for m in range(3):
                        M[k, m] += w * row[k] * row[m]
        if not again:
            _assemble(M, A)
            if not inverse(A, inv):
                return False, 0.0
            for k in range(5):
                terms[k + 1] = 0.0
                for m in range(5):
                    terms[k + 1] += inv[k, m] * rhs[m]
    return True, square / weight


@compiled_part
def _assemble(M: Array, out: Array) -> None:
    """Moments of the five from those of (1, x, y), which both slopes share."""
    out[:] = 0.0
    for k in range(3):
        for m in range(3):
            out[_OF_X[k], _OF_X[m]] += M[k, m]
            out[_OF_Y[k], _OF_Y[m]] += M[k, m]


@compiled
def _read_slopes(
    depth: Array,
    slopes: Array,
    pitch: float,
    pixels: int,
    radius: float,
    least: float,
    noise: Array,
    centres: Array,
    terms: Array,
    covariances: Array,
    residual: Array,
    flags: Index,
) -> None:
    """As `depth_reading.read_images`, from slopes (B, H, W, 2) and their integral (B, H, W)."""
    h, w = (depth.shape[1] + pixels - 1) // pixels, (depth.shape[2] + pixels - 1) // pixels
    cells, cx, cy = np.empty((4, h, w)), np.empty((4, h, w)), np.empty((4, h, w))
    inside, hertz, inv6 = np.zeros((h, w), np.bool_), np.empty(7), np.empty((TERMS, TERMS))
    M, B, five, inv = np.empty((3, 3)), np.zeros((TERMS, TERMS)), np.empty((5, 5)), np.empty((5, 5))
    side, longest = pitch * pixels, 0.5 * pitch * np.hypot(depth.shape[1], depth.shape[2])
    for b in range(depth.shape[0]):
        deepest, same = pool(depth[b], pitch, pixels, cells)
        flags[b] = locate(cells, deepest, same, pixels, least, inside)
        if flags[b] & NO_CONTACT:
            continue
        flags[b] |= fit_domain(cells, radius, longest, inside, centres[b], terms[b], inv6, hertz)
        if not flags[b] & SMALL:
            pool(slopes[b, :, :, 0], pitch, pixels, cx)
            pool(slopes[b, :, :, 1], pitch, pixels, cy)
            good, square = _fit_slopes(cx, cy, inside, centres[b], terms[b], M, inv)
            flags[b] |= 0 if good else SMALL
        if flags[b] & SMALL:
            place_only(cells, radius, centres[b], terms[b])
            continue
        if leaves_image(hertz, 0.5 * pitch * depth.shape[2], 0.5 * pitch * depth.shape[1]):
            flags[b] |= BORDER
        if np.isnan(noise[b, 0]):
            noise[b, 0], noise[b, 1], noise[b, 2] = 0.0, square**0.5, _LENGTH
        B[:] = 0.0
        if noise[b, 1] > 0.0:
            smooth_moment(cells, inside, centres[b], side, pixels, noise[b, 2], B)
        _assemble(B[:3, :3], five)
        share = 0.5 * trace_product(inv, five) / M[0, 0]
        left = noise[b, 0] ** 2 / (pixels * pixels) + noise[b, 1] ** 2 * max(1.0 - share, 1e-2)
        residual[b] = (square / max(left, 1e-30)) ** 0.5
        scale = 1.0
        if residual[b] > POOR_RATIO:
            flags[b] |= POOR
            scale = residual[b] ** 2
        covariances[b] = 0.0
        covariances[b, 1:, 1:] = scale * (
            noise[b, 0] ** 2 * inv + noise[b, 1] ** 2 * (inv @ five @ inv)
        )
        depth_here = dome(centres[b, 0], centres[b, 1], radius) - terms[b, 0]
        covariances[b, 0, 0] = (HEIGHT_SHARE * depth_here) ** 2
