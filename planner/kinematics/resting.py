"""Gauss-Newton that lays one posture after another onto a surface of revolution.

Unknown are the joints and the six coordinates of the base: a small system for each of thousands of
postures. Residuals of a pad are its gap, its turn beyond the cone (three) and its height beyond
the ends; the step is the least one that closes them,

    step = -W J^T (J W J^T + I)^-1 residual

with W how willingly joints and base move: the dual form, 5 unknowns a pad.
"""

from __future__ import annotations

from math import acos, atan2, hypot, sqrt

import numpy as np

from estimator.compiled import compiled, compiled_part
from estimator.linear import factor, solve_factored
from estimator.vectors import Array, Index
from hand_models.chains import Chains
from planner.kinematics.meridian import Meridian, foot
from planner.kinematics.placing import ball_jacobian, place_ball, place_joints, place_pad
from planner.kinematics.small import clear, times, transposed_times, turn_by, turned

GAP_UNIT = 0.3e-3  # so far off the surface weighs as much as ...
ANGLE_UNIT = 0.2  # ... this much of pad angle beyond the cone [rad]
HEIGHT_UNIT = 1e-3  # ... or this far beyond the ends [m]
JOINT_UNIT = 1.0  # how willingly a joint moves, in one step [rad]
BASE_UNITS = (0.1, 3.0)  # ... and the base [m], [rad]
LONGEST = (0.03, 0.4)  # of one step [m], [rad]
ROWS = 5  # residuals of a pad


@compiled
def rest(
    chains: Chains, meridian: Meridian, inset: Array, cone: float, iterations: int,
    fingers: Index, q: Array, R: Array, p: Array, places: Array,
) -> None:  # fmt: skip
    """Move N postures, in place, until they rest on the surface.

    Args:
        inset: Lowest and highest z of a pad (2,).
        cone: Beyond which a pad's angle counts [rad].
        fingers: (N, m) pads that touch.
        q, R, p: (N, nq), (N, 3, 3), (N, 3) joints and base in the object frame: start, then end.
        places: (N, m, 4) for theta, z, gap and angle of each pad at the end.
    """
    m, nq, J = fingers.shape[1], q.shape[1], len(chains.joints)
    joints_R, joints_p = np.zeros((J, 3, 3)), np.zeros((J, 3))
    pads, jacobians = np.zeros((m, 4, 3)), np.zeros((m, 2, 3, nq))  # centre, normal, n, about that
    rows, residual = np.zeros((ROWS * m, nq + 6)), np.zeros(ROWS * m)
    system, lower = np.zeros((ROWS * m, ROWS * m)), np.zeros((ROWS * m, ROWS * m))
    step = np.zeros(nq + 6)
    looks = 2 if chains.domed else 1  # a dome again along what it met
    for i in range(len(q)):
        place_joints(chains, q[i], joints_R, joints_p)
        _face(chains, fingers[i], R[i], joints_R, joints_p, pads)
        for turn in range(iterations + looks):
            if turn > iterations:
                _as_met(pads)
            place_joints(chains, q[i], joints_R, joints_p)
            _pads(chains, fingers[i], R[i], p[i], joints_R, joints_p, pads, jacobians)
            _residuals(
                chains, meridian, inset, cone, fingers[i], pads, jacobians, rows, residual,
                places[i],
            )  # fmt: skip
            if turn < iterations:
                _least_step(rows, residual, system, lower, step, nq)
                _take(chains, step, pads, q[i], R[i], p[i])


@compiled_part
def _face(
    chains: Chains, fingers: Index, R: Array, joints_R: Array, joints_p: Array, pads: Array
) -> None:
    """Pads begin as if they touched right in their middle."""
    centre, normal = np.zeros(3), np.zeros(3)
    for k in range(len(fingers)):
        place_pad(chains, fingers[k], joints_R, joints_p, centre, normal)
        n = times(R, -normal[0], -normal[1], -normal[2])
        pads[k, 3, 0], pads[k, 3, 1], pads[k, 3, 2] = n


