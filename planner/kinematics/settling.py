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

from math import acos, hypot, sin, sqrt
from typing import NamedTuple

import numpy as np

from estimator.compiled import compiled
from estimator.linear import factor, solve_factored
from estimator.vectors import Array, Index
from hand_models.chains import Chains
from planner.kinematics.meridian import Meridian, distance_and_slopes
from planner.kinematics.placing import pad_jacobian, place_joints, place_pad
from planner.kinematics.resting import rotation

PLACE_UNIT = 2e-5
CONE_UNIT = 0.01  # ... this much of angle beyond the cone [rad]
CLEARANCE_UNIT = 1e-4  # ... or a link sphere so much too near [m]
BASE_UNITS = (0.1, 1.0)
LONGEST = (0.03, 0.4)
WORST = 10  # spheres of a knot that are pushed out at a time
SPARE = 2e-4
CLOSE = 1e-6  # largest violation: done [m]
ARC = 0.05  # at which an angle counts as a violation [m]
INSIDE = 0.97  # of the cone, where an angle beyond it goes
HALF_TURN = 3.1  # beyond which a turn back has no direction [rad]
REFREEZE = 3  # times that limits are asked for a step


class Demands(NamedTuple):
    """What is asked of k fingers at K knots, in the world.

    Attributes:
        fingers: (k,) pads.
        points, normals: (k, 3) contacts.
        lengths: (K,) of each knot along the normals [m].
        cones: (K,) largest pad angle [rad].
        R_WO, p_WO, meridian: The object.
        table: (4,) n, h of the half-space n . p >= h.
        joints, spheres: (M,) and (M, 4) link spheres: centre in the joint's frame and radius.
        asked: (K, M) least distance from object and table; -inf where none is asked [m].
        columns: (K, nq) unknown that moves each joint at each knot; joints, base, then the others'.
        willing: (unknowns,) how willingly each moves.
        box: (2, 3) range of the base's position [m].
        R_nominal, most_turn: The base turns from there by at most so much [rad].
    """

    fingers: Index
    points: Array
    normals: Array
    lengths: Array
    cones: Array
    R_WO: Array
    p_WO: Array
    meridian: Meridian
    table: Array
    joints: Index
    spheres: Array
    asked: Array
    columns: Index
    willing: Array
    box: Array
    R_nominal: Array
    most_turn: float


@compiled
def settle(
    chains: Chains, demands: Demands, q: Array, R: Array, p: Array, iterations: int
) -> float:
    """Move knots (K, nq) and base (3, 3), (3,), in place; returns the largest violation [m].

    An angle beyond the cone counts as its arc of 50 mm.
    """
    K, k = len(q), len(demands.fingers)
    unknowns = len(demands.willing)
    rows = np.zeros((K * (4 * k + WORST), unknowns))
    residual, lower = np.zeros(len(rows)), np.zeros((len(rows), len(rows)))
    system, dual = np.zeros((len(rows), len(rows))), np.zeros(len(rows))
    step, free = np.zeros(unknowns), np.zeros(unknowns)
    middle = np.zeros(3)
    for i in range(3):
        for j in range(k):
            middle[i] += demands.points[j, i] / k
    for turn in range(iterations + 1):
        used, off = _write(chains, demands, q, R, p, middle, rows, residual)
        if off < CLOSE or turn == iterations:
            break
        _step(chains, demands, q, p, rows[:used], residual[:used], system, lower, dual, free, step)
        _take(chains, demands, step, middle, q, R, p)
    return off


@compiled
def _write(
    chains: Chains, demands: Demands, q: Array, R: Array, p: Array, middle: Array,
    rows: Array, residual: Array,
) -> tuple[int, float]:  # fmt: skip
    """Rows and residuals; how many, and the largest violation [m]."""
    J, nq = len(chains.parents), q.shape[1]
    joints_R, joints_p = np.zeros((J, 3, 3)), np.zeros((J, 3))
    used, off = 0, 0.0
    rows[:] = 0.0
    for knot in range(len(q)):
        place_joints(chains, q[knot], joints_R, joints_p)
        for j in range(len(demands.fingers)):
            gap, angle = _pad_rows(
                chains, demands, knot, j, joints_R, joints_p, R, p, middle, rows, residual, used, nq
            )
            off = max(off, gap, ARC * (angle - demands.cones[knot]))
            used += 3 if angle <= demands.cones[knot] else 4
        near, depth = _sphere_rows(
            chains, demands, knot, joints_R, joints_p, R, p, middle, rows, residual, used, nq
        )
        off, used = max(off, depth), used + near
    return used, off


