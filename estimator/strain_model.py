"""What the tactels read under a Hertz contact: the impulse response under the contact's pressure.

    eps_t = compliance F  integral over the ellipse of p(u) h_t(x_0 + M u - x_t) du,

the pressure p ~ sqrt(1 - |u|^2) of Hertz, by a disk rule: Gauss-Jacobi in |u|^2, equispaced angles
staggered from ring to ring. Long ellipses need more nodes: too few bias the inverse. The integral
is taken on the skin rolled out flat (y = r_f theta), sensor.md: "wrapped half space".
"""

from __future__ import annotations

import numpy as np
from scipy.special import roots_jacobi

from estimator.compiled import compiled
from estimator.hertz import ellipse_into
from estimator.response import POINT_LOAD, ResponseModel, response_at
from estimator.strain_array import StrainArray
from estimator.vectors import Array, Index

RULES = ((4, 12), (6, 18), (8, 24), (10, 32), (12, 44))  # rings and nodes on each
REACH = (1.1, 1.8, 2.5, 3.3)  # up to this a/d the rule serves: 1e-5 of strain
STATE = 6  # x_0, y_0 [m], ln F, K_xx, K_yy, K_xy of the relative curvature [1/m]


def disk_rule(rings: int, nodes: int) -> Array:
    """Rows u_x, u_y, weight: integrates over the unit disk with Hertz's pressure, sum 1."""
    roots, weights = roots_jacobi(rings, 0.5, 0.0)  # (1 - |u|^2)^(1/2) over |u|^2
    radius = np.sqrt(0.5 * (1.0 + roots))
    ring = np.repeat(np.arange(rings), nodes)
    angle = (np.tile(np.arange(nodes), rings) + 0.5 * (ring % 2)) * (2.0 * np.pi / nodes)
    weight = np.repeat(weights / weights.sum(), nodes) / nodes
    return np.stack([radius[ring] * np.cos(angle), radius[ring] * np.sin(angle), weight])


def _stacked() -> tuple[Array, Index]:
    counts = np.array([r * n for r, n in RULES], dtype=np.intp)
    nodes = np.zeros((len(RULES), 3, counts.max()))
    for i, rule in enumerate(RULES):
        nodes[i, :, : counts[i]] = disk_rule(*rule)
    return nodes, counts


NODES, COUNTS = _stacked()


@compiled
def rule_for(long_axis: float, depth: float) -> int:
    """Index of the disk rule good to 1e-5 strain at this semi-axis."""
    rule = 0
    for limit in REACH:
        rule += long_axis > limit * depth
    return rule


@compiled
def long_axis(M: Array) -> float:
    """Larger eigenvalue of M = (M_xx, M_yy, M_xy)."""
    half = 0.5 * (M[0] - M[1])
    return 0.5 * (M[0] + M[1]) + (half * half + M[2] * M[2]) ** 0.5


@compiled
def _point_load_sums(
    row: Array, x: float, y: float, px: Array, py: Array, nodes: Array, n: int, out: Array
) -> None:
    """Weighted sums of h, h_x, h_y, h_x u_x, h_y u_y, h_x u_y + h_y u_x for a half space.

    The response's own formula again (`response.response_at`), in a loop that vectorises.
    """
    c, v, d2 = row[1], row[2], row[3]
    s0, s1, s2, s3, s4, s5 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(n):
        dx, dy = px[k] + x, py[k] + y
        r2 = dx * dx + dy * dy
        q = 1.0 / (r2 + d2)
        weight = nodes[2, k] * q * q * np.sqrt(q)
        top = c - v * r2
        slope = -2.0 * weight * (v + 2.5 * top * q)
        fx, fy = slope * dx, slope * dy
        s0 += weight * top
        s1 += fx
        s2 += fy
        s3 += fx * nodes[0, k]
        s4 += fy * nodes[1, k]
        s5 += fx * nodes[1, k] + fy * nodes[0, k]
    A = row[0]
    out[0], out[1], out[2] = A * s0, A * s1, A * s2
    out[3], out[4], out[5] = A * s3, A * s4, A * s5


@compiled
def _any_sums(
    kind: int, row: Array, x: float, y: float, px: Array, py: Array, nodes: Array, n: int,
    out: Array,
) -> None:  # fmt: skip
    """The same of any response."""
    out[:] = 0.0
    for k in range(n):
        h, fx, fy = response_at(kind, row, px[k] + x, py[k] + y)
        w = nodes[2, k]
        out[0] += w * h
        out[1] += w * fx
        out[2] += w * fy
        out[3] += w * fx * nodes[0, k]
        out[4] += w * fy * nodes[1, k]
        out[5] += w * (fx * nodes[1, k] + fy * nodes[0, k])