@compiled_part
def _pads(
    chains: Chains, fingers: Index, R: Array, p: Array, joints_R: Array, joints_p: Array,
    pads: Array, jacobians: Array,
) -> None:  # fmt: skip
    """Centres, normals and Jacobians of the touching pads in the object frame.

    A pad's ball is the one that touches along the normals met so far, the last ones above all:
    along the very last, a cylinder would go to and fro between its ends.
    """
    nq = jacobians.shape[3]
    centre, normal, facing, turning = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros((3, 3))
    moves, turns = np.zeros((3, nq)), np.zeros((3, nq))
    for k in range(len(fingers)):
        j, n = fingers[k], pads[k, 3]
        facing[0], facing[1], facing[2] = transposed_times(R, -n[0], -n[1], -n[2])
        place_pad(chains, j, joints_R, joints_p, centre, normal)
        place_ball(chains, j, joints_R, joints_p, facing, centre, turning)
        ball_jacobian(chains, j, joints_R, joints_p, facing, centre, turning, moves, turns)
        for a in range(3):
            pads[k, 0, a], pads[k, 1, a] = p[a], 0.0
            for b in range(3):
                pads[k, 0, a] += R[a, b] * centre[b]
                pads[k, 1, a] += R[a, b] * normal[b]
            for c in range(nq):
                jacobians[k, 0, a, c] = (
                    R[a, 0] * moves[0, c] + R[a, 1] * moves[1, c] + R[a, 2] * moves[2, c]
                )
                jacobians[k, 1, a, c] = (
                    R[a, 0] * turns[0, c] + R[a, 1] * turns[1, c] + R[a, 2] * turns[2, c]
                )


@compiled_part
def _residuals(
    chains: Chains, meridian: Meridian, inset: Array, cone: float, fingers: Index, pads: Array,
    jacobians: Array, rows: Array, residual: Array, places: Array,
) -> None:  # fmt: skip
    """Residuals and their rows in joints, base position and turn about the pads' middle."""
    m, nq = len(fingers), jacobians.shape[3]
    middle, arm = np.zeros(3), np.zeros(3)
    move, spin = np.zeros((3, nq + 6)), np.zeros((3, nq + 6))
    for k in range(m):
        for a in range(3):
            middle[a] += pads[k, 0, a] / m
    for k in range(m):
        centre, pad = pads[k, 0], pads[k, 1]
        for a in range(3):
            arm[a] = centre[a] - middle[a]
        _motions(arm, jacobians[k], move, spin)
        rho = max(hypot(centre[0], centre[1]), 1e-9)
        z, r, dr = foot(meridian, rho, centre[2])
        w = sqrt(1.0 + dr**2)
        n = pads[k, 2]
        n[0], n[1], n[2] = centre[0] / rho / w, centre[1] / rho / w, -dr / w
        _halfway(n, pads[k, 3])
        gap = ((rho - r) - dr * (centre[2] - z)) / w - chains.pads[fingers[k]].radius
        cosine = -(pad[0] * n[0] + pad[1] * n[1] + pad[2] * n[2])
        angle = acos(min(max(cosine, -1.0), 1.0))
        places[k, 0], places[k, 1], places[k, 2], places[k, 3] = atan2(n[1], n[0]), z, gap, angle
        first = ROWS * k
        residual[first] = gap / GAP_UNIT
        beyond = z - min(max(z, inset[0]), inset[1])
        residual[first + 4] = beyond / HEIGHT_UNIT
        for c in range(nq + 6):
            along = n[0] * move[0, c] + n[1] * move[1, c] + n[2] * move[2, c]
            rows[first, c] = along / GAP_UNIT
            rows[first + 4, c] = move[2, c] / HEIGHT_UNIT if beyond != 0.0 else 0.0
        _turned_away(n, pad, max(angle - cone, 0.0), angle, rho, move, spin, first, rows, residual)


@compiled_part
def _as_met(pads: Array) -> None:
    for k in range(len(pads)):
        for a in range(3):
            pads[k, 3, a] = pads[k, 2, a]


@compiled_part
def _halfway(n: Array, about: Array) -> None:
    """Turn a direction half of the way to a normal."""
    x, y, z = about[0] + n[0], about[1] + n[1], about[2] + n[2]
    length = max(sqrt(x * x + y * y + z * z), 1e-9)
    about[0], about[1], about[2] = x / length, y / length, z / length


