"""What is asked of a reach, as rows of a least-squares problem, inside compiled loops.

A pad's place (three rows), its angle beyond the cone, and link spheres nearer to object or table
than asked: the worst few of each knot.
"""

from __future__ import annotations

from math import acos, hypot, sin, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimator.compiled import compiled_part
from estimator.vectors import Array, Index
from hand_models.chains import Chains
from planner.kinematics.meridian import Meridian, distance_and_slopes
from planner.kinematics.placing import ball_jacobian, place_ball, place_joints, place_pad
from planner.kinematics.small import clear, times, transposed_times

PLACE_UNIT = 2e-5  # so far off its place [m] weighs as much as ...
CONE_UNIT = 0.01  # ... this much of angle beyond the cone [rad]
CLEARANCE_UNIT = 1e-4  # ... or a link sphere so much too near [m]
WORST = 10  # spheres of a knot that are pushed out at a time
SPARE = 2e-4  # beyond what is asked, for those [m]
ARC = 0.05  # at which an angle counts as a violation [m]
INSIDE = 0.97  # of the cone, where an angle beyond it goes


CONTACT = np.dtype([
    ("finger", np.int64), ("point", np.float64, 3), ("normal", np.float64, 3),
], align=True)  # fmt: skip
KNOT = np.dtype([("length", np.float64), ("cone", np.float64)], align=True)
SPHERE = np.dtype([
    ("joint", np.int64), ("centre", np.float64, 3), ("radius", np.float64),
], align=True)  # fmt: skip
SETTING = np.dtype([
    ("R_WO", np.float64, (3, 3)), ("p_WO", np.float64, 3), ("table", np.float64, 4),
    ("box", np.float64, (2, 3)), ("R_nominal", np.float64, (3, 3)), ("most_turn", np.float64),
], align=True)  # fmt: skip


class Demands(NamedTuple):
    """What is asked of k fingers at K knots, in the world; in records, as `Chains`.

    Attributes:
        contacts: (k,) records of `finger`, the pad, and where it touches: `point`, `normal` (3,).
        knots: (K,) records of `length` along the normals [m], `cone`, the largest pad angle [rad].
        setting: (1,) record of the object's pose `R_WO`, `p_WO`; `table` (4,), n and h of the
            half-space n . p >= h; `box` (2, 3), range of the base's position [m]; the base turns
            from `R_nominal` by `most_turn` [rad] at most.
        meridian: The object.
        spheres: (M,) records of link spheres: `joint`, in its frame `centre` (3,), `radius` [m].
        asked: (K, M) least distance from object and table; -inf where none is asked [m].
        columns: (K, nq) unknown that moves each joint at each knot; joints, base, then the others'.
        willing: (unknowns,) how willingly each moves.
    """

    contacts: NDArray[np.void]
    knots: NDArray[np.void]
    setting: NDArray[np.void]
    meridian: Meridian
    spheres: NDArray[np.void]
    asked: Array
    columns: Index
    willing: Array


@compiled_part
def write_rows(
    chains: Chains, demands: Demands, q: Array, R: Array, p: Array, middle: Array,
    rows: Array, residual: Array,
) -> tuple[int, float]:  # fmt: skip
    """Rows and residuals; how many, and the largest violation [m]."""
    J, nq = len(chains.joints), q.shape[1]
    joints_R, joints_p = np.zeros((J, 3, 3)), np.zeros((J, 3))
    used, off = 0, 0.0
    clear(rows)
    for knot in range(len(q)):
        place_joints(chains, q[knot], joints_R, joints_p)
        for j in range(len(demands.contacts)):
            gap, angle = _pad_rows(
                chains, demands, knot, j, joints_R, joints_p, R, p, middle, rows, residual, used, nq
            )
            off = max(off, gap, ARC * (angle - demands.knots[knot].cone))
            used += 3 if angle <= demands.knots[knot].cone else 4
        near, depth = _sphere_rows(
            chains, demands, knot, joints_R, joints_p, R, p, middle, rows, residual, used, nq
        )
        off, used = max(off, depth), used + near
    return used, off


