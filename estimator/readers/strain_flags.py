"""What a user should know of a reading of strains, and how much wider it makes the covariance."""

from __future__ import annotations

import numpy as np

from estimator.readers.strain_array import StrainArray
from estimator.readers.strain_covariance import relative_tensors
from estimator.readers.strain_window import FEWEST, Windows
from estimator.vectors import Array, Mask

NO_CONTACT = "no contact"
TOO_FEW = "too few live tactels"
DEAD = "dead tactels"
BEYOND = "strain beyond the linear range"
LONG = "ellipse longer than the window"
EDGE = "contact near the edge of the array"
TWO = "two contacts"
POOR = "poor fit"
SATURATED = "second curvature saturated"
BY_PRIOR = "second curvature is the prior's"
OFF_PRIOR = "second curvature against the prior"
UMBILIC = "direction void, nearly umbilic"
FLAGS = (
    NO_CONTACT,
    TOO_FEW,
    DEAD,
    BEYOND,
    LONG,
    EDGE,
    TWO,
    POOR,
    SATURATED,
    BY_PRIOR,
    OFF_PRIOR,
    UMBILIC,
)

NOISE_PEAKS = 6.0  # a peak below this many standard deviations is no contact
POOR_FIT = 1.7  # rms residual over noise; chance alone passes it once in 3000 with 10 to spare
VOID = 3.0  # half difference of the curvatures over its standard deviation


def before_fit(windows: Windows, array: StrainArray) -> Mask:
    """Flags (B, F) that the raw readings raise, and with them whether there is anything to fit."""
    raised = np.zeros((len(windows.readings), len(FLAGS)), dtype=np.bool_)
    peak = windows.readings.max(axis=1)
    floor = np.sqrt(array.rounding**2 / 3.0 + array.noise**2)
    alive = windows.live.sum(axis=1)
    raised[:, FLAGS.index(NO_CONTACT)] = peak < NOISE_PEAKS * floor
    raised[:, FLAGS.index(TOO_FEW)] = alive < FEWEST
    raised[:, FLAGS.index(DEAD)] = ~windows.live.all(axis=1)
    raised[:, FLAGS.index(BEYOND)] = np.abs(windows.readings).max(axis=1) > array.linear_range
    return raised


def nothing_to_fit(raised: Mask) -> Mask:
    return np.asarray(
        raised[:, FLAGS.index(NO_CONTACT)] | raised[:, FLAGS.index(TOO_FEW)], dtype=np.bool_
    )


def too_long(ellipses: Array, array: StrainArray) -> Mask:
    """The ellipse covers more than the window and most of a sense depth around it."""
    half = np.sqrt(np.einsum("bij,bij->bi", ellipses, ellipses))  # rows' lengths: half extents
    reach = (
        0.5 * array.window[1] * array.axial_pitch + 0.7 * array.depth,
        0.5 * array.window[0] * array.arc_pitch + 0.7 * array.depth,
    )
    return np.asarray(np.any(half > reach, axis=1))


def near_edge(places: Array, middles: Array, array: StrainArray) -> Mask:
    """Outside the window's own tactels: the contact is seen from one side only."""
    reach = np.array([(array.window[1] - 2) * array.axial_pitch, 0.0])
    reach[1] = (array.window[0] - 2) * array.arc_pitch
    return np.asarray(np.any(np.abs(places - middles) > 0.5 * reach + 0.25 * array.depth, axis=1))


def umbilic(tensors: Array, covariances: Array) -> Mask:
    """The half difference of the curvatures does not stand out of its own error."""
    to_deviator = np.zeros((2, 6))
    to_deviator[0, 3], to_deviator[0, 4], to_deviator[1, 5] = 0.5, -0.5, 1.0
    p, r = 0.5 * (tensors[:, 0, 0] - tensors[:, 1, 1]), tensors[:, 0, 1]
    spread = to_deviator @ covariances @ to_deviator.T
    worst = np.sqrt(np.linalg.eigvalsh(spread)[:, 1])
    return np.asarray(np.hypot(p, r) < VOID * worst)


def widened(
    covariances: Array, states: Array, residuals: Array, raised: Mask, array: StrainArray
) -> Array:
    """Covariances of the states (B, 6, 6) that own up to what the flags say.

    A poor fit scales by the residual; outside the model's range (linear strain, window) the
    curvatures may be off by half themselves; of two contacts nothing is known but roughly where.
    A long ellipse that is seen in its middle has a true direction and curvature across; what the
    window does not see of it counts as a twelfth. On a curved finger, where any misfit becomes an
    error of direction, it counts as a third.
    """
    out = covariances * np.where(residuals > POOR_FIT, residuals**2, 1.0)[:, None, None]
    size = np.linalg.norm(relative_tensors(states), axis=(1, 2))
    off = raised[:, FLAGS.index(BEYOND)] | raised[:, FLAGS.index(EDGE)]
    long = raised[:, FLAGS.index(LONG)]
    lost = raised[:, FLAGS.index(TWO)]
    added, unseen = np.zeros((len(states), 6)), 0.08 if array.curvature == 0.0 else 0.33
    pitch = 0.5 * max(array.axial_pitch, array.arc_pitch)
    added[:, :2] = np.where(lost, 2.0 * pitch, np.where(off | long, 0.25 * pitch, 0.0))[:, None]
    added[:, 2] = np.where(lost, 1.0, np.where(off, 0.3, np.where(long, 0.1, 0.0)))
    share = np.where(off, 0.5, np.where(long, unseen, 0.0))
    added[:, 3:] = np.where(lost, 1e3, share * size)[:, None]
    index = np.arange(6)
    out[:, index, index] += np.square(added)
    return out