@compiled
def readings_into(
    state: Array, modulus: float, compliance: float, rule: int, kind: int,
    rows: Array, positions: Array, tactels: Index, readings: Array, J: Array, M: Array, M_J: Array,
    p: Array,
) -> None:  # fmt: skip
    """Write readings of the tactels named and their derivatives over the state.

    Args:
        state: x_0, y_0, ln F and the relative curvature, see `STATE`.
        modulus, compliance: E* [Pa]; response to reading [1/N m^2].
        rule: Index of the disk rule.
        kind, rows, positions: Of the response model.
        tactels: Indices into rows and positions, (T,).
        readings, J: Out, (T,) and (T, 6).
        M, M_J: Out, ellipse and its derivatives, (3,) and (3, 4).
        p: Room for the nodes, (2, N).
    """
    ellipse_into(state[3:6], np.exp(state[2]), modulus, M, M_J)
    nodes, n = NODES[rule], COUNTS[rule]
    px, py = p[0], p[1]
    for k in range(n):
        px[k] = M[0] * nodes[0, k] + M[2] * nodes[1, k]
        py[k] = M[2] * nodes[0, k] + M[1] * nodes[1, k]
    scale = compliance * np.exp(state[2])
    s = np.empty(6)
    for i in range(len(tactels)):
        t = tactels[i]
        x, y = state[0] - positions[t, 0], state[1] - positions[t, 1]
        if kind == POINT_LOAD:
            _point_load_sums(rows[t], x, y, px, py, nodes, n, s)
        else:
            _any_sums(kind, rows[t], x, y, px, py, nodes, n, s)
        readings[i] = scale * s[0]
        J[i, 0], J[i, 1] = scale * s[1], scale * s[2]
        for j in range(4):
            J[i, 2 + j] = scale * (s[3] * M_J[0, j] + s[4] * M_J[1, j] + s[5] * M_J[2, j])
        J[i, 2] += readings[i]


@compiled
def _all_readings(
    states: Array, modulus: float, compliance: float, depth: float, rule: int, kind: int,
    rows: Array, positions: Array, J: Array,
) -> Array:  # fmt: skip
    """`readings_into` of every tactel for each state; J (B or 0, T, 6) is filled if it has room."""
    T = len(positions)
    out, slopes, every = np.empty((len(states), T)), np.empty((T, 6)), np.arange(T)
    M, M_J, p = np.empty(3), np.empty((3, 4)), np.empty((2, NODES.shape[2]))
    for i in range(len(states)):
        chosen = rule
        if rule < 0:
            ellipse_into(states[i, 3:6], np.exp(states[i, 2]), modulus, M, M_J)
            chosen = rule_for(long_axis(M), depth)
        readings_into(
            states[i], modulus, compliance, chosen, kind, rows, positions, every, out[i], slopes,
            M, M_J, p,
        )  # fmt: skip
        if len(J):
            J[i] = slopes
    return out


def touch_state(places: Array, forces: Array, tensors: Array, array: StrainArray) -> Array:
    """States (B, 6) of touches, see `STATE`: the finger's own curvature is added.

    Args:
        places: x, y = r theta of the contact's centre [m], (B, 2).
        forces: [N], (B,).
        tensors: Curvature of the body along x and y, convex positive [1/m], (B, 2, 2).
    Raises:
        ValueError: A body too hollow for the finger (no Hertz contact), a force not positive.
    """
    places, forces = np.asarray(places, float), np.asarray(forces, float)
    relative = np.asarray(tensors, float) + np.diag([0.0, array.curvature])
    if not np.all(np.linalg.eigvalsh(relative) > 0.0):
        raise ValueError("tensors: relative to the finger some body is hollow: no Hertz contact")
    if not np.all(forces > 0.0):
        raise ValueError(f"forces: expected greater than zero, got {forces.min()}")
    K = np.stack([relative[:, 0, 0], relative[:, 1, 1], relative[:, 0, 1]], axis=1)
    return np.column_stack([places, np.log(forces), K])


def predicted_readings(
    states: Array, array: StrainArray, response: ResponseModel | None = None, *, rule: int = -1
) -> Array:
    """What every tactel of the array reads without noise, (B, rows, columns) [unit].

    Args:
        states: (B, 6), see `touch_state`.
        response: Measured impulse responses of all tactels; by default the half space's.
        rule: Index of the disk rule, by default the one the ellipse needs.
    """
    model = response or array.response()
    out = _all_readings(
        np.ascontiguousarray(states, dtype=np.float64), array.effective_modulus, array.compliance,
        array.depth, rule, model.kind, model.rows, model.positions, np.empty((0, 1, 1)),
    )  # fmt: skip
    return out.reshape(-1, *array.tactels)


def reading_slopes(
    states: Array, array: StrainArray, response: ResponseModel | None = None
) -> Array:
    """Derivatives of all tactels over the state, (B, rows * columns, 6)."""
    model = response or array.response()
    J = np.empty((len(states), len(model), STATE))
    _all_readings(
        np.ascontiguousarray(states, dtype=np.float64), array.effective_modulus, array.compliance,
        array.depth, -1, model.kind, model.rows, model.positions, J,
    )  # fmt: skip
    return J
