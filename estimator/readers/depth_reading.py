"""One depth image to one quadratic: the steps in their order, compiled, and over a batch."""

from __future__ import annotations

import numpy as np

from estimator.compiled import compiled, compiled_part
from estimator.readers.depth_cells import COUNT, MEAN, X, Y, deepest_cell, flood, other_blob, pool
from estimator.readers.depth_covariance import (
    expected_square,
    noise_of_residuals,
    residuals,
    smooth_moment,
)
from estimator.readers.depth_fit import (
    FEWEST_CELLS,
    ROUNDS,
    TERMS,
    domain,
    dome_terms,
    ellipse_of,
    fit_once,
    gather,
)
from estimator.vectors import Array, Index, Mask

FLAGS = (
    "no contact",
    "two contacts",
    "contact reaches the border of the image",
    "depth saturated",
    "poor fit",
    "contact too small to fit",
    "hollow against the pad: not a Hertz contact",
    "directions undetermined (umbilic)",
)
NO_CONTACT, TWO, BORDER, SATURATED, POOR, SMALL, HOLLOW, UMBILIC = (1 << k for k in range(8))
CELL = 0.4  # about the side of a cell [mm]
_START, _BLOB = 0.6, 0.5  # of the deepest cell
_PLATEAU = 0.1  # of a contact's pixels equal to the deepest one: clipped
POOR_RATIO = 1.6  # residual over noise
_DOUBT = 9.0  # on variances, where a flag says that the fit may not be the object


@compiled_part
def _is_clipped(same: int, blob: int, pixels: int) -> bool:
    return same > 8 and same > _PLATEAU * blob * pixels * pixels


@compiled_part
def leaves_image(hertz: Array, half_width: float, half_height: float) -> bool:
    """Whether the contact ellipse, a tenth larger, reaches beyond the image."""
    x, y, c, s, a, b = hertz[0], hertz[1], hertz[2], hertz[3], hertz[4], hertz[5]
    wide, high = 1.1 * np.hypot(a * c, b * s), 1.1 * np.hypot(a * s, b * c)
    return bool(abs(x) + wide > half_width or abs(y) + high > half_height)


