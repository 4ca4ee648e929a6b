"""Least squares of one window of readings: Levenberg-Marquardt over place, force and curvature.

The state is (x_0, y_0, ln F, K) with K the relative curvature, so the prior on the object's flat
curvature is one more residual and no elliptic integral is in the loop. The one-curvature algorithm
moves on the ridge K = flat I + w w' of a given second curvature, w in the plane: two numbers
without a singular direction.
"""

from __future__ import annotations

import numpy as np

from estimator.compiled import compiled, compiled_part
from estimator.readers.hertz import curvature_into, ellipse_into
from estimator.readers.strain_equations import (
    Problem,
    Room,
    allowed,
    evaluate,
    new_room,
    solve_into,
)
from estimator.vectors import Array, Index

MOST_STEPS = 60
CONVERGED = 1e-5  # predicted fall of the sum of squares, of the sum + 1e-6
ROUGH = 1e-2  # of the sum + 100 for the first part: less is not worth a step by the ellipse
BY_ELLIPSE, BY_CURVATURE, ON_RIDGE = 0, 1, 2


@compiled_part
def ridge_tangents(w: Array) -> Array:
    """Of the ridge at K = flat I + w w', columns x_0, y_0, ln F, w_x, w_y; (6, 5)."""
    C = np.zeros((6, 5))
    C[0, 0] = C[1, 1] = C[2, 2] = 1.0
    C[3, 3], C[4, 4] = 2.0 * w[0], 2.0 * w[1]
    C[5, 3], C[5, 4] = w[1], w[0]
    return C


@compiled_part
def ridge_point(state: Array, finger: float, flat: float) -> Array:
    """w of the ridge's point nearest to the state's body curvature."""
    p, r = 0.5 * (state[3] - state[4] + finger), state[5]
    D = (p * p + r * r) ** 0.5
    size = max(0.5 * (state[3] + state[4] - finger) + D - flat, 1.0) ** 0.5
    angle = 0.5 * np.arctan2(r, p)
    return np.array((size * np.cos(angle), size * np.sin(angle)))


@compiled_part
def put_on_ridge(state: Array, w: Array, finger: float, flat: float) -> None:
    state[3] = flat + w[0] * w[0]
    state[4] = flat + w[1] * w[1] + finger
    state[5] = w[0] * w[1]


@compiled_part
def moved_into(
    state: Array, w: Array, step: Array, ridge: bool, problem: Problem, to: Array, w_to: Array
) -> None:
    """The state one step on; on the ridge the last two numbers of the step move w."""
    for i in range(3):
        to[i] = state[i] + step[i]
    if ridge:
        w_to[0], w_to[1] = w[0] + step[3], w[1] + step[4]
        put_on_ridge(to, w_to, problem.material[3], problem.material[4])
    else:
        for i in range(3, 6):
            to[i] = state[i] + step[i]


@compiled_part
def descend(
    readings: Array, weights: Array, tactels: Index, middle: Array, state: Array, w: Array,
    coordinates: int, problem: Problem, room: Room, information: Array,
) -> tuple[float, int]:  # fmt: skip
    """Move the state to the least sum of squares; chi2 there and the steps taken.

    Args:
        coordinates: BY_ELLIPSE, BY_CURVATURE or ON_RIDGE; on the ridge w moves too.
        information: Out, J'WJ with the prior's part (6, 6). For the rest see `fit_window`.
    """
    by_ellipse, ridge = coordinates == BY_ELLIPSE, coordinates == ON_RIDGE
    n = 5 if ridge else 6
    w_trial, trial = w.copy(), state.copy()
    chi2, total = evaluate(readings, weights, tactels, state, by_ellipse, problem, room)
    information[:], g = room.A, room.g.copy()
    L, step, damping = np.zeros((6, 6)), np.zeros(6), 1e-3
    A_n, g_n = information, g
    for done in range(MOST_STEPS):
        if ridge:
            C = ridge_tangents(w)
            C_T = np.ascontiguousarray(C.T)
            A_n, g_n = C_T @ information @ C, C_T @ g
        while not solve_into(A_n, g_n, n, damping, L, step):
            damping = max(10.0 * damping, 1e-9)
        moved_into(state, w, step, ridge, problem, trial, w_trial)
        fall = 0.0
        for i in range(n):
            fall += step[i] * g_n[i]
        better = False
        if allowed(trial, middle, problem.box, 0.02 if by_ellipse else 1e-5):
            chi2_trial, total_trial = evaluate(
                readings, weights, tactels, trial, by_ellipse, problem, room
            )
            better = total_trial <= total
            if better:
                state[:], w[:], chi2, total = trial, w_trial, chi2_trial, total_trial
                information[:], g[:] = room.A, room.g
        least = ROUGH * (100.0 + total) if by_ellipse else CONVERGED * (1e-6 + total)
        if fall < least or damping > 1e12:
            return chi2, done + 1
        damping = max(0.1 * damping, 1e-12) if better else 8.0 * damping
    return chi2, MOST_STEPS


@compiled_part
def fit_window(
    readings: Array, weights: Array, tactels: Index, middle: Array, state: Array, ridge: bool,
    problem: Problem, room: Room, information: Array,
) -> tuple[float, int]:  # fmt: skip
    """Move the state first roughly by the ellipse, nearly linear, then by the curvature.

    Args:
        readings, weights: (T,), weights 1/sd and 0 for what is left out (a dead tactel).
        tactels, middle: Which they are, and the window's middle [m].
        state: Start, and then the answer (6,).
        ridge: Keep the flat curvature at its given value: the one-curvature algorithm.
    Returns:
        chi2 of the readings and the steps taken.
    """
    modulus, finger, flat = problem.material[0], problem.material[3], problem.material[4]
    w = np.zeros(2)
    ellipse_into(state[3:6], np.exp(state[2]), modulus, room.M, room.M_J)
    state[3:6] = room.M
    _, rough = descend(
        readings, weights, tactels, middle, state, w, BY_ELLIPSE, problem, room, information
    )
    room.M[:] = state[3:6]
    curvature_into(room.M, np.exp(state[2]), modulus, state[3:6])
    if ridge:
        w[:] = ridge_point(state, finger, flat)
        put_on_ridge(state, w, finger, flat)
    coordinates = ON_RIDGE if ridge else BY_CURVATURE
    chi2, steps = descend(
        readings, weights, tactels, middle, state, w, coordinates, problem, room, information
    )
    return chi2, rough + steps


@compiled
def fit_all(
    readings: Array, weights: Array, tactels: Index, middles: Array, states: Array, ridge: bool,
    problem: Problem,
) -> tuple[Array, Array, Array]:  # fmt: skip
    """`fit_window` of each row: information (B, 6, 6), chi2 and steps (B,); states move."""
    B = len(readings)
    information, chi2, steps = np.empty((B, 6, 6)), np.empty(B), np.empty(B)
    room = new_room(readings.shape[1])
    for i in range(B):
        chi2[i], steps[i] = fit_window(
            readings[i], weights[i], tactels[i], middles[i], states[i], ridge, problem, room,
            information[i],
        )  # fmt: skip
    return information, chi2, steps