@compiled
def _pad_rows(
    chains: Chains, demands: Demands, knot: int, j: int, joints_R: Array, joints_p: Array,
    R: Array, p: Array, middle: Array, rows: Array, residual: Array, first: int, nq: int,
) -> tuple[float, float]:  # fmt: skip
    """Three rows of a pad's place, one of its angle if beyond the cone; gap and angle."""
    finger, n = demands.fingers[j], demands.normals[j]
    centre, pad = np.zeros(3), np.zeros(3)
    moves, turns = np.zeros((3, nq)), np.zeros((3, nq))
    place_pad(chains, finger, joints_R, joints_p, centre, pad)
    pad_jacobian(chains, finger, joints_R, joints_p, centre, moves, turns)
    away, square, cosine = chains.pad_radii[finger] + demands.lengths[knot], 0.0, 0.0
    there, facing = R @ centre + p, R @ pad
    for a in range(3):
        gap = there[a] - demands.points[j, a] - away * n[a]
        residual[first + a] = gap / PLACE_UNIT
        square += gap * gap
        cosine -= facing[a] * n[a]
    angle = acos(min(max(cosine, -1.0), 1.0))
    _base_rows(there - middle, rows, first, nq, 1.0 / PLACE_UNIT)
    for c in range(nq):
        column = demands.columns[knot, c]
        for a in range(3):
            along = R[a, 0] * moves[0, c] + R[a, 1] * moves[1, c] + R[a, 2] * moves[2, c]
            rows[first + a, column] += along / PLACE_UNIT
    if angle > demands.cones[knot]:
        # d angle = (facing x n) . w / sin angle, as the angle is between facing and -n
        scale = 1.0 / max(sin(angle), 1e-3) / CONE_UNIT
        x = (facing[1] * n[2] - facing[2] * n[1]) * scale
        y = (facing[2] * n[0] - facing[0] * n[2]) * scale
        z = (facing[0] * n[1] - facing[1] * n[0]) * scale
        row = rows[first + 3]
        residual[first + 3] = (angle - INSIDE * demands.cones[knot]) / CONE_UNIT
        row[nq + 3], row[nq + 4], row[nq + 5] = x, y, z
        for c in range(nq):
            w0 = R[0, 0] * turns[0, c] + R[0, 1] * turns[1, c] + R[0, 2] * turns[2, c]
            w1 = R[1, 0] * turns[0, c] + R[1, 1] * turns[1, c] + R[1, 2] * turns[2, c]
            w2 = R[2, 0] * turns[0, c] + R[2, 1] * turns[1, c] + R[2, 2] * turns[2, c]
            row[demands.columns[knot, c]] += x * w0 + y * w1 + z * w2
    return sqrt(square), angle


@compiled
def _base_rows(arm: Array, rows: Array, first: int, nq: int, scale: float) -> None:
    """How a point moves with the base's position and its turn about the contacts' middle."""
    for a in range(3):
        rows[first + a, nq + a] = scale
    rows[first, nq + 4], rows[first, nq + 5] = arm[2] * scale, -arm[1] * scale
    rows[first + 1, nq + 3], rows[first + 1, nq + 5] = -arm[2] * scale, arm[0] * scale
    rows[first + 2, nq + 3], rows[first + 2, nq + 4] = arm[1] * scale, -arm[0] * scale


@compiled
def _sphere_rows(
    chains: Chains, demands: Demands, knot: int, joints_R: Array, joints_p: Array,
    R: Array, p: Array, middle: Array, rows: Array, residual: Array, first: int, nq: int,
) -> tuple[int, float]:  # fmt: skip
    """Rows of the spheres that are too near, the worst of them; how many, and the worst [m]."""
    worst, depths, count = np.zeros(WORST, dtype=np.int64), np.zeros(WORST), 0
    at, push = np.zeros(3), np.zeros(3)
    for k in range(len(demands.joints)):
        if demands.asked[knot, k] == -np.inf:
            continue
        _in_world(demands, k, joints_R, joints_p, R, p, at)
        depth = demands.asked[knot, k] + demands.spheres[k, 3] - _distance(demands, at, push)
        if depth <= 0.0:
            continue
        if count < WORST:
            worst[count], depths[count] = k, depth
            count += 1
            continue
        least = np.argmin(depths)
        if depth > depths[least]:
            worst[least], depths[least] = k, depth
    for i in range(count):
        k, row = worst[i], rows[first + i]
        _in_world(demands, k, joints_R, joints_p, R, p, at)
        _distance(demands, at, push)
        residual[first + i] = (depths[i] + SPARE) / CLEARANCE_UNIT
        _push_row(chains, demands, knot, k, joints_R, joints_p, R, p, middle, at, push, row, nq)
    return count, depths.max()


@compiled
def _push_row(
    chains: Chains, demands: Demands, knot: int, k: int, joints_R: Array, joints_p: Array,
    R: Array, p: Array, middle: Array, at: Array, push: Array, row: Array, nq: int,
) -> None:  # fmt: skip
    """How a sphere's depth changes: minus its motion along the push."""
    for a in range(3):
        row[nq + a] = -push[a] / CLEARANCE_UNIT
    _about(row, at - middle, push, nq)
    j = demands.joints[k]
    while j > 0:
        times = chains.multipliers[j]
        w = R @ (joints_R[j] @ chains.angular[j])
        v = R @ (joints_R[j] @ chains.linear[j])
        arm = at - (R @ joints_p[j] + p)
        moved = (
            push[0] * (w[1] * arm[2] - w[2] * arm[1] + v[0])
            + push[1] * (w[2] * arm[0] - w[0] * arm[2] + v[1])
            + push[2] * (w[0] * arm[1] - w[1] * arm[0] + v[2])
        )
        row[demands.columns[knot, chains.q_indices[j]]] -= times * moved / CLEARANCE_UNIT
        j = chains.parents[j]