@compiled_part
def _pad_rows(
    chains: Chains, demands: Demands, knot: int, j: int, joints_R: Array, joints_p: Array,
    R: Array, p: Array, middle: Array, rows: Array, residual: Array, first: int, nq: int,
) -> tuple[float, float]:  # fmt: skip
    """Three rows of a pad's place, one of its angle if beyond the cone; gap and angle."""
    contact = demands.contacts[j]
    finger, n = contact.finger, contact.normal
    centre, pad, arm, inward = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3)
    moves, turns, turning = np.zeros((3, nq)), np.zeros((3, nq)), np.zeros((3, 3))
    inward[0], inward[1], inward[2] = transposed_times(R, -n[0], -n[1], -n[2])
    place_pad(chains, finger, joints_R, joints_p, centre, pad)
    place_ball(chains, finger, joints_R, joints_p, inward, centre, turning)
    ball_jacobian(chains, finger, joints_R, joints_p, inward, centre, turning, moves, turns)
    away, square, cosine = chains.pads[finger].radius + demands.knots[knot].length, 0.0, 0.0
    there, facing = times(R, centre[0], centre[1], centre[2]), times(R, pad[0], pad[1], pad[2])
    for a in range(3):
        at = there[a] + p[a]
        arm[a] = at - middle[a]
        gap = at - contact.point[a] - away * n[a]
        residual[first + a] = gap / PLACE_UNIT
        square += gap * gap
        cosine -= facing[a] * n[a]
    angle = acos(min(max(cosine, -1.0), 1.0))
    _base_rows(arm, rows, first, nq, 1.0 / PLACE_UNIT)
    _going_along(turning, R, n, rows, first, nq, 1.0 / PLACE_UNIT)
    for c in range(nq):
        column = demands.columns[knot, c]
        for a in range(3):
            along = R[a, 0] * moves[0, c] + R[a, 1] * moves[1, c] + R[a, 2] * moves[2, c]
            rows[first + a, column] += along / PLACE_UNIT
    if angle > demands.knots[knot].cone:
        # d angle = (facing x n) . w / sin angle, as the angle is between facing and -n
        scale = 1.0 / max(sin(angle), 1e-3) / CONE_UNIT
        x = (facing[1] * n[2] - facing[2] * n[1]) * scale
        y = (facing[2] * n[0] - facing[0] * n[2]) * scale
        z = (facing[0] * n[1] - facing[1] * n[0]) * scale
        row = rows[first + 3]
        residual[first + 3] = (angle - INSIDE * demands.knots[knot].cone) / CONE_UNIT
        row[nq + 3], row[nq + 4], row[nq + 5] = x, y, z
        for c in range(nq):
            w = times(R, turns[0, c], turns[1, c], turns[2, c])
            row[demands.columns[knot, c]] += x * w[0] + y * w[1] + z * w[2]
    return sqrt(square), angle


@compiled_part
def _base_rows(arm: Array, rows: Array, first: int, nq: int, scale: float) -> None:
    """How a point moves with the base's position and its turn about the contacts' middle."""
    for a in range(3):
        rows[first + a, nq + a] = scale
    rows[first, nq + 4], rows[first, nq + 5] = arm[2] * scale, -arm[1] * scale
    rows[first + 1, nq + 3], rows[first + 1, nq + 5] = -arm[2] * scale, arm[0] * scale
    rows[first + 2, nq + 3], rows[first + 2, nq + 4] = arm[1] * scale, -arm[0] * scale


@compiled_part
def _going_along(
    turning: Array, R: Array, n: Array, rows: Array, first: int, nq: int, scale: float
) -> None:
    """How a pad's ball goes along as the base turns: by (db/du) (w x n)."""
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3  # w = e_a: e_a x n has n_b at c and -n_c at b
        x = R[c, 0] * n[b] - R[b, 0] * n[c]
        y = R[c, 1] * n[b] - R[b, 1] * n[c]
        z = R[c, 2] * n[b] - R[b, 2] * n[c]
        u, v, w = times(turning, x, y, z)
        u, v, w = times(R, u, v, w)
        rows[first, nq + 3 + a] += scale * u
        rows[first + 1, nq + 3 + a] += scale * v
        rows[first + 2, nq + 3 + a] += scale * w