@compiled_part
def locate(cells: Array, deepest: float, same: int, pixels: int, least: float, inside: Mask) -> int:
    """Flags of where the contact is; `inside` becomes the cells that surely belong to it."""
    i, j, peak = deepest_cell(cells)
    inside[:] = False
    if not peak > least:
        return NO_CONTACT
    labels = np.zeros(inside.shape)
    blob = flood(cells, i, j, _BLOB * peak, 1, labels)
    flags = 0
    if other_blob(cells, _BLOB * peak, labels) >= max(4, blob // 20):
        flags |= TWO
    ceiling = np.inf
    if _is_clipped(same, blob, pixels):
        flags |= SATURATED
        ceiling = deepest - 1e-9 * abs(deepest)
    for k in range(inside.shape[0]):
        for m in range(inside.shape[1]):
            deep = cells[MEAN, k, m] > _START * peak
            if cells[MEAN, k, m] >= ceiling:
                cells[COUNT, k, m] = 0.0  # clipped: says nothing more
            inside[k, m] = labels[k, m] == 1 and deep and cells[COUNT, k, m] > 0.0
    return flags


@compiled_part
def fit_domain(
    cells: Array,
    radius: float,
    longest: float,
    inside: Mask,
    centre: Array,
    terms: Array,
    inv: Array,
    hertz: Array,
) -> int:
    """Fit and domain in turn until the domain stays; flags."""
    points = np.empty((4, inside.size))
    terms[:] = 0.0
    n = gather(cells, inside, radius, points, centre)
    for _ in range(ROUNDS):
        if n < FEWEST_CELLS or not fit_once(points, n, centre, terms, inv):
            return SMALL
        if not ellipse_of(terms, radius, centre, longest, hertz):
            return HOLLOW
        x, y, before = centre[0], centre[1], n
        n = domain(cells, hertz, radius, inside, points, centre)
        if abs(n - before) <= 1 and abs(x - centre[0]) + abs(y - centre[1]) < 0.02:
            break
    if n < FEWEST_CELLS or not fit_once(points, n, centre, terms, inv):
        return SMALL
    return 0


@compiled_part
def place_only(cells: Array, radius: float, centre: Array, terms: Array) -> None:
    """Of a contact too small to fit: its deepest cell, the pad's own slope, no curvature."""
    i, j, peak = deepest_cell(cells)
    centre[0], centre[1] = cells[X, i, j], cells[Y, i, j]
    if peak == -np.inf:  # every cell is clipped: somewhere
        centre[:], peak = 0.0, 0.0
    dome_terms(centre[0], centre[1], radius, terms)
    terms[0] -= peak
    terms[3:] = 0.0


@compiled
def covariance_into(
    cells: Array, inside: Mask, centre: Array, inv: Array, side: float, pixels: int,
    noise: Array, B: Array, out: Array,
) -> None:  # fmt: skip
    """s_w^2 A^-1 + s_c^2 A^-1 B A^-1; leaves B = X'RX."""
    B[:] = 0.0
    if noise[1] > 0.0:
        smooth_moment(cells, inside, centre, side, pixels, noise[2], B)
    half = np.zeros((TERMS, TERMS))
    for i in range(TERMS):
        for j in range(TERMS):
            for k in range(TERMS):
                half[i, j] += inv[i, k] * B[k, j]
    for i in range(TERMS):
        for j in range(TERMS):
            s = 0.0
            for k in range(TERMS):
                s += half[i, k] * inv[k, j]
            out[i, j] = noise[0] ** 2 * inv[i, j] + noise[1] ** 2 * s


@compiled_part
def domain_spread(terms: Array, covariance: Array, radius: float, centre: Array) -> float:
    """What a domain that follows the noise adds to variances: 1 + 6 (sd(kappa_b) / kappa_b)^2.

    A curvature that comes out too large narrows its own domain, which lets the noise in further;
    the second-order term's size is measured (radii 10-60 mm, 1-5 N, l = 0-2 mm).
    """
    pad = np.empty(TERMS)
    dome_terms(centre[0], centre[1], radius, pad)
    xx, xy, yy = terms[3] - pad[3], terms[4] - pad[4], terms[5] - pad[5]
    half = 0.5 * (xx - yy)
    angle = 0.5 * np.arctan2(xy, half)  # of the sharper direction
    c, s = np.cos(angle), np.sin(angle)
    sharp = np.array((c * c, 2.0 * c * s, s * s))
    variance = 0.0
    for i in range(3):
        for j in range(3):
            variance += sharp[i] * covariance[3 + i, 3 + j] * sharp[j]
    kappa = sharp[0] * xx + sharp[1] * xy + sharp[2] * yy
    return float(1.0 + 6.0 * min(variance / max(kappa * kappa, 1e-12), 0.25))


@compiled
def read_images(
    images: Array,
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
    """`images` (B, H, W) in mm to the fitted terms; everything but the images in mm too.

    Args:
        pixels: Along a cell's side.
        least: Depth that is a contact.
        noise: (B, 3) white, correlated, length; NaN rows are estimated and written.
        centres, terms, covariances: Out; of `fit_once`, (B, 2), (B, 6), (B, 6, 6).
        residual: Out; rms misfit over the noise's, (B,).
        flags: Out; bits of `FLAGS`, (B,).
    """
    h, w = (images.shape[1] + pixels - 1) // pixels, (images.shape[2] + pixels - 1) // pixels
    cells, inside, misfit = np.empty((4, h, w)), np.zeros((h, w), np.bool_), np.empty((h, w))
    inv, B, hertz, side = np.empty((TERMS, TERMS)), np.empty((TERMS, TERMS)), np.empty(7), 0.0
    side = pitch * pixels
    longest = 0.5 * pitch * np.hypot(images.shape[1], images.shape[2])
    for b in range(images.shape[0]):
        deepest, same = pool(images[b], pitch, pixels, cells)
        flags[b] = locate(cells, deepest, same, pixels, least, inside)
        if flags[b] & NO_CONTACT:
            continue
        flags[b] |= fit_domain(cells, radius, longest, inside, centres[b], terms[b], inv, hertz)
        if flags[b] & SMALL:
            place_only(cells, radius, centres[b], terms[b])
            continue
        if leaves_image(hertz, 0.5 * pitch * images.shape[2], 0.5 * pitch * images.shape[1]):
            flags[b] |= BORDER
        square = residuals(cells, inside, radius, centres[b], terms[b], misfit)
        if np.isnan(noise[b, 0]):
            noise_of_residuals(cells, inside, centres[b], inv, side, pixels, misfit, noise[b])
        covariance_into(cells, inside, centres[b], inv, side, pixels, noise[b], B, covariances[b])
        covariances[b] *= domain_spread(terms[b], covariances[b], radius, centres[b])
        expected = expected_square(cells, inside, inv, B, side, pixels, noise[b])
        residual[b] = (square / max(expected, 1e-30)) ** 0.5
        if residual[b] > POOR_RATIO:
            flags[b] |= POOR
            covariances[b] *= residual[b] ** 2
        if flags[b] & (TWO | SATURATED | HOLLOW):
            covariances[b] *= _DOUBT