@compiled
def _about(row: Array, arm: Array, push: Array, nq: int) -> None:
    row[nq + 3] = -(arm[1] * push[2] - arm[2] * push[1]) / CLEARANCE_UNIT
    row[nq + 4] = -(arm[2] * push[0] - arm[0] * push[2]) / CLEARANCE_UNIT
    row[nq + 5] = -(arm[0] * push[1] - arm[1] * push[0]) / CLEARANCE_UNIT


@compiled
def _in_world(
    demands: Demands, k: int, joints_R: Array, joints_p: Array, R: Array, p: Array, out: Array
) -> None:
    Rj, pj, local = joints_R[demands.joints[k]], joints_p[demands.joints[k]], demands.spheres[k]
    x = pj[0] + Rj[0, 0] * local[0] + Rj[0, 1] * local[1] + Rj[0, 2] * local[2]
    y = pj[1] + Rj[1, 0] * local[0] + Rj[1, 1] * local[1] + Rj[1, 2] * local[2]
    z = pj[2] + Rj[2, 0] * local[0] + Rj[2, 1] * local[1] + Rj[2, 2] * local[2]
    for a in range(3):
        out[a] = p[a] + R[a, 0] * x + R[a, 1] * y + R[a, 2] * z


@compiled
def _distance(demands: Demands, at: Array, push: Array) -> float:
    """From the nearer of object and table, and the way out."""
    R, o = demands.R_WO, at - demands.p_WO
    x = R[0, 0] * o[0] + R[1, 0] * o[1] + R[2, 0] * o[2]
    y = R[0, 1] * o[0] + R[1, 1] * o[1] + R[2, 1] * o[2]
    z = R[0, 2] * o[0] + R[1, 2] * o[1] + R[2, 2] * o[2]
    rho = max(hypot(x, y), 1e-9)
    d, out, up = distance_and_slopes(demands.meridian, rho, z)
    table = demands.table
    above = table[0] * at[0] + table[1] * at[1] + table[2] * at[2] - table[3]
    for a in range(3):
        push[a] = out * (R[a, 0] * x + R[a, 1] * y) / rho + up * R[a, 2]
        if above < d:
            push[a] = table[a]
    return float(min(d, above))


@compiled
def _step(
    chains: Chains, demands: Demands, q: Array, p: Array, rows: Array, residual: Array,
    system: Array, lower: Array, dual: Array, free: Array, step: Array,
) -> None:  # fmt: skip
    """The least step; what a limit stops is frozen, and the step asked again without it."""
    used, unknowns, nq = len(rows), len(step), q.shape[1]
    free[:] = demands.willing
    for _ in range(REFREEZE):
        for i in range(used):
            for j in range(i + 1):
                total = 1.0 if i == j else 0.0
                for c in range(unknowns):
                    total += rows[i, c] * rows[j, c] * free[c] * free[c]
                system[i, j] = total
            dual[i] = residual[i]
        factor(system[:used, :used], lower[:used, :used])
        solve_factored(lower[:used, :used], dual[:used])
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
    step /= longest


@compiled
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
        stopped = (step[nq + a] > 0.0 and p[a] >= demands.box[1, a]) or (
            step[nq + a] < 0.0 and p[a] <= demands.box[0, a]
        )
        if stopped and free[nq + a] > 0.0:
            free[nq + a], found = 0.0, True
    return found


@compiled
def _take(
    chains: Chains, demands: Demands, step: Array, middle: Array, q: Array, R: Array, p: Array
) -> None:
    """Joints within their limits, the base within its box."""
    nq = q.shape[1]
    for knot in range(len(q)):
        for c in range(nq):
            moved = q[knot, c] + step[demands.columns[knot, c]]
            q[knot, c] = min(max(moved, chains.lower[c]), chains.upper[c])
    turn = np.zeros((3, 3))
    rotation(step[nq + 3 : nq + 6], turn)
    arm, was = turn @ (p - middle), R.copy()
    R[:] = turn @ was
    _turn_back(demands, R)
    for a in range(3):
        moved = middle[a] + arm[a] + step[nq + a]
        p[a] = min(max(moved, demands.box[0, a]), demands.box[1, a])


@compiled
def _turn_back(demands: Demands, R: Array) -> None:
    """Onto the largest turn from nominal, where it is beyond."""
    away = demands.R_nominal.T @ R
    cosine = 0.5 * (away[0, 0] + away[1, 1] + away[2, 2] - 1.0)
    angle = acos(min(max(cosine, -1.0), 1.0))
    if angle <= demands.most_turn or angle > HALF_TURN:
        return
    w = np.zeros(3)
    w[0], w[1] = away[2, 1] - away[1, 2], away[0, 2] - away[2, 0]
    w[2] = away[1, 0] - away[0, 1]
    w *= demands.most_turn / (2.0 * sin(angle))
    turn = np.zeros((3, 3))
    rotation(w, turn)
    R[:] = demands.R_nominal @ turn