@compiled_part
def _sphere_rows(
    chains: Chains, demands: Demands, knot: int, joints_R: Array, joints_p: Array,
    R: Array, p: Array, middle: Array, rows: Array, residual: Array, first: int, nq: int,
) -> tuple[int, float]:  # fmt: skip
    """Rows of the spheres that are too near, the worst of them; how many, and the worst [m]."""
    worst, depths, count = np.zeros(WORST, dtype=np.int64), np.zeros(WORST), 0
    at, push = np.zeros(3), np.zeros(3)
    for k in range(len(demands.spheres)):
        if demands.asked[knot, k] == -np.inf:
            continue
        _in_world(demands, k, joints_R, joints_p, R, p, at)
        depth = demands.asked[knot, k] + demands.spheres[k].radius - _distance(demands, at, push)
        if depth <= 0.0:
            continue
        if count < WORST:
            worst[count], depths[count] = k, depth
            count += 1
            continue
        least = 0
        for i in range(1, WORST):
            if depths[i] < depths[least]:
                least = i
        if depth > depths[least]:
            worst[least], depths[least] = k, depth
    deepest = 0.0
    for i in range(count):
        k, row = worst[i], rows[first + i]
        _in_world(demands, k, joints_R, joints_p, R, p, at)
        _distance(demands, at, push)
        residual[first + i] = (depths[i] + SPARE) / CLEARANCE_UNIT
        deepest = max(deepest, depths[i])
        _push_row(chains, demands, knot, k, joints_R, joints_p, R, p, middle, at, push, row, nq)
    return count, deepest


@compiled_part
def _push_row(
    chains: Chains, demands: Demands, knot: int, k: int, joints_R: Array, joints_p: Array,
    R: Array, p: Array, middle: Array, at: Array, push: Array, row: Array, nq: int,
) -> None:  # fmt: skip
    """How a sphere's depth changes: minus its motion along the push."""
    for a in range(3):
        row[nq + a] = -push[a] / CLEARANCE_UNIT
    x, y, z = at[0] - middle[0], at[1] - middle[1], at[2] - middle[2]
    row[nq + 3] = -(y * push[2] - z * push[1]) / CLEARANCE_UNIT
    row[nq + 4] = -(z * push[0] - x * push[2]) / CLEARANCE_UNIT
    row[nq + 5] = -(x * push[1] - y * push[0]) / CLEARANCE_UNIT
    # In the hand base frame, where the joints are.
    out = transposed_times(R, push[0], push[1], push[2])
    here = transposed_times(R, at[0] - p[0], at[1] - p[1], at[2] - p[2])
    j = demands.spheres[k].joint
    while j > 0:
        joint = chains.joints[j]
        turn, slide, o = joint.angular, joint.linear, joints_p[j]
        w = times(joints_R[j], turn[0], turn[1], turn[2])
        v = times(joints_R[j], slide[0], slide[1], slide[2])
        x, y, z = here[0] - o[0], here[1] - o[1], here[2] - o[2]
        moved = (
            out[0] * (w[1] * z - w[2] * y + v[0])
            + out[1] * (w[2] * x - w[0] * z + v[1])
            + out[2] * (w[0] * y - w[1] * x + v[2])
        )
        column = demands.columns[knot, joint.q_index]
        row[column] -= joint.multiplier * moved / CLEARANCE_UNIT
        j = joint.parent


@compiled_part
def _in_world(
    demands: Demands, k: int, joints_R: Array, joints_p: Array, R: Array, p: Array, out: Array
) -> None:
    sphere = demands.spheres[k]
    Rj, pj, local = joints_R[sphere.joint], joints_p[sphere.joint], sphere.centre
    x = pj[0] + Rj[0, 0] * local[0] + Rj[0, 1] * local[1] + Rj[0, 2] * local[2]
    y = pj[1] + Rj[1, 0] * local[0] + Rj[1, 1] * local[1] + Rj[1, 2] * local[2]
    z = pj[2] + Rj[2, 0] * local[0] + Rj[2, 1] * local[1] + Rj[2, 2] * local[2]
    for a in range(3):
        out[a] = p[a] + R[a, 0] * x + R[a, 1] * y + R[a, 2] * z


@compiled_part
def _distance(demands: Demands, at: Array, push: Array) -> float:
    """From the nearer of object and table, and the way out."""
    setting = demands.setting[0]
    R, o, table = setting.R_WO, setting.p_WO, setting.table
    x, y, z = transposed_times(R, at[0] - o[0], at[1] - o[1], at[2] - o[2])
    rho = max(hypot(x, y), 1e-9)
    d, out, up = distance_and_slopes(demands.meridian, rho, z)
    above = table[0] * at[0] + table[1] * at[1] + table[2] * at[2] - table[3]
    for a in range(3):
        push[a] = out * (R[a, 0] * x + R[a, 1] * y) / rho + up * R[a, 2]
        if above < d:
            push[a] = table[a]
    return float(min(d, above))
