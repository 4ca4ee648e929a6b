"""From peaks to a verdict, for many sets at once.

High label probability alone never makes `determined`: every hypothesis with more than one per
cent must be fixed by the touches in all four degrees of freedom, no labelling may leave all
meridian planes coincident (the paper's third case, 3.8), whatever prior or magnitudes say, and the
contacts must fit a surface of revolution at all. A normal gives one plane through the axis, a
direction that is known gives another; the axis has four unknowns, and four planes always fit.
"""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc

from estimator.compiled import V3, along, compiled, compiled_part, dot, scaled, vector
from estimator.modes import Modes
from estimator.readings import (
    EDGE,
    K0,
    K1,
    KAPPA,
    NORMAL,
    POSITION,
    SD_COMMON,
    SD_DIRECTION,
    SD_K_TZ,
    SD_NORMAL,
    SD_POSITION,
    VOID,
    Readings,
)
from estimator.vectors import Array, Index, Mask, frozen

FREE = 0.2  # sd [rad], or [-] of the object's size, above which a motion of the axis is free
FEIGNED = 1.5  # information that the noise of one contact feigns [1/rad^2]
SURE = 0.99  # probability one hypothesis needs
MENTIONED = 0.01  # probability from which a hypothesis matters
MISFIT = 1e-4  # p-value of the fit below which nothing is believed of the axis
FITS = 1e-4  # p-value from which planes count as coincident, normals as parallel or concurrent
PIERCED = 10.0  # position errors from a contact within which an axis may not pass,
PIERCED_MOST = 3e-3  # ... but no farther: of a contact hardly placed that would be anywhere [m]
LIKELY_TURNS = frozen(0.4 * np.arange(-6, 7))  # of a sensor's directions, in its own sd
REDUNDANT = 5  # planes that contacts must give: one more than the axis has unknowns
MOST_GROSS = 1.0 / 3.0  # share of the contacts beyond which they are not exceptions
DETERMINED, AMBIGUOUS, UNDETERMINED = range(3)


class Findings(NamedTuple):
    """What speaks against an axis, for S sets.

    Args:
        verdict: Index into VERDICTS, (S,).
        best: Leading peak of the likeliest hypothesis, (S,).
        probability: Of every hypothesis at its leading peak, zero elsewhere, (S, M).
        p_value: Of the fit of all contacts at the best peak, gross errors or not, (S,).
        few, blunt, misfit, flat, coincident, sphere, pierced, free: What was found, (S,).
    """

    verdict: Index
    best: Index
    probability: Array
    p_value: Array
    few: Mask
    blunt: Mask
    misfit: Mask
    flat: Mask
    coincident: Mask
    sphere: Mask
    pierced: Mask
    free: Mask


def judge(readings: Readings, modes: Modes, size: Array) -> Findings:
    """Verdicts with what they rest on; `size` is a length of each object [m], (S,)."""
    S, n = readings.shape[:2]
    rows = np.arange(S)
    probability = _hypotheses(modes)
    best = np.argmax(probability, axis=1)
    tally = modes.tally[rows, best]
    gross = np.sum(modes.right[rows, best] < 0.5, axis=1)
    none = np.zeros(S, dtype=bool)
    reasons = (
        np.full(S, n < 2),
        n + np.sum(readings[..., VOID] == 0.0, axis=1) < REDUNDANT,
        (fit_p_value(tally[:, 0], tally[:, 1]) < MISFIT) | (gross > MOST_GROSS * n),
        normals_parallel(readings) if n > 1 else none,
        planes_coincide(readings) if n > 1 else none,
        normals_meet(readings) if n > 1 else none,
        np.any(pierced(readings, modes.x[rows, best]), axis=1),
        np.any((modes.probability > MENTIONED) & (_freest(modes, size, n) > FREE), axis=1),
    )
    ambiguous = probability[rows, best] < SURE
    verdict = np.where(ambiguous, AMBIGUOUS, DETERMINED)
    verdict = np.where(np.any(reasons, axis=0), UNDETERMINED, verdict)
    return Findings(verdict, best, probability, fit_p_value(tally[:, 2], tally[:, 3]), *reasons)


def _hypotheses(modes: Modes) -> Array:
    """Probability of each hypothesis, at the place of its leading peak, (S, M)."""
    rows = np.arange(len(modes.leader))
    probability = np.zeros(modes.probability.shape)
    for k in range(int(modes.peaks.max(initial=0))):
        probability[rows, modes.leader[:, k]] += modes.probability[:, k]
    return probability


def fit_p_value(chi_square: Array, freedom: Array) -> Array:
    """How often contacts of a true surface of revolution would fit worse."""
    tail = chdtrc(np.maximum(freedom, 0.5), chi_square)
    return np.asarray(np.where(freedom > 0.5, tail, 1.0))


def pierced(readings: Readings, x: Array) -> Mask:
    """Contacts that an axis passes so near that their parallel has no direction, (S, n)."""
    gap = readings[..., POSITION:NORMAL] - x[:, None, :3]
    u = x[:, None, 3:6]
    gap = gap - np.sum(gap * u, axis=-1, keepdims=True) * u
    near = np.minimum(PIERCED * readings[..., SD_POSITION], PIERCED_MOST)
    return np.asarray(np.linalg.norm(gap, axis=-1) < near)