@compiled_part
def _motions(arm: Array, jacobians: Array, move: Array, spin: Array) -> None:
    """How a pad's centre moves and turns with joints, base position and turn, (3, nq + 6)."""
    nq = jacobians.shape[2]
    clear(move)
    clear(spin)
    for a in range(3):
        for c in range(nq):
            move[a, c], spin[a, c] = jacobians[0, a, c], jacobians[1, a, c]
        move[a, nq + a] = spin[a, nq + 3 + a] = 1.0
    move[0, nq + 4], move[0, nq + 5] = arm[2], -arm[1]
    move[1, nq + 3], move[1, nq + 5] = -arm[2], arm[0]
    move[2, nq + 3], move[2, nq + 4] = arm[1], -arm[0]


@compiled_part
def _turned_away(
    n: Array, pad: Array, excess: float, angle: float, rho: float, move: Array, spin: Array,
    first: int, rows: Array, residual: Array,
) -> None:  # fmt: skip
    """Three rows of n x pad beyond the cone: the pad turns with its link, n with its meridian."""
    share = excess / max(angle, 1e-6) / ANGLE_UNIT
    across = max(hypot(n[0], n[1]), 1e-12)
    e0, e1 = -n[1] / across, n[0] / across  # along the parallel
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        residual[first + 1 + a] = share * (n[b] * pad[c] - n[c] * pad[b])
    for c in range(rows.shape[1]):
        if excess == 0.0:
            rows[first + 1, c] = rows[first + 2, c] = rows[first + 3, c] = 0.0
            continue
        swing = (e0 * move[0, c] + e1 * move[1, c]) / rho
        v0 = spin[1, c] * pad[2] - spin[2, c] * pad[1]  # d pad
        v1 = spin[2, c] * pad[0] - spin[0, c] * pad[2]
        v2 = spin[0, c] * pad[1] - spin[1, c] * pad[0]
        d0, d1 = e0 * swing, e1 * swing  # d n
        rows[first + 1, c] = (n[1] * v2 - n[2] * v1 + d1 * pad[2]) / ANGLE_UNIT
        rows[first + 2, c] = (n[2] * v0 - n[0] * v2 - d0 * pad[2]) / ANGLE_UNIT
        rows[first + 3, c] = (n[0] * v1 - n[1] * v0 + d0 * pad[1] - d1 * pad[0]) / ANGLE_UNIT


@compiled_part
def _least_step(
    rows: Array, residual: Array, system: Array, lower: Array, step: Array, nq: int
) -> None:
    """The least step that closes the residuals, no longer than a linear model is good for."""
    for c in range(nq + 6):
        willing = JOINT_UNIT if c < nq else BASE_UNITS[0] if c < nq + 3 else BASE_UNITS[1]
        for k in range(len(rows)):
            rows[k, c] *= willing
    for k in range(len(rows)):
        for j in range(k + 1):
            total = 1.0 if j == k else 0.0
            for c in range(nq + 6):
                total += rows[k, c] * rows[j, c]
            system[k, j] = total
    factor(system, lower)
    solve_factored(lower, residual)
    longest = 1.0
    for c in range(nq + 6):
        total = 0.0
        for k in range(len(rows)):
            total -= rows[k, c] * residual[k]
        willing = JOINT_UNIT if c < nq else BASE_UNITS[0] if c < nq + 3 else BASE_UNITS[1]
        step[c] = willing * total
        limit = LONGEST[0] if nq <= c < nq + 3 else LONGEST[1]
        longest = max(longest, abs(step[c]) / limit)
    for c in range(nq + 6):
        step[c] /= longest


@compiled_part
def _take(chains: Chains, step: Array, pads: Array, q: Array, R: Array, p: Array) -> None:
    """Joints within their limits, the base turned about the pads' middle and shifted."""
    nq, m = len(q), len(pads)
    for c in range(nq):
        q[c] = min(max(q[c] + step[c], chains.lower[c]), chains.upper[c])
    w0, w1, w2 = step[nq + 3], step[nq + 4], step[nq + 5]
    turn_by(w0, w1, w2, R)
    middle = np.zeros(3)
    for a in range(3):
        for k in range(m):
            middle[a] += pads[k, 0, a] / m
    arm = turned(w0, w1, w2, p[0] - middle[0], p[1] - middle[1], p[2] - middle[2])
    for a in range(3):
        p[a] = middle[a] + arm[a] + step[nq + a]
