"""Strains of a tactile finger to the surface it touches: place, normal, curvature, force.

    readings = read_strains(strains, StrainArray())
    readings.surface(0)      # a LocalSurface, with covariance and flags

The inverse of `strain_model`: the Hertz ellipse that explains 4 x 4 readings best, then the
object's curvature tensor, which is the relative one less the finger's (never the ellipse's own
axes: on a curved finger they are not the object's). Appendix 7 of Berkemeier & Fearing 1989 after
Fearing & Binford 1988; what is added is the prior and the covariance.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from estimator.readers.response import ResponseModel
from estimator.readers.strain_array import StrainArray
from estimator.readers.strain_covariance import (
    LOOSE,
    body_tensors,
    ellipses_of,
    flat_curvatures,
    inverse_information,
    ridge_covariance,
    shared_errors,
    with_prior_pull,
)  # fmt: skip
from estimator.readers.strain_flags import (
    BY_PRIOR,
    EDGE,
    FLAGS,
    LONG,
    NOISE_PEAKS,
    OFF_PRIOR,
    POOR,
    POOR_FIT,
    SATURATED,
    TWO,
    UMBILIC,
    before_fit,
    near_edge,
    nothing_to_fit,
    too_long,
    umbilic,
    widened,
)  # fmt: skip
from estimator.readers.strain_model import DIGITS, predicted_readings, reading_slopes
from estimator.readers.strain_readings import StrainReadings
from estimator.readers.strain_solve import Curvatures, Solved, solve
from estimator.readers.strain_window import Windows, checked_frames, choose_windows
from estimator.vectors import Array, Mask

FLAT_PRIOR = (10.0, 10.0)  # mean, sd of the flat curvature [1/m]: 40 mm to flat within 1.5 sd
MEASURED = 0.8  # of the prior's sd: above that the flat curvature is not measured
DOUBT = 1.5  # standard deviations between strains and prior: then its pull counts as an error
SECOND = 0.1  # of the peak: less than this outside the window is no contact of its own
DEPTH_STEP = 1e-3


def read_strains(
    strains: ArrayLike,
    array: StrainArray,
    *,
    curvatures: Curvatures = "map",
    flat_prior: tuple[float, float] = FLAT_PRIOR,
    convex: bool = True,
    response: ResponseModel | None = None,
    digits: float = DIGITS,
) -> StrainReadings:
    """The touch behind each frame of strains (or of taxel forces).

    Degenerates where the contact is longer than the window or nearly a line, where the strain is
    beyond the linear range, where the object is nearly umbilic (then it has no direction), and
    under two contacts: flagged, and the covariance widened.

    Args:
        strains: (B, rows, columns) of the whole array, or one frame; compression positive, NaN
            where a tactel is dead.
        array: What was measured with.
        curvatures: "map": both, the flat one with a prior that steps back where the strains
            contradict it. "two": both by maximum likelihood;
            needs 2 N or more. "one": the flat one is 0, as in the paper's experiments.
        flat_prior: Mean and standard deviation of the flat curvature [1/m]: for "map", and for
            "one" how much of it may have been left out.
        convex: A second curvature below 0 is refitted as 0 and called saturated ("two" only).
        response: Measured impulse response of every tactel; by default the half space's.
        digits: Of the quadrature, relative to the peak.
    Raises:
        ValueError: Wrong shape, infinite values, a frame that is all NaN, an unknown algorithm.
    """
    if curvatures not in ("map", "two", "one"):
        raise ValueError(f"curvatures: expected 'map', 'two' or 'one', got {curvatures!r}")
    if not (np.isfinite(flat_prior[0]) and flat_prior[1] > 0.0):
        raise ValueError(f"flat_prior: expected mean and standard deviation > 0, got {flat_prior}")
    if response is not None and len(response) != array.tactels[0] * array.tactels[1]:
        raise ValueError(
            f"response: expected one for each of {array.tactels[0]} x {array.tactels[1]} tactels, "
            f"got {len(response)}"
        )
    frames = checked_frames(strains, array)
    windows = choose_windows(frames, array)
    raised = before_fit(windows, array)
    touched = ~nothing_to_fit(raised)
    model = response or array.response()
    solved = solve(windows, touched, array, model, curvatures, flat_prior, convex, digits)
    states = solved.states
    covariances = _covariances(solved, curvatures, flat_prior, array)
    if array.modulus_error > 0.0 or array.depth_error > 0.0:
        slopes = _depth_slopes(states, windows, array, model)
        covariances = shared_errors(covariances, solved.information, states, slopes, array)
    ellipses, indentations = ellipses_of(states, array)
    unknowns = 6 - (curvatures == "one") - solved.saturated
    freedom = np.maximum(windows.live.sum(axis=1) - unknowns, 1)
    residuals = np.where(touched, np.sqrt(solved.chi2 / freedom), 0.0)
    after = {
        LONG: too_long(ellipses, array),
        EDGE: near_edge(states[:, :2], windows.middles, array),
        TWO: _two_contacts(states, windows, frames, array, model),
        POOR: residuals > POOR_FIT,
        SATURATED: solved.saturated,
        OFF_PRIOR: solved.off_prior,
    }
    for name, up in after.items():
        raised[:, FLAGS.index(name)] = up & touched
    covariances = widened(covariances, states, residuals, raised, array)
    tensors = body_tensors(states, array)
    raised[:, FLAGS.index(UMBILIC)] = umbilic(tensors, covariances) & touched
    if curvatures == "map":
        known = flat_curvatures(tensors, covariances)[1] < MEASURED * flat_prior[1]
        raised[:, FLAGS.index(BY_PRIOR)] = ~known & touched & ~solved.off_prior
    states, covariances = _without_touch(~touched, states, covariances, windows, array)
    return StrainReadings(
        array, states, covariances, ellipses, np.where(touched, indentations, 0.0), residuals,
        raised, solved.steps,
    )  # fmt: skip


def _covariances(
    solved: Solved, curvatures: Curvatures, flat_prior: tuple[float, float], array: StrainArray
) -> Array:
    """Of the states, by the algorithm that found them."""
    tensors = body_tensors(solved.states, array)
    if curvatures != "one":
        free = inverse_information(solved.information)
        if curvatures == "two":
            return free
        pulled = with_prior_pull(free, tensors, flat_prior, DOUBT)
        return np.where(solved.off_prior[:, None, None], free, pulled)
    left_out = flat_prior[0] ** 2 + flat_prior[1] ** 2
    return ridge_covariance(solved.information, tensors, left_out, array)


def _depth_slopes(
    states: Array, windows: Windows, array: StrainArray, model: ResponseModel
) -> Array:
    """J'W times the readings' slope over the logarithm of the depth, (B, 6)."""
    each = np.arange(len(states))[:, None]
    deeper = replace(array, depth=array.depth * (1.0 + DEPTH_STEP))
    moved = predicted_readings(states, deeper) - predicted_readings(states, array)
    slope = moved.reshape(len(states), -1)[each, windows.tactels] / DEPTH_STEP
    J = reading_slopes(states, array, model)[each, windows.tactels]
    weights = windows.live / windows.sd**2
    return np.asarray(np.einsum("bti,bt,bt->bi", J, weights, slope))


def _two_contacts(
    states: Array, windows: Windows, frames: Array, array: StrainArray, model: ResponseModel
) -> Mask:
    """The largest reading outside the window is not of the contact inside."""
    flat = frames.reshape(len(frames), array.positions.shape[0])
    seen = flat[np.arange(len(flat)), windows.outside]
    peak = windows.readings.max(axis=1)
    suspects = np.flatnonzero((windows.outside >= 0) & (seen > SECOND * peak))
    two = np.zeros(len(flat), dtype=np.bool_)
    if len(suspects) == 0:
        return two
    expected = predicted_readings(states[suspects], array, model).reshape(-1, flat.shape[1])
    surplus = seen[suspects] - expected[np.arange(len(suspects)), windows.outside[suspects]]
    limit = SECOND * peak + NOISE_PEAKS * windows.sd.min(axis=1)
    two[suspects] = surplus > limit[suspects]
    return two


def _without_touch(
    void: Mask, states: Array, covariances: Array, windows: Windows, array: StrainArray
) -> tuple[Array, Array]:
    """Nothing felt: the middle of the window, flat, and errors as large as the finger."""
    blank = np.array([0.0, 0.0, np.log(1e-3), 0.0, array.curvature, 0.0])
    away = np.column_stack([windows.middles, np.tile(blank[2:], (len(void), 1))])
    wide = np.diag(np.square(LOOSE))
    return (
        np.where(void[:, None], away, states),
        np.where(void[:, None, None], wide, covariances),
    )
