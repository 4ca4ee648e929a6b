"""Gauss-Newton for a reach: contact, stand-off and overshoot of all touching fingers at once.

Knots are postures of one hand on one base: the first at the contact, others with the touching
fingers' pads moved along their normals; only those fingers' joints differ between knots. Residuals
are the pads' places, pad angles beyond the cone and link spheres nearer than asked, the worst few
of each knot. The step is the least one that closes them, in its dual form

    step = -W J^T (J W J^T + I)^-1 residual

with W how willingly each unknown moves: zero for joints that a limit stops. Nothing is minimised
beyond that, and nothing promised: what comes out is inspected, and what fails is the optimiser's.
"""

from __future__ import annotations

from math import acos, sin

import numpy as np

from estimator.compiled import compiled, compiled_part
from estimator.linear import factor, solve_factored
from estimator.vectors import Array
from hand_models.chains import Chains
from planner.kinematics.demands import WORST, Demands, write_rows
from planner.kinematics.small import turn_by, turned

BASE_UNITS = (0.1, 1.0)  # how willingly the base moves, where a joint moves by 1 rad [m], [rad]
LONGEST = (0.03, 0.4)  # of one step [m], [rad]
CLOSE = 1e-6  # largest violation: done [m]
HALF_TURN = 3.1  # beyond which a turn back has no direction [rad]
PATIENT = 12  # steps after which, of domes, one that makes things worse makes the next ones shorter
LEAST_SHARE = 0.1  # ... but no shorter than this: a flat dome rolls to and fro
REFREEZE = 3  # times that limits are asked for a step


@compiled
def settle(
    chains: Chains, demands: Demands, q: Array, R: Array, p: Array, iterations: int
) -> float:
    """Move knots (K, nq) and base (3, 3), (3,), in place; returns the largest violation [m].

    An angle beyond the cone counts as its arc of 50 mm.
    """
    K, k = len(q), len(demands.contacts)
    unknowns = len(demands.willing)
    rows = np.zeros((K * (4 * k + WORST), unknowns))
    residual, lower = np.zeros(len(rows)), np.zeros((len(rows), len(rows)))
    system, dual = np.zeros((len(rows), len(rows))), np.zeros(len(rows))
    step, free = np.zeros(unknowns), np.zeros(unknowns)
    middle = np.zeros(3)
    for i in range(3):
        for j in range(k):
            middle[i] += demands.contacts[j].point[i] / k
    _turn_back(demands, R)
    share, last = 1.0, np.inf
    for turn in range(iterations + 1):
        used, off = write_rows(chains, demands, q, R, p, middle, rows, residual)
        if off < CLOSE or turn == iterations:
            break
        if chains.domed and turn > PATIENT and off > last:
            share = max(0.5 * share, LEAST_SHARE)
        last = off
        _step(chains, demands, q, p, rows, residual, used, system, lower, dual, free, step)
        for c in range(unknowns):
            step[c] *= share
        _take(chains, demands, step, middle, q, R, p)
    return off


@compiled_part
def _step(
    chains: Chains, demands: Demands, q: Array, p: Array, rows: Array, residual: Array,
    used: int, system: Array, lower: Array, dual: Array, free: Array, step: Array,
) -> None:  # fmt: skip
    """The least step; what a limit stops is frozen, and the step asked again without it."""
    unknowns, nq = len(step), q.shape[1]
    for c in range(unknowns):
        free[c] = demands.willing[c]
    for _ in range(REFREEZE):
        for i in range(used):
            for j in range(i + 1):
                total = 1.0 if i == j else 0.0
                for c in range(unknowns):
                    total += rows[i, c] * rows[j, c] * free[c] * free[c]
                system[i, j] = total
            dual[i] = residual[i]
        factor(system[:used, :used], lower)
        solve_factored(lower, dual[:used])
        for c in range(unknowns):
            step[c] = 0.0
            for i in range(used):
                step[c] -= rows[i, c] * dual[i]
            step[c] *= free[c] * free[c]
        if not _freeze(chains, demands, q, p, step, free):
            break
    longest = 1.0
    for c in range(unknowns):
        limit = LONGEST[0] if nq <= c < nq + 3 else LONGEST[1]
        longest = max(longest, abs(step[c]) / limit)
    for c in range(unknowns):
        step[c] /= longest


@compiled_part
def _freeze(chains: Chains, demands: Demands, q: Array, p: Array, step: Array, free: Array) -> bool:
    """Whether the step leads out of limits where it already is at them; frees those no more."""
    nq, found = q.shape[1], False
    for knot in range(len(q)):
        for c in range(nq):
            column = demands.columns[knot, c]
            stopped = (step[column] > 0.0 and q[knot, c] >= chains.upper[c] - 1e-9) or (
                step[column] < 0.0 and q[knot, c] <= chains.lower[c] + 1e-9
            )
            if stopped and free[column] > 0.0:
                free[column], found = 0.0, True
    for a in range(3):
        stopped = (step[nq + a] > 0.0 and p[a] >= demands.setting[0].box[1, a]) or (
            step[nq + a] < 0.0 and p[a] <= demands.setting[0].box[0, a]
        )
        if stopped and free[nq + a] > 0.0:
            free[nq + a], found = 0.0, True
    return found


@compiled_part
def _take(
    chains: Chains, demands: Demands, step: Array, middle: Array, q: Array, R: Array, p: Array
) -> None:
    """Joints within their limits, the base within its box."""
    nq = q.shape[1]
    for knot in range(len(q)):
        for c in range(nq):
            moved = q[knot, c] + step[demands.columns[knot, c]]
            q[knot, c] = min(max(moved, chains.lower[c]), chains.upper[c])
    w0, w1, w2 = step[nq + 3], step[nq + 4], step[nq + 5]
    arm = turned(w0, w1, w2, p[0] - middle[0], p[1] - middle[1], p[2] - middle[2])
    turn_by(w0, w1, w2, R)
    _turn_back(demands, R)
    for a in range(3):
        moved = middle[a] + arm[a] + step[nq + a]
        p[a] = min(max(moved, demands.setting[0].box[0, a]), demands.setting[0].box[1, a])


@compiled_part
def _turn_back(demands: Demands, R: Array) -> None:
    """Onto the largest turn from nominal, where it is beyond."""
    nominal, most, trace = demands.setting[0].R_nominal, demands.setting[0].most_turn, 0.0
    w0 = w1 = w2 = 0.0  # in the world: of R R_nominal^T
    for k in range(3):
        for a in range(3):
            trace += R[a, k] * nominal[a, k]
        w0 += R[2, k] * nominal[1, k] - R[1, k] * nominal[2, k]
        w1 += R[0, k] * nominal[2, k] - R[2, k] * nominal[0, k]
        w2 += R[1, k] * nominal[0, k] - R[0, k] * nominal[1, k]
    angle = acos(min(max(0.5 * (trace - 1.0), -1.0), 1.0))
    if most < angle < HALF_TURN:
        back = (most - angle) / (2.0 * sin(angle))
        turn_by(back * w0, back * w1, back * w2, R)
