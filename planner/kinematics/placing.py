"""Joint frames and pads of one posture, inside compiled loops."""

from __future__ import annotations

from math import cos, sin, sqrt

import numpy as np

from estimator.compiled import compiled, compiled_part
from estimator.vectors import Array
from hand_models.chains import Chains
from planner.kinematics.small import clear


@compiled
def place_joints(chains: Chains, q: Array, R: Array, p: Array) -> None:
    """Rotations (J, 3, 3) and positions (J, 3) of all joints in the hand base frame."""
    for j in range(len(chains.joints)):
        if j == 0:
            for i in range(3):
                p[0, i] = 0.0
                for k in range(3):
                    R[0, i, k] = 1.0 if i == k else 0.0
            continue
        _place(chains, q, j, R, p)


@compiled_part
def _place(chains: Chains, q: Array, j: int, R: Array, p: Array) -> None:
    """One joint whose parent is in place: fixed pose, then Rodrigues' formula and the slide."""
    joint = chains.joints[j]
    parent, w, v = joint.parent, joint.angular, joint.linear
    at = joint.multiplier * q[joint.q_index] + joint.offset
    s, c, square = sin(at), cos(at), w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    for i in range(3):
        row = R[parent, i]
        f0 = _times(row, joint.rotation, 0)
        f1 = _times(row, joint.rotation, 1)
        f2 = _times(row, joint.rotation, 2)
        p[j, i] = p[parent, i]
        for k in range(3):
            p[j, i] += row[k] * joint.position[k]
        slide = f0 * v[0] + f1 * v[1] + f2 * v[2]
        p[j, i] += at * slide
        along = f0 * w[0] + f1 * w[1] + f2 * w[2]
        keep = 1.0 - (1.0 - c) * square
        R[j, i, 0] = keep * f0 + (1.0 - c) * along * w[0] + s * (f1 * w[2] - f2 * w[1])
        R[j, i, 1] = keep * f1 + (1.0 - c) * along * w[1] + s * (f2 * w[0] - f0 * w[2])
        R[j, i, 2] = keep * f2 + (1.0 - c) * along * w[2] + s * (f0 * w[1] - f1 * w[0])


@compiled_part
def _times(row: Array, matrix: Array, column: int) -> float:
    total = 0.0
    for k in range(3):
        total += row[k] * matrix[k, column]
    return total


@compiled
def place_pad(
    chains: Chains, finger: int, R: Array, p: Array, centre: Array, normal: Array
) -> None:
    """A pad's centre and normal (3,) in the hand base frame, its joints being in place."""
    pad = chains.pads[finger]
    j = pad.joint
    for i in range(3):
        centre[i], normal[i] = p[j, i], 0.0
        for k in range(3):
            centre[i] += R[j, i, k] * pad.centre[k]
            normal[i] += R[j, i, k] * pad.normal[k]


@compiled
def place_ball(
    chains: Chains, finger: int, R: Array, p: Array, facing: Array, centre: Array, turning: Array
) -> None:
    """The ball of the pad's radius that touches along `facing` as the pad does.

    Args:
        facing: (3,) unit vector out of the pad, minus the normal of what it touches; like all here
            in the hand base frame.
        centre: (3,) of the ball (`hand_models.dome`, b).
        turning: (3, 3) db/du, by which it goes along with the direction; zero for a sphere.
    """
    pad = chains.pads[finger]
    j, A, u, e = pad.joint, pad.dome_spread, np.zeros(3), np.zeros(3)
    more, stretch = pad.dome_more, 0.0
    for i in range(3):
        for k in range(3):
            u[i] += R[j, k, i] * facing[k]
    for i in range(3):
        for k in range(3):
            e[i] += A[i, k] * u[k]
        stretch += u[i] * e[i]
    stretch = sqrt(stretch)
    local, scale = np.zeros((3, 3)), 1.0 / stretch if stretch > 0.0 else 0.0
    for i in range(3):
        e[i] *= scale
    for i in range(3):
        centre[i] = p[j, i]
        for k in range(3):
            centre[i] += R[j, i, k] * (pad.dome_centre[k] + e[k] + more * u[k])
            local[i, k] = scale * (A[i, k] - e[i] * e[k]) + (more if i == k else 0.0)
    for i in range(3):
        for k in range(3):
            turning[i, k] = 0.0
            for a in range(3):
                for b in range(3):
                    turning[i, k] += R[j, i, a] * local[a, b] * R[j, k, b]


@compiled
def ball_jacobian(
    chains: Chains, finger: int, R: Array, p: Array, facing: Array, centre: Array, turning: Array,
    moves: Array, turns: Array,
) -> None:  # fmt: skip
    """d centre / d q of such a ball for a fixed `facing`, and the pad's angular velocity, (3, nq).

    As the tip turns by w, the direction turns by -w on it:  db = w x arm - (db/du) (w x u).
    """
    pad_jacobian(chains, finger, R, p, centre, moves, turns)
    for c in range(moves.shape[1]):
        x = turns[1, c] * facing[2] - turns[2, c] * facing[1]
        y = turns[2, c] * facing[0] - turns[0, c] * facing[2]
        z = turns[0, c] * facing[1] - turns[1, c] * facing[0]
        for i in range(3):
            moves[i, c] -= turning[i, 0] * x + turning[i, 1] * y + turning[i, 2] * z


@compiled
def pad_jacobian(
    chains: Chains, finger: int, R: Array, p: Array, centre: Array, moves: Array, turns: Array
) -> None:
    """d centre / d q and the pad's angular velocity per joint velocity, both (3, nq)."""
    clear(moves)
    clear(turns)
    for j in chains.supports[finger]:
        if j < 0:
            break
        joint = chains.joints[j]
        q, times = joint.q_index, joint.multiplier
        w0, w1, w2 = 0.0, 0.0, 0.0
        for k in range(3):
            w0 += times * R[j, 0, k] * joint.angular[k]
            w1 += times * R[j, 1, k] * joint.angular[k]
            w2 += times * R[j, 2, k] * joint.angular[k]
        a0, a1, a2 = centre[0] - p[j, 0], centre[1] - p[j, 1], centre[2] - p[j, 2]
        turns[0, q] += w0
        turns[1, q] += w1
        turns[2, q] += w2
        moves[0, q] += w1 * a2 - w2 * a1
        moves[1, q] += w2 * a0 - w0 * a2
        moves[2, q] += w0 * a1 - w1 * a0
        for i in range(3):
            for k in range(3):
                moves[i, q] += times * R[j, i, k] * joint.linear[k]