def scaled_information(contacts: Array, size: Array, n: int) -> Array:
    """Information of the contacts alone, lengths in sizes, less what their noise feigns.

    The noise of a contact turns its own derivative as well and so feigns an information of about
    one per square radian: eight normals that should meet in a sphere's centre miss it, each by its
    noise, and seem to know a direction. That much is taken off.
    """
    units = np.ones((*size.shape, 4))
    units[..., :2] = size[..., None]
    scaled = contacts * units[..., :, None] * units[..., None, :]
    whole = np.all(np.isfinite(scaled), axis=(-2, -1), keepdims=True)
    return np.asarray(np.where(whole, scaled, 0.0) - FEIGNED * n * np.eye(4))


def _freest(modes: Modes, size: Array, n: int) -> Array:
    """Sd of the freest motion of every peak, (S, M)."""
    used = int(modes.peaks.max(initial=1))
    scaled = scaled_information(modes.contacts[:, :used], size[:, None], n)
    least = np.linalg.eigvalsh(scaled)[..., 0]
    out = np.zeros(modes.cost.shape)
    out[:, :used] = 1.0 / np.sqrt(np.maximum(least, 1e-12))
    return out


def planes_coincide(readings: Readings) -> Mask:
    """Whether some labelling makes all meridian planes one plane, within the noise, (S,).

    A rotation common to the directions of a sensor may hide it, so all likely ones are tried.
    """
    known = np.sum(readings[..., VOID] == 0.0, axis=1)
    statistic = np.full(len(readings), np.inf)
    _fill_one_plane(readings, LIKELY_TURNS, statistic)
    freedom = 2.0 * readings.shape[1] + known - 3.0
    return np.asarray((known > 0) & (chdtrc(np.maximum(freedom, 1.0), statistic) > FITS))


@compiled
def _fill_one_plane(readings: Readings, turns: Array, statistic: Array) -> None:
    n = readings.shape[1]
    for s in range(readings.shape[0]):
        common, first = 0.0, -1
        for i in range(n - 1, -1, -1):
            common = max(common, readings[s, i, SD_COMMON])
            first = i if readings[s, i, VOID] == 0.0 else first
        for turn in turns:
            if first >= 0 and (common > 0.0 or turn == 0.0):
                for row in range(2):
                    found = _one_plane(readings, s, first, row, turn * common) + turn**2
                    statistic[s] = min(statistic[s], found)


@compiled_part
def _one_plane(readings: Readings, s: int, first: int, row: int, turn: float) -> float:
    """Chi-square of one common plane, where `row` of contact `first` is across it.

    A known direction must be across the plane (two numbers), of a void one the normal must be
    along it, and all contacts must lie in it. The plane's normal is the mean of the directions.
    """
    n = readings.shape[1]
    reference = _turned(readings[s, first], row, turn)
    mean, centre = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for i in range(n):
        contact = readings[s, i]
        centre = along(centre, 1.0 / n, vector(contact, POSITION))
        if contact[VOID] == 0.0:
            across = _nearest(contact, reference, turn)
            mean = along(mean, 1.0 if dot(across, reference) > 0.0 else -1.0, across)
    mean = scaled(1.0 / sqrt(dot(mean, mean)), mean)
    total = 0.0
    for i in range(n):
        contact = readings[s, i]
        var_n, var_p = contact[SD_NORMAL] ** 2, contact[SD_POSITION] ** 2
        spread = max(abs(contact[KAPPA] - contact[KAPPA + 1]), 1e-9)
        var_turn = (contact[SD_K_TZ] / spread) ** 2 + contact[SD_DIRECTION] ** 2 + var_n
        away = along(vector(contact, POSITION), -1.0, centre)
        if contact[VOID] == 0.0:
            cosine = dot(_nearest(contact, reference, turn), mean)
            total += max(1.0 - cosine**2, 0.0) / var_turn
        else:
            total += dot(vector(contact, NORMAL), mean) ** 2 / var_n
            var_turn = var_n
        total += dot(away, mean) ** 2 / (var_p + dot(away, away) * var_turn / n)
    return total


@compiled_part
def _turned(contact: Array, row: int, turn: float) -> V3:
    """A measured direction, turned back about the normal."""
    k0, k1 = vector(contact, K0), vector(contact, K1)
    if row == 0:
        return along(scaled(cos(turn), k0), -sin(turn), k1)
    return along(scaled(cos(turn), k1), sin(turn), k0)


@compiled_part
def _nearest(contact: Array, reference: V3, turn: float) -> V3:
    """The one of its two directions that is nearer to the reference."""
    first, second = _turned(contact, 0, turn), _turned(contact, 1, turn)
    return first if abs(dot(first, reference)) >= abs(dot(second, reference)) else second


def meeting_point(readings: Readings) -> tuple[Array, Array]:
    """The point all normals pass nearest, and the least eigenvalue of its system, (S, 3), (S,)."""
    p, n = readings[..., POSITION:NORMAL], readings[..., NORMAL:K0]
    across = np.eye(3) - n[..., :, None] * n[..., None, :]
    total = across.sum(axis=1)
    least = np.linalg.eigvalsh(total)[:, 0]
    pull = np.where(least < 1e-9, 1e-9, 0.0)[:, None, None] * np.eye(3)
    centre = np.linalg.solve(total + pull, np.einsum("snij,snj->si", across, p)[..., None])
    return centre[..., 0], least


def normals_parallel(readings: Readings) -> Mask:
    """Whether all normals are one direction within their noise, as on a flat end, (S,)."""
    n = readings[..., NORMAL:K0]
    mean = n.mean(axis=1, keepdims=True)
    mean = mean / np.maximum(np.linalg.norm(mean, axis=-1, keepdims=True), 1e-12)
    square = np.sum((n - mean) ** 2, axis=-1) / readings[..., SD_NORMAL] ** 2
    return np.asarray(chdtrc(2.0 * n.shape[1] - 2.0, np.sum(square, axis=1)) > FITS)


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
