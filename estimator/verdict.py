"""From peaks to a verdict, for many sets at once.

High label probability alone never makes `determined`: every hypothesis with more than one per
cent must be fixed by the touches in all four degrees of freedom, no labelling may leave all
meridian planes coincident (the paper's third case, 3.8), whatever prior or magnitudes say, and the
contacts must fit a surface of revolution at all. A normal gives one plane through the axis, a
direction that is known gives another; the axis has four unknowns, and four planes always fit.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc

from estimator.modes import Modes
from estimator.readings import (
    EDGE,
    K0,
    K1,
    KAPPA,
    NORMAL,
    POSITION,
    SD_DIRECTION,
    SD_K_TZ,
    SD_NORMAL,
    SD_POSITION,
    VOID,
    Readings,
)
from estimator.vectors import Array, Index, Mask

FREE = 0.2  # sd [rad], or [-] of the object's size, above which a motion of the axis is free
FEIGNED = 1.5  # information that the noise of one contact feigns [1/rad^2]
SURE = 0.99  # probability one hypothesis needs
MENTIONED = 0.01  # probability from which a hypothesis matters
MISFIT = 1e-4  # p-value of the fit below which nothing is believed of the axis
FITS = 0.01  # p-value from which planes count as coincident
REDUNDANT = 5  # planes that contacts must give: one more than the axis has unknowns
MOST_GROSS = 1.0 / 3.0  # share of the contacts beyond which they are not exceptions
DETERMINED, AMBIGUOUS, UNDETERMINED = range(3)


class Findings(NamedTuple):
    """What speaks against an axis, for S sets.

    Args:
        verdict: Index into VERDICTS, (S,).
        best: Leading peak of the likeliest hypothesis, (S,).
        probability: Of every hypothesis at its leading peak, zero elsewhere, (S, M).
        p_value: Of the fit at the best peak, (S,).
        few, blunt, misfit, coincident, sphere, free: What was found, (S,).
    """

    verdict: Index
    best: Index
    probability: Array
    p_value: Array
    few: Mask
    blunt: Mask
    misfit: Mask
    coincident: Mask
    sphere: Mask
    free: Mask


def judge(readings: Readings, modes: Modes, size: Array) -> Findings:
    """Verdicts with what they rest on; `size` is a length of each object [m], (S,)."""
    S, M = modes.cost.shape
    n = readings.shape[1]
    rows = np.arange(S)
    probability = np.zeros((S, M))
    for k in range(M):
        probability[rows, modes.leader[:, k]] += modes.probability[:, k]
    best = np.argmax(probability, axis=1)
    p_value = fit_p_value(modes.chi_square[rows, best], modes.freedom[rows, best])
    gross = np.mean(1.0 - modes.right[rows, best], axis=1) if n else np.zeros(S)
    misfit = (p_value < MISFIT) | (gross > MOST_GROSS)
    few = np.full(S, n < 2)
    blunt = n + np.sum(readings[..., VOID] == 0.0, axis=1) < REDUNDANT
    coincident = planes_coincide(readings) if n > 1 else np.zeros(S, dtype=bool)
    sphere = normals_meet(readings) if n > 1 else np.zeros(S, dtype=bool)
    free = np.any((modes.probability > MENTIONED) & (_freest(modes, size, n) > FREE), axis=1)
    undetermined = few | blunt | misfit | coincident | sphere | free
    ambiguous = probability[rows, best] < SURE
    verdict = np.where(undetermined, UNDETERMINED, np.where(ambiguous, AMBIGUOUS, DETERMINED))
    return Findings(
        verdict, best, probability, p_value, few, blunt, misfit, coincident, sphere, free
    )


def fit_p_value(chi_square: Array, freedom: Array) -> Array:
    """How often contacts of a true surface of revolution would fit worse."""
    tail = chdtrc(np.maximum(freedom, 0.5), chi_square)
    return np.asarray(np.where(freedom > 0.5, tail, 1.0))


def scaled_information(contacts: Array, size: Array, n: int) -> Array:
    """Information of the contacts alone, lengths in sizes, less what their noise feigns.

    The noise of a contact turns its own derivative as well and so feigns an information of about
    one per square radian: eight normals that should meet in a sphere's centre miss it, each by its
    noise, and seem to know a direction. That much is taken off.
    """
    units = np.ones((*size.shape, 4))
    units[..., :2] = size[..., None]
    return contacts * units[..., :, None] * units[..., None, :] - FEIGNED * n * np.eye(4)


def _freest(modes: Modes, size: Array, n: int) -> Array:
    """Sd of the freest motion of every peak, (S, M)."""
    used = int(modes.peaks.max(initial=1))
    scaled = scaled_information(modes.contacts[:, :used], size[:, None], n)
    least = np.linalg.eigvalsh(scaled)[..., 0]
    out = np.zeros(modes.cost.shape)
    out[:, :used] = 1.0 / np.sqrt(np.maximum(least, 1e-12))
    return out


def planes_coincide(readings: Readings) -> Mask:
    """Whether some labelling makes all meridian planes one plane, within the noise, (S,)."""
    void = np.any(readings[..., VOID] > 0.0, axis=1)
    return np.asarray(~void & (_coincide(readings, K0) | _coincide(readings, K1)))


def _coincide(readings: Readings, reference: int) -> Mask:
    """... when the first contact's row `reference` is the parallel's."""
    n = readings.shape[1]
    N = np.stack([readings[..., K0:K1], readings[..., K1:KAPPA]], axis=2)  # planes' normals
    first = readings[:, 0, reference : reference + 3]
    row = np.argmax(np.abs(np.einsum("snlx,sx->snl", N, first)), axis=2)
    chosen = np.take_along_axis(N, row[..., None, None], axis=2)[:, :, 0]
    mean = np.linalg.eigh(np.einsum("snx,sny->sxy", chosen, chosen))[1][..., -1]
    sine = 1.0 - np.einsum("snx,sx->sn", chosen, mean) ** 2
    D = 0.5 * np.abs(readings[..., KAPPA] - readings[..., KAPPA + 1])
    var_turn = (readings[..., SD_K_TZ] / np.maximum(2.0 * D, 1e-9)) ** 2
    var_turn = var_turn + readings[..., SD_DIRECTION] ** 2 + readings[..., SD_NORMAL] ** 2
    p = readings[..., POSITION:NORMAL]
    centred = p - p.mean(axis=1, keepdims=True)
    reach = np.sum(centred**2, axis=2)
    var_gap = readings[..., SD_POSITION] ** 2 + reach * var_turn / n
    gap = np.einsum("snx,sx->sn", centred, mean)
    statistic = np.sum(np.maximum(sine, 0.0) / var_turn + gap**2 / var_gap, axis=1)
    return np.asarray(chdtrc(3.0 * n - 3.0, statistic) > FITS)


def meeting_point(readings: Readings) -> tuple[Array, Array]:
    """The point all normals pass nearest, and the least eigenvalue of its system, (S, 3), (S,)."""
    p, n = readings[..., POSITION:NORMAL], readings[..., NORMAL:K0]
    across = np.eye(3) - n[..., :, None] * n[..., None, :]
    total = across.sum(axis=1)
    least = np.linalg.eigvalsh(total)[:, 0]
    pull = np.where(least < 1e-9, 1e-9, 0.0)[:, None, None] * np.eye(3)
    centre = np.linalg.solve(total + pull, np.einsum("snij,snj->si", across, p)[..., None])
    return centre[..., 0], least


def normals_meet(readings: Readings) -> Mask:
    """Whether all contacts are umbilic and all normals pass one point, as on a sphere, (S,)."""
    void = np.all(readings[..., VOID] > 0.0, axis=1) & np.all(readings[..., EDGE] < np.inf, axis=1)
    if not np.any(void):
        return np.asarray(void)
    p, n = readings[..., POSITION:NORMAL], readings[..., NORMAL:K0]
    centre, least = meeting_point(readings)
    gap = centre[:, None] - p
    miss = gap - np.sum(gap * n, axis=2, keepdims=True) * n
    variance = readings[..., SD_POSITION] ** 2
    variance = variance + readings[..., SD_NORMAL] ** 2 * np.sum(gap**2, axis=2)
    statistic = np.sum(np.sum(miss**2, axis=2) / variance, axis=1)
    parallel = least < 1e-3 * readings.shape[1]  # a flat end, which has words of its own
    freedom = 2.0 * readings.shape[1] - 3.0
    return np.asarray(void & ~parallel & (chdtrc(freedom, statistic) > FITS))
