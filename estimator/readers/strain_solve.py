"""Fits of windows of strains by one of three algorithms, with other starts where a fit is poor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from estimator.readers.response import ResponseModel
from estimator.readers.strain_array import StrainArray
from estimator.readers.strain_covariance import body_tensors, flat_curvatures, inverse_information
from estimator.readers.strain_equations import Problem
from estimator.readers.strain_fit import MOST_STEPS, fit_all
from estimator.readers.strain_flags import POOR_FIT
from estimator.readers.strain_start import starts
from estimator.readers.strain_window import Windows
from estimator.vectors import Array, Index, Mask

Curvatures = Literal["map", "two", "one"]
OTHER_STARTS = 3
CONTRADICTION = 3.5  # standard deviations between prior and strains
FORCES = (-9.0, 7.0)  # ln F [N]


@dataclass(frozen=True, eq=False)
class Solved:
    """States (B, 6), J'WJ with the prior (B, 6, 6), chi2 of the readings and steps (B,).

    `saturated`: the second curvature came out below 0 and was held there; `off_prior`: it was
    fitted without the prior, which the strains contradict; (B,).
    """

    states: Array
    information: Array
    chi2: Array
    steps: Array
    saturated: Mask
    off_prior: Mask


def solve(
    windows: Windows,
    touched: Mask,
    array: StrainArray,
    model: ResponseModel,
    curvatures: Curvatures,
    flat_prior: tuple[float, float],
    convex: bool,
    digits: float,
) -> Solved:
    """The best state of each window touched; see `strain.read_strains` for the algorithms."""
    prior = (flat_prior[0], 1.0 / flat_prior[1]) if curvatures == "map" else (0.0, 0.0)
    problem = _problem(array, model, prior, digits)
    B = len(touched)
    solved = Solved(
        np.tile([0.0, 0.0, -7.0, 1.0, 1.0 + array.curvature, 0.0], (B, 1)),
        np.zeros((B, 6, 6)), np.zeros(B), np.zeros(B), np.zeros(B, dtype=np.bool_),
        np.zeros(B, dtype=np.bool_),
    )  # fmt: skip
    weights = np.where(windows.live, 1.0 / windows.sd, 0.0)
    rows, ridge = np.flatnonzero(touched), curvatures == "one"
    first = starts(windows.readings[rows], weights[rows], array)[:, 0]
    first[:, :2] += windows.middles[rows]
    _keep_better(solved, rows, first, windows, weights, problem, ridge, always=True)
    freedom = np.maximum(windows.live.sum(axis=1) - 6, 1)
    poor = solved.chi2 > freedom * POOR_FIT**2
    poor = touched & ((poor & (not ridge)) | (solved.steps >= MOST_STEPS))
    rows = np.flatnonzero(poor)
    if len(rows):
        others = starts(windows.readings[rows], weights[rows], array, best=1 + OTHER_STARTS)
        others[..., :2] += windows.middles[rows, None]
        for k in range(1, 1 + OTHER_STARTS):
            _keep_better(solved, rows, others[:, k], windows, weights, problem, ridge)
    if curvatures == "two" and convex:
        _saturate(solved, touched, array, windows, weights, problem)
    if curvatures == "map":
        _contradict(solved, touched, array, windows, weights, problem)
    return solved


def _contradict(
    solved: Solved, touched: Mask, array: StrainArray, windows: Windows, weights: Array,
    problem: Problem,
) -> None:  # fmt: skip
    """Once more without the prior, and kept if the sum of squares falls by more than 3.5^2.

    That fall is the squared distance between prior and strains in standard deviations. Worth a
    try only where the answer is far from the prior's mean by what the prior has left of it: with
    posterior variance V and the prior's P the distance is about (kappa_2 - mean) / sqrt(P - V).
    """
    mean, rate = problem.prior
    covariances = inverse_information(solved.information)
    flat, sd = flat_curvatures(body_tensors(solved.states, array), covariances)
    learnt = np.maximum(1.0 / rate**2 - sd**2, 1e-9 / rate**2)
    far = touched & (np.abs(flat - mean) > 0.6 * CONTRADICTION * np.sqrt(learnt))
    rows = np.flatnonzero(far)
    solved.chi2[rows] += np.square(rate * (flat[rows] - mean)) - CONTRADICTION**2
    before = solved.chi2[rows]
    free = problem._replace(prior=(0.0, 0.0))
    _keep_better(solved, rows, solved.states[rows], windows, weights, free, False)
    solved.off_prior[rows] = solved.chi2[rows] < before
    kept = rows[~solved.off_prior[rows]]
    solved.chi2[kept] -= np.square(rate * (flat[kept] - mean)) - CONTRADICTION**2


def _problem(
    array: StrainArray, model: ResponseModel, prior: tuple[float, float], digits: float
) -> Problem:
    reach_y, reach_x = (0.5 * (n + 1) for n in array.window)
    x, y = reach_x * array.axial_pitch, reach_y * array.arc_pitch
    material = (array.effective_modulus, array.compliance, array.depth, array.curvature, 0.0)
    box = np.array([(-x, x), (-y, y), FORCES])
    return Problem(model.kind, model.rows, model.positions, material, prior, box, digits)


def _keep_better(
    solved: Solved, rows: Index, states: Array, windows: Windows, weights: Array, problem: Problem,
    ridge: bool, *, always: bool = False,
) -> None:  # fmt: skip
    """Fit these rows from these states; where that explains the readings better, keep it."""
    if len(rows) == 0:
        return
    states = np.ascontiguousarray(states)
    information, chi2, steps = fit_all(
        windows.readings[rows], weights[rows], windows.tactels[rows], windows.middles[rows],
        states, ridge, problem,
    )  # fmt: skip
    better = np.full(len(rows), True) if always else chi2 < solved.chi2[rows]
    kept = rows[better]
    solved.states[kept], solved.information[kept] = states[better], information[better]
    solved.chi2[kept], solved.steps[kept] = chi2[better], steps[better]


def _saturate(
    solved: Solved, touched: Mask, array: StrainArray, windows: Windows, weights: Array,
    problem: Problem,
) -> None:  # fmt: skip
    """Where the flat curvature came out negative: once more with it held at 0."""
    half = 0.5 * (solved.states[:, 3] - solved.states[:, 4] + array.curvature)
    mean = 0.5 * (solved.states[:, 3] + solved.states[:, 4] - array.curvature)
    solved.saturated[:] = touched & (mean < np.hypot(half, solved.states[:, 5]))
    rows = np.flatnonzero(solved.saturated)
    _keep_better(solved, rows, solved.states[rows], windows, weights, problem, True, always=True)
